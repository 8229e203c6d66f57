"""What is said between opening the port and the first measurement: as Slamtec's SDK says it, but made to last.

A sensor left streaming by a killed program is silenced first, and nothing is asked before it is quiet, because one
dense capsule in 267 begins like a descriptor.
"""

import struct
import time
from dataclasses import replace

from lidarcore.errors import DeviceError, NoAnswerError, ProtectionStopError
from lidarcore.rplidar.connection.port import Port
from lidarcore.rplidar.connection.requests import STREAMS, ask, ask_conf, ask_number, begin
from lidarcore.rplidar.protocol import S1_MODES, Answer, Command, Conf, DeviceInfo, Health, ScanMode, request

COMMON_BAUDS = (256000, 115200, 460800, 1000000)
PATIENT = 5  # tries; fewer would fail on a sensor that is just starting
RESET_TIME = 0.5  # s, before it is worth asking; an S1 is deaf for about two
RESET_PATIENCE = 18  # tries, about 10 s
MOST_MODES = 16
PROTECTION_STOP = 2


def identify(port: Port, tries: int = PATIENT) -> DeviceInfo:
    """Silence the sensor and ask who it is. Raises NoAnswerError."""
    for _ in range(tries):
        if not silence(port):
            raise NoAnswerError(
                f"The bytes from {port.path} are not those of an RPLIDAR, or the baud rate is wrong: check that this "
                "is the right port and rate (256000 for an S1)."
            )
        if answer := ask(port, Command.GET_INFO, answer=Answer.INFO, size=DeviceInfo.SIZE, tries=1):
            return DeviceInfo.decode(answer)
    raise NoAnswerError(
        f"Nothing answers at {port.path}: check that the sensor has power (5 V; a weak USB port is not enough), "
        "that its cables are firm, and that this is the right port and baud rate (256000 for an S1)."
    )


def find_baud(port: Port) -> tuple[int, DeviceInfo] | None:
    """Another common baud rate at which an RPLIDAR answers here, and which it is."""
    for baud in COMMON_BAUDS:
        if baud == port.baud:
            continue
        port.set_baud(baud)
        try:
            return baud, identify(port, tries=1)
        except NoAnswerError:
            continue
    return None


def ensure_health(port: Port) -> Health:
    """Ask for the health; a sensor that stopped itself is reset once. Raises ProtectionStopError, NoAnswerError."""
    health = _ask_health(port)
    if health.status == PROTECTION_STOP:
        port.write(request(Command.RESET))
        port.cancelled.wait(RESET_TIME)
        identify(port, tries=RESET_PATIENCE)
        health = _ask_health(port)
    if health.status == PROTECTION_STOP:
        raise ProtectionStopError(
            f"The sensor at {port.path} has stopped itself for protection (health code {health.code}), and a reset "
            "did not help: unplug it, see that nothing blocks its turning head, plug it in; if that does not help, "
            "it is broken."
        )
    return health


def read_modes(port: Port) -> tuple[tuple[ScanMode, ...], int | None]:
    """The sensor's scan modes and the number of the one it recommends.

    An old sensor does not answer; its only mode is that of the legacy protocol.
    """
    count = ask_number(port, Conf.SCAN_MODE_COUNT) or 0
    modes = [mode for number in range(min(count, MOST_MODES)) if (mode := _read_mode(port, number))]
    if not modes:
        return (S1_MODES[0],), None
    return tuple(modes), ask_number(port, Conf.TYPICAL)


def choose_mode(modes: tuple[ScanMode, ...], typical: int | None, name: str | None) -> ScanMode:
    """The mode of that name, else the one recommended, else the first. Raises DeviceError."""
    if name is None:
        return next((mode for mode in modes if mode.id == typical), modes[0])
    for mode in modes:
        if mode.name.casefold() == name.casefold():
            return mode
    raise DeviceError(f"The sensor has no mode {name}: take {' or '.join(mode.name for mode in modes)}.")


def mode_sending(answer: Answer, asked: ScanMode, modes: tuple[ScanMode, ...]) -> ScanMode:
    """The mode that sends such answers: the one asked for, else one the sensor has, else one of an S1.

    A sensor may start in another mode than asked, and does where a capture of one is replayed.
    """
    known = (mode for mode in (asked, *modes, *S1_MODES) if mode.answer_type == answer)
    return next(known, replace(asked, answer_type=answer))


def start(port: Port, mode: ScanMode) -> tuple[Answer, bytes]:
    """Start measuring: the type of what will come, and what has come already. Raises NoAnswerError."""
    for _ in range(3):
        if mode.answer_type == Answer.NODES:
            begun = begin(port, Command.SCAN)
        else:
            begun = begin(port, Command.EXPRESS_SCAN, struct.pack("<BHH", mode.id, 0, 0))
        if begun:
            return begun
        silence(port)
    raise NoAnswerError(
        f"The sensor at {port.path} does not start measuring in mode {mode.name}: check its power, "
        "or take another mode."
    )


def set_speed(port: Port, rpm: int) -> None:
    """Turn at that speed; the sensor does not confirm it. 0 stops the motor and leaves the sensor idle."""
    port.write(request(Command.MOTOR_SPEED, struct.pack("<H", rpm)))


def silence(port: Port) -> bool:
    """Stop measuring, and wait until what was under way has arrived; False if there is no end to it."""
    for _ in range(2):  # the first may have come where the sensor waited for the rest of another request
        port.write(request(Command.STOP))
        if port.drain():
            return True
    return False


def stop(port: Port) -> None:
    """Stop measuring, then the motor: an S1 needs both."""
    port.write(request(Command.STOP))
    time.sleep(0.02)  # the protocol asks for 1 ms
    set_speed(port, 0)


def _ask_health(port: Port) -> Health:
    data = ask(port, Command.GET_HEALTH, answer=Answer.HEALTH, size=Health.SIZE)
    if data is None:
        raise NoAnswerError(
            f"The sensor at {port.path} does not report its health: check its power and cables."
        )
    return Health.decode(data)


def _read_mode(port: Port, number: int) -> ScanMode | None:
    us_q8 = ask_number(port, Conf.US_PER_SAMPLE, number)
    metres_q8 = ask_number(port, Conf.MAX_DISTANCE, number)
    answer_type = ask_number(port, Conf.ANSWER_TYPE, number)
    name = ask_conf(port, Conf.NAME, number)
    if not us_q8 or not metres_q8 or answer_type not in STREAMS or not name:
        return None
    text = name.split(b"\0")[0].decode("ascii", "replace")
    return ScanMode(number, text, us_q8 / 256, metres_q8 / 256, Answer(answer_type))
