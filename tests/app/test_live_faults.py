"""A sensor that is lost, found again, and run otherwise while it plays. The sensor is the real emulator."""

import math
import os

import numpy as np
import pytest
from lidarcore_app.sources.live import DeviceOptions, LiveSource, Taps
from sensing import device, revolutions, settled
from serving import Server, assert_problem, wait_until

from lidarcore import Scan
from lidarcore.rplidar.emulator_process import EmulatorProcess


def test_unplugged_it_says_so_and_goes_on_when_it_is_back(watching: Server, sensor: EmulatorProcess) -> None:
    with watching.stream() as stream:
        before = revolutions(stream, 3)[-1]
        sensor.command("unplug")
        lost = device(stream, lambda d: d["state"] == "reconnecting")
        assert sensor.port in lost["error"]
        assert watching.get("/source")["state"] == "playing"
        sensor.command("replug")
        back = device(stream, lambda d: d["state"] == "streaming")
        assert (back["error"], back["reconnects"], back["port"]) == (None, 1, sensor.port)
        after = stream.frame(lambda f: f["stamp"] > before["stamp"] + 0.5)
    assert after["source"]["index"] > before["source"]["index"]


@pytest.mark.long
def test_a_stall_is_named_and_passes(watching: Server, sensor: EmulatorProcess) -> None:
    with watching.stream() as stream:
        settled(stream)
        sensor.command("stall 1.2")
        assert "no measurements" in device(stream, lambda d: d["state"] == "stalled")["error"]
        told = device(stream, lambda d: d["state"] == "streaming")
        assert (told["error"], told["reconnects"]) == (None, 0)


@pytest.mark.long
def test_lost_capsules_are_sectors_without_points_and_counted(
    watching: Server, sensor: EmulatorProcess
) -> None:
    with watching.stream() as stream:
        assert settled(stream)["completeness"] == 1
        sensor.command("lose 0.1")
        frames = [stream.frame(lambda f: f["gaps"]) for _ in range(5)]
        told = device(stream, lambda d: d["completeness"] < 0.97)
        sensor.command("lose 0")
        device(stream, lambda d: d["completeness"] == 1)
        whole = revolutions(stream, 1)[0]
    assert told["dropped"]
    assert all(count > 0 for count in told["dropped"].values())
    assert (whole["completeness"], whole["gaps"]) == (1, [])
    for frame in frames:
        spans = [(end - begin) % math.tau for begin, end in frame["gaps"]]
        assert sum(spans) == pytest.approx((1 - frame["completeness"]) * math.tau, abs=1e-6)
        bearings = np.arctan2(*np.array(frame["points"]).T[::-1])
        for (begin, _), span in zip(frame["gaps"], spans, strict=True):
            inside = ((bearings - begin) % math.tau > 1e-3) & ((bearings - begin) % math.tau < span - 1e-3)
            assert not inside.any()


@pytest.mark.long
def test_the_port_is_handed_over_to_the_same_sensor_run_otherwise(
    watching: Server, sensor: EmulatorProcess
) -> None:
    with watching.stream() as stream:
        settled(stream)
        for port in (sensor.port, os.path.realpath(sensor.port)):  # one sensor, by whatever name
            answer = watching.change(
                "PUT", "/source", {"kind": "device", "port": port, "mode": "Standard", "rpm": 720}
            )
            assert (answer["device"]["mode"], answer["device"]["rpm"]) == ("Standard", 720)
            told = settled(stream, 12)
            assert (told["mode"], told["reconnects"]) == ("Standard", 0)


def test_if_it_cannot_be_run_so_it_goes_on_as_it_was(watching: Server, sensor: EmulatorProcess) -> None:
    watching.change("PATCH", "/source", {"rpm": 720})
    body = {"kind": "device", "port": sensor.port, "mode": "Turbo"}
    problem = assert_problem(watching.http.put("/source", json=body), 422)
    assert "Turbo" in problem["detail"]
    assert "DenseBoost" in problem["detail"]
    with watching.stream() as stream:
        told = settled(stream, 12)
        assert (told["mode"], told["rpm"]) == ("DenseBoost", 720)
        assert revolutions(stream, 2)


@pytest.mark.long
def test_the_emulator_plays_obeys_and_ends_with_its_source(server: Server, room: object) -> None:
    with server.stream() as stream:
        assert_problem(server.http.post("/emulator", json={"command": "unplug"}), 409)
        answer = server.change("PUT", "/source", {"kind": "emulator", "mode": "Standard", "rpm": 900})
        assert (answer["kind"], answer["live"], answer["device"]["mode"]) == ("emulator", True, "Standard")
        settled(stream, 15)
        for command in ("unplug", "replug"):
            assert server.http.post("/emulator", json={"command": command}).status_code == 204
            device(
                stream, lambda d, c=command: d["state"] == ("reconnecting" if c == "unplug" else "streaming")
            )
        told = settled(stream, 15)
        assert (told["mode"], told["rpm"], told["reconnects"]) == ("Standard", 900, 1)
        emulator = server.runtime.player.source.emulator
        server.change("PUT", "/source", {"kind": "recording", "name": "room.npz"})
        assert stream.state(lambda s: s["source"]["kind"] == "recording")["source"]["device"] is None
    with pytest.raises(ProcessLookupError):
        os.kill(emulator.pid, 0)
    assert not os.path.lexists(answer["device"]["port"])


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    ["quit", "unplug 5", "lose", "lose 0.1\nquit", "lose 1.2.3", "lose 7", "stall 1 2", "explode", ""],
)
def test_what_the_emulator_does_not_know_it_does_not_do(emulating: Server, command: str) -> None:
    assert_problem(emulating.http.post("/emulator", json={"command": command}), 422)
    assert emulating.get("/source")["device"]["state"] == "streaming"


@pytest.fixture(scope="module")
def emulating(tmp_path_factory: pytest.TempPathFactory) -> Server:
    """A server that plays an emulator from the start."""
    server = Server(tmp_path_factory.mktemp("emulating"), device=DeviceOptions(emulated=True))
    try:
        with server.stream() as stream:
            device(stream, lambda d: d["state"] == "streaming")
        yield server
    finally:
        server.stop()


def test_what_fails_beside_does_not_end_the_view(
    sensor: EmulatorProcess, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(scan: Scan) -> None:
        raise OSError("the disk is full")

    source = LiveSource(DeviceOptions(sensor.port), Taps(scan=fail))
    source.start(lambda: None, lambda: None)
    wait_until(lambda: source.count >= 4)
    source.close()
    told = [record for record in caplog.records if record.name == "lidarcore.threads"]
    assert [record.exc_text.splitlines()[-1] for record in told] == ["OSError: the disk is full"]
