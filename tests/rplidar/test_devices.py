"""Sensors are found where they are, and nothing else is touched.

Which adapters are on USB no test machine can offer: that list is made up, of pyserial's own type. The ports are
real pseudo-terminals with the emulator, or nobody, behind.
"""

import json
import os
import time
from collections.abc import Iterator
from itertools import islice

import pytest
import typer
from lidarcore_app.cli.devices import ADVICE, devices, sensor_at
from serial import Serial
from serial.tools.list_ports import comports
from serial.tools.list_ports_common import ListPortInfo
from typer.testing import CliRunner
from waiting import PATIENCE

from lidarcore.errors import NoDeviceError
from lidarcore.rplidar import Driver, find_devices
from lidarcore.rplidar.connection.devices import only_device
from lidarcore.rplidar.emulator_process import EmulatorProcess

CP2102 = (0x10C4, 0xEA60)
FTDI = (0x0403, 0x6001)


def usb(path: str, adapter: tuple[int, int] = CP2102) -> ListPortInfo:
    port = ListPortInfo(path)
    port.vid, port.pid = adapter
    port.description = "CP2102 USB to UART Bridge Controller"
    return port


@pytest.fixture(scope="module")
def sensor() -> Iterator[EmulatorProcess]:
    with EmulatorProcess() as emulator:
        yield emulator


@pytest.fixture(scope="module")
def silent() -> Iterator[str]:
    """A port at which nobody answers."""
    ends = os.openpty()
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


def test_the_ports_of_this_machine_are_listed_as_pyserial_does() -> None:
    assert {device.path for device in find_devices(ask=False)} == {port.device for port in comports()}


def test_what_looks_like_a_sensor_is_asked_who_it_is(sensor: EmulatorProcess) -> None:
    (found,) = find_devices(list_ports=lambda: [usb(sensor.port)])
    assert (found.path, found.vid_pid, found.looks_like) == (sensor.port, "10c4:ea60", True)
    assert found.info is not None
    assert (found.info.name, found.info.firmware, found.baud) == ("RPLIDAR S1", (1, 28), 256_000)
    assert (found.error, found.in_use) == (None, False)


@pytest.mark.long
def test_a_sensor_at_another_baud_rate_is_found() -> None:
    with EmulatorProcess(baud=115_200) as sensor:
        (found,) = find_devices(list_ports=lambda: [usb(sensor.port)])
    assert found.info is not None
    assert found.baud == 115_200


@pytest.mark.long
def test_other_adapters_are_listed_and_left_alone() -> None:
    with EmulatorProcess(streaming=True) as sensor, Serial() as line:
        (found,) = find_devices(list_ports=lambda: [usb(sensor.port, FTDI)])
        line.port, line.baudrate, line.timeout = sensor.port, 256_000, PATIENCE
        line.open()
        assert len(line.read(1000)) == 1000, "it was stopped"
    assert (found.looks_like, found.info, found.vid_pid) == (False, None, "0403:6001")


def test_a_sensor_in_use_is_not_disturbed(sensor: EmulatorProcess) -> None:
    with Driver(sensor.port) as driver:
        revolutions = driver.revolutions()
        next(revolutions)
        (found,) = find_devices(list_ports=lambda: [usb(sensor.port)])
        assert found.in_use
        assert "in use" in (found.error or "")
        assert all(revolution.complete for revolution in islice(revolutions, 5))
        assert driver.statistics.reconnects == 0


def test_a_silent_port_says_so_in_bounded_time(silent: str) -> None:
    start = time.monotonic()
    (found,) = find_devices(list_ports=lambda: [usb(silent)])
    assert time.monotonic() - start < PATIENCE / 2
    assert found.info is None
    assert "power" in (found.error or "")


def test_the_only_sensor_is_taken_without_asking(silent: str) -> None:
    assert only_device(lambda: [usb("/dev/other", FTDI), usb(silent)]) == silent


def test_of_several_the_one_that_answers_is_taken(sensor: EmulatorProcess, silent: str) -> None:
    assert only_device(lambda: [usb(silent), usb(sensor.port)]) == sensor.port


@pytest.mark.long
def test_of_several_sensors_one_must_be_chosen(sensor: EmulatorProcess) -> None:
    with EmulatorProcess() as other:
        with pytest.raises(NoDeviceError, match="Several RPLIDARs") as raised:
            only_device(lambda: [usb(sensor.port), usb(other.port)])
        assert sensor.port in str(raised.value)
        assert other.port in str(raised.value)


def test_without_a_sensor_the_ports_there_are_are_named() -> None:
    with pytest.raises(NoDeviceError, match=r"plug one in.*/dev/ttyS7"):
        only_device(lambda: [ListPortInfo("/dev/ttyS7")])
    with pytest.raises(NoDeviceError, match="no serial port"):
        only_device(lambda: [])


def test_the_command_lists_every_port_and_says_what_to_do_without_a_sensor() -> None:
    cli = typer.Typer()
    cli.command()(devices)
    shown = CliRunner().invoke(cli, ["--no-ask"])
    told = CliRunner().invoke(cli, ["--no-ask", "--json"])
    assert shown.exit_code == told.exit_code == 0
    listed = json.loads(told.output)
    assert {device["path"] for device in listed} == {port.device for port in comports()}
    assert all(device["path"] in shown.output for device in listed)
    assert (ADVICE in shown.output) == (not any(device["looks_like"] for device in listed))


@pytest.mark.long
def test_the_command_names_sensors_and_faults(sensor: EmulatorProcess, silent: str) -> None:
    found = find_devices(list_ports=lambda: [usb(sensor.port), usb(silent), usb("/dev/other", FTDI)])
    lines = {device.path: sensor_at(device) for device in found}
    assert lines[sensor.port].startswith("RPLIDAR S1, firmware 1.28, serial ")
    assert "Nothing answers" in lines[silent]
    assert lines["/dev/other"].startswith("no RPLIDAR")
