"""JSON read item by item: as Python's objects, a document takes ten times the size of its text."""

import json
import re
from collections.abc import Callable, Iterator
from typing import Any, TextIO, TypeVar

PIECE = 1 << 16  # characters that are read at a time
LONGEST = 1 << 20  # characters of a value that is taken as a whole

_AFTER = re.compile(r"[ \t\n\r,:\]}]")
_SPACE = re.compile(r"[ \t\n\r]*")
_DECODER = json.JSONDecoder()
T = TypeVar("T")


class JsonReader:
    """What is next in a text file of JSON.

    Raises ValueError (from any method) if that is no JSON or a value is longer than LONGEST, and RecursionError if it
    is nested too deeply.
    """

    def __init__(self, file: TextIO) -> None:
        self._file, self._text, self._at = file, "", 0

    def next(self) -> str:
        """The next character that is no space, left where it is; "" at the end."""
        self._skip_space()
        while self._at == len(self._text) and self._fill():
            self._skip_space()
        return self._text[self._at : self._at + 1]

    def value(self) -> Any:
        """Take a whole value."""
        self.next()
        while True:
            try:
                value, end = _DECODER.raw_decode(self._text, self._at)
            except json.JSONDecodeError:
                if not self._fill():
                    raise
            else:
                if _AFTER.match(self._text, end) or not self._fill():  # else a number may go on
                    self._at = end
                    return value

    def members(self) -> Iterator[str]:
        """The names of an object's members; what each stands for is to be taken before the next."""
        return self._between("{", "}", self._name)

    def items(self) -> Iterator[Any]:
        """The items of a list."""
        return self._between("[", "]", self.value)

    def _between(self, begin: str, end: str, take: Callable[[], T]) -> Iterator[T]:
        self._skip(begin)
        is_over = self.next() == end and self._skip(end) == end
        while not is_over:
            yield take()
            is_over = self._skip("," + end) == end

    def _name(self) -> str:
        name = self.value()
        if not isinstance(name, str):
            raise ValueError(f"{name!r} where the name of a member should be")
        self._skip(":")
        return name

    def _skip(self, expected: str) -> str:
        """Take the next character, one of those expected."""
        found = self.next()
        if not found or found not in expected:
            raise ValueError(f"{found or 'the end'} where {' or '.join(expected)} should be")
        self._at += 1
        return found

    def _skip_space(self) -> None:
        if space := _SPACE.match(self._text, self._at):
            self._at = space.end()

    def _fill(self) -> bool:
        """Read on, twice as far each time that nothing could be taken; False at the end of the file."""
        rest = self._text[self._at :]
        if len(rest) > LONGEST:
            raise ValueError(f"a value is longer than {LONGEST} characters")
        more = self._file.read(max(PIECE, len(rest)))
        if more:
            self._text, self._at = rest + more, 0
        return bool(more)
