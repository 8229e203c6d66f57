"""A client of the emulator that knows bytes only: pyserial, and the tables of Slamtec's protocol written out again."""

import struct
import time
from contextlib import contextmanager

import numpy as np
import serial
from waiting import PATIENCE

ASK_INFO, ASK_HEALTH = "a550", "a552"
ASK_SAMPLERATE, SAMPLERATE = "a559", "a55a0400000015f4006c00"
STOP, RESET, SCAN, FORCE_SCAN = "a525", "a540", "a520", "a521"
DENSE_BOOST = "a582050100000000" + "23"
DENSE_BOOST_OF_OLD_SDKS = "a582050000000000" + "22"
DENSE, LEGACY = "a55a5400004085", "a55a0500004081"


class Line:
    def __init__(self, port, baud=256000):
        self.serial = serial.Serial(port, baud, timeout=PATIENCE, exclusive=True)

    def send(self, request: str) -> None:
        self.serial.write(bytes.fromhex(request))

    def read(self, count: int) -> bytes:
        data = self.serial.read(count)
        assert len(data) == count
        return data

    def ask(self, request: str, count: int) -> str:
        self.send(request)
        return self.read(count).hex()

    def ask_until_answered(self, request: str, count: int) -> str:
        """Of a sensor that is still deaf."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            self.send(request)
            if first := self.read_within(0.2):
                return (first + self.read(count - 1)).hex()
        raise AssertionError("it stays deaf")

    def read_within(self, seconds: float) -> bytes:
        """A byte, or none."""
        self.serial.timeout, before = seconds, self.serial.timeout
        data = self.serial.read(1)
        self.serial.timeout = before
        return data

    def is_silent(self, seconds: float) -> bool:
        return not self.read_within(seconds)

    def scan(self, request: str = DENSE_BOOST, descriptor: str = DENSE) -> None:
        assert self.ask(request, 7) == descriptor

    def drain(self) -> None:
        """Stop whatever scans, and read all that was under way: what is asked after it is answered last."""
        self.send(STOP)
        self.until_silent(0.05)  # so that the line has room for an answer
        self.send(ASK_SAMPLERATE)
        heard = b""
        while not heard.endswith(bytes.fromhex(SAMPLERATE)):
            heard += self.read(1)

    def until_silent(self, seconds: float) -> bytes:
        """All that comes before it is quiet for so long: a sensor that is busy finishes later what it was asked."""
        heard, until = b"", time.monotonic() + PATIENCE
        while byte := self.read_within(seconds):
            assert time.monotonic() < until, "it goes on"
            heard += byte
        return heard

    def until_whole(self, n: int, within: int = 600) -> None:
        """Read capsules until so many in a row are whole: what was sent before may still be on its way."""
        run = 0
        for _ in range(within):
            run = run + 1 if self.capsules(1)[0][0] else 0
            if run == n:
                return
        raise AssertionError("capsules stay broken")

    def capsules(self, n: int):
        return capsules(self.read(84 * n))


@contextmanager
def line_to(emulator, baud=256000):
    line = Line(emulator.port, baud)
    try:
        yield line
    finally:
        line.serial.close()


def with_checksum(request: str) -> str:
    data = bytes.fromhex(request)
    return request + f"{np.bitwise_xor.reduce(np.frombuffer(data, np.uint8)):02x}"


def speed(rpm: int) -> str:
    return with_checksum("a5a802" + struct.pack("<H", rpm).hex())


def conf(entry: int, mode: int | None = None) -> str:
    payload = struct.pack("<I", entry) + (b"" if mode is None else struct.pack("<H", mode))
    return with_checksum(f"a584{len(payload):02x}{payload.hex()}")


def capsules(data: bytes):
    """Whether each of P dense capsules is whole, its flag, start angle (degrees) and 40 distances (mm)."""
    rows = np.frombuffer(data, np.uint8).reshape(-1, 84)
    told = (rows[:, 0] & 15) | (rows[:, 1] << 4)
    whole = (rows[:, 0] >> 4 == 0xA) & (rows[:, 1] >> 4 == 0x5)
    whole &= told == np.bitwise_xor.reduce(rows[:, 2:], axis=1)
    starts = rows[:, 2:4].copy().view("<u2")[:, 0]
    distances = rows[:, 4:].copy().view("<u2")
    return whole, starts >> 15 == 1, (starts & 0x7FFF) / 64, distances


def nodes(data: bytes):
    """Flag, inverse flag, quality, check bit, angle (degrees) and distance (mm) of legacy nodes."""
    rows = np.frombuffer(data, np.dtype([("flags", "u1"), ("angle", "<u2"), ("distance", "<u2")]))
    flags, angle = rows["flags"], rows["angle"]
    return flags & 1, flags >> 1 & 1, flags >> 2, angle & 1, (angle >> 1) / 64, rows["distance"] / 4


def steps(starts):
    """From each start angle to the next, degrees."""
    return np.diff(starts) % 360
