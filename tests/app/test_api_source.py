import threading
import time
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app.pipeline.frame import Frame
from lidarcore_app.sources.player import LATE, Player
from lidarcore_app.sources.recorded import RecordingSource
from lidarcore_app.sources.timed_scan import TimedScan
from serving import Json, Server, Stream, assert_problem, chosen, wait_until, write_room
from two_lidars import write_two_lidars
from waiting import PATIENCE, soonest


def test_a_recording_plays_from_where_it_is_told_to(server: Server, room: Path) -> None:
    order = {"kind": "recording", "name": "room.npz", "index": 12, "paused": True}
    with server.stream() as stream:
        answer = server.change("PUT", "/source", order)
        state = wait_until_complete(stream, "room.npz")
        server.change("PATCH", "/source", {"index": 12})  # shown again, now that this is sure to be seen
        frame = stream.frame(chosen)
    assert answer["kind"] == "recording"
    assert (answer["recording"], answer["format"]) == ("room.npz", "NumPy .npz")
    assert (frame["source"]["index"], frame["stamp"]) == (12, pytest.approx(101.2))
    assert (state["state"], state["count"], state["duration"]) == ("paused", 30, pytest.approx(2.9))
    assert state["time"] == pytest.approx(1.2)
    assert state["error"] is None


def wait_until_complete(stream: Stream, name: str) -> Json:
    """What is told of the recording once all of it is read."""
    source: Json = stream.state(lambda s: s["source"]["recording"] == name and s["source"]["complete"])[
        "source"
    ]
    return source


def test_stepping_and_seeking_show_the_scan_asked_for_and_stay_inside(server: Server, room: Path) -> None:
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": "room.npz", "paused": True})
        wait_until_complete(stream, room.name)
        for method, path, body, index in [
            ("POST", "/source/step", {"by": 1}, 1),
            ("POST", "/source/step", {"by": 5}, 6),
            ("POST", "/source/step", {"by": -2}, 4),
            ("PATCH", "/source", {"index": 20}, 20),
            ("POST", "/source/step", {"by": 600}, 29),
            ("PATCH", "/source", {"index": 10**9}, 29),
            ("POST", "/source/step", {"by": -600}, 0),
        ]:
            answer = server.change(method, path, body)
            assert (answer["index"], answer["state"]) == (index, "paused")
            frame = stream.frame(lambda f, index=index: chosen(f) and f["source"]["index"] == index)
            assert frame["stamp"] == pytest.approx(100 + 0.1 * index)


def test_stepping_pauses_what_plays(server: Server, room: Path) -> None:
    server.play(room)
    assert server.change("POST", "/source/step", {})["state"] == "paused"
    assert server.change("PATCH", "/source", {"state": "playing"})["state"] == "playing"


@pytest.mark.parametrize("speed", [1, 4])
def test_a_recording_keeps_the_pace_of_its_stamps(tmp_path: Path, speed: int) -> None:
    room = write_room(tmp_path / "paced.npz", scans=21, period=0.1)
    handed_over: list[TimedScan] = []
    ended = threading.Event()

    def too_slow_by() -> float:
        """How much longer than by its stamps it takes; no scan may come early."""
        handed_over.clear()
        ended.clear()
        player = Player(
            RecordingSource(room),
            hand_over=handed_over.append,
            is_idle=lambda: True,
            changed=lambda: player.status().state == "ended" and ended.set(),
        )
        player.control(speed=speed, loop=False)
        player.start()
        assert ended.wait(PATIENCE)
        player.close()
        assert [taken.position.index for taken in handed_over] == list(range(21))
        after = np.array([taken.arrival - handed_over[0].arrival for taken in handed_over])
        assert (after >= np.arange(21) * 0.1 / speed - LATE).all()
        return float(after[-1] - 2.0 / speed)

    assert soonest(too_slow_by, 0.2 / speed) <= 0.2 / speed


@pytest.mark.long
def test_at_the_end_it_stops_and_playing_on_starts_again(server: Server) -> None:
    room = write_room(server.folder / "short.npz", scans=4)
    seen: list[int] = []

    def note(frame: Frame) -> None:
        if frame.timed.name == room.name:
            seen.append(frame.timed.position.index)

    server.runtime.frame_listeners.append(note)
    server.change("PATCH", "/source", {"loop": False, "speed": 0, "state": "paused"})
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": room.name, "paused": True})
        wait_until_complete(stream, room.name)
        wait_until(lambda: seen == [0])
        server.change("PATCH", "/source", {"state": "playing"})
        ended = stream.state(lambda s: s["source"]["state"] == "ended")["source"]
        assert ended["index"] == 3
        wait_until(lambda: seen == [0, 1, 2, 3])
        server.change("PATCH", "/source", {"state": "playing"})
        wait_until(lambda: seen == 2 * [0, 1, 2, 3])
        wait_until(lambda: server.get("/source")["state"] == "ended")
        server.change("PATCH", "/source", {"loop": True, "state": "playing"})
        wait_until(lambda: len(seen) >= 20)
        assert seen[:20] == 5 * [0, 1, 2, 3]


def test_as_fast_as_possible_drops_nothing(server: Server) -> None:
    room = write_room(server.folder / "long.npz", scans=400, period=1.0)
    seen: list[int] = []
    server.change("PATCH", "/source", {"speed": 0, "loop": False, "state": "paused"})
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": room.name, "paused": True})
        wait_until_complete(stream, room.name)
        server.runtime.frame_listeners.append(lambda f: seen.append(f.timed.position.index))
        started = time.monotonic()
        server.change("PATCH", "/source", {"state": "playing"})
        stream.frame(lambda f: f["source"]["index"] == 399)
        assert time.monotonic() - started < 100  # 400 s by its stamps
    wait_until(lambda: seen[-1] == 399)  # the stream is told first
    assert seen == list(range(1, 400))


@pytest.mark.parametrize(
    ("name", "content", "status"),
    [("missing.bag", None, 404), ("bad.bag", b"#ROSBAG V2.0\n but not really", 422), ("empty.csv", b"", 422)],
)
def test_what_cannot_be_played_leaves_playing_what_played(
    server: Server, room: Path, name: str, content: bytes | None, status: int
) -> None:
    if content is not None:
        (server.folder / name).write_bytes(content)
    server.play(room)
    before = server.get("/source")
    assert_problem(server.http.put("/source", json={"kind": "recording", "name": name}), status)
    after = server.get("/source")
    assert {k: after[k] for k in ("recording", "state", "error")} == {
        k: before[k] for k in ("recording", "state", "error")
    }
    assert chosen(server.next_frame())


def test_of_several_lidars_one_is_to_be_chosen(server: Server) -> None:
    bag = write_two_lidars(server.folder / "two.mcap")
    assert server.http.put("/recordings/again.mcap", content=bag.read_bytes()).status_code == 201
    body = {"kind": "recording", "name": bag.name}
    problem = assert_problem(server.http.put("/source", json=body), 409)
    assert problem["topics"] == ["/front", "/rear"]
    assert server.get("/source")["recording"] == "background.npz"
    assert_problem(server.http.put("/source", json=body | {"topic": "/nose"}), 409)
    assert server.play(bag, topic="/rear")["n_beams"] == 180
    assert server.get("/source")["topic"] == "/rear"


def test_a_file_that_breaks_off_plays_as_far_as_it_goes(server: Server, hokuyo: Path) -> None:
    cut = server.folder / "cut.bag"
    data = hokuyo.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": cut.name})
        state = wait_until_complete(stream, "cut.bag")
    assert 0 < state["count"] < 360
    assert state["error"] or state["notes"]


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("PUT", "/source", {"kind": "camera"}),
        ("PUT", "/source", {"kind": "recording"}),
        ("PUT", "/source", {"kind": "recording", "name": "../../etc/passwd"}),
        ("PUT", "/source", {"kind": "recording", "name": "room.npz", "index": -1}),
        ("PUT", "/source", {"kind": "emulator", "name": "room.npz"}),
        ("PATCH", "/source", {"speed": 0.05}),
        ("PATCH", "/source", {"speed": 101}),
        ("PATCH", "/source", {"speed": -1}),
        ("PATCH", "/source", {"speed": "fast"}),
        ("PATCH", "/source", {"state": "ended"}),
        ("PATCH", "/source", {"index": 1.5}),
        ("PATCH", "/source", {"indx": 1}),
        ("PUT", "/source", {"kind": "simulation", "settings": {"world": "the moon"}}),
        ("PUT", "/source", {"kind": "simulation", "settings": {"max_range": -1}}),
        ("PUT", "/source", {"kind": "device", "baud": 100}),
        ("PUT", "/source", {"kind": "device", "rpm": "fast"}),
        ("PUT", "/source", {"kind": "emulator", "port": "/dev/ttyUSB0"}),
        ("PATCH", "/source", {"rpm": 600.5}),
        ("POST", "/source/step", {"by": 601}),
        ("POST", "/source/step", {"by": "1"}),
        ("PUT", "/source", []),
    ],
)
def test_bad_orders_are_refused(shared_server: Server, method: str, path: str, body: object) -> None:
    before = shared_server.get("/source")
    assert_problem(shared_server.http.request(method, path, json=body), 422)
    after = shared_server.get("/source")
    assert [after[k] for k in ("kind", "speed", "loop")] == [before[k] for k in ("kind", "speed", "loop")]


def test_a_speed_that_is_not_finite_is_refused(shared_server: Server) -> None:
    for number in ("NaN", "Infinity"):
        response = shared_server.http.patch(
            "/source", content=f'{{"speed": {number}}}', headers={"content-type": "application/json"}
        )
        assert_problem(response, 422)
