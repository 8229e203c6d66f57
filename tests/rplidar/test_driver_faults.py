"""The driver when things go wrong, alone and together."""

import os
import random
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

import pytest
from driving import PATIENCE, Watched
from serial.tools.list_ports_common import ListPortInfo
from waiting import wait_until

from lidarcore.errors import NoAnswerError, NoDeviceError, ProtectionStopError, UnpluggedError
from lidarcore.rplidar import Driver
from lidarcore.rplidar.connection.port import holders
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.rplidar.protocol import Answer, Command, Descriptor, DeviceInfo, RequestReader


@pytest.fixture(scope="module")
def shared_sensor() -> Iterator[EmulatorProcess]:
    with EmulatorProcess(spin_up=0, reset=0.2) as emulator:
        yield emulator


@pytest.fixture
def sensor(shared_sensor: EmulatorProcess) -> EmulatorProcess:
    """In good order, and at full speed at once."""
    for command in ("flip 0", "lose 0", "lose-bytes 0", "stall 0", "health 0", "replug"):
        shared_sensor.command(command)
    return shared_sensor


def usb(path: str) -> ListPortInfo:
    """A port as pyserial lists it where an RPLIDAR's adapter is plugged in."""
    port = ListPortInfo(path)
    port.vid, port.pid = 0x10C4, 0xEA60
    return port


def test_an_unplugged_sensor_is_noticed_and_comes_back(sensor: EmulatorProcess) -> None:
    noticed, back = [], []
    with Watched(sensor.port) as driver:
        scans = iter(driver)
        next(scans)
        for _ in range(3):
            start = time.monotonic()
            sensor.command("unplug")
            noticed.append(driver.wait_for("reconnecting", start) - start)
            assert "plug" in (driver.error or "")
            start = time.monotonic()
            sensor.command("replug")
            back.append(driver.wait_for("streaming", start) - start)
            assert driver.error is None
        assert driver.statistics.reconnects == 3
        for scan in islice(scans, 20):  # also those from before
            assert len(scan) < 950
        assert driver.statistics.rate_hz == pytest.approx(10, rel=0.1)
    assert min(noticed) <= 0.6
    assert min(back) <= 2.0


def test_a_sensor_that_comes_back_under_another_name_is_found(
    sensor: EmulatorProcess, tmp_path: Path
) -> None:
    first, second = tmp_path / "ttyUSB0", tmp_path / "ttyUSB1"
    first.symlink_to(sensor.port)
    with Watched(str(first), list_ports=lambda: [usb(str(second))] if second.is_symlink() else []) as driver:
        driver.wait_for("streaming")
        first.unlink()
        start = time.monotonic()
        sensor.command("unplug")
        driver.wait_for("reconnecting", start)
        start = time.monotonic()
        sensor.command("replug")
        second.symlink_to(sensor.port)
        driver.wait_for("streaming", start)
        assert driver.port == str(second)


def test_another_sensor_elsewhere_is_asked_once_and_not_taken_for_the_one_that_is_gone(
    sensor: EmulatorProcess,
) -> None:
    looks = threading.Semaphore(0)

    def list_ports() -> list[ListPortInfo]:
        looks.release()
        return [usb(other.path)]

    with Other() as other, Watched(sensor.port, list_ports=list_ports) as driver:
        driver.wait_for("streaming")
        sensor.command("unplug")
        for _ in range(6):
            assert looks.acquire(timeout=PATIENCE)
        start = time.monotonic()
        sensor.command("replug")
        driver.wait_for("streaming", start)
        assert driver.port == sensor.port
        assert other.asked <= 2  # of six looks; the second time if the first answer came late
        assert not other.started


def test_without_reconnecting_the_iterator_says_what_happened(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port, reconnect=False) as driver:
        scans = iter(driver)
        next(scans)
        sensor.command("unplug")
        with pytest.raises(UnpluggedError, match="went away"):
            list(scans)
        assert driver.state == "closed"
        assert "went away" in (driver.error or "")


def test_a_short_stall_is_told_and_survived(sensor: EmulatorProcess) -> None:
    with Watched(sensor.port) as driver:
        driver.wait_for("streaming")
        start = time.monotonic()
        sensor.command("stall 1")
        driver.wait_for("streaming", driver.wait_for("stalled", start))
        assert driver.statistics.reconnects == 0


def test_what_came_before_says_nothing_about_a_stall(sensor: EmulatorProcess) -> None:
    with Watched(sensor.port) as driver:
        driver.wait_for("streaming")
        next(iter(driver))
        assert driver.statistics.completeness == 1
        sensor.command("stall 60")
        driver.wait_for("reconnecting")  # after 2 s
        told = driver.statistics
    sensor.command("stall 0")
    assert (told.completeness, told.rate_hz, told.samples_per_s) == (0, 0, 0)


def test_a_sensor_that_stays_silent_is_started_again(sensor: EmulatorProcess) -> None:
    with Watched(sensor.port) as driver:
        driver.wait_for("streaming")
        start = time.monotonic()
        sensor.command("stall 2.5")
        lost = driver.wait_for("reconnecting", start)
        driver.wait_for("streaming", lost)
        assert driver.statistics.reconnects == 1


@pytest.mark.long
@pytest.mark.parametrize("option", ["legacy_only", "silent_conf"])
def test_a_sensor_that_does_not_tell_its_modes_scans_as_the_first_ones_did(option: str) -> None:
    with EmulatorProcess(spin_up=0, **{option: True}) as sensor, Driver(sensor.port) as driver:
        assert (driver.mode.name, driver.mode.answer_type) == ("Standard", Answer.NODES)
        assert 380 < len(next(iter(driver))) < 430


@pytest.mark.long
def test_a_protection_stop_is_reset(sensor: EmulatorProcess) -> None:
    sensor.command("health 2 17")
    with Watched(sensor.port) as driver:
        assert driver.health.name == "good"
        driver.wait_for("streaming")
        start = time.monotonic()
        sensor.command("health 2 17")  # once more, while it scans
        driver.wait_for("streaming", driver.wait_for("reconnecting", start))


def test_a_protection_stop_that_stays_is_told_with_its_code() -> None:
    with (
        EmulatorProcess(health=2, health_code=17, health_sticks=True, reset=0.2) as sensor,
        pytest.raises(ProtectionStopError, match=r"health code 17.*reset did not help"),
    ):
        Driver(sensor.port).__enter__()


@pytest.mark.long
def test_a_warning_is_told_and_no_reason_to_stop() -> None:
    with EmulatorProcess(health=1, health_code=3, spin_up=0) as sensor, Driver(sensor.port) as driver:
        assert (driver.health.name, driver.health.code) == ("warning", 3)
        next(iter(driver))


@pytest.mark.long
def test_something_else_that_talks_is_no_sensor() -> None:
    with Other(b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n") as gps:
        start = time.monotonic()
        with pytest.raises(NoAnswerError, match=r"not those of an RPLIDAR.*right port"):
            Driver(gps.path).__enter__()
        assert time.monotonic() - start < PATIENCE / 2


def test_closing_ends_a_stall_and_a_search_too(sensor: EmulatorProcess) -> None:
    for fault, state in (("stall 60", "stalled"), ("unplug", "reconnecting")):
        with Watched(sensor.port) as driver:
            driver.wait_for("streaming")
            sensor.command(fault)
            driver.wait_for(state)  # type: ignore[arg-type]
            start = time.monotonic()
            driver.close()
            assert time.monotonic() - start < 3
            assert driver.state == "closed"
            assert list(driver) == []
        sensor.command("stall 0")


def test_unplugging_at_any_moment_of_connecting_is_an_error_and_no_hang(sensor: EmulatorProcess) -> None:
    for delay in range(0, 80, 8):
        unplug = threading.Timer(delay / 1000, sensor.command, ("unplug",))
        unplug.start()
        try:
            with Driver(sensor.port, reconnect=False) as driver:
                list(driver)
        except (UnpluggedError, NoDeviceError):
            pass
        else:
            pytest.fail("the sensor was unplugged, but there was no error")
        unplug.join()
        sensor.command("replug")
    with Driver(sensor.port) as driver:
        next(iter(driver))


LINK = """import os, sys, time
end = time.monotonic() + 0.5
while time.monotonic() < end:
    os.symlink("/dev/null", sys.argv[1])
    os.unlink(sys.argv[1])
"""


def test_who_holds_a_port_can_be_asked_while_it_comes_and_goes(tmp_path: Path) -> None:
    """Asked some ten thousand times; in a quarter of them the link goes between being found and being read."""
    link = tmp_path / "ttyS1"
    with subprocess.Popen([sys.executable, "-c", LINK, str(link)]) as process:
        while process.poll() is None:
            assert holders(str(link)) == []


@pytest.mark.long
def test_faults_in_combination_are_survived(sensor: EmulatorProcess) -> None:
    dice = random.Random(7)
    faults = (
        "flip 0.1",
        "lose 0.1",
        "lose-bytes 0.002",
        "garbage 500",
        "stall 0.2",
        "unplug",
        "replug",
        "health 2 1",
    )
    with Watched(sensor.port, rpm=900) as driver:
        driver.wait_for("streaming")
        sizes: list[int] = []
        taker = threading.Thread(target=lambda: sizes.extend(map(len, driver)))
        taker.start()
        for _ in range(25):
            sensor.command(dice.choice(faults))
            time.sleep(dice.uniform(0, 0.2))  # the moment is part of the dice
        for mended in ("flip 0", "lose 0", "lose-bytes 0", "stall 0", "replug"):
            sensor.command(mended)
        calm = driver.statistics

        def is_as_before() -> bool:
            told = driver.statistics
            return (
                driver.state == "streaming"
                and told.revolutions >= calm.revolutions + 12
                and told.completeness == 1
                and told.rate_hz == pytest.approx(15, rel=0.1)
            )

        wait_until(is_as_before, "it turns and measures as before")
    taker.join()
    assert max(sizes) < 1.05 * 926, "two turns were merged"


class Other:
    """A port with something else than our sensor: another RPLIDAR, which only says who it is, or what `says`."""

    def __init__(self, says: bytes = b"") -> None:
        self._far, self._near = os.openpty()
        os.set_blocking(self._far, False)
        self.path = os.ttyname(self._near)
        self.asked, self.started = 0, False
        self._says = says
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._live)

    def __enter__(self) -> "Other":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()
        for end in (self._far, self._near):
            os.close(end)

    def _live(self) -> None:
        requests = RequestReader()
        while not self._done.is_set():
            if not select.select([self._far], [], [], 0.01)[0]:
                self._say(self._says)
                continue
            for request in requests.feed(os.read(self._far, 4096)):
                self.started |= request.command in (Command.SCAN, Command.EXPRESS_SCAN)
                if request.command == Command.GET_INFO and not self._says:
                    info = DeviceInfo(serial="AB" * 16).encode()
                    self._say(Descriptor(Answer.INFO, len(info)).encode() + info)
                    self.asked += 1

    def _say(self, data: bytes) -> None:
        with suppress(BlockingIOError):  # nobody listens
            os.write(self._far, data)
