from pathlib import Path

import pytest
from serving import Json, Server, assert_problem, chosen

NOTHING = {"corner": None, "landmark": None}


def corner_ids(frame: Json) -> set[int]:
    return {corner["id"] for corner in frame["corners"]}


def test_a_selected_corner_is_marked_in_the_frames_and_told_to_all(server: Server, room: Path) -> None:
    first = server.play(room)
    corner = first["corners"][2]["id"]
    with server.stream() as one, server.stream() as other:
        assert server.change("PUT", "/selection", {"corner": corner}) == {"corner": corner, "landmark": None}
        for stream in (one, other):
            assert stream.state(lambda s: s["selection"]["corner"] == corner)
        frame = one.frame(lambda f: any(c["selected"] for c in f["corners"]))
    assert [c["id"] for c in frame["corners"] if c["selected"]] == [corner]
    assert server.get("/selection") == {"corner": corner, "landmark": None}
    assert server.change("PUT", "/selection", {"corner": None}) == NOTHING


def test_while_paused_the_mark_appears_as_well(server: Server, room: Path) -> None:
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": room.name, "paused": True})
        frame = stream.frame(chosen)
        server.change("PUT", "/selection", {"corner": frame["corners"][0]["id"]})
        marked = stream.frame(lambda f: any(c["selected"] for c in f["corners"]))
    assert marked["source"]["index"] == frame["source"]["index"] == 0
    assert corner_ids(marked) == corner_ids(frame)


def test_corners_keep_their_ids_from_frame_to_frame(server: Server, room: Path) -> None:
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": room.name})
        frames = [stream.frame(chosen) for _ in range(10)]
    assert len(corner_ids(frames[0])) == 4
    assert all(corner_ids(frame) == corner_ids(frames[0]) for frame in frames)


def test_another_recording_has_other_corners_and_no_selection(server: Server, room: Path) -> None:
    first = server.play(room)
    server.change("PUT", "/selection", {"corner": first["corners"][0]["id"]})
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": room.name})
        stream.state(lambda s: s["selection"]["corner"] is None)
        second = stream.frame(lambda f: not corner_ids(f) & corner_ids(first))
    assert len(corner_ids(second)) == 4


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"corner": 10**6}, 404),
        ({"corner": "1"}, 422),
        ({"corner": True}, 422),
        ({}, 422),
        ({"corner": None, "x": 1}, 422),
    ],
)
def test_what_is_no_corner_of_the_frame_is_not_selected(server: Server, body: Json, status: int) -> None:
    server.next_frame()
    assert_problem(server.http.put("/selection", json=body), status)
    assert server.get("/selection") == NOTHING
