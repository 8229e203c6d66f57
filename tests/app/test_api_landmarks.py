"""Questions about landmarks over HTTP, against numpy over all of them."""

import csv
import io
import json
import sqlite3
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote
from zipfile import ZipFile

import numpy as np
import pytest
from lidarcore_app.web.routes.landmarks import LandmarksJson
from PIL import Image
from pydantic import TypeAdapter
from ruamel.yaml import YAML
from serving import Json, Server, assert_problem, strict_json, wait_until

from lidarcore.landmarks import Atlas, Landmark, LandmarkMap

N = 2500
HEAD = {"format": "lidarcore landmarks", "version": 1, "unit": "m"}
GOOD = {"x": 1, "y": 2, "var_x": 0.01, "cov_xy": 0, "var_y": 0.01, "kind": "corner"}


class Truth:
    """N landmarks in a square of 50 m, as columns."""

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self.xy, sigma = rng.uniform(-25, 25, (N, 2)), 10 ** rng.uniform(-2.5, -0.5, (N, 2))
        off = rng.uniform(-0.9, 0.9, N) * sigma.prod(1)
        self.covariance = np.stack([sigma[:, 0] ** 2, off, off, sigma[:, 1] ** 2], -1).reshape(N, 2, 2)
        self.sigma = np.sqrt(np.linalg.eigvalsh(self.covariance)[:, 1])
        self.kind = np.where(rng.uniform(size=N) < 0.3, "post", "corner")
        self.count = rng.integers(1, 50, N)
        self.first_seen = rng.uniform(0, 1000, N)
        self.last_seen = self.first_seen + rng.uniform(0, 100, N)

    def landmarks(self) -> Iterator[Landmark]:
        for i in range(N):
            yield Landmark.of(
                self.xy[i], self.covariance[i], str(self.kind[i]), method="ml", count=self.count[i],
                first_seen=self.first_seen[i], last_seen=self.last_seen[i],
            )  # fmt: skip


class Maps:
    """A server, the file of its maps opened a second time, and in it one large map between two small ones."""

    def __init__(self, server: Server) -> None:
        self.server, self.truth = server, Truth()
        self.atlas = Atlas(server.get("/sessions")["store"]["path"])
        self.small = self.filled("small", 3)
        self.large = self.atlas.begin("large", 2.0, "slam")
        self.ids = np.array(self.large.put(self.truth.landmarks()))
        self.newest = self.filled("newest", 5)

    def filled(self, name: str, n: int) -> LandmarkMap:
        landmark_map = self.atlas.begin(name, 1.0, "slam")
        landmark_map.put(Landmark(float(i), float(i), 1e-4, 0.0, 1e-4, "corner") for i in range(n))
        return landmark_map

    def get(self, path: str = "", **params: Any) -> Any:
        return self.server.get(f"/landmarks{path}", **{"session": self.large.session} | params)

    def pages(self, **params: Any) -> list[int]:
        """The ids on all pages."""
        ids, page = [], {"next": 0}
        while page["next"] is not None:
            page = self.get(after=page["next"], **params)
            ids += [row["id"] for row in page["landmarks"]]
        return ids


@pytest.fixture(scope="module")
def maps(shared_server: Server) -> Iterator[Maps]:
    made = Maps(shared_server)
    yield made
    made.atlas.close()


REGIONS: dict[str, tuple[dict[str, Any], Callable[[Truth], np.ndarray]]] = {
    "anywhere": ({}, lambda t: np.full(N, True)),
    "box": ({"bbox": "-3,-4,10.5,6"}, lambda t: ((t.xy >= (-3, -4)) & (t.xy <= (10.5, 6))).all(1)),
    "circle": ({"x": 2, "y": -1, "radius": 8}, lambda t: np.hypot(*(t.xy - (2, -1)).T) <= 8),
    "nowhere": ({"bbox": "90,90,91,91"}, lambda t: np.full(N, False)),
}
FILTERS: dict[str, tuple[dict[str, Any], Callable[[Truth], np.ndarray]]] = {
    "all": ({}, lambda t: np.full(N, True)),
    "kind": ({"kind": "post"}, lambda t: t.kind == "post"),
    "kinds": ({"kind": ["post", "tree"]}, lambda t: t.kind == "post"),
    "method": ({"method": "dbscan"}, lambda t: np.full(N, False)),
    "time": ({"since": 300, "until": 400}, lambda t: (t.last_seen >= 300) & (t.first_seen <= 400)),
    "certain": (
        {"min_count": 20, "max_sigma": 0.1, "kind": "corner"},
        lambda t: (t.count >= 20) & (t.sigma <= 0.1) & (t.kind == "corner"),
    ),
}


@pytest.mark.parametrize("which", FILTERS)
@pytest.mark.parametrize("region", REGIONS)
def test_pages_are_all_that_is_asked_for(maps: Maps, region: str, which: str) -> None:
    (where, inside), (what, passes) = REGIONS[region], FILTERS[which]
    expected = maps.ids[inside(maps.truth) & passes(maps.truth)].tolist()
    assert maps.pages(limit=97, **where, **what) == expected
    first = maps.get(**where, **what)
    TypeAdapter(LandmarksJson).validate_json(json.dumps(first), strict=True)
    assert [row["id"] for row in first["landmarks"]] == expected[:100]


@pytest.mark.parametrize("which", FILTERS)
@pytest.mark.parametrize("metric", ["euclidean", "mahalanobis"])
def test_the_nearest_are_those_of_all_distances_sorted(maps: Maps, metric: str, which: str) -> None:
    what, passes = FILTERS[which]
    d, C = maps.truth.xy - (3.5, -7), maps.truth.covariance + 0.02**2 * np.eye(2)
    squared = (d**2).sum(1) if metric == "euclidean" else np.einsum("ni,nij,nj->n", d, np.linalg.inv(C), d)
    distances = np.sort(np.sqrt(squared[passes(maps.truth)]))
    asked = {"metric": metric} | ({"sigma": 0.02} if metric == "mahalanobis" else {})
    found = maps.get("/nearest", x=3.5, y=-7, k=10, **asked, **what)["neighbours"]
    np.testing.assert_allclose([one["distance"] for one in found], distances[:10], rtol=1e-9)
    gate = distances[4:6].mean() if len(distances) else 1.0
    within = maps.get("/nearest", x=3.5, y=-7, k=1000, within=gate, **asked, **what)
    assert len(within["neighbours"]) == min(5, len(distances))
    assert len(maps.get("/nearest", x=3.5, y=-7, **asked, **what)["neighbours"]) == min(1, len(distances))


def test_a_page_is_the_same_in_every_format_and_links_to_the_next(maps: Maps) -> None:
    rows = maps.get(limit=10, after=int(maps.ids[99]))["landmarks"]
    assert [row["id"] for row in rows] == maps.ids[100:110].tolist()
    assert [(row["x"], row["y"]) for row in rows] == [tuple(xy) for xy in maps.truth.xy[100:110]]
    asked = {"session": maps.large.session, "limit": 10, "after": int(maps.ids[99])}
    answers = {
        name: maps.server.http.get("/landmarks", params=asked | {"format": name})
        for name in ("csv", "geojson")
    }
    assert answers["csv"].headers["content-type"].startswith("text/csv")
    table = list(csv.DictReader(io.StringIO(answers["csv"].text, newline="")))
    assert [(float(row["x_m"]), float(row["var_y_m2"]), int(row["id"])) for row in table] == [
        (row["x"], row["var_y"], row["id"]) for row in rows
    ]
    assert answers["geojson"].headers["content-type"] == "application/geo+json"
    features = strict_json(answers["geojson"].text)["features"]
    assert [feature["geometry"]["coordinates"] for feature in features] == [[r["x"], r["y"]] for r in rows]
    for name, answer in answers.items():
        link = answer.links["next"]["url"]
        following = maps.server.http.get(f"{maps.server.url}{link}")
        assert (
            following.headers["content-type"].split(";")[0] == answer.headers["content-type"].split(";")[0]
        ), name
        assert repr(float(maps.truth.xy[110, 0])) in following.text
        assert repr(float(maps.truth.xy[109, 0])) not in following.text
    assert "next" not in maps.server.http.get("/landmarks", params=asked | {"after": int(maps.ids[-3])}).links


def test_the_newest_map_answers_if_no_session_is_named(maps: Maps) -> None:
    assert maps.server.get("/landmarks")["session"] == maps.newest.session
    assert len(maps.server.get("/landmarks")["landmarks"]) == 5
    assert maps.server.get("/landmarks/nearest", x=0, y=0)["session"] == maps.newest.session


def test_a_landmark_tells_its_history_also_when_it_was_removed(maps: Maps) -> None:
    landmark_map = maps.filled("one that moves", 2)
    id, other = (m.id for m in landmark_map)
    states = [
        Landmark(i / 10, 0.0, 1e-4, 0.0, 1e-4, "corner", "ml", i, 0.0, float(i), id) for i in range(1, 250)
    ]
    landmark_map.put(states)
    told = maps.server.get(f"/landmarks/{id}")
    assert (told["session"], told["landmark"]["x"]) == (landmark_map.session, 24.9)
    assert [row["count"] for row in told["history"]] == [1, *range(1, 100)]
    rest = maps.server.get(f"/landmarks/{id}", after=told["next"], limit=1000)
    assert [row["count"] for row in rest["history"]] == list(range(100, 250))
    assert rest["next"] is None
    landmark_map.remove([id])
    told = maps.server.get(f"/landmarks/{id}")
    assert told["landmark"] is None
    assert len(told["history"]) == 100
    assert maps.server.get(f"/landmarks/{other}")["landmark"]["x"] == 1.0
    assert_problem(maps.server.http.get("/landmarks/987654"), 404)
    maps.atlas.delete(landmark_map.session)
    assert_problem(maps.server.http.get(f"/landmarks/{other}"), 404)


@pytest.mark.parametrize(
    ("path", "asked", "words"),
    [
        ("", {"bbox": "1,0,0,1"}, "no minimum above its maximum"),
        ("", {"bbox": "0,1,1,0"}, "no minimum above its maximum"),
        ("", {"bbox": "nan,0,1,1"}, "'nan,0,1,1': nan is no number"),
        ("", {"bbox": "0,0,1"}, "min_x,min_y,max_x,max_y"),
        ("", {"bbox": "a,b,c,d"}, "min_x,min_y,max_x,max_y"),
        ("", {"x": 1, "y": 1}, "radius"),
        ("", {"radius": 1}, "radius"),
        ("", {"x": "nan", "y": 1, "radius": 1}, "x"),
        ("", {"x": 1, "y": 1, "radius": -1}, "radius"),
        ("", {"x": 1, "y": 1, "radius": 1, "bbox": "0,0,1,1"}, "not both"),
        ("", {"since": 2, "until": 1}, "since (2 s) is after until (1 s)"),
        ("", {"since": "nan"}, "since: Input should be a finite"),
        ("", {"until": "nan"}, "until: Input should be a finite"),
        ("", {"x": 1e200, "y": 1, "radius": 1}, "x: Input should be less"),
        ("", {"max_sigma": -1}, "max_sigma: Input should be greater"),
        ("", {"max_sigma": "nan"}, "max_sigma: Input should be a finite"),
        ("", {"min_count": 1.5}, "min_count"),
        ("", {"min_count": 2**63}, "min_count"),
        ("", {"limit": 0}, "limit"),
        ("", {"limit": 1001}, "limit"),
        ("", {"after": -1}, "after"),
        ("", {"after": 2**63}, "after"),
        ("", {"format": "xml"}, "format"),
        ("", {"session": "one"}, "session"),
        ("/nearest", {"x": 1}, "y"),
        ("/nearest", {"x": 1, "y": "inf"}, "y"),
        ("/nearest", {"x": 1e200, "y": 0}, "x: Input should be less"),
        ("/nearest", {"x": 0, "y": -2e7}, "y: Input should be greater"),
        ("/nearest", {"x": 1, "y": 1, "k": 0}, "k"),
        ("/nearest", {"x": 1, "y": 1, "k": 1001}, "k"),
        ("/nearest", {"x": 1, "y": 1, "metric": "manhattan"}, "metric"),
        ("/nearest", {"x": 1, "y": 1, "sigma": 1}, "metric is 'euclidean'"),
        ("/nearest", {"x": 1, "y": 1, "within": "nan"}, "within: Input should be a finite"),
        ("/nearest", {"x": 1, "y": 1, "sigma": "nan", "metric": "mahalanobis"}, "sigma"),
        ("/one", {}, "id"),
        ("/7", {"after": "nan"}, "after: Input should be a finite"),
    ],
)
def test_a_question_that_makes_no_sense_is_refused_with_the_reason(
    maps: Maps, path: str, asked: dict[str, Any], words: str
) -> None:
    problem = assert_problem(maps.server.http.get(f"/landmarks{path}", params=asked), 422)
    assert words in problem["detail"]


@pytest.mark.parametrize(
    ("method", "path", "asked"),
    [
        ("GET", "/landmarks", {}),
        ("GET", "/landmarks/nearest", {"x": 0, "y": 0}),
        ("DELETE", "/landmarks", {}),
        ("GET", "/map", {}),
    ],
)
def test_an_unknown_session_is_said_to_be_unknown(maps: Maps, method: str, path: str, asked: Json) -> None:
    problem = assert_problem(maps.server.http.request(method, path, params=asked | {"session": 999}), 404)
    assert "999" in problem["detail"]
    assert_problem(maps.server.http.delete("/sessions/999"), 404)
    for large in (2**63, -(2**63) - 1):
        assert_problem(maps.server.http.delete(f"/sessions/{large}"), 422)
        assert_problem(maps.server.http.get("/landmarks", params={"session": large}), 422)
        assert_problem(maps.server.http.get(f"/landmarks/{large}"), 422)


def test_sessions_are_listed_cleared_and_deleted(maps: Maps) -> None:
    passing = maps.filled("passing", 4)
    listed = maps.server.get("/sessions")
    assert listed["sessions"][-1] == {
        "id": passing.session, "source": "passing", "mode": "slam", "started": 1.0, "ended": None, "landmarks": 4,
        "walls": 0,
        "grid": False,
        "name": "",
    }  # fmt: skip
    assert listed["store"]["error"] is None
    assert maps.server.http.delete("/landmarks", params={"session": passing.session}).status_code == 204
    assert maps.server.get("/landmarks", session=passing.session)["landmarks"] == []
    assert maps.server.get("/sessions")["sessions"][-1]["landmarks"] == 0
    assert maps.server.http.delete(f"/sessions/{passing.session}").status_code == 204
    assert maps.server.get("/sessions")["sessions"] == listed["sessions"][:-1]
    assert_problem(maps.server.http.get("/landmarks", params={"session": passing.session}), 404)


def test_a_session_is_named_renamed_and_nameless_again(maps: Maps) -> None:
    session = maps.filled("to be named", 2).session
    path = f"/sessions/{session}"
    for given, name in (("  Hall, ground floor ", "Hall, ground floor"), ("ä" * 200, "ä" * 200), (" ", "")):
        assert maps.server.change("PATCH", path, {"name": given})["name"] == name
        assert maps.server.get("/sessions")["sessions"][-1]["name"] == name
    maps.server.change("PATCH", path, {"name": "kept"})
    for wrong, words in (
        ("x" * 201, "at most 200"),
        ("two\nlines", "cannot be shown"),
        (7, "string"),
        (None, 'give "" to take the name away'),
    ):
        problem = assert_problem(maps.server.http.patch(path, json={"name": wrong}), 422)
        assert words in problem["detail"]
    assert_problem(maps.server.http.patch(path, json={}), 422)
    assert "no object: send one" in assert_problem(maps.server.http.patch(path, json=[]), 422)["detail"]
    assert maps.server.get("/sessions")["sessions"][-1]["name"] == "kept"
    unknown = assert_problem(maps.server.http.patch("/sessions/999", json={"name": "x"}), 404)
    assert "no session 999" in unknown["detail"]
    maps.server.http.delete(path).raise_for_status()


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("Hall, ground floor", "Hall-ground-floor"),
        ("v1.2 a/b\\c", "v1-2-a-b-c"),
        ('a/b\\c: "d" - e_1', "a-b-c-d-e_1"),
        ("Größe", "Größe"),
        ("दीवार २", "दीवार-२"),
        ("廊" * 200, "廊" * 50),
        ("../..", None),
        ("CON", "map-CON"),
        ("nul.", "map-nul"),
        ("Com¹", "map-Com¹"),
        ("lpt9", "map-lpt9"),
        ("Hall.", "Hall"),
        ("Console", "Console"),
    ],
)
def test_a_file_of_a_map_is_named_after_it(maps: Maps, name: str, stem: str | None) -> None:
    id = maps.large.session
    maps.server.change("PATCH", f"/sessions/{id}", {"name": name})
    file = maps.server.http.get("/map", params={"session": id, "format": "csv"}).raise_for_status()
    wanted = f"{stem or f'map-{id}'}.csv"
    plain, encoded = f'filename="{wanted}"', f"filename*=utf-8''{quote(wanted)}"
    assert file.headers["content-disposition"] == f"attachment; {plain if wanted.isascii() else encoded}"
    some = maps.server.http.get("/landmarks", params={"session": id, "format": "csv"}).raise_for_status()
    named = f"{stem or f'map-{id}'}-landmarks.csv"
    plain, encoded = f'filename="{named}"', f"filename*=utf-8''{quote(named)}"
    assert some.headers["content-disposition"] == f"attachment; {plain if named.isascii() else encoded}"
    maps.server.change("PATCH", f"/sessions/{id}", {"name": ""})


@pytest.mark.parametrize("name", ["json", "csv", "geojson"])
def test_a_map_that_was_downloaded_loads_as_a_new_session(maps: Maps, name: str) -> None:
    asked = {"session": maps.large.session, "format": name}
    file = maps.server.http.get("/map", params=asked)
    assert file.status_code == 200
    assert f'filename="map-{maps.large.session}.{name}"' in file.headers["content-disposition"]
    began = time.time()
    loaded = maps.server.http.post(
        "/map", params={"format": name, "name": f"hall.{name}"}, content=file.content
    )
    assert loaded.status_code == 201
    session = loaded.json()
    assert (session["source"], session["mode"], session["landmarks"]) == (f"hall.{name}", "import", N)
    assert began - 1 < session["started"] <= session["ended"] < time.time() + 1
    copies, truth = list(maps.atlas[session["id"]]), list(maps.large)
    fields = [name for name in Landmark.__slots__ if name != "id"]
    assert [[getattr(m, f) for f in fields] for m in copies] == [
        [getattr(m, f) for f in fields] for m in truth
    ]
    assert min(m.id for m in copies) > max(m.id for m in truth)
    maps.atlas.delete(session["id"])


def test_a_picture_comes_alone_or_with_what_ros_needs(maps: Maps, tmp_path: Path) -> None:
    asked = {"session": maps.small.session, "resolution": 0.5}
    picture = maps.server.http.get("/map", params=asked | {"format": "png"})
    archive = ZipFile(io.BytesIO(maps.server.http.get("/map", params=asked | {"format": "zip"}).content))
    assert sorted(archive.namelist()) == ["map.png", "map.yaml"]
    assert archive.read("map.png") == picture.content
    about = YAML(typ="safe").load(archive.read("map.yaml").decode())
    assert (about["image"], about["resolution"]) == ("map.png", 0.5)
    grey = np.asarray(Image.open(io.BytesIO(picture.content)), float)
    row, column = np.nonzero((255 - grey) / 255 > about["occupied_thresh"])
    x = about["origin"][0] + column * 0.5
    y = about["origin"][1] + (grey.shape[0] - 1 - row) * 0.5
    assert sorted(zip(x.tolist(), y.tolist(), strict=True)) == [(0, 0), (1, 1), (2, 2)]
    assert_problem(maps.server.http.get("/map", params=asked | {"format": "png", "resolution": 0}), 422)


def document(**changes: Any) -> str:
    return json.dumps(HEAD | {"landmarks": [GOOD, GOOD | changes]})


@pytest.mark.parametrize(
    ("name", "body", "words"),
    [
        ("json", b"", "cannot be read"),
        ("json", b"\xff\xfe\xfa", "cannot be read"),
        ("json", "[" * 100_000, "cannot be read"),
        ("json", json.dumps(HEAD | {"unit": "mm", "landmarks": [GOOD]}), "unit should be 'm' and is 'mm'"),
        ("json", json.dumps(HEAD | {"version": 2, "landmarks": [GOOD]}), "version should be 1 and is 2"),
        ("json", document(x=float("nan")), "Landmark 2"),
        ("json", document(var_x=-1), "positive definite"),
        ("json", document(cov_xy=0.01), "positive definite"),
        ("json", document(y="north"), "number"),
        ("json", document(last_seen=1e300), "give seconds"),
        ("json", json.dumps(HEAD | {"landmarks": []}), "holds no landmarks"),
        ("geojson", json.dumps({"type": "FeatureCollection", "features": []} | HEAD), "holds no landmarks"),
        ("csv", "x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind\n", "holds no landmarks"),
        ("csv", document(), "Columns"),
        ("geojson", document(), "features"),
        ("xml", "<map/>", "format"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused_and_nothing_is_kept_of_it(
    maps: Maps, name: str, body: str | bytes, words: str
) -> None:
    before = maps.server.get("/sessions")["sessions"]
    content = body if isinstance(body, bytes) else body.encode()
    problem = assert_problem(maps.server.http.post("/map", params={"format": name}, content=content), 422)
    assert words in problem["detail"]
    assert maps.server.get("/sessions")["sessions"] == before


def test_a_name_that_cannot_be_shown_is_refused(maps: Maps) -> None:
    before = maps.server.get("/sessions")["sessions"]
    answer = maps.server.http.post("/map", params={"name": "a\0b"}, content=document())
    assert "name is 'a\\x00b'" in assert_problem(answer, 422)["detail"]
    assert maps.server.get("/sessions")["sessions"] == before


@pytest.mark.parametrize("chunked", [False, True])
def test_too_large_a_map_is_refused(maps: Maps, chunked: bool) -> None:
    chunk = b" " * (1 << 20)
    content = iter([chunk] * 40) if chunked else chunk * 40
    assert_problem(maps.server.http.post("/map", content=content), 413)


def test_a_file_that_is_locked_can_be_read_and_says_why_it_cannot_be_written(maps: Maps) -> None:
    blocker = sqlite3.connect(maps.atlas.path, isolation_level=None)
    blocker.execute("BEGIN IMMEDIATE")
    try:
        assert len(maps.get(limit=10)["landmarks"]) == 10
        problem = assert_problem(maps.server.http.delete(f"/sessions/{maps.small.session}"), 503)
        assert "locked" in problem["detail"]
    finally:
        blocker.execute("ROLLBACK")
        blocker.close()
    assert maps.server.get("/landmarks", session=maps.small.session)["landmarks"]


def test_without_a_map_it_says_how_to_get_one(server: Server) -> None:
    assert server.get("/sessions")["sessions"] == []
    for path in ("/landmarks", "/landmarks/nearest?x=0&y=0", "/map"):
        said = assert_problem(server.http.get(path), 404)["detail"]
        assert "navigation.method to landmarks" in said
        assert "/map/grid" in said


def test_the_map_of_a_run_is_there_within_a_second_and_cannot_be_deleted_under_it(
    make_server: Callable[..., Server], room: Path
) -> None:
    server = make_server(recording=room)
    server.change("PATCH", "/settings", {"navigation": {"mode": "slam", "method": "landmarks"}})

    def landmarks() -> list[Json]:
        answer = server.http.get("/landmarks")
        return answer.json()["landmarks"] if answer.status_code == 200 else []

    wait_until(lambda: len(landmarks()) == 4)
    (session,) = server.get("/sessions")["sessions"]
    assert (session["source"], session["mode"], session["ended"]) == ("room.npz", "slam", None)
    assert_problem(server.http.delete(f"/sessions/{session['id']}"), 409)
    server.change("PATCH", "/settings", {"navigation": {"mode": "off"}})
    wait_until(lambda: server.get("/sessions")["sessions"][0]["ended"])
    assert server.http.delete(f"/sessions/{session['id']}").status_code == 204
