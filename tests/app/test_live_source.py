"""A sensor in the app: what is shown of it, and how it is steered. The sensor is the real emulator."""

import json
import statistics
from functools import partial

import lidarcore_app.sources.history
import lidarcore_app.sources.live
import lidarcore_app.web.routes.sensor
import numpy as np
import pytest
from lidarcore_app.sources.live import DeviceOptions, Taps, connected_or_emulated
from lidarcore_app.sources.player import SourceStatus
from lidarcore_app.web.schemas import FrameJson
from pydantic import TypeAdapter
from sensing import device, revolutions, settled, unbroken, watch
from serial.tools.list_ports import comports
from serial.tools.list_ports_common import ListPortInfo
from serving import Server, assert_problem, chosen
from waiting import soonest

from lidarcore.rplidar import find_devices
from lidarcore.rplidar.emulator_process import EmulatorProcess

AT_ONCE = 20  # ms: 2 or 3 on a machine at rest, and what waited for anything would take longer
KNOWS = {
    "name": "RPLIDAR S1",
    "firmware": "1.28",
    "hardware": 18,
    "health": "good",
    "mode": "DenseBoost",
    "modes": ["Standard", "DenseBoost"],
    "rpm": 600,
    "baud": 256_000,
    "state": "streaming",
    "error": None,
    "reconnects": 0,
    "overruns": 0,
    "checked": True,
}


def test_a_sensor_plays_and_says_what_it_is(server: Server, sensor: EmulatorProcess) -> None:
    with server.stream() as stream:
        answer = watch(server, sensor)
        TypeAdapter(SourceStatus).validate_json(json.dumps(answer), strict=True)
        told = settled(stream)
        frame = stream.frame(chosen)
    assert {name: answer[name] for name in ("kind", "live", "recording", "count", "duration", "complete")} == {
        "kind": "device", "live": True, "recording": None, "count": None, "duration": None, "complete": False,
    }  # fmt: skip
    assert {name: told[name] for name in KNOWS} == KNOWS
    assert told["port"] == sensor.port
    assert len(bytes.fromhex(told["serial"])) == 16
    assert told["samples_per_s"] == pytest.approx(9259, rel=0.02)
    assert told["completeness"] == 1
    assert told["bytes"] >= told["revolutions"] * 900 * 84 / 40  # 40 samples are 84 bytes
    TypeAdapter(FrameJson).validate_python(frame)
    assert frame["n_beams"] == pytest.approx(926, abs=41)
    assert (frame["completeness"], frame["gaps"]) == (1, [])
    assert server.get("/source")["state"] == "playing"


@pytest.mark.long
def test_frames_come_at_the_sensors_rate_numbered_and_stamped(watching: Server) -> None:
    with watching.stream() as stream:
        settled(stream)
        frames = unbroken(stream, 15)
    assert np.diff([f["stamp"] for f in frames]) == pytest.approx(0.1, abs=0.01)
    assert np.diff([f["source"]["time"] for f in frames]) == pytest.approx(
        np.diff([f["stamp"] for f in frames])
    )


@pytest.mark.long
def test_the_last_byte_of_a_revolution_is_sent_on_at_once(watching: Server) -> None:
    layers = {"rejected": True}
    watching.change("PATCH", "/settings", {"view": {"compare": True, "colour": "quality", "layers": layers}})
    with watching.stream() as stream:
        settled(stream)

        def latency() -> float:
            """Median over some revolutions, ms."""
            timings = [f["timings"] for f in revolutions(stream, 10)]
            for timing in timings:
                assert timing["age_ms"] >= 1e-3 * (timing["extract_us"] + timing["draw_us"])
            return statistics.median(timing["age_ms"] for timing in timings)

        assert soonest(latency, 5) <= AT_ONCE


@pytest.mark.long
def test_counters_are_told_at_least_once_a_second(watching: Server) -> None:
    with watching.stream() as stream:
        watching.change("PATCH", "/source", {"state": "paused"})
        stream.state(lambda s: s["source"]["state"] == "paused")
        seen = [device(stream)["revolutions"] for _ in range(6)]
    assert 0 < np.median(np.diff(seen)) <= 10, seen


@pytest.mark.long
@pytest.mark.parametrize(("mode", "beams"), [("Standard", 1e6 / 244 / 10), ("DenseBoost", 1e6 / 108 / 10)])
def test_the_mode_decides_how_many_beams_a_revolution_has(
    server: Server, sensor: EmulatorProcess, mode: str, beams: float
) -> None:
    with server.stream() as stream:
        assert watch(server, sensor, mode=mode)["device"]["mode"] == mode
        told, frame = settled(stream), revolutions(stream, 1)[0]
    assert told["samples_per_s"] == pytest.approx(10 * beams, rel=0.02)
    assert frame["n_beams"] == pytest.approx(beams, rel=0.05)
    assert len(frame["corners"]) >= 4


@pytest.mark.long
def test_the_speed_changes_while_it_plays(watching: Server) -> None:
    with watching.stream() as stream:
        settled(stream)
        assert watching.change("PATCH", "/source", {"rpm": 900})["device"]["rpm"] == 900
        settled(stream, 15)
        assert revolutions(stream, 1)[0]["n_beams"] == pytest.approx(1e6 / 108 / 15, rel=0.05)
        problem = assert_problem(watching.http.patch("/source", json={"rpm": 1000}), 422)
        assert "480 to 900" in problem["detail"]
        assert device(stream)["rpm"] == 900


def test_a_recording_has_no_motor(server: Server) -> None:
    before = server.get("/source")
    problem = assert_problem(server.http.patch("/source", json={"rpm": 600, "loop": False}), 422)
    assert "no motor" in problem["detail"]
    assert server.get("/source")["loop"] == before["loop"]


@pytest.mark.long
def test_while_paused_kept_revolutions_are_stepped_through_and_playing_shows_the_newest(
    watching: Server,
) -> None:
    with watching.stream() as stream:
        unbroken(stream, 6)
        paused = watching.change("PATCH", "/source", {"state": "paused"})["index"]
        shown = {paused: stream.frame(lambda f: f["source"]["index"] == paused)}
        device(stream, lambda d: d["revolutions"] > paused + 30)
        for by in (-3, -1, 2, 1, 1):
            at = watching.change("POST", "/source/step", {"by": by})["index"]
            frame = stream.frame(lambda f, at=at: f["source"]["index"] == at)
            known = shown.setdefault(at, frame)
            assert (frame["stamp"], frame["points"]) == (known["stamp"], known["points"])
            assert frame["timings"]["age_ms"] < 1500  # of the wish to see it, not of the scan
        assert at == paused
        assert sorted(shown) == [paused - 4, paused - 3, paused - 2, paused - 1, paused]
        assert np.diff([shown[at]["stamp"] for at in sorted(shown)]) == pytest.approx(0.1, abs=0.01)
        watching.change("PATCH", "/source", {"state": "playing"})
        on = stream.frame(lambda f: f["source"]["index"] != at)
    assert on["source"]["index"] >= paused + 29
    assert watching.get("/source")["count"] is None


@pytest.mark.long
def test_what_is_looked_at_stays_when_it_is_older_than_what_is_kept(
    server: Server, sensor: EmulatorProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lidarcore_app.sources.history, "HISTORY", 5)
    watch(server, sensor)
    with server.stream() as stream:
        revolutions(stream, 3)
        at = server.change("POST", "/source/step", {"by": 0})["index"]
        looked_at = stream.frame(lambda f: f["source"]["index"] == at)
        device(stream, lambda d: d["revolutions"] > at + 10)
        server.change("PATCH", "/settings", {"extraction": {"fitter": "cwlf"}})
        again = stream.frame(lambda f: f["fitter"] == "cwlf")
        assert (again["source"], again["points"]) == (looked_at["source"], looked_at["points"])
        oldest = server.change("PATCH", "/source", {"index": 0})["index"]
    assert oldest >= at + 5


def usb(path: str) -> ListPortInfo:
    """A port behind the adapter of an RPLIDAR, as pyserial tells: no test machine can offer one."""
    port = ListPortInfo(path)
    port.vid, port.pid, port.description = 0x10C4, 0xEA60, "CP2102 USB to UART Bridge Controller"
    return port


def test_the_ports_are_listed_with_who_is_there(
    server: Server, sensor: EmulatorProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert [port["path"] for port in server.get("/devices")] == sorted(port.device for port in comports())
    listing = partial(find_devices, list_ports=lambda: [usb(sensor.port)])
    monkeypatch.setattr(lidarcore_app.web.routes.sensor, "find_devices", listing)
    (free,) = server.get("/devices")
    serial = free.pop("serial")
    assert free == {
        "path": sensor.port, "description": "CP2102 USB to UART Bridge Controller", "vid_pid": "10c4:ea60",
        "looks_like": True, "name": "RPLIDAR S1", "error": None, "in_use": False,
    }  # fmt: skip
    assert watch(server, sensor)["device"]["serial"] == serial
    with server.stream() as stream:
        revolutions(stream, 2)
        (taken,) = server.get("/devices")
        assert (taken["in_use"], taken["name"]) == (True, None)
        assert "in use" in taken["error"]
        told = device(stream, lambda d: d["completeness"] == 1)
        assert (told["state"], told["reconnects"]) == ("streaming", 0)


def test_without_being_told_the_connected_sensor_is_taken(
    sensor: EmulatorProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports = [usb("/dev/ttyUSB98"), usb(sensor.port)]
    monkeypatch.setattr(
        lidarcore_app.sources.live, "find_devices", partial(find_devices, list_ports=lambda: ports)
    )
    source, said = connected_or_emulated(DeviceOptions(), Taps())
    source.close()
    assert source.kind == "device"
    assert sum("/dev/ttyUSB98" in sentence for sentence in said) == len(said) - 1 == 1
    assert said[-1] == f"Playing RPLIDAR S1, serial {source.device().serial}, at {sensor.port}."
