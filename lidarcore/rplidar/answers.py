"""Answers of an RPLIDAR other than measurements, to bytes and back (SLAMTEC, RPLIDAR interface protocol)."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar


class Answer(IntEnum):
    """Type of an answer, as its descriptor says."""

    INFO = 0x04
    HEALTH = 0x06
    SAMPLERATE = 0x15
    CONF = 0x20
    NODES = 0x81
    EXPRESS = 0x82
    HQ = 0x83
    ULTRA = 0x84
    DENSE = 0x85
    ACC = 0xFF


@dataclass(frozen=True)
class Descriptor:
    """What goes ahead of every answer: `A5 5A`, 30 bits of length, 2 bits of mode, type.

    type      one of Answer, or a number that is not known here
    length    bytes of one data packet
    repeated  packets follow until a stop, not only one
    """

    type: int
    length: int
    repeated: bool = False

    SYNC: ClassVar[bytes] = b"\xa5\x5a"
    SIZE: ClassVar[int] = 7

    def encode(self) -> bytes:
        """The 7 bytes."""
        return self.SYNC + struct.pack("<IB", self.length | self.repeated << 30, self.type)

    @classmethod
    def decode(cls, data: bytes) -> "Descriptor | None":
        """Decode exactly 7 bytes; None if they are not a descriptor."""
        if len(data) != cls.SIZE or not data.startswith(cls.SYNC):
            return None
        word, kind = struct.unpack("<IB", data[2:])
        mode = word >> 30
        return cls(kind, word & (1 << 30) - 1, mode == 1) if mode < 2 else None


_SERIES = ((12, "M"), (9, "T"), (6, "S"), (4, "C"))
"""First major model number of each series, as in Slamtec's SDK; the A series is below."""


@dataclass(frozen=True)
class DeviceInfo:
    """Answer to GET_INFO.

    model     its high four bits are the series and number, its low four the version
    firmware  major, minor
    hardware  revision
    serial    32 hexadecimal digits, in capitals
    """

    model: int = 0x61
    firmware: tuple[int, int] = (1, 28)
    hardware: int = 18
    serial: str = "00" * 16

    SIZE: ClassVar[int] = 20

    def encode(self) -> bytes:
        """The 20 bytes."""
        major, minor = self.firmware
        return bytes((self.model, minor, major, self.hardware)) + bytes.fromhex(self.serial)

    @classmethod
    def decode(cls, data: bytes) -> "DeviceInfo":
        """Decode 20 bytes. Raises ValueError for another number of them."""
        _check_size("device info", data, cls.SIZE)
        return cls(data[0], (data[2], data[1]), data[3], data[4:].hex().upper())

    @property
    def name(self) -> str:
        """Such as "RPLIDAR S1"."""
        major = self.model >> 4
        for first, series in _SERIES:
            if major >= first:
                return f"RPLIDAR {series}{major - first + 1}"
        return f"RPLIDAR A{major}"

    @property
    def version(self) -> str:
        """The firmware, such as "1.28"."""
        return f"{self.firmware[0]}.{self.firmware[1]:02}"


@dataclass(frozen=True)
class Health:
    """Answer to GET_HEALTH: status 0 good, 1 warning, 2 protection stop; the codes are not documented."""

    status: int = 0
    code: int = 0

    SIZE: ClassVar[int] = 3
    NAMES: ClassVar[tuple[str, ...]] = ("good", "warning", "protection stop")

    def encode(self) -> bytes:
        """The 3 bytes."""
        return struct.pack("<BH", self.status, self.code)

    @classmethod
    def decode(cls, data: bytes) -> "Health":
        """Decode 3 bytes. Raises ValueError for another number of them."""
        _check_size("health", data, cls.SIZE)
        return cls(*struct.unpack("<BH", data))

    @property
    def name(self) -> str:
        """The status in words."""
        return self.NAMES[self.status] if self.status < len(self.NAMES) else f"unknown status {self.status}"


@dataclass(frozen=True)
class ScanMode:
    """A way of scanning: time per sample in us, reach in m, and the answer type its measurements come in."""

    id: int
    name: str
    us_per_sample: float
    max_distance: float
    answer_type: int

    @property
    def checked(self) -> bool:
        """Whether packets carry a checksum: without, as in the legacy scan, a wrong distance goes unnoticed."""
        return self.answer_type != Answer.NODES


S1_MODES = (
    ScanMode(0, "Standard", 244.0, 40.0, Answer.NODES),
    ScanMode(1, "DenseBoost", 108.0, 40.0, Answer.DENSE),
)
"""What an S1 reports (firmware 1.28)."""


def _check_size(what: str, data: bytes, size: int) -> None:
    if len(data) != size:
        raise ValueError(f"{what} has {len(data)} bytes, not {size}")
