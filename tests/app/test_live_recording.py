"""Recording the sensor that plays: all of it, whatever is looked at meanwhile."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app.jobs.recorder import RecorderStatus
from pydantic import TypeAdapter
from sensing import device, revolutions, settled, watch
from serving import Json, Server, Stream, assert_problem, chosen

from lidarcore import Scan, open_recording
from lidarcore.rplidar.emulator_process import EmulatorProcess


def start(server: Server, **options: object) -> Json:
    status: Json = server.change("POST", "/recorder/start", options)
    TypeAdapter(RecorderStatus).validate_python(status)
    return status


def stop(server: Server) -> Json:
    status: Json = server.change("POST", "/recorder/stop", None)
    return status


def recorded(stream: Stream, scans: int) -> Json:
    """What is told of the recording once it has so many scans."""

    def holds(state: Json) -> bool:
        return state["recorder"]["state"] == "recording" and state["recorder"]["scans"] >= scans

    return stream.state(holds)["recorder"]


def assert_is_what_was_shown(scan: Scan, frame: Json) -> None:
    """To the millimetre that float32 and the rounding of what is shown leave."""
    assert (len(scan), int(scan.valid.sum())) == (frame["n_beams"], frame["n_valid"])
    np.testing.assert_allclose(scan.xy[scan.valid], frame["points"], atol=1e-3)
    np.testing.assert_allclose(scan.gaps, np.reshape(frame["gaps"], (-1, 2)), atol=1e-5)


def assert_every_revolution(scans: list[Scan]) -> None:
    for before, after in pairwise(scans):
        assert after.stamp - before.stamp == pytest.approx(0.1, abs=0.02)


@pytest.mark.long
def test_what_is_recorded_is_what_was_shown(watching: Server, sensor: EmulatorProcess) -> None:
    sensor.command("lose 0.05")  # all of 13 revolutions come whole once in 10^6 times
    with watching.stream() as stream:
        revolutions(stream, 3)
        status = start(watching, name="hall")
        assert (status["state"], status["name"], status["raw"], status["error"]) == (
            "recording", "hall.mcap", False, None,
        )  # fmt: skip
        frames = revolutions(stream, 15)
        told = recorded(stream, 12)
        sensor.command("lose 0")
    assert told["state"] == "recording"
    assert told["size"] > 10_000
    assert told["rate"] > 1000
    assert told["duration"] == pytest.approx(0.1 * (told["scans"] - 1), abs=0.1)
    ended = stop(watching)
    path = watching.folder / "hall.mcap"
    scans = list(open_recording(path))
    assert (ended["state"], ended["scans"], ended["dropped"]) == ("idle", len(scans), 0)
    assert ended["size"] == path.stat().st_size
    assert watching.get("/recorder") == ended
    assert [entry["name"] for entry in watching.recordings()] == ["hall.mcap"]
    assert_every_revolution(scans)
    by_stamp = {round(scan.stamp, 6): scan for scan in scans}
    compared = [(scan, f) for f in frames if (scan := by_stamp.get(round(f["stamp"], 6)))]
    assert len(compared) >= 13
    assert any(frame["gaps"] for _, frame in compared)
    for scan, frame in compared:
        assert_is_what_was_shown(scan, frame)


@pytest.mark.long
def test_a_paused_view_does_not_hold_it_up_and_what_was_recorded_plays(watching: Server) -> None:
    with watching.stream() as stream:
        settled(stream)
        watching.change("PATCH", "/source", {"state": "paused"})
        start(watching, name="hall.mcap")
        before = device(stream)
        recorded(stream, 10)
        after = device(stream)
        assert watching.get("/source")["state"] == "paused"
    ended = stop(watching)
    scans = list(open_recording(watching.folder / "hall.mcap"))
    assert len(scans) == ended["scans"] >= after["revolutions"] - before["revolutions"] - 1
    assert_every_revolution(scans)
    shown = watching.play(watching.folder / "hall.mcap", index=4, paused=True)
    assert shown["stamp"] == pytest.approx(scans[4].stamp, abs=1e-6)
    assert_is_what_was_shown(scans[4], shown)


def test_without_a_name_it_is_called_by_date_and_time(watching: Server) -> None:
    name = start(watching)["name"]
    assert re.fullmatch(r"20\d\d-\d\d-\d\d_\d\d-\d\d-\d\d\.mcap", name)
    with watching.stream() as stream:
        recorded(stream, 1)
    assert stop(watching)["name"] == name
    assert (watching.folder / name).is_file()


@pytest.mark.long
def test_the_bytes_of_the_port_replay_to_the_same_scans(watching: Server) -> None:
    with watching.stream() as stream:
        settled(stream)
        assert start(watching, name="both", raw=True)["raw"] is True
        recorded(stream, 15)
    ended = stop(watching)
    recording, capture = (watching.folder / f"both.{suffix}" for suffix in ("mcap", "rplidar"))
    assert ended["size"] == recording.stat().st_size + capture.stat().st_size
    scans, raw = list(open_recording(recording)), list(open_recording(capture))
    beams = [scan.ranges for scan in scans]
    begin = next(i for i, scan in enumerate(scans) if same(scan.ranges, raw[1].ranges))
    together = min(len(scans) - begin, len(raw) - 1)
    assert together >= 12
    assert all(same(beams[begin + i], raw[1 + i].ranges) for i in range(together))
    assert watching.play(capture)["n_beams"] == pytest.approx(926, abs=41)


def same(some: np.ndarray, others: np.ndarray) -> bool:
    return len(some) == len(others) and np.allclose(some, others, atol=1e-4, equal_nan=True)


@pytest.mark.long
def test_it_goes_on_over_an_interruption(watching: Server, sensor: EmulatorProcess) -> None:
    with watching.stream() as stream:
        start(watching, name="hall")
        before = recorded(stream, 3)["scans"]
        sensor.command("unplug")
        device(stream, lambda d: d["state"] == "reconnecting")
        sensor.command("replug")
        recorded(stream, before + 5)
    ended = stop(watching)
    scans = list(open_recording(watching.folder / "hall.mcap"))
    assert ended["error"] is None
    assert ended["scans"] == len(scans)
    assert max(after.stamp - before.stamp for before, after in pairwise(scans)) > 0.3


@pytest.mark.long
@pytest.mark.parametrize("raw", [False, True])
def test_another_source_ends_it(watching: Server, sensor: EmulatorProcess, room: Path, raw: bool) -> None:
    with watching.stream() as stream:
        start(watching, name="first", raw=raw)
        recorded(stream, 3)
        watching.change("PUT", "/source", {"kind": "recording", "name": room.name})
        told = stream.state(lambda s: s["recorder"]["state"] == "idle")
        assert told["recorder"]["name"] == "first.mcap"
        scans = list(open_recording(watching.folder / "first.mcap"))
        assert len(scans) == watching.get("/recorder")["scans"]
        watch(watching, sensor)
        start(watching, name="second", raw=raw)
        stream.frame(chosen)
        recorded(stream, 3)
        watch(watching, sensor, mode="Standard")  # the same port, but not the same stream
        assert watching.get("/recorder")["state"] == "idle"
        revolutions(stream, 3)
    assert {len(scan) > 500 for scan in open_recording(watching.folder / "second.mcap")} == {True}
    if raw:
        assert {len(scan) > 500 for scan in list(open_recording(watching.folder / "second.rplidar"))[1:]} == {
            True
        }


def test_what_cannot_be_played_does_not_end_it(watching: Server) -> None:
    with watching.stream() as stream:
        start(watching, name="hall")
        recorded(stream, 2)
        assert_problem(watching.http.put("/source", json={"kind": "recording", "name": "none.bag"}), 404)
        assert_problem(watching.http.put("/source", json={"kind": "device", "port": "/dev/ttyUSB98"}), 404)
        recorded(stream, 6)
    assert stop(watching)["state"] == "idle"


def test_a_recording_that_plays_is_not_recorded(server: Server) -> None:
    assert (
        "A recording is playing"
        in assert_problem(server.http.post("/recorder/start", json={}), 409)["detail"]
    )
    assert server.get("/recorder")["state"] == stop(server)["state"] == "idle"
    assert list(server.folder.iterdir()) == []


def test_what_is_refused_leaves_the_one_that_runs_running(watching: Server, room: Path) -> None:
    (watching.folder / "a.rplidar").write_text("precious")
    files = sorted(path.name for path in watching.folder.iterdir())
    for body, status in [
        ({"name": "room.npz.mcap/x"}, 422),
        ({"name": "../up"}, 422),
        ({"name": ".hidden"}, 422),
        ({"name": 5}, 422),
        ({"file": "x"}, 422),
        ({"name": "a", "raw": True}, 409),
    ]:
        assert_problem(watching.http.post("/recorder/start", json=body), status)
    assert sorted(path.name for path in watching.folder.iterdir()) == files
    with watching.stream() as stream:
        start(watching, name="hall")
        recorded(stream, 1)
        for name in ("hall", "other"):
            problem = assert_problem(watching.http.post("/recorder/start", json={"name": name}), 409)
            assert "hall.mcap" in problem["detail"]
        recorded(stream, 5)
    assert not (watching.folder / "other.mcap").exists()
    assert stop(watching)["scans"] >= 5
    assert_problem(watching.http.post("/recorder/start", json={"name": "hall"}), 409)
    assert len(list(open_recording(watching.folder / "hall.mcap"))) >= 5
    assert (watching.folder / "a.rplidar").read_text() == "precious"


def test_the_server_ends_it_properly_when_it_ends(server: Server, sensor: EmulatorProcess) -> None:
    watch(server, sensor)
    start(server, name="hall")
    with server.stream() as stream:
        recorded(stream, 3)
    server.stop()
    recording = open_recording(server.folder / "hall.mcap")
    assert len(list(recording)) >= 3
    assert recording.notes == ()
