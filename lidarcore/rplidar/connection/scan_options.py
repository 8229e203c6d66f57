"""What a user can ask of a sensor's scan, and what of it no sensor can do."""

from dataclasses import dataclass

from lidarcore.errors import DeviceError
from lidarcore.rplidar.connection.handshake import choose_mode
from lidarcore.rplidar.protocol import S1_MODES

BAUD = 256_000  # of an S1
RPM = 600
SPEEDS = (480, 900)  # rpm


@dataclass(frozen=True)
class ScanOptions:
    """What the user asked for: baud rate, scan mode (None: what the sensor recommends), speed in rpm."""

    baud: int
    mode: str | None
    rpm: int


def check_scan_options(mode: str | None, rpm: int | None) -> None:
    """Raises DeviceError for a mode or speed that no S1 has, not even an emulated one; None leaves the choice to it."""
    choose_mode(S1_MODES, None, mode)
    checked_rpm(rpm)


def checked_rpm(rpm: int | None) -> int:
    """The speed, if a sensor can turn at it; the usual one for None. Raises DeviceError."""
    if rpm is None:
        return RPM
    slowest, fastest = SPEEDS
    if not slowest <= rpm <= fastest:
        raise DeviceError(f"The sensor cannot turn at {rpm} rpm: choose {slowest} to {fastest}.")
    return rpm
