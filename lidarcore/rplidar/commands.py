"""Requests to an RPLIDAR: written by the driver, read back by the emulator.

SLAMTEC, RPLIDAR interface protocol: `A5 command`, and from command 0x80 on `A5 command size payload checksum`,
where the checksum is the XOR of all bytes before it.
"""

from dataclasses import dataclass
from enum import IntEnum

SYNC = 0xA5
HAS_PAYLOAD = 0x80


class Command(IntEnum):
    """What can be asked of the sensor."""

    STOP = 0x25
    RESET = 0x40
    SCAN = 0x20
    FORCE_SCAN = 0x21
    EXPRESS_SCAN = 0x82  # u8 mode id, u16 flags, u16 parameter
    GET_INFO = 0x50
    GET_HEALTH = 0x52
    GET_SAMPLERATE = 0x59
    GET_LIDAR_CONF = 0x84  # u32 Conf, and for what belongs to a scan mode u16 mode id
    MOTOR_SPEED = 0xA8  # u16 rpm; no answer
    SET_MOTOR_PWM = 0xF0  # u16; the accessory board of the A series; no answer
    GET_ACC_BOARD_FLAG = 0xFF  # u32 0


class Conf(IntEnum):
    """What GET_LIDAR_CONF can ask for."""

    DESIRED_SPEED = 0x01  # u16 rpm, u16 pwm
    MIN_SPEED = 0x04  # u16 rpm
    MAX_SPEED = 0x05  # u16 rpm
    SCAN_MODE_COUNT = 0x70  # u16
    US_PER_SAMPLE = 0x71  # u32, 1/256 us; of a mode
    MAX_DISTANCE = 0x74  # u32, 1/256 m; of a mode
    ANSWER_TYPE = 0x75  # u8; of a mode
    MAC = 0x79  # 6 bytes
    TYPICAL = 0x7C  # u16 mode id
    NAME = 0x7F  # ASCII, ends with a zero byte; of a mode


_KNOWN = {int(command): command for command in Command}


@dataclass(frozen=True)
class Request:
    """One request as the sensor receives it; `command` is a Command if it is a known one."""

    command: int
    payload: bytes = b""


def request(command: int, payload: bytes = b"") -> bytes:
    """Bytes of a request.

    Raises ValueError if a command below 0x80 is given a payload, or the payload exceeds 255 bytes.
    """
    if command < HAS_PAYLOAD:
        if payload:
            raise ValueError(f"command {command:#04x} takes no payload: only commands from 0x80 on do")
        return bytes((SYNC, command))
    head = bytes((SYNC, command, len(payload))) + payload
    return head + bytes((xor(head),))


def xor(data: bytes) -> int:
    """XOR of all bytes: the number is folded upon itself, which takes a tenth of the time of a loop."""
    folded, bits = int.from_bytes(data, "little"), 8 << max(len(data) - 1, 1).bit_length()
    while bits > 8:
        bits >>= 1
        folded ^= folded >> bits
    return folded & 0xFF


class RequestReader:
    """Finds requests in bytes that arrive in any fragments; an incomplete one waits for its rest.

    dropped  bytes that belonged to no request, or to one with a wrong checksum
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._buffer = b""

    def feed(self, data: bytes) -> list[Request]:
        """Requests that these bytes complete."""
        buffer, position, found = self._buffer + data, 0, list[Request]()
        while True:
            start = buffer.find(SYNC, position)
            start = len(buffer) if start < 0 else start
            self.dropped += start - position
            end = start + _size(buffer[start : start + 3])
            if len(buffer) < end:
                break
            if end - start > 2 and xor(buffer[start:end]):
                self.dropped, position = self.dropped + 1, start + 1  # a request may begin inside this one
            else:
                command = buffer[start + 1]
                found.append(Request(_KNOWN.get(command, command), buffer[start + 3 : end - 1]))
                position = end
        self._buffer = buffer[start:]
        return found

    def reset(self) -> None:
        """Forget an incomplete request, as the sensor does when its rest does not come within 5 s."""
        self.dropped += len(self._buffer)
        self._buffer = b""


def _size(head: bytes) -> int:
    """Bytes of a request that begins like this, at least."""
    if len(head) < 2 or head[1] < HAS_PAYLOAD:
        return 2
    return 4 + head[2] if len(head) > 2 else 4
