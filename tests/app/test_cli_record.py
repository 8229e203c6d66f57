"""`lidarcore record` as a process of its own, on an emulated sensor."""

import os
import re
import select
import signal
import subprocess
import sys
import time

import pytest

from lidarcore import open_recording
from lidarcore.rplidar.emulator_process import EmulatorProcess

COMMAND = [sys.executable, "-m", "lidarcore_app.cli.main", "record"]


def run(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=120)


def start(*arguments):
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def is_among(captured, scan):
    """The one measured at the same time has as many beams."""
    nearest = min(captured, key=lambda other: abs(other.stamp - scan.stamp))
    return abs(nearest.stamp - scan.stamp) < 0.02 and len(nearest) == len(scan)


@pytest.mark.long
def test_it_records_for_a_while_and_says_how_much(tmp_path):
    output, raw = tmp_path / "a.mcap", tmp_path / "a.rplidar"
    began = time.monotonic()
    done = run(output, "--emulator", "--duration", 2, "--raw", raw, "--set", "gap=0.3")
    turned = 10 * (
        time.monotonic() - began
    )  # revolutions of the sensor, which a busy machine may get all at once
    assert done.returncode == 0, done.stderr
    scans = list(open_recording(output))
    assert 15 <= len(scans) <= turned
    assert scans[-1].stamp - scans[0].stamp == pytest.approx(2, abs=0.5)
    assert abs(scans[-1].stamp - time.time()) < 60
    assert re.search(rf"a\.mcap: {len(scans)} scans in \d\.\d s, \d\.\d MB, \d+ kB/s$", done.stdout.strip())
    captured = list(open_recording(raw))
    assert sum(is_among(captured, scan) for scan in scans) >= len(scans) - 2


@pytest.mark.long
def test_a_sensor_that_goes_away_is_told_of_at_the_end(tmp_path):
    output = tmp_path / "a.mcap"
    with EmulatorProcess() as emulator:
        process = start(output, "--port", emulator.port, "--duration", 6)
        deadline = time.monotonic() + 60
        while not (output.exists() and output.stat().st_size):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        emulator.command("unplug")
        said, complaint = process.communicate(timeout=60)
    assert process.returncode == 1
    assert f"{len(list(open_recording(output)))} scans" in said
    assert "went away: check the sensor's cable" in complaint


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_properly(tmp_path, number):
    output = tmp_path / "a.mcap"
    with EmulatorProcess() as emulator:
        process = start(output, "--port", emulator.port)
        deadline = time.monotonic() + 60
        while not (output.exists() and output.stat().st_size):
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(number)
        said, complaint = process.communicate(timeout=60)
    assert (process.returncode, complaint) == (0, "")
    recording = open_recording(output)
    count = len(list(recording))
    assert f"{count} scans" in said
    assert count > 0
    assert recording.notes == ()


def test_a_signal_ends_waiting_for_an_answer_and_leaves_nothing(tmp_path):
    far, near = os.openpty()
    process = start(tmp_path / "a.mcap", "--port", os.ttyname(near))
    assert select.select([far], [], [], 60)[0]  # it asks
    process.terminate()
    said, complaint = process.communicate(timeout=60)
    assert (process.returncode, said) == (2, "")
    assert complaint == "lidarcore: Nothing was recorded: no scan came.\n"
    assert list(tmp_path.iterdir()) == []
    for end in (far, near):
        os.close(end)


@pytest.mark.long
def test_under_nohup_a_hangup_is_ignored(tmp_path):
    output = tmp_path / "a.mcap"
    command = ["nohup", *COMMAND, output, "--emulator", "--duration", "2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        deadline = time.monotonic() + 60
        while not (output.exists() and output.stat().st_size):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(signal.SIGHUP)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert open_recording(output).notes == ()
    assert float(re.search(r"\d+ scans in (\d+\.\d) s", said)[1]) >= 1.5


@pytest.mark.long
@pytest.mark.parametrize(
    ("wish", "complaint"),
    [
        (["--duration", "inf"], "at most"),
        (["--duration", "nan"], "0.1"),
        (["--rpm", "60"], "choose 480 to 900"),
        (["--mode", "Turbo", "--emulator"], "no mode Turbo: take Standard or DenseBoost"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_starts(tmp_path, wish, complaint):
    done = run(tmp_path / "a.mcap", *wish)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_refused_before_anything_turns(tmp_path):
    (tmp_path / "a.mcap").write_text("precious")
    done = run(tmp_path / "a.mcap", "--port", tmp_path / "no port")
    assert done.returncode == 2
    assert "a.mcap exists already: give the recording another name" in done.stderr
    assert (tmp_path / "a.mcap").read_text() == "precious"


def test_without_the_sensor_nothing_is_left(tmp_path):
    done = run(tmp_path / "a.mcap", "--port", "/dev/ttyNothing", "--raw", tmp_path / "a.rplidar")
    assert done.returncode == 2
    assert "/dev/ttyNothing" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_port_and_emulator_exclude_each_other(tmp_path):
    done = run(tmp_path / "a.mcap", "--port", "x", "--emulator")
    assert done.returncode == 2
    assert "not both" in done.stderr
