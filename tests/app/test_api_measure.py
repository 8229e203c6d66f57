"""Measuring in the current frame and in its map: the room's own measures, with sigmas, and what cannot be measured."""

import numpy as np
import pytest
from serving import CORNERS, Server, assert_problem, write_room

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
