"""What a recording holds, found by reading all of it once."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock

from lidarcore import LidarError, RecordingError, TopicError, open_recording

from ..isolation import Isolated
from .recorded import PERIOD

MOST = 500  # recordings of which the facts are kept
_READING = Lock()  # one at a time: reading takes a core


@dataclass(frozen=True, slots=True)
class RecordingFacts:
    """Format, sensor and lidars (by topic) where it names them, how many scans, and the s from the first to the last.

    scans and duration are None, and `problem` says why, if that is not known.
    """

    format: str | None
    sensor: str | None
    topics: tuple[str, ...]
    scans: int | None
    duration: float | None
    problem: str | None = None


def facts(path: Path) -> RecordingFacts:
    """Read the recording, in a process of its own, unless it is known and has not changed. For any thread."""
    status = path.stat()
    with _READING:
        return _read(path, status.st_size, status.st_mtime_ns)


@lru_cache(MOST)
def _read(path: Path, size: int, modified: int) -> RecordingFacts:
    found: list[RecordingFacts] = []
    try:
        found.extend(Isolated(path.name, RecordingError, _facts, path))
    except TopicError as error:
        return RecordingFacts(
            None, None, tuple(error.topics), None, None, "It holds several lidars: choose one."
        )
    except LidarError as error:
        begun = found[-1] if found else RecordingFacts(None, None, (), None, None)
        return replace(begun, scans=None, duration=None, problem=str(error))
    return found[-1]


def _facts(path: Path) -> Iterator[RecordingFacts]:
    """The facts as far as it is read, now and then, and in the end."""
    recording = open_recording(path)
    scans, duration, before = 0, 0.0, 0.0
    for scan in recording:
        step = scan.stamp - before if scans else 0.0
        duration += step if step > 0 or not scans else PERIOD
        scans, before = scans + 1, scan.stamp
        if scans % 500 == 0:
            yield RecordingFacts(recording.name, recording.sensor, recording.topics, scans, duration)
    yield RecordingFacts(recording.name, recording.sensor, recording.topics, scans, duration)
