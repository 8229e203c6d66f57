"""The emulated sensor's side of the protocol: what it answers, what it sends when, and in which state it is."""

import math
import struct
from collections.abc import Iterator

from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.emulation.options import EmulatorOptions
from lidarcore.rplidar.emulation.scan import Motor, Packet, Room, packets
from lidarcore.rplidar.protocol import (
    S1_MODES,
    Answer,
    Command,
    Conf,
    Descriptor,
    DeviceInfo,
    Health,
    Request,
    RequestReader,
    ScanMode,
)

_STANDARD, _DENSE_BOOST = S1_MODES
_SERIAL = "E0D1C8F0B7A59384C2E3A4F5B6C7D8E9"
_PROTECTION_STOP = 2
_REQUEST_TIME = 5.0  # s after which the rest of a request is not waited for


class Device:
    """Something that answers requests and sends packets at their time."""

    packet_size = 0  # bytes of the packets it sends; 0 if they are of any size

    def __init__(self) -> None:
        self._packets: Iterator[Packet] = iter(())
        self._next: Packet = (math.inf, b"")

    def receive(self, data: bytes, now: float) -> bytes:
        """What is answered at once to bytes from the client, at `now` (s)."""
        return b""

    def set_health(self, health: Health) -> None:
        """Be in this state from now on."""

    @property
    def due(self) -> float:
        """When the next packet is to be sent, s; inf if there is none."""
        return self._next[0]

    def take(self) -> bytes:
        """The next packet."""
        packet = self._next[1]
        self._next = next(self._packets, (math.inf, b""))
        return packet

    def play(self, packets: Iterator[Packet]) -> None:
        """Send these from now on, instead of others."""
        self._packets = packets
        self.take()


class EmulatedS1(Device):
    """An RPLIDAR S1 in a room, plugged in at `now` (s)."""

    def __init__(self, options: EmulatorOptions, room: Room, now: float) -> None:
        super().__init__()
        self._options, self._requests = options, RequestReader()
        self._room, self._motor = room, Motor(options, room.rng, now)
        self._heard, self._deaf_until = now, now + options.boot
        self._health = Health(options.health, options.health_code)
        if options.streaming:
            self._scan(_STANDARD if options.legacy_only else _DENSE_BOOST, now)

    def receive(self, data: bytes, now: float) -> bytes:
        """Answers; while it boots there are none."""
        if now - self._heard > _REQUEST_TIME:
            self._requests.reset()
        self._heard = now
        return b"".join(self._answer(request, now) for request in self._requests.feed(data))

    def set_health(self, health: Health) -> None:
        """A protection stop ends the scan."""
        self._health = health
        if health.status == _PROTECTION_STOP:
            self.play(iter(()))

    def _answer(self, request: Request, now: float) -> bytes:
        command, payload = request.command, request.payload
        if now < self._deaf_until:
            return b""
        if command in (Command.MOTOR_SPEED, Command.SET_MOTOR_PWM):
            if command == Command.MOTOR_SPEED and len(payload) == 2:
                self._set_speed(int.from_bytes(payload, "little"), now)
            return b""
        self.play(iter(()))  # any other request ends the scan
        if command in (Command.SCAN, Command.FORCE_SCAN):
            return self._scan(_STANDARD, now, wait=command == Command.SCAN)
        if command == Command.EXPRESS_SCAN:
            return self._scan(_DENSE_BOOST, now) if self._knows_mode(payload) else b""
        if command == Command.RESET:
            self._reset(now)
            return b""
        return self._tell(command, payload)

    def _tell(self, command: int, payload: bytes) -> bytes:
        """Answers that are one packet."""
        if command == Command.GET_INFO:
            return _single(Answer.INFO, DeviceInfo(serial=_SERIAL).encode())
        if command == Command.GET_HEALTH:
            return _single(Answer.HEALTH, self._health.encode())
        if command == Command.GET_SAMPLERATE:
            periods = (int(mode.us_per_sample) for mode in S1_MODES)
            return _single(Answer.SAMPLERATE, struct.pack("<HH", *periods))
        if command == Command.GET_ACC_BOARD_FLAG:
            return _single(Answer.ACC, bytes(4))
        if command == Command.GET_LIDAR_CONF and not (self._options.silent_conf or self._options.legacy_only):
            return self._tell_conf(payload)
        return b""

    def _tell_conf(self, payload: bytes) -> bytes:
        """The entry asked for, of the mode asked for; nothing if there is no such."""
        entry, mode_id = payload[:4], int.from_bytes(payload[4:], "little")
        kind = int.from_bytes(entry, "little")
        if len(entry) < 4 or mode_id >= len(S1_MODES):
            return b""
        values = self._general_conf() | _mode_conf(S1_MODES[mode_id])
        return _single(Answer.CONF, entry + values[kind]) if kind in values else b""

    def _general_conf(self) -> dict[int, bytes]:
        options = self._options
        return {
            # Never empty: Slamtec's SDK 2.1 would crash.
            Conf.DESIRED_SPEED: struct.pack("<HH", options.rpm, 0),
            Conf.MIN_SPEED: struct.pack("<H", options.min_rpm),
            Conf.MAX_SPEED: struct.pack("<H", options.max_rpm),
            Conf.SCAN_MODE_COUNT: struct.pack("<H", len(S1_MODES)),
            Conf.TYPICAL: struct.pack("<H", _DENSE_BOOST.id),
            Conf.MAC: b"",  # there is no network
        }

    def _knows_mode(self, payload: bytes) -> bool:
        """DenseBoost, also as 0: so older SDKs of Slamtec ask for it."""
        return not self._options.legacy_only and len(payload) == 5 and payload[0] <= _DENSE_BOOST.id

    def _scan(self, mode: ScanMode, now: float, *, wait: bool = True) -> bytes:
        """Begin a scan; the descriptor comes at once, the samples when the motor is stable."""
        if self._health.status == _PROTECTION_STOP:
            return b""
        self._motor.coast(now)
        self._motor.wanted = self._motor.wanted or 6.0 * self._options.rpm
        self.packet_size = FORMATS[Answer(mode.answer_type)].size
        self.play(packets(mode, self._motor, self._room, self._options.baud, wait=wait))
        return Descriptor(mode.answer_type, self.packet_size, repeated=True).encode()

    def _set_speed(self, rpm: int, now: float) -> None:
        """Set another speed; 0 stops the motor and with it the scan."""
        self._motor.coast(now)
        if rpm == 0:
            self._motor.wanted = 0.0
            self.play(iter(()))
        else:
            self._motor.wanted = 6.0 * min(max(rpm, self._options.min_rpm), self._options.max_rpm)

    def _reset(self, now: float) -> None:
        self._set_speed(0, now)
        self._deaf_until = now + self._options.reset
        if not self._options.health_sticks:
            self._health = Health()


def _mode_conf(mode: ScanMode) -> dict[int, bytes]:
    return {
        Conf.US_PER_SAMPLE: struct.pack("<I", round(256 * mode.us_per_sample)),
        Conf.MAX_DISTANCE: struct.pack("<I", round(256 * mode.max_distance)),
        Conf.ANSWER_TYPE: bytes([mode.answer_type]),
        Conf.NAME: mode.name.encode() + b"\0",
    }


def _single(kind: Answer, data: bytes) -> bytes:
    return Descriptor(kind, len(data)).encode() + data
