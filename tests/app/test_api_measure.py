"""Measuring in the current frame and in its map: the room's own measures, with sigmas, and what cannot be measured."""

import io
import shutil
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from lidarcore_app.jobs.maps.store import LandmarkStore
from lidarcore_app.jobs.maps.wall_writer import CONFIRMED
from serving import CORNERS, Json, Server, assert_problem, wait_until, write_room

from lidarcore.mapping.export import COVARIANCE_FILE
from lidarcore.mapping.walls import MOST_WALLS

WHOLE_SCANS = {"navigation": {"mode": "slam", "method": "scans"}}
MIDDLES = (CORNERS + np.roll(CORNERS, -1, axis=0)) / 2


def at(kind: str, xy: np.ndarray) -> str:
    return f"{kind}@{xy[0]:.3f},{xy[1]:.3f}"


def test_corners_and_walls_are_as_far_from_each_other_as_in_the_room(server: Server, room) -> None:
    frame = server.play(room, paused=True)
    ids = {corner["id"] for corner in frame["corners"]}
    for first, second, distance in (
        (at("corner", CORNERS[0]), at("corner", CORNERS[2]), np.hypot(6, 4)),
        (at("corner", CORNERS[0]), at("wall", MIDDLES[2]), 4.0),
        (at("wall", MIDDLES[0]), at("wall", MIDDLES[2]), 4.0),
    ):
        found = server.get("/measure", first=first, second=second)
        assert 0 < found["sigma"] < 0.01
        assert found["distance"] == pytest.approx(distance, abs=6 * found["sigma"])
        assert found["first"]["kind"] == "wall" or found["first"]["id"] in ids
    assert found["angle"] == pytest.approx(0, abs=6 * found["angle_sigma"])


def test_what_is_not_there_is_not_measured(server: Server, room) -> None:
    server.play(room, paused=True)
    corner, nowhere = at("corner", CORNERS[0]), "corner@0.5,0.2"
    for first, second, status in ((corner, nowhere, 404), (corner, corner, 404), (corner, "post@1,2", 422)):
        problem = assert_problem(
            server.http.get("/measure", params={"first": first, "second": second}), status
        )
        assert status == 404 or "write corner@x,y, wall@x,y" in problem["detail"]


@pytest.fixture
def mapped(server: Server) -> Server:
    """The sensor stands still, so the frame of the map is that of the room."""
    server.change("PATCH", "/settings", WHOLE_SCANS)
    server.play(write_room(server.folder / "long.npz", scans=600))
    with server.stream() as stream:
        stream.until("walls", lambda message: len(message["corners"]) == 4)
    server.change("PATCH", "/source", {"state": "paused"})
    return server


def test_corners_and_walls_of_the_map_are_as_far_from_each_other_as_in_the_room(mapped: Server) -> None:
    ids = {wall["id"] for wall in mapped.get("/walls")["walls"]}
    for first, second, distance in (
        (at("map-corner", CORNERS[0]), at("map-corner", CORNERS[2]), np.hypot(6, 4)),
        (at("map-corner", CORNERS[0]), at("map-wall", MIDDLES[2]), 4.0),
        (at("map-wall", MIDDLES[0]), at("map-wall", MIDDLES[2]), 4.0),
    ):
        found = mapped.get("/measure", first=first, second=second)
        assert 0 < found["sigma"] < 0.02
        assert found["distance"] == pytest.approx(distance, abs=6 * found["sigma"])
        assert [found["first"]["kind"], found["second"]["kind"]] == [
            first.split("@")[0],
            second.split("@")[0],
        ]
    assert {found["first"]["id"], found["second"]["id"]} < ids
    assert found["angle"] == pytest.approx(0, abs=6 * found["angle_sigma"])


def test_walls_of_the_map_are_named_by_their_ids(mapped: Server) -> None:
    walls = {wall["id"]: wall for wall in mapped.get("/walls")["walls"]}
    by_place = mapped.get("/measure", first=at("map-wall", MIDDLES[0]), second=at("map-wall", MIDDLES[2]))
    first, second = by_place["first"]["id"], by_place["second"]["id"]
    by_id = mapped.get("/measure", first=f"map-wall:{first}", second=f"map-wall:{second}")
    assert by_id["distance"] == pytest.approx(by_place["distance"])
    assert by_id["sigma"] == pytest.approx(by_place["sigma"])
    assert by_id["first"]["id"] == first
    assert by_id["first"]["at"] == pytest.approx(
        np.mean([walls[first]["start"], walls[first]["end"]], axis=0)
    )
    params = {"first": f"map-wall:{first}", "second": at("map-corner", CORNERS[2])}
    assert mapped.get("/measure", **params)["distance"] == pytest.approx(4, abs=0.1)
    gone = assert_problem(mapped.http.get("/measure", params=params | {"first": "map-wall:99999"}), 404)
    assert "no wall 99999 now: take an id that /walls gives" in gone["detail"]
    for none in ("map-wall:-1", "map-wall:x", "wall:1", "map-corner:1"):
        problem = assert_problem(mapped.http.get("/measure", params=params | {"first": none}), 422)
        assert "map-wall:ID" in problem["detail"]


def test_scan_and_map_are_not_mixed_and_without_a_map_nothing_of_it_is_measured(mapped: Server, room) -> None:
    corner, other = CORNERS[0], CORNERS[2]
    for first, second, status in (
        (at("map-corner", corner), at("corner", other), 422),
        (at("wall", MIDDLES[0]), at("map-wall", MIDDLES[2]), 422),
        (at("map-corner", corner), at("map-corner", corner), 404),
        (at("map-corner", corner), "map-wall@0.5,0.2", 404),
    ):
        assert_problem(mapped.http.get("/measure", params={"first": first, "second": second}), status)
    mapped.change("PATCH", "/settings", {"navigation": {"mode": "off"}})
    mapped.play(room, paused=True)
    params = {"first": at("map-corner", corner), "second": at("map-corner", other)}
    assert "slam" in assert_problem(mapped.http.get("/measure", params=params), 404)["detail"]


def between(server: Server, first: str, second: str, **asked: int) -> Json:
    return server.get("/measure", first=first, second=second, **asked)


def refused(server: Server, status: int, **asked: int) -> str:
    two = {"first": at("map-wall", MIDDLES[0]), "second": at("map-wall", MIDDLES[2])}
    return assert_problem(server.http.get("/measure", params=two | asked), status)["detail"]


def all_measured(server: Server, **asked: int) -> dict[tuple[str, str], Json]:
    """Between all corners and walls of the room."""
    places = [at("map-corner", xy) for xy in CORNERS] + [at("map-wall", xy) for xy in MIDDLES]
    return {pair: between(server, *pair, **asked) for pair in combinations(places, 2)}


def assert_same(found: dict[tuple[str, str], Json], truth: dict[tuple[str, str], Json]) -> None:
    """Corners have no ids that last, and the ends of walls that meet are the same to rounding."""
    for pair, told in truth.items():
        names = (
            ("distance", "sigma") if told["angle"] is None else ("distance", "sigma", "angle", "angle_sigma")
        )
        assert [found[pair][name] for name in names] == pytest.approx(
            [told[name] for name in names], rel=1e-3, abs=1e-5
        )
        for side in ("first", "second"):
            assert found[pair][side]["at"] == pytest.approx(told[side]["at"], abs=1e-6)
            if told[side]["kind"] == "map-wall":
                assert found[pair][side]["id"] == told[side]["id"]


def rested(told: Callable[[], list[Json]]) -> None:
    """Wait until walls are of all scans: of a sensor that stands still they are sought every few seconds."""
    walls, since = told(), time.monotonic()

    def unchanged() -> bool:
        nonlocal walls, since
        if (now := told()) != walls:
            walls, since = now, time.monotonic()
        return time.monotonic() - since > 8

    wait_until(unchanged, "the walls are of all scans", 60)


@pytest.fixture
def finished(server: Server) -> tuple[Server, int, dict[tuple[str, str], Json]]:
    """A map, its session, and what was measured in it as the last thing before it was finished."""

    def told(**asked: int) -> list[Json]:
        answer = server.http.get("/walls", params=asked)
        return answer.json()["walls"] if answer.is_success else []

    server.change("PATCH", "/settings", WHOLE_SCANS)
    server.play(write_room(server.folder / "long.npz", scans=600))
    wait_until(lambda: [wall["count"] >= CONFIRMED for wall in told()] == 4 * [True], "all are confirmed", 60)
    server.change("PATCH", "/source", {"state": "paused"})
    rested(told)
    wait_until(lambda: server.get("/sessions")["store"]["session"] is not None, "the map is kept")
    session = server.get("/sessions")["store"]["session"]
    wait_until(lambda: told(session=session) == told(), "all of it is on the disk")
    server.runtime.player.refresh()  # the scan is shown with that map
    wait_until(lambda: server.runtime.frame.picture is server.runtime.navigation.picture, "it is measured in")
    assert "still being made: leave out session" in refused(server, 404, session=session)
    truth = all_measured(server)
    server.change("PATCH", "/settings", {"navigation": {"mode": "off"}})
    wait_until(lambda: server.get("/sessions")["sessions"][-1]["ended"] is not None, "it is finished")
    return server, session, truth


def test_a_finished_map_is_measured_as_before_wherever_it_is(finished, tmp_path: Path) -> None:
    """By its session, where it is localized in, and loaded from its zip; and once the server was killed."""
    server, session, truth = finished
    assert "give the session of one that is kept" in refused(server, 404)
    assert_same(all_measured(server, session=session), truth)
    server.change("PUT", "/localization/map", {"session": session})
    server.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
    wait_until(lambda: server.get("/localization")["session"] == session, "it is localized in")
    assert_same(all_measured(server), truth)

    packed = server.http.get("/map", params={"session": session, "format": "zip"}).raise_for_status().content
    loaded = (
        server.http.post("/map", params={"format": "zip"}, content=packed).raise_for_status().json()["id"]
    )
    assert_same(all_measured(server, session=loaded), truth)
    assert_same(all_measured(server, session=session), truth)

    path = Path(server.get("/sessions")["store"]["path"])
    for part in path.parent.glob(f"{path.name}*"):  # as it is on the disk while the server goes on
        shutil.copy(part, tmp_path / part.name)
    with closing(LandmarkStore(tmp_path / path.name)) as store:
        assert store.joint_walls(session) is not None


def test_a_map_of_which_it_is_not_known_is_refused_with_the_reason(finished) -> None:
    server, session, _ = finished
    for one, other in (("corner@1,1", "corner@2,2"), ("wall@1,1", "corner@2,2")):
        params = {"first": one, "second": other, "session": session}
        assert (
            "leave out session" in assert_problem(server.http.get("/measure", params=params), 422)["detail"]
        )
    assert_problem(
        server.http.get("/measure", params={"first": "map-wall:1", "second": "map-wall:2", "session": "x"}),
        422,
    )
    assert "no session 99" in refused(server, 404, session=99)
    assert_problem(
        server.http.get("/measure", params={"first": "map-wall:1", "second": "map-wall:2", "session": 2**70}),
        422,
    )

    files = server.http.get("/map", params={"session": session, "format": "zip"}).raise_for_status().content
    bare, damaged = (without_covariance(files, more) for more in ({}, {COVARIANCE_FILE: b"nonsense"}))
    loaded = server.http.post("/map", params={"format": "zip"}, content=bare).raise_for_status().json()["id"]
    assert f"loaded without {COVARIANCE_FILE}" in refused(server, 404, session=loaded)
    assert f"Map {loaded} lacks that" in refused(server, 404, session=loaded)
    assert "It has no recording here" in refused(server, 404, session=loaded)
    before = server.get("/sessions")["sessions"]
    problem = assert_problem(server.http.post("/map", params={"format": "zip"}, content=damaged), 422)
    assert f"{COVARIANCE_FILE}: " in problem["detail"]
    assert server.get("/sessions")["sessions"] == before

    store = server.app.state.server.landmarks
    walls = store.atlas[session].walls()
    empty = store.atlas.begin("empty", 1.0)
    store.atlas.rename(empty.session, "Hall")
    assert f"Hall (map {empty.session}) has no walls" in refused(server, 404, session=empty.session)
    empty.put_walls([replace(walls[0], id=id) for id in range(MOST_WALLS + 1)])
    assert f"more than {MOST_WALLS} walls" in refused(server, 404, session=empty.session)
    live, recorded = (
        store.atlas.begin(source, 1.0, "slam") for source in ("RPLIDAR S1 emulated", "long.npz")
    )
    for one in (live, recorded):
        one.put_walls(walls)
    assert "It has no recording here: build another" in refused(server, 404, session=live.session)
    assert "once more from its recording, long.npz" in refused(server, 404, session=recorded.session)
    with closing(sqlite3.connect(server.get("/sessions")["store"]["path"])) as file, file:
        file.execute(
            "UPDATE wall_covariances SET packed = substr(packed, 1, 40) WHERE session = ?", (session,)
        )
    assert "is damaged" in refused(server, 422, session=session)
    assert len(server.get("/walls", session=session)["walls"]) == len(walls)


def without_covariance(packed: bytes, more: dict[str, bytes]) -> bytes:
    """A zip without that file, but with more."""
    file = io.BytesIO()
    with ZipFile(io.BytesIO(packed)) as before, ZipFile(file, "w") as after:
        kept = {name: before.read(name) for name in before.namelist() if name != COVARIANCE_FILE}
        for name, content in (kept | more).items():
            after.writestr(name, content)
    return file.getvalue()
