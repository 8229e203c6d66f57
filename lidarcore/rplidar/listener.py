"""Revolutions from all that an RPLIDAR sent and was sent, without asking it anything: for captures."""

import re
from collections import Counter

from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.protocol import (
    S1_MODES,
    Answer,
    Command,
    Descriptor,
    RequestReader,
    Revolution,
    StreamDecoder,
)

_BEGINNINGS = {
    Descriptor(answer, layout.size, repeated=True).encode(): answer for answer, layout in FORMATS.items()
}
BEGINNING = re.compile(b"|".join(map(re.escape, _BEGINNINGS)))
"""The descriptor of a scan."""

_HARMLESS = (Command.MOTOR_SPEED, Command.SET_MOTOR_PWM)  # a scan goes on
_PERIODS = {mode.answer_type: mode.us_per_sample for mode in S1_MODES}
_PERIOD = 125.0  # us, of most modes of other models


class Listener:
    """Decodes the scan of each descriptor that announces one, until the next request.

    answer_type, us_per_sample  of what is streaming already when it begins to listen; None if unknown
    baud                        of the line
    """

    def __init__(
        self, answer_type: int | None = None, us_per_sample: float | None = None, baud: int = 256000
    ) -> None:
        self._dropped: Counter[str] = Counter()
        self._answer_type, self._us_per_sample, self._baud = answer_type, us_per_sample, baud
        self._decoder = self._decoding(answer_type) if answer_type else None
        self._requests = RequestReader()
        self._before = b""

    def sent(self, data: bytes) -> None:
        """The sensor was sent these bytes."""
        if any(request.command not in _HARMLESS for request in self._requests.feed(data)):
            self._end()

    def received(self, data: bytes, arrival: float) -> list[Revolution]:
        """The revolutions that are completed by these bytes of the sensor; arrival in s."""
        revolutions: list[Revolution] = []
        known = len(self._before)  # a descriptor may have begun in what was fed already
        data = self._before + data
        while match := BEGINNING.search(data):
            revolutions += self._feed(data[known : match.start()], arrival)
            self._end()
            self._decoder = self._decoding(_BEGINNINGS[match[0]])
            data, known = data[match.end() :], 0
        revolutions += self._feed(data[known:], arrival)
        self._before = data[-Descriptor.SIZE + 1 :]
        return revolutions

    def close(self) -> Counter[str]:
        """What was dropped in all, by reason as in Counts."""
        self._end()
        return self._dropped

    def _feed(self, data: bytes, arrival: float) -> list[Revolution]:
        return self._decoder.feed(data, arrival) if self._decoder and data else []

    def _decoding(self, answer_type: int) -> StreamDecoder:
        given = self._us_per_sample if answer_type == self._answer_type else None
        return StreamDecoder(answer_type, given or _PERIODS.get(Answer(answer_type), _PERIOD), self._baud)

    def _end(self) -> None:
        if self._decoder:
            self._dropped += self._decoder.statistics.dropped
        self._decoder = None
