"""One connection to a sensor: from opening its port until it is closed or lost."""

import threading
import time
from contextlib import suppress

from lidarcore.errors import DeviceError, NoAnswerError
from lidarcore.rplidar.connection import handshake
from lidarcore.rplidar.connection.port import Port, Tap
from lidarcore.rplidar.connection.scan_options import ScanOptions
from lidarcore.rplidar.protocol import Revolution, StreamDecoder

STALL = 0.5  # s without measurements after which the stream counts as stalled
LOST = 2.0  # s without measurements after which it is given up
FIRST = 5.0  # s until the first measurements: the motor comes up to speed before


class Session:
    """A sensor that measures. Raises DeviceError, of the type of what went wrong, and Cancelled."""

    def __init__(self, path: str, options: ScanOptions, tap: Tap | None, cancelled: threading.Event) -> None:
        self.port = Port(path, options.baud, tap, cancelled)
        try:
            self._shake_hands(options)
        except BaseException:
            self.close()
            raise

    def _shake_hands(self, options: ScanOptions) -> None:
        self.info = handshake.identify(self.port)
        self.health = handshake.ensure_health(self.port)
        self.modes, typical = handshake.read_modes(self.port)
        asked = handshake.choose_mode(self.modes, typical, options.mode)
        answer, self._early = handshake.start(self.port, asked)
        # The sensor forgets a speed that was set before the scan began.
        handshake.set_speed(self.port, options.rpm)
        # What comes counts, not what was asked for.
        self.mode = handshake.mode_sending(answer, asked, self.modes)
        self.decoder = StreamDecoder(answer, self.mode.us_per_sample, options.baud)
        self._packets = 0
        self._last = time.monotonic()

    def read(self) -> list[Revolution]:
        """The revolutions that are completed by what has arrived; waits a moment if nothing has."""
        data, self._early = self._early or self.port.read(), b""
        now = time.monotonic()
        revolutions = self.decoder.feed(data, now) if data else []
        packets = self.decoder.statistics.packets
        if packets > self._packets:
            self._packets, self._last = packets, now
        elif now - self._last > (LOST if packets else FIRST):
            raise NoAnswerError(self.complaint)
        return revolutions

    @property
    def complaint(self) -> str:
        """What to tell when no measurements come."""
        return (
            f"The sensor at {self.port.path} sends no measurements: check its power (5 V; a weak USB port is not "
            "enough) and cables, and that its head turns."
        )

    @property
    def started(self) -> bool:
        """There have been measurements."""
        return self._packets > 0

    @property
    def stalled(self) -> bool:
        """There have been none for a while."""
        return time.monotonic() - self._last > STALL

    def set_speed(self, rpm: int) -> None:
        """Turn at that speed from now on."""
        with suppress(DeviceError):  # the thread that reads learns of it, too
            handshake.set_speed(self.port, rpm)

    def close(self) -> None:
        """Stop measuring and the motor, as far as the sensor is still there, and let go of the port."""
        with suppress(DeviceError):
            handshake.stop(self.port)
        self.port.close()
