"""The driver on a real port, with the emulated sensor as a process of its own behind it."""

import signal
import statistics
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from driving import PATIENCE, Program, Watched, leave_streaming
from serial import Serial
from waiting import soonest, wait_until

from lidarcore.errors import DeviceError, NoAnswerError, NoDeviceError, PortBusyError
from lidarcore.rplidar import Driver, check_scan_options
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.rplidar.protocol import S1_MODES, StreamDecoder

STANDARD, DENSE_BOOST = S1_MODES


@pytest.fixture(scope="module")
def sensor() -> Iterator[EmulatorProcess]:
    """At full speed at once."""
    with EmulatorProcess(spin_up=0) as emulator:
        yield emulator


def test_it_tells_what_is_connected_and_gives_whole_turns(sensor: EmulatorProcess) -> None:
    before = time.time()
    with Driver(sensor.port) as driver:
        scans = list(islice(driver, 5))
        assert driver.state == "streaming"
        assert driver.error is None
        assert (driver.port, driver.baud, driver.rpm) == (sensor.port, 256_000, 600)
        assert (driver.info.name, driver.info.version, driver.health.name) == ("RPLIDAR S1", "1.28", "good")
        assert (driver.modes, driver.mode) == (S1_MODES, DENSE_BOOST)
        told = driver.statistics
    assert driver.state == "closed"
    for scan in scans:
        assert scan.completeness == 1
        assert 900 < len(scan) < 950
        assert before < scan.stamp < time.time()
    assert np.diff([scan.stamp for scan in scans]) == pytest.approx(0.1, rel=0.05)
    assert told.rate_hz == pytest.approx(10, rel=0.05)
    assert told.samples_per_s == pytest.approx(9259, rel=0.02)
    assert told.completeness == 1
    assert told.revolutions >= 5
    assert told.bytes > 5 * 23 * 84
    assert (told.overruns, told.reconnects) == (0, 0)


def test_the_first_scan_is_there_within_a_second(sensor: EmulatorProcess) -> None:
    def duration() -> float:
        start = time.monotonic()
        with Driver(sensor.port) as driver:
            next(iter(driver))
            return time.monotonic() - start

    assert soonest(duration, 1.0) <= 1.0


def test_the_mode_can_be_chosen(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port, mode="standard") as driver:
        scan = next(iter(driver))
        assert driver.mode == STANDARD
    assert 380 < len(scan) < 430
    assert scan.quality is not None
    with pytest.raises(DeviceError, match="no mode Turbo: take Standard or DenseBoost"):
        Driver(sensor.port, mode="Turbo").__enter__()


def test_the_speed_can_be_changed_while_it_turns(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port, rpm=600) as driver:
        revolutions = driver.revolutions()
        driver.set_speed(840)
        assert driver.rpm == 840
        durations = [float(np.ptp(revolution.times)) for revolution in islice(revolutions, 25)]
        with pytest.raises(DeviceError, match="cannot turn at 100 rpm: choose 480 to 900"):
            driver.set_speed(100)
    assert statistics.median(durations[-5:]) == pytest.approx(60 / 840, rel=0.05)


def test_what_nobody_takes_is_dropped_the_oldest_first(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port, rpm=900) as driver:
        enough = time.monotonic() + PATIENCE
        while driver.statistics.overruns < 5 and time.monotonic() < enough:
            time.sleep(0.01)
        told = driver.statistics
        kept = [revolution.times[0] for revolution in islice(driver.revolutions(), 10)]
    assert told.overruns >= 5
    assert told.revolutions - told.overruns in (10, 11)  # one may be on its way
    assert max(np.diff(kept)) < 0.1, "they do not follow each other"


def test_the_tap_sees_every_byte(sensor: EmulatorProcess) -> None:
    seen: list[tuple[str, float, bytes]] = []
    with Driver(sensor.port, tap=lambda *seeing: seen.append(seeing)) as driver:
        taken = list(islice(driver.revolutions(), 5))
    decoder = StreamDecoder(DENSE_BOOST.answer_type, DENSE_BOOST.us_per_sample)
    heard = [data for direction, _, data in seen if direction == "in"]
    descriptor = next(i for i, data in enumerate(heard) if data.startswith(bytes.fromhex("a55a5400004085")))
    decoded = [turn for data in heard[descriptor + 1 :] for turn in decoder.feed(data, 0.0)]
    assert len(decoded) >= len(taken) == 5
    for ours, theirs in zip(taken, decoded, strict=False):
        np.testing.assert_array_equal(ours.angles, theirs.angles)
        np.testing.assert_array_equal(ours.distances, theirs.distances)


def test_closing_from_another_thread_ends_the_iteration(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port) as driver:
        scans = iter(driver)
        next(scans)
        closer = threading.Timer(0.05, driver.close)
        closer.start()
        for _ in scans:
            pass
        closer.join()
        assert driver.state == "closed"
        assert list(driver) == []
        driver.close()
    with Driver(sensor.port) as again:
        next(iter(again))


def test_what_the_tap_raises_reaches_the_caller_and_the_sensor_is_stopped(sensor: EmulatorProcess) -> None:
    def tap(direction: str, when: float, data: bytes) -> None:
        if len(data) == 84:
            raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"), Driver(sensor.port, tap=tap) as driver:
        list(driver)
    with Serial(sensor.port, 256_000, timeout=0.2) as line:
        wait_until(lambda: line.read(200) == b"", "it is silent")


@pytest.mark.parametrize(
    ("body", "by"),
    [
        ("with driver:\n    print('on', next(iter(driver)), flush=True)", None),
        ("with driver:\n    print('on', next(iter(driver)), flush=True)\n    1 / 0", None),
        ("driver.__enter__()\nprint('on', next(iter(driver)), flush=True)", None),
        ("with driver:\n    for scan in driver: print('on', flush=True)", signal.SIGINT),
        ("with driver:\n    for scan in driver: print('on', flush=True)", signal.SIGTERM),
        ("with driver:\n    for scan in driver: print('on', flush=True)", signal.SIGHUP),
        ("driver.__enter__()\nfor scan in driver: print('on', flush=True)", signal.SIGTERM),
    ],
    ids=["with", "exception", "end", "SIGINT", "SIGTERM", "SIGHUP", "SIGTERM without with"],
)
def test_however_a_program_ends_the_motor_stops(
    sensor: EmulatorProcess, tmp_path: Path, body: str, by: signal.Signals | None
) -> None:
    with Program(sensor.port, tmp_path / "sent", body) as program:
        program.await_line()
        if by:
            program.send_signal(by)
        program.communicate(timeout=PATIENCE)
    assert program.stopped_the_motor()


def test_a_program_that_handles_sigterm_itself_goes_on_doing_so(
    sensor: EmulatorProcess, tmp_path: Path
) -> None:
    body = """
import signal
signal.signal(signal.SIGTERM, lambda *_: driver.close())
with driver:
    for scan in driver: print('on', flush=True)
print('mine')
"""
    with Program(sensor.port, tmp_path / "sent", body) as program:
        program.await_line()
        program.terminate()
        output, _ = program.communicate(timeout=PATIENCE)
    assert output.endswith("mine\n")
    assert program.returncode == 0
    assert program.stopped_the_motor()


@pytest.mark.long
def test_a_sensor_left_streaming_is_taken_over_a_hundred_times_of_a_hundred() -> None:
    def take_over(first: int) -> int:
        with EmulatorProcess(spin_up=0, seed=first) as sensor:
            for attempt in range(first, first + 25):
                leave_streaming(sensor.port, 91 + attempt)  # anywhere within a capsule
                with Watched(sensor.port) as driver:
                    driver.wait_for("streaming")
                    assert driver.mode == DENSE_BOOST
                    assert driver.statistics.reconnects == 0
        return 25

    with ThreadPoolExecutor() as pool:
        assert sum(pool.map(take_over, range(0, 100, 25))) == 100


def test_a_program_killed_while_it_scans_is_followed_by_another(
    sensor: EmulatorProcess, tmp_path: Path
) -> None:
    body = "with driver:\n    for scan in driver: print('on', flush=True)"
    with Program(sensor.port, tmp_path / "sent", body) as program:
        program.await_line()
        program.kill()
    with Driver(sensor.port) as driver:
        assert next(iter(driver)).completeness == 1


def test_a_port_in_use_is_busy_and_its_user_undisturbed(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port) as driver:
        revolutions = driver.revolutions()
        next(revolutions)
        with pytest.raises(PortBusyError, match=f"{sensor.port} is in use"):
            Driver(sensor.port).__enter__()
        assert all(revolution.complete for revolution in islice(revolutions, 5))


def test_scan_options_that_no_sensor_has_are_refused() -> None:
    with pytest.raises(DeviceError, match="choose 480 to 900"):
        Driver("/dev/ttyUSB0", rpm=60)
    with pytest.raises(NoDeviceError, match="no port /dev/ttyUSB99"):
        Driver("/dev/ttyUSB99").__enter__()
    with pytest.raises(DeviceError, match="no mode Turbo: take Standard or DenseBoost"):
        check_scan_options("Turbo", None)
    with pytest.raises(DeviceError, match="choose 480 to 900"):
        check_scan_options("DenseBoost", 901)
    check_scan_options(None, None)
    check_scan_options("standard", 480)


@pytest.mark.long
def test_the_right_baud_rate_is_named_where_the_wrong_one_was_given(sensor: EmulatorProcess) -> None:
    with pytest.raises(NoAnswerError, match="uses 256000 baud, not 115200: choose that rate"):
        Driver(sensor.port, baud=115_200).__enter__()
    with Driver(sensor.port) as driver:
        next(iter(driver))
