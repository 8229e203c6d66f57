"""Questions to the sensor and their answers: repeated a few times, every wait with an end."""

import struct
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from lidarcore.rplidar.connection.port import Port
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.protocol import Answer, Command, Conf, Descriptor, request

ANSWER_TIME = 0.5  # s; a sensor takes a few ms, a busy computer longer to notice
CONF_TIME = 0.25  # s; shorter, because old sensors never answer these
LONGEST_ANSWER = 256  # bytes; anything longer is a false descriptor
STREAMS = {int(answer): layout.size for answer, layout in FORMATS.items()}  # bytes of a packet

T = TypeVar("T")


def ask(
    port: Port,
    command: Command,
    payload: bytes = b"",
    *,
    answer: Answer,
    size: int | None = None,
    echo: bytes = b"",
    tries: int = 3,
    patience: float = ANSWER_TIME,
) -> bytes | None:
    """The data of the answer, which must have that size and begin with that echo; none if none came."""
    for attempt in range(tries):
        if attempt:
            port.drain()  # else an answer that comes late is taken for the next one
        port.write(request(command, payload))
        data = _await(port, patience, lambda received: _find_answer(received, answer, size))
        if data is not None and data.startswith(echo):
            return data
    return None


def ask_conf(port: Port, entry: Conf, mode: int | None = None) -> bytes | None:
    """An entry of the sensor's configuration, of one of its scan modes if given; none if it does not say."""
    echo = struct.pack("<I", entry)
    payload = echo if mode is None else echo + struct.pack("<H", mode)
    question, answer = Command.GET_LIDAR_CONF, Answer.CONF
    data = ask(port, question, payload, answer=answer, echo=echo, tries=2, patience=CONF_TIME)
    return None if data is None else data[len(echo) :]


def ask_number(port: Port, entry: Conf, mode: int | None = None) -> int | None:
    """An entry of the configuration that is a number."""
    data = ask_conf(port, entry, mode)
    return None if data is None else int.from_bytes(data, "little")


def begin(port: Port, command: Command, payload: bytes = b"") -> tuple[Answer, bytes] | None:
    """Start a stream: its type and what came of it already; none if the sensor did not begin one."""
    port.write(request(command, payload))
    return _await(port, ANSWER_TIME, _find_stream)


def _await(port: Port, patience: float, find: Callable[[bytes], T | None]) -> T | None:
    received = b""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        received += port.read()
        if (found := find(received)) is not None:
            return found
    return None


def _find_answer(received: bytes, answer: Answer, size: int | None) -> bytes | None:
    for descriptor, rest in _descriptors(received):
        if descriptor.type != answer or descriptor.repeated:
            continue
        if descriptor.length == size or (size is None and descriptor.length <= LONGEST_ANSWER):
            return rest[: descriptor.length] if len(rest) >= descriptor.length else None
    return None


def _find_stream(received: bytes) -> tuple[Answer, bytes] | None:
    for descriptor, rest in _descriptors(received):
        if descriptor.repeated and STREAMS.get(descriptor.type) == descriptor.length:
            return Answer(descriptor.type), rest
    return None


def _descriptors(received: bytes) -> Iterator[tuple[Descriptor, bytes]]:
    """Whatever reads as a descriptor, with what follows it."""
    at = received.find(Descriptor.SYNC)
    while at >= 0:
        end = at + Descriptor.SIZE
        if descriptor := Descriptor.decode(received[at:end]):
            yield descriptor, received[end:]
        at = received.find(Descriptor.SYNC, at + 1)
