"""A sensor that answers and measures what a real one did, as a raw capture has it."""

from collections.abc import Iterator
from pathlib import Path

from lidarcore.errors import RecordingError
from lidarcore.rplidar.capture import Stream, read_pieces, read_stream
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.emulation.device import EmulatedS1
from lidarcore.rplidar.emulation.options import EmulatorOptions
from lidarcore.rplidar.emulation.scan import Packet, Room
from lidarcore.rplidar.protocol import Answer, Command, Descriptor, Request, RequestReader, ScanMode

_SCANS = (Command.SCAN, Command.FORCE_SCAN, Command.EXPRESS_SCAN)


class Replay:
    """What is in a capture. Raises RecordingError if the file is none, or cannot be read.

    answers    bytes that came back on each request before the first scan
    announced  the capture has the beginning of the scan, with its descriptor
    stream     what was streaming already otherwise
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.answers: dict[Request, bytes] = {}
        self.announced = False
        self.stream = _stream(path)
        asked = None
        for _, event in self._events():
            if isinstance(event, Request):
                asked, self.answers[event], self.announced = event, b"", event.command in _SCANS
            elif asked is not None:
                self.answers[asked] += event
            if asked is None or self.announced:
                break

    def measurements(self) -> Iterator[Packet]:
        """All that came from the beginning of the first scan on, with times (s) since then."""
        begin = None
        for time, event in self._events():
            if isinstance(event, bytes):
                begin = time if begin is None and not self.announced else begin
                if begin is not None:
                    yield time - begin, event
            elif begin is None and event.command in _SCANS:
                begin = time

    def _events(self) -> Iterator[tuple[float, Request | bytes]]:
        """Unix time (s), and either a request to the sensor or bytes from it."""
        requests = RequestReader()
        with self._path.open("rb") as file:
            read_stream(file)
            for direction, time, data in read_pieces(file):
                if direction == "in":
                    yield time, data
                else:
                    yield from ((time, request) for request in requests.feed(data))


class ReplayedS1(EmulatedS1):
    """Answers as captured where the capture has that question, and sends what was measured, once."""

    def __init__(self, options: EmulatorOptions, replay: Replay, room: Room, now: float) -> None:
        self._replay = replay
        super().__init__(options, room, now)

    def _tell(self, command: int, payload: bytes) -> bytes:
        question = Request(command, payload)
        if question in self._replay.answers:  # maybe with nothing: old sensors do not know every question
            return self._replay.answers[question]
        return super()._tell(command, payload)

    def _scan(self, mode: ScanMode, now: float, *, wait: bool = True) -> bytes:
        self.play((now + time, data) for time, data in self._replay.measurements())
        if self._replay.announced:
            return b""
        kind = Answer(self._replay.stream.answer_type or mode.answer_type)
        return Descriptor(kind, FORMATS[kind].size, repeated=True).encode()


def _stream(path: Path) -> Stream:
    try:
        with path.open("rb") as file:
            stream = read_stream(file)
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be replayed: {error.strerror}. Give a capture, as `lidarcore record --raw` writes it."
        ) from error
    if stream.answer_type not in (None, *FORMATS):
        raise RecordingError(f"{path} cannot be replayed: there is no scan of type {stream.answer_type}.")
    return stream
