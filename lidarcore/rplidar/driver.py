"""The driver: an RPLIDAR at a serial port as an iterator of scans.

A thread of its own reads and decodes, so that nothing is lost while the caller is busy; what he does not take in
time is dropped, the oldest first. When the sensor goes away the same thread looks for it, under any name.
"""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal, Self

from serial.tools.list_ports import comports

from lidarcore.closing import Closing
from lidarcore.errors import DeviceError, NoAnswerError
from lidarcore.rplidar.connection.devices import find_other_baud, only_device
from lidarcore.rplidar.connection.exit_handlers import close_at_exit, forget_at_exit
from lidarcore.rplidar.connection.latest import Latest
from lidarcore.rplidar.connection.port import Cancelled, ListPorts, Tap
from lidarcore.rplidar.connection.reconnection import find_again
from lidarcore.rplidar.connection.scan_options import BAUD, ScanOptions, checked_rpm
from lidarcore.rplidar.connection.session import Session
from lidarcore.rplidar.connection.statistics import Statistics, Tally
from lidarcore.rplidar.protocol import DeviceInfo, Health, Revolution, ScanMode
from lidarcore.scan import Scan
from lidarcore.threads import join

State = Literal["connecting", "streaming", "stalled", "reconnecting", "closed"]

KEPT = 10  # revolutions
CLOSING = 3.0  # s


class Driver(Closing):
    """An RPLIDAR at a serial port.

        with Driver() as driver:
            for scan in driver:
                ...

    port       its path, or its name in /dev; None takes the only one connected
    baud       256000 for an S1
    mode       "DenseBoost" or "Standard"; None takes what the sensor recommends
    rpm        480 to 900; None is 600
    reconnect  go on by itself when the sensor has gone away and comes back: at the same path, or with the same
               serial number at another one. Without, the iterators raise what happened.
    tap        called with "in" or "out", Unix seconds and the bytes, for all that goes over the port
    on_change  called when `state` has changed
    list_ports which ports there are, as pyserial tells

    Both callbacks run in the driver's thread and must be quick; what they raise, the iterators raise.

    Entering connects. Leaving stops the motor, as do the end of the program, SIGINT, and SIGTERM and SIGHUP if the
    program (its main thread enters the driver) does not handle them itself: they raise SystemExit.

    Raises DeviceError for a mode or speed that no sensor has, and on entering NoDeviceError, PortPermissionError,
    PortBusyError, NoAnswerError or ProtectionStopError, UnpluggedError.
    """

    def __init__(
        self,
        port: str | None = None,
        *,
        baud: int = BAUD,
        mode: str | None = None,
        rpm: int | None = None,
        reconnect: bool = True,
        tap: Tap | None = None,
        on_change: Callable[[], object] | None = None,
        list_ports: ListPorts = comports,
    ) -> None:
        self._port = port
        self._options = ScanOptions(baud, mode, checked_rpm(rpm))
        self._reconnects = reconnect
        self._tap = tap
        self._on_change = on_change
        self._list_ports = list_ports
        self._closing = threading.Event()
        self._revolutions: Latest[Revolution] = Latest(KEPT)
        self._tally = Tally()
        self._failure: BaseException | None = None
        self._state: State = "closed"
        self._error: str | None = None
        self._thread = threading.Thread(target=self._run, name="rplidar", daemon=True)

    def __enter__(self) -> Self:
        self._become("connecting")
        close_at_exit(self.close)
        try:
            self._session = self._connect_first(self._port or only_device(self._list_ports))
        except BaseException as error:
            forget_at_exit(self.close)
            self._become("closed", str(error))
            raise
        self._thread.start()
        return self

    def close(self) -> None:
        """Stop the motor, let go of the port and end the iterators; from any thread, also more than once.

        Entering that is still under way in another thread raises DeviceError soon.
        """
        forget_at_exit(self.close)
        self._closing.set()
        self._revolutions.close()
        join(self._thread, CLOSING)

    def __iter__(self) -> Iterator[Scan]:
        """Scans as they are completed; the stamp is the Unix time of the first beam, in s."""
        for revolution in self.revolutions():
            yield revolution.scan(time.time() - time.monotonic())

    def revolutions(self) -> Iterator[Revolution]:
        """Revolutions as they were decoded, before they become scans; times are of time.monotonic(), in s."""
        while (revolution := self._revolutions.get()) is not None:
            yield revolution
        if self._failure:
            raise self._failure

    def set_speed(self, rpm: int) -> None:
        """Turn at that speed from now on, 480 to 900 rpm. Raises DeviceError for others."""
        self._options = replace(self._options, rpm=checked_rpm(rpm))
        self._session.set_speed(rpm)

    @property
    def port(self) -> str:
        """Path at which the sensor is, or was last."""
        return self._session.port.path

    @property
    def info(self) -> DeviceInfo:
        """What the sensor says it is."""
        return self._session.info

    @property
    def health(self) -> Health:
        """How it said it is when it was connected."""
        return self._session.health

    @property
    def modes(self) -> tuple[ScanMode, ...]:
        """The scan modes it has."""
        return self._session.modes

    @property
    def mode(self) -> ScanMode:
        """The scan mode it is in."""
        return self._session.mode

    @property
    def rpm(self) -> int:
        """The speed asked for; the one it has is 60 times the statistics' rate."""
        return self._options.rpm

    @property
    def baud(self) -> int:
        """The baud rate."""
        return self._options.baud

    @property
    def state(self) -> State:
        """Streaming; or why not."""
        return self._state

    @property
    def error(self) -> str | None:
        """What is wrong now, and what to do about it; None while all is well."""
        return self._error

    @property
    def statistics(self) -> Statistics:
        """How well measurements arrive."""
        return self._tally.statistics(self._revolutions.overruns)

    def _connect_first(self, path: str) -> Session:
        try:
            return self._connect_or_name_baud(path)
        except Cancelled:
            raise DeviceError("The driver was closed: make another one.") from None

    def _connect_or_name_baud(self, path: str) -> Session:
        try:
            return self._connect(path)
        except NoAnswerError as error:
            if (baud := find_other_baud(path, self.baud, self._closing)) is None:
                raise
            raise NoAnswerError(
                f"The sensor at {path} uses {baud} baud, not {self.baud}: choose that rate."
            ) from error

    def _connect(self, path: str) -> Session:
        session = Session(path, self._options, self._tap, self._closing)
        self._tally.begin(session.decoder.statistics)
        return session

    def _run(self) -> None:
        """The thread: follow the sensor until the driver is closed."""
        try:
            while True:
                try:
                    self._follow()
                except DeviceError as error:
                    if not self._reconnects:
                        raise
                    self._come_back(error)
        except Cancelled:
            pass
        except BaseException as error:
            self._failure = error
        finally:
            self._session.close()
            self._revolutions.close()
            self._become("closed", None if self._failure is None else str(self._failure))
            # Who is told may hold the driver: without a cycle both are freed as soon as nobody needs them.
            self._tap = self._on_change = None

    def _follow(self) -> None:
        """Hand on revolutions until the sensor is lost."""
        while True:
            for revolution in self._session.read():
                self._tally.add(revolution)
                self._revolutions.put(revolution)
            if self._session.stalled and self._state == "streaming":
                self._become("stalled", self._session.complaint)
            elif self._session.started and not self._session.stalled:
                self._become("streaming")

    def _come_back(self, error: DeviceError) -> None:
        self._complain(error)
        self._session.close()  # before the system gives its name to the same sensor again
        self._session = find_again(self._session, self._connect, self._list_ports, self._complain)

    def _complain(self, error: DeviceError) -> None:
        self._become("reconnecting", str(error))

    def _become(self, state: State, error: str | None = None) -> None:
        """Change the state, and tell if that is new."""
        if (state, error) == (self._state, self._error):
            return
        self._state, self._error = state, error
        if self._on_change:
            self._on_change()
