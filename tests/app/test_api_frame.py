import csv
import io
import threading
from collections.abc import Callable
from pathlib import Path

import httpx
import lidarcore_app.pipeline.runtime
import numpy as np
import pytest
from lidarcore_app.web.schemas import CornerJson, FrameJson, SegmentJson
from pydantic import TypeAdapter
from serving import CORNERS, Server, assert_problem, chosen, strict_json

from lidarcore import FITTERS, Client, ExtractionSettings, compare, open_recording
from lidarcore.errors import ClientError


def test_a_frame_is_what_its_schema_says(server: Server) -> None:
    server.next_frame()
    for params in ({}, {"points": "true"}):
        text = server.http.get("/frame", params=params).raise_for_status().text
        strict_json(text)
        TypeAdapter(FrameJson).validate_json(text, strict=True)


def test_points_come_when_asked_for_and_are_the_valid_ones(server: Server) -> None:
    server.next_frame()
    assert "points" not in server.get("/frame")
    frame = server.get("/frame", points=True)
    assert len(frame["points"]) == frame["n_valid"] <= frame["n_beams"]


def test_the_corners_are_where_the_walls_of_the_room_meet(server: Server, room) -> None:
    frame = server.play(room)
    found = np.array([[c["by_method"]["ml"][axis] for axis in "xy"] for c in frame["corners"]])
    assert len(found) == 4
    distances = np.linalg.norm(found[:, None] - CORNERS, axis=2)
    assert sorted(distances.argmin(axis=1)) == [0, 1, 2, 3]
    assert distances.min(axis=1).max() < 0.01
    assert frame["summary"]["ml"]["corners"] == 4


def test_a_recorded_scan_gives_what_the_library_gives_for_every_method(server: Server, hokuyo: Path) -> None:
    (server.folder / "demo.bag").symlink_to(hokuyo)
    server.change("PATCH", "/settings", {"view": {"compare": True}})
    server.change("PUT", "/source", {"kind": "recording", "name": "demo.bag", "index": 7, "paused": True})
    with server.stream() as stream:
        frame = stream.frame(lambda f: chosen(f) and len(f["methods"]) == len(FITTERS))
    scan = next(scan for i, scan in enumerate(open_recording(hokuyo)) if i == 7)
    assert frame["source"]["index"] == 7
    assert frame["stamp"] == scan.stamp
    assert frame["methods"][0] == "ml"
    for name, features in compare(scan, ExtractionSettings()).items():
        r = [segment["r"] for segment in frame["segments"][name]]
        np.testing.assert_array_equal(r, features.segments.lines.r)
        xy = [(m["x"], m["y"]) for c in frame["corners"] if (m := c["by_method"].get(name))]
        assert sorted(xy) == sorted(map(tuple, features.corners.xy.tolist()))
        area = np.median(features.corners.area)
        assert frame["summary"][name] == {"corners": len(features.corners), "median_area": area}


def test_segments_and_corners_are_those_of_the_frame_as_json_and_as_csv(server: Server, room) -> None:
    server.change("PATCH", "/settings", {"view": {"compare": True, "methods": ["cwlf"]}})
    server.play(room, paused=True)
    frame = server.get("/frame")
    segments, corners = server.get("/segments", fitter="cwlf"), server.get("/corners", fitter="cwlf")
    TypeAdapter(list[SegmentJson]).validate_python(segments)
    TypeAdapter(list[CornerJson]).validate_python(corners)
    assert segments == frame["segments"]["cwlf"]
    assert [c["by_method"]["cwlf"] for c in corners] == [c["by_method"]["cwlf"] for c in frame["corners"]]
    assert server.get("/segments") == frame["segments"]["ml"]

    response = server.http.get("/segments", params={"fitter": "cwlf", "format": "csv"})
    assert response.headers["content-disposition"] == 'attachment; filename="segments.csv"'
    assert response.headers["content-type"].startswith("text/csv")
    rows = list(csv.DictReader(io.StringIO(response.text)))
    for row, segment in zip(rows, segments, strict=True):
        assert float(row["alpha"]) == segment["alpha"]
        assert [float(row["x_start"]), float(row["y_start"])] == segment["start"]
        assert float(row["cov_alpha_r"]) == segment["covariance"][0][1]
    response = server.http.get("/corners?fitter=cwlf&format=csv")
    assert response.headers["content-disposition"] == 'attachment; filename="corners.csv"'
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert {int(row["id"]): float(row["x"]) for row in rows} == {
        c["id"]: c["by_method"]["cwlf"]["x"] for c in corners
    }


def test_a_fitter_that_is_not_in_the_frame_is_not_found(server: Server) -> None:
    server.next_frame()
    for path in ("/segments", "/corners"):
        problem = assert_problem(server.http.get(path, params={"fitter": "cwlf"}), 404)
        assert "ml" in problem["detail"]
        assert_problem(server.http.get(path, params={"format": "xml"}), 422)


def assert_not_yet(answer: httpx.Response) -> None:
    """It says that the server is still starting, and when to ask again."""
    assert "still being compiled" in assert_problem(answer, 503)["detail"]
    assert float(answer.headers["Retry-After"]) > 0


def test_while_the_kernels_compile_the_server_answers_and_says_so(
    make_server: Callable[..., Server], monkeypatch: pytest.MonkeyPatch, room: Path
) -> None:
    compiled = threading.Event()
    monkeypatch.setattr(lidarcore_app.pipeline.runtime, "warm_up", compiled.wait)
    server = make_server()
    with server.stream() as stream:
        assert stream.state()["ready"] is False
        assert server.get("/health")["ready"] is False
        assert_problem(server.http.get("/pose"), 404)  # nothing is localized
        maps = ("/walls", "/walls/nearest?x=0&y=0", "/map/grid", "/map/grid?format=zip")
        for path in maps:
            assert "no map of whole scans" in assert_problem(server.http.get(path), 404)["detail"]
        server.change("PATCH", "/settings", {"navigation": {"mode": "slam", "method": "scans"}})
        for path in ("/frame", "/segments", "/corners", "/clusters", "/pose", *maps):
            assert_not_yet(server.http.get(path))
        server.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
        for path in maps:
            assert_not_yet(server.http.get(path))
        places = {"first": "corner@1,1", "second": "corner@2,2"}
        assert_not_yet(server.http.get("/measure", params=places))
        assert_not_yet(server.http.put("/selection", json={"corner": 1}))
        with (
            Client(server.url) as client,
            pytest.raises(ClientError, match="still being compiled") as refused,
        ):
            client.corners()
        assert refused.value.status == 503
        server.change("PATCH", "/settings", {"navigation": None})
        server.change("PUT", "/source", {"kind": "recording", "name": room.name})
        assert server.get("/source")["state"] == "loading"
        compiled.set()
        assert (
            stream.state(lambda state: state["ready"] and state["source"]["complete"])["source"]["count"]
            == 30
        )
        assert chosen(stream.frame())


def test_timings_and_rate_are_measured(server: Server) -> None:
    with server.stream() as stream:
        frame = [stream.frame() for _ in range(12)][-1]
        stream.frame(lambda f: 9 < f["rate_hz"] < 11)  # once nothing else keeps the machine busy
    timings = frame["timings"]
    assert timings["extract_us"] > 0
    assert timings["draw_us"] > 0
    assert timings["age_ms"] * 1e3 >= timings["extract_us"]


def test_a_scan_that_is_shown_again_is_no_other_one(server: Server, room: Path) -> None:
    server.play(room, paused=True)
    with server.stream() as stream:
        frames = [stream.frame()]
        for ellipse_scale in range(3, 13):
            server.change("PATCH", "/settings", {"view": {"ellipse_scale": ellipse_scale}})
            frames.append(stream.frame(lambda f, last=frames[-1]: f["sequence"] > last["sequence"]))
    rates = [frame["rate_hz"] for frame in frames]
    assert rates == sorted(rates, reverse=True)


def test_only_a_pose_that_is_estimated_takes_time(server: Server, room: Path) -> None:
    server.play(room, paused=True)
    assert server.get("/frame")["timings"]["locate_us"] is None
    with server.stream() as stream:
        stream.frame()
        server.change("PATCH", "/settings", {"navigation": {"mode": "slam"}})
        new = stream.frame(lambda f: f["localization"])
        server.change("POST", "/source/step", {"by": 1})
        newer = stream.frame(lambda f: f["source"]["index"] == 1)
        server.change("POST", "/source/step", {"by": -1})
        known = stream.frame(lambda f: f["source"]["index"] == 0)
    assert new["timings"]["locate_us"] > 0
    assert newer["timings"]["locate_us"] > 0
    assert known["localization"]
    assert known["timings"]["locate_us"] is None


def test_a_scan_that_is_drawn_again_keeps_the_time_that_its_pose_took(server: Server, room: Path) -> None:
    server.play(room, paused=True)
    with server.stream() as stream:
        server.change("PATCH", "/settings", {"navigation": {"mode": "slam"}})
        new = stream.frame(lambda f: f["localization"])
        server.change("PATCH", "/settings", {"view": {"ellipse_scale": 7}})
        again = stream.frame(lambda f: f["sequence"] > new["sequence"])
    assert again["timings"]["locate_us"] == new["timings"]["locate_us"] > 0
