"""A sensor at a port of the server, while somebody has it read files that cost as much as a file may."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import httpx
import pytest
from processes import Serving
from serving import wait_until
from waiting import PATIENCE

from lidarcore import open_recording
from lidarcore.rplidar.emulator_process import EmulatorProcess

TRIES = 3  # what a busy machine loses now and then is not the files' doing; what they cost comes every time
NESTED = b'{"dev1": [[1,2],' + b"[]," * 4_000_000 + b"[]]}"  # 12 MB, and 400 MB as objects
POINTS = b'{"dev1": [' + b"[1.0, 2.0]," * 1_000_000 + b"[1.0, 2.0]]}"
LANDMARKS = (
    b'{"format": "lidarcore landmarks", "version": 1, "unit": "m", "landmarks": [[' + b"[]," * 10_000_000
)
MANY_SCANS = b"newscan,angle,distance\n" + b"1,1,1\n" * 15_000


@pytest.fixture
def server(serving: Callable[..., Serving], sensor: EmulatorProcess) -> Iterator[httpx.Client]:
    """A client of a server that plays the sensor."""
    address = serving("--port", sensor.port, "--http-port", 0).url
    with httpx.Client(base_url=f"{address.rstrip('/')}/api/v1/", timeout=PATIENCE) as client:
        wait_until(lambda: client.get("source").json()["device"]["completeness"] == 1, "whole revolutions")
        yield client


@pytest.mark.long
def test_the_sensor_loses_nothing_while_files_are_read(server: httpx.Client, tmp_path: Path) -> None:
    losses = [lost(server, tmp_path / "recordings", f"beside{i}.mcap") for i in range(TRIES)]
    assert [] in losses, losses


def lost(server: httpx.Client, folder: Path, name: str) -> list[str]:
    """What a recording of the sensor lacks, made while the files are read."""
    before = counters(server)
    server.post("recorder/start", json={"name": name}).raise_for_status()
    wait_until(lambda: server.get("recorder").json()["scans"] > 1)
    for file in ("nested.json", "points.json"):
        answer = server.put(f"recordings/{file}", content=NESTED if file == "nested.json" else POINTS)
        assert answer.status_code == 422
    assert server.post("map", content=LANDMARKS).status_code == 422
    assert server.put("recordings/scans.csv?overwrite=true", content=MANY_SCANS).status_code == 201
    assert server.get("recordings/scans.csv/facts").json()["scans"] == 15_000
    status = server.post("recorder/stop").raise_for_status().json()
    scans = list(open_recording(folder / name))
    assert (status["dropped"], status["scans"], status["error"]) == (0, len(scans), None)
    late = [f"{b.stamp - a.stamp:.3f} s" for a, b in pairwise(scans) if not 0.08 < b.stamp - a.stamp < 0.12]
    gaps = [f"{len(scan.gaps)} gaps" for scan in scans if len(scan.gaps)]
    return late + gaps + [str(now) for now in [counters(server)] if now != before]


def counters(server: httpx.Client) -> tuple[object, ...]:
    device = server.get("source").raise_for_status().json()["device"]
    return device["dropped"], device["overruns"], device["reconnects"]
