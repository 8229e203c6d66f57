"""`lidarcore serve` with a sensor: which one it takes, what it says of it, and that it leaves nothing running."""

import resource
import signal
import time
from collections.abc import Callable
from pathlib import Path

import httpx
import psutil
import pytest
from processes import ENVIRONMENT, Serving, assert_refused, run
from serial import Serial
from serving import Json, wait_until
from waiting import PATIENCE

from lidarcore import open_recording
from lidarcore.rplidar.emulator_process import EmulatorProcess

BUSY = 2.0  # s that a machine may be late by; the recording is more than twice as long
Serve = Callable[..., Serving]


class Client(httpx.Client):
    """Of the REST interface of that process."""

    def __init__(self, server: Serving) -> None:
        super().__init__(base_url=f"{server.url}api/v1", timeout=60)

    def source(self) -> Json:
        source: Json = self.get("/source").raise_for_status().json()
        return source

    def wait_for_scans(self, count: int = 2) -> None:
        wait_until(lambda: self.source()["index"] >= count)


@pytest.mark.long
def test_without_an_argument_it_takes_an_emulated_sensor_and_says_so(serving: Serve) -> None:
    server = serving("--http-port", 0)
    with Client(server) as client:
        source = client.source()
        assert source["kind"] == "emulator"
        where = source["device"]["port"]
        assert server.said == f"No RPLIDAR is connected. Playing an emulated RPLIDAR S1 at {where}.\n"
        client.wait_for_scans()
    assert server.end() == ""


@pytest.mark.long
def test_the_port_named_is_taken_and_run_as_asked(serving: Serve, sensor: EmulatorProcess) -> None:
    server = serving("--http-port", 0, "--port", sensor.port, "--mode", "Standard", "--rpm", 720)
    with Client(server) as client:
        told = client.source()["device"]
        assert server.said == f"Playing RPLIDAR S1, serial {told['serial']}, at {sensor.port}.\n"
        assert (told["port"], told["mode"], told["rpm"]) == (sensor.port, "Standard", 720)
        client.wait_for_scans()


@pytest.mark.long
def test_a_port_that_is_a_number_is_that_of_the_dashboard(
    serving: Serve, free_port: Callable[[], int], background: Path
) -> None:
    port = free_port()
    assert serving(background, "--port", port).url == f"http://127.0.0.1:{port}/"


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "/dev/ttyUSB98"], ["There is no port /dev/ttyUSB98"]),
        (["--emulator", "--mode", "Turbo"], ["Turbo", "DenseBoost"]),
    ],
)
def test_what_cannot_be_played_is_one_sentence(arguments: list[str], words: list[str]) -> None:
    assert_refused(run("serve", "--http-port", 0, *arguments), *words)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            b"not a database at all" * 100,
            "broken.db cannot be used: it is no database, or damaged; give another file",
        ),
        (None, "The name of the landmark map is empty: give a path"),
    ],
)
def test_what_cannot_be_the_file_of_maps_is_one_sentence(
    content: bytes | None, words: str, tmp_path: Path, background: Path
) -> None:
    """Without a word of what had begun and ends for it."""
    broken = tmp_path / "broken.db"
    broken.write_bytes(content or b"")
    refused = run("serve", background, "--http-port", 0, "--map", broken if content else "")
    assert_refused(refused, words)


@pytest.mark.long
def test_a_busy_sensor_is_one_sentence(sensor: EmulatorProcess) -> None:
    with Serial(sensor.port, exclusive=True):
        assert_refused(run("serve", "--http-port", 0, "--port", sensor.port), sensor.port, "in use", "pid")


@pytest.mark.parametrize("first", ["room.npz", "--port=/dev/ttyUSB98"])
def test_one_source_at_a_time(first: str) -> None:
    result = run("serve", first, "--emulator")
    assert result.returncode == 2
    assert "one of RECORDING, --port and --emulator" in " ".join(result.stderr.split())
    assert result.stdout == ""


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_nothing_is_left_of_the_emulator(serving: Serve, tmp_path: Path, number: int) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    server = serving("--http-port", 0, "--emulator", env=ENVIRONMENT | {"TMPDIR": str(temporary)})
    with Client(server) as client:
        client.wait_for_scans()
    (emulator,) = psutil.Process(server.process.pid).children(recursive=True)
    assert list(temporary.iterdir()) != []
    said = server.end(number)
    assert said == ""
    assert psutil.wait_procs([emulator], timeout=PATIENCE)[1] == []
    assert list(temporary.iterdir()) == []


def streams(port: str, within: float = 0.3) -> bool:
    """Whether the sensor there sends measurements to nobody."""
    with Serial(port, 256_000, timeout=within) as line:
        line.reset_input_buffer()
        return bool(line.read(1))


@pytest.mark.long
def test_a_signal_stops_the_motor_and_closes_the_recording(
    serving: Serve, sensor: EmulatorProcess, tmp_path: Path
) -> None:
    server = serving("--http-port", 0, "--port", sensor.port)
    with Client(server) as client:
        client.post("/recorder/start", json={"name": "hall"}).raise_for_status()
        wait_until(lambda: client.get("/recorder").json()["scans"] >= 3)
    said = server.end(signal.SIGTERM)
    assert said == ""
    wait_until(lambda: not streams(sensor.port))
    recording = open_recording(tmp_path / "recordings" / "hall.mcap")
    assert len(list(recording)) >= 3
    assert recording.notes == ()


@pytest.mark.long
def test_killed_at_once_it_loses_a_second_at_most_and_the_next_one_takes_the_sensor_over(
    serving: Serve, sensor: EmulatorProcess, tmp_path: Path
) -> None:
    server = serving("--http-port", 0, "--port", sensor.port)
    with Client(server) as client:
        client.post("/recorder/start", json={"name": "hall"}).raise_for_status()
        wait_until(lambda: client.get("/recorder").json()["scans"] >= 50)
    killed = time.time()
    server.end(signal.SIGKILL)
    assert streams(sensor.port, PATIENCE), "it was left turning"
    scans = list(open_recording(tmp_path / "recordings" / "hall.mcap"))
    assert killed - scans[-1].stamp < 1.2 + BUSY  # a second, and the revolution under way
    with Client(serving("--http-port", 0, "--port", sensor.port)) as client:
        client.wait_for_scans()


@pytest.mark.long
def test_a_full_disk_ends_the_recording_and_the_view_goes_on(
    serving: Serve, sensor: EmulatorProcess, tmp_path: Path
) -> None:
    """A limit on the size of files is met with the same errors as a full disk."""
    limit = 300_000  # more than is written in one piece
    server = serving(
        "--http-port", 0, "--port", sensor.port,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip
    with Client(server) as client:
        client.post("/recorder/start", json={"name": "hall"}).raise_for_status()
        wait_until(lambda: client.get("/recorder").json()["state"] == "failed")
        status, before = client.get("/recorder").json(), client.source()["index"]
        assert "hall.mcap" in status["error"]
        assert 0 < status["size"] <= limit, status
        client.wait_for_scans(before + 5)
        assert client.get("/frame").json()["corners"]
    recording = open_recording(tmp_path / "recordings" / "hall.mcap")
    assert status["scans"] - 15 <= len(list(recording)) <= status["scans"]
