"""What Prometheus would read, read by its own parser."""

from pathlib import Path

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families
from sensing import device, revolutions, settled, watch
from serving import Json, Server
from waiting import wait_until

from lidarcore.rplidar.emulator_process import EmulatorProcess


def scrape(server: Server) -> dict[str, float]:
    """Every sample by its name and labels; each metric has a type and a help."""
    response = httpx.get(f"{server.url}/metrics").raise_for_status()
    assert response.headers["content-type"].startswith("text/plain; version=")
    samples = {}
    for family in text_string_to_metric_families(response.text):
        assert family.documentation
        assert family.type in ("counter", "gauge", "histogram")
        for sample in family.samples:
            labels = ",".join(f"{name}={value}" for name, value in sorted(sample.labels.items()))
            samples[sample.name + (f"{{{labels}}}" if labels else "")] = sample.value
    return samples


def test_of_a_recording_frames_are_counted_and_timed_and_no_sensor_is_spoken_of(server: Server) -> None:
    server.next_frame()
    before = scrape(server)
    with server.stream() as stream:
        for _ in range(5):
            stream.frame()
        after = scrape(server)
    for name in (
        "frames_total",
        "extraction_seconds_count",
        "drawing_seconds_count",
        "latency_seconds_count",
    ):
        assert after[f"lidarcore_{name}"] >= before[f"lidarcore_{name}"] + 3, name
    assert after["lidarcore_browsers"] == 1
    assert after["lidarcore_recording"] == 0
    assert after["process_resident_memory_bytes"] > 1e7
    assert not [name for name in after if "sensor" in name]


def test_the_pose_of_a_scan_that_is_drawn_again_is_counted_once(server: Server, room: Path) -> None:
    server.play(room, paused=True)
    before = scrape(server)
    with server.stream() as stream:
        server.change("PATCH", "/settings", {"navigation": {"mode": "slam"}})
        frame = stream.frame(lambda f: f["localization"])
        for ellipse_scale in range(3, 6):
            server.change("PATCH", "/settings", {"view": {"ellipse_scale": ellipse_scale}})
            frame = stream.frame(lambda f, last=frame: f["sequence"] > last["sequence"])
    after = scrape(server)
    name = "lidarcore_location_seconds_count"
    assert after[name] == before[name] + 1


@pytest.mark.long
def test_the_sensors_counters_are_those_of_the_source_and_move(
    server: Server, sensor: EmulatorProcess
) -> None:
    watch(server, sensor)
    with server.stream() as stream:
        settled(stream)
        sensor.command("lose 0.05")
        device(stream, lambda d: d["completeness"] < 1)
        sensor.command("lose 0")
        device(stream, lambda d: d["completeness"] == 1)
        earlier = server.get("/source")["device"]
        first = scrape(server)
        later = server.get("/source")["device"]
        wait_until(lambda: has_moved(scrape(server), first), "every counter has moved by two")
        second = scrape(server)
    assert_tells(first, earlier, later)
    assert second["lidarcore_sensor_streaming"] == 1
    assert first["lidarcore_sensor_completeness"] == 1
    assert 9 < second["lidarcore_sensor_revolutions_per_second"] < 11
    assert second["lidarcore_sensor_reconnects_total"] == 0


def has_moved(samples: dict[str, float], since: dict[str, float]) -> bool:
    counters = ("sensor_bytes_total", "sensor_revolutions_total", "frames_total", "latency_seconds_count")
    return all(samples[f"lidarcore_{name}"] >= since[f"lidarcore_{name}"] + 2 for name in counters)


def assert_tells(samples: dict[str, float], earlier: Json, later: Json) -> None:
    """Counters are between what was told before and after."""
    for name in ("revolutions", "bytes"):
        assert 0 < earlier[name] <= samples[f"lidarcore_sensor_{name}_total"] <= later[name]
    assert earlier["dropped"]
    for reason, count in earlier["dropped"].items():
        told = samples[f"lidarcore_sensor_dropped_total{{reason={reason}}}"]
        assert 0 < count <= told <= later["dropped"][reason]


@pytest.mark.long
def test_recording_and_interruption_show(server: Server, sensor: EmulatorProcess) -> None:
    watch(server, sensor)
    server.change("POST", "/recorder/start", {"name": "hall"})
    with server.stream() as stream:
        told = stream.state(lambda s: s["recorder"]["size"] > 0)["recorder"]
        samples = scrape(server)
        assert samples["lidarcore_recording"] == 1
        assert samples["lidarcore_recording_bytes"] >= told["size"]
        server.change("POST", "/recorder/stop", None)
        sensor.command("unplug")
        device(stream, lambda d: d["state"] == "reconnecting")
        samples = scrape(server)
        assert (samples["lidarcore_recording"], samples["lidarcore_sensor_streaming"]) == (0, 0)
        sensor.command("replug")
        device(stream, lambda d: d["state"] == "streaming")
    assert scrape(server)["lidarcore_sensor_reconnects_total"] == 1


@pytest.mark.long
def test_what_is_looked_at_again_is_not_late(server: Server, sensor: EmulatorProcess) -> None:
    watch(server, sensor)
    with server.stream() as stream:
        shown = revolutions(stream, 5)[-1]["source"]["index"]
        server.change("PATCH", "/source", {"state": "paused", "index": shown - 3})
        device(stream, lambda d: d["revolutions"] > shown + 30)
        before = scrape(server)
        for by in (-1, 1, -1):
            at = server.change("POST", "/source/step", {"by": by})["index"]
            stream.frame(lambda f, at=at: f["source"]["index"] == at)
        after = scrape(server)
    count, total = "lidarcore_latency_seconds_count", "lidarcore_latency_seconds_sum"
    assert after[count] - before[count] >= 3
    assert after[total] - before[total] < 3  # the three scans are as many seconds old, each
