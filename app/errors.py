"""What can go wrong with what the application keeps; every message says what was found and what to do about it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from lidarcore import LidarError


class NotFoundError(LidarError):
    """There is nothing of that name."""


class NotYetError(LidarError):
    """There is nothing yet, but will be."""


class ConflictError(LidarError):
    """Something cannot be done now: a name is taken, or something else is under way."""


class InvalidNameError(LidarError):
    """A name is no plain file name."""


class TooLargeError(LidarError):
    """More bytes than are allowed."""


class StorageError(LidarError):
    """The disk refused."""


@contextmanager
def storing(trouble: str) -> Iterator[None]:
    """Turn what the disk refuses into a StorageError: the trouble, and why."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"{trouble}: {error.strerror}.") from error


class InvalidValues(Protocol):
    """Pydantic's ValidationError, and what wraps one."""

    def errors(self) -> Sequence[Any]:
        """Every value that is not valid: `loc` and `msg`."""


_PLACES = ("body", "query", "path")  # of a request: what the value is called says enough
_NO_BODY = ("missing", "dict_type", "model_attributes_type")
NO_BODY = "Send a JSON body, with the header Content-Type: application/json."
_NO_OBJECT = 'The body is JSON, but no object: send one, {"name": value}, with the names that /docs tells.'


def invalid_values(error: InvalidValues) -> list[tuple[list[str], str]]:
    """Every value that is not valid: the names that lead to it, and what is wrong with it."""
    return [(_path(e), _wrong(e)) for e in error.errors()]


def _path(error: Any) -> list[str]:
    return [] if _is_no_json(error) else [str(part) for part in error["loc"] if part not in _PLACES]


def _is_no_json(error: Any) -> bool:
    """Whether a body cannot be read as JSON: it names no value then, but where reading failed."""
    return bool(error["type"] == "json_invalid" and error["loc"][:1] == ("body",))


def _wrong(error: Any) -> str:
    if _is_no_json(error):
        return f"The body is not valid JSON: {error['ctx']['error']} (character {error['loc'][1] + 1})."
    if error["loc"] == ("body",) and error["type"] in _NO_BODY:
        return NO_BODY if error["input"] is None or isinstance(error["input"], bytes) else _NO_OBJECT
    return str(error["msg"]).removeprefix("Value error, ")


def explained(error: InvalidValues) -> str:
    """Every value that is not valid in a line: its dotted name and what is wrong with it."""
    return "; ".join(": ".join(filter(None, (".".join(path), what))) for path, what in invalid_values(error))
