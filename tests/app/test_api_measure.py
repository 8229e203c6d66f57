"""Measuring in the current frame: the room's own measures, with sigmas, and what cannot be measured."""

import numpy as np
import pytest
from serving import CORNERS, Server, assert_problem


def at(kind: str, xy: np.ndarray) -> str:
    return f"{kind}@{xy[0]:.3f},{xy[1]:.3f}"


def test_corners_and_walls_are_as_far_from_each_other_as_in_the_room(server: Server, room) -> None:
    frame = server.play(room, paused=True)
    ids = {corner["id"] for corner in frame["corners"]}
    middles = (CORNERS + np.roll(CORNERS, -1, axis=0)) / 2
    for first, second, distance in (
        (at("corner", CORNERS[0]), at("corner", CORNERS[2]), np.hypot(6, 4)),
        (at("corner", CORNERS[0]), at("wall", middles[2]), 4.0),
        (at("wall", middles[0]), at("wall", middles[2]), 4.0),
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
        assert_problem(server.http.get("/measure", params={"first": first, "second": second}), status)
