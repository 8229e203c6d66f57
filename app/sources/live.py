"""The live source: an RPLIDAR at a port, or an emulated one, through the same driver."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Literal

from lidarcore import DeviceError, Scan
from lidarcore.rplidar import (
    BAUD,
    Driver,
    EmulatorProcess,
    Stream,
    Tap,
    check_scan_options,
    find_devices,
    path_of,
)

from ..records import record
from .history import HistorySource
from .source import DeviceStatus


@dataclass(frozen=True)
class DeviceOptions:
    """Which sensor, and how to run it. None leaves it to the driver."""

    port: str | None = None
    baud: int | None = None
    mode: str | None = None
    rpm: int | None = None
    emulated: bool = False


@dataclass(frozen=True)
class Taps:
    """Who else is told of what a live source produces: of every scan, and of every byte."""

    scan: Callable[[Scan], None] = lambda scan: None
    bytes: Tap = lambda direction, time, data: None


class LiveSource(HistorySource):
    """The revolutions of a sensor.

    Connects when made, and streams from `start` on; raises DeviceError if there is no sensor to talk to.
    """

    def __init__(self, options: DeviceOptions, taps: Taps) -> None:
        super().__init__(taps.scan)
        self.options = options
        self.kind: Literal["device", "emulator"] = "emulator" if options.emulated else "device"
        self._taps = taps
        self._started = False
        self._let_go: Callable[[], None] = lambda: None
        if options.emulated:
            check_scan_options(options.mode, options.rpm)  # before a process is started for them
        self.emulator = EmulatorProcess(on_end=self._emulator_ended) if options.emulated else None
        if self.emulator is not None:
            self.noise = self.emulator.noise
        try:
            self._driver = Driver(
                self.emulator.port if self.emulator else options.port,
                baud=options.baud or BAUD,
                mode=options.mode,
                rpm=options.rpm,
                tap=self._tap,
                on_change=lambda: self._changed(),
            )
            self._let_go = self._driver.close
            self._driver.__enter__()
        except BaseException:
            self._end_emulator()
            raise

    @property
    def sensor(self) -> str:
        """Model and serial number."""
        return f"{self.kind} {self._driver.info.name} {self._driver.info.serial}"

    @property
    def stream(self) -> Stream:
        """What one has to know to understand the bytes from here on."""
        mode = self._driver.mode
        return Stream(mode.answer_type, mode.us_per_sample, self._driver.baud)

    def start(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        self._started = True
        super().start(arrived, progress)

    def close(self) -> None:
        self._driver.close()
        super().close()
        self._end_emulator()

    def set_speed(self, rpm: int) -> None:
        self._driver.set_speed(rpm)
        self.options = replace(self.options, rpm=rpm)

    def holds(self, port: str | None) -> bool:
        """Whether opening that port (None: the only one connected) would find it taken by this source."""
        return self.kind == "device" and (
            port is None or os.path.realpath(path_of(port)) == os.path.realpath(self._driver.port)
        )

    def device(self) -> DeviceStatus:
        driver = self._driver
        return record(
            DeviceStatus,
            driver.statistics,
            port=driver.port,
            name=driver.info.name,
            serial=driver.info.serial,
            firmware=driver.info.version,
            hardware=driver.info.hardware,
            health=driver.health.name,
            mode=driver.mode.name,
            checked=driver.mode.checked,
            modes=tuple(mode.name for mode in driver.modes),
            rpm=driver.rpm,
            baud=driver.baud,
            state=driver.state,
            error=driver.error,
        )

    def _follow(self) -> None:
        try:
            for revolution in self._driver.revolutions():
                self._take(revolution.scan(time.time() - time.monotonic()), revolution.arrival)
        except DeviceError as error:
            self.error = str(error)
            self._changed()

    def _tap(self, direction: Literal["in", "out"], time: float, data: bytes) -> None:
        """Only of the source that plays: another one may be tried meanwhile."""
        if self._started:
            self._taps.bytes(direction, time, data)

    def _emulator_ended(self) -> None:
        """The emulator ended by itself; it does not come back, so there is nothing to reconnect to."""
        self.error = "The emulator has ended: choose it again to start a new one."
        self._let_go()
        self._changed()

    def _end_emulator(self) -> None:
        if self.emulator:
            self.emulator.close()


def connected_or_emulated(options: DeviceOptions, taps: Taps) -> tuple[LiveSource, list[str]]:
    """The sensor asked for; if none is, the one connected, else an emulated one; and what there is to say of it.

    Raises DeviceError if a port was named and there is no sensor to talk to.
    """
    if options.port is not None or options.emulated:
        source = LiveSource(options, taps)
        return source, [_sentence(source)]
    sentences = []
    for path in islice(_candidates(), 8):
        try:
            source = LiveSource(DeviceOptions(path, options.baud, options.mode, options.rpm), taps)
        except DeviceError as error:
            sentences.append(str(error))
        else:
            return source, [*sentences, _sentence(source)]
    source = LiveSource(DeviceOptions(mode=options.mode, rpm=options.rpm, emulated=True), taps)
    return source, [*sentences, f"No RPLIDAR is connected. {_sentence(source)}"]


def _candidates() -> Iterator[str]:
    return (device.path for device in find_devices(ask=False) if device.looks_like)


def _sentence(source: LiveSource) -> str:
    device = source.device()
    what = "an emulated RPLIDAR S1" if source.emulator else f"{device.name}, serial {device.serial},"
    return f"Playing {what} at {device.port}."
