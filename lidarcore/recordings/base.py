"""What every recording offers, whatever its format."""

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import ClassVar

from lidarcore.body_mask import Sector, masked
from lidarcore.errors import LidarError, RecordingError, ScanError, TopicError
from lidarcore.files import reason
from lidarcore.files.streams import MEBIBYTE, available, open_stream, whole
from lidarcore.scan import Array, Scan

MOST_BEAMS = 1 << 18
"""Beams of a scan at most: ten times those of the densest 2D lidar."""

MOST_NOTES = 100
"""Kinds of oddities that are counted one by one."""


class Recording(ABC):
    """Scans from a file, read lazily and as often as wanted: `for scan in recording`.

    name            of the format
    path            of the file or directory
    topics          the lidars in the file, where the format names them; topic: the one that is read
    sensor          model of the lidar, where the file or its format says so, else None
    T_base_sensor   (3,) x m, y m, yaw rad of the sensor in the robot's base frame; None if the file has none
    mask            sectors of the robot's own body, left out of every scan; those kept in the file, else ()
    stations        numbers of the scans from which on the sensor stood at another place, as far as the file says so
                    and the iteration has come; () if it says nothing
    is_corrected    whether the odometry of scans is poses that someone has corrected, which are their truth, too

    Iterating raises RecordingError if the file holds no scan or turns out hostile. What can be saved of a
    damaged or truncated file is yielded, and `notes` say so. Iterate in one place at a time: an iteration
    starts the counts in `notes` again.

    A format is a module of this package with a concrete subclass: `name`, `signature`, `_open`, `_scans`; packages in
    it export theirs.
    """

    name: ClassVar[str]
    signature: ClassVar[re.Pattern[bytes]]
    """Found in the beginning of every file of the format, and of no other."""
    sensor: str | None = None

    def __init__(self, path: Path, topic: str | None = None) -> None:
        self.path = path
        self.topics: tuple[str, ...] = ()
        self.topic: str | None = None
        self.T_base_sensor: Array | None = None
        self.mask: tuple[Sector, ...] = ()
        self.is_corrected = False
        self._stations: list[int] = []
        self._remarks: dict[str, None] = {}
        self._counts: Counter[str] = Counter()
        with self._guard():
            self._open(topic)

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Say whether the file is of this format; `head` is its beginning, unpacked; a directory has none."""
        return cls.signature.search(head) is not None

    @abstractmethod
    def _open(self, topic: str | None) -> None:
        """Find out what the file holds, and call `_choose`."""

    @abstractmethod
    def _scans(self) -> Iterator[Callable[[], Scan]]:
        """Yield what makes each scan: one that turns out damaged is then counted and left out."""

    def __repr__(self) -> str:
        topic = f", topic {self.topic}" if self.topic else ""
        return f"<{self.name} {self.path}{topic}>"

    @property
    def stations(self) -> tuple[int, ...]:
        """Scans from which on the sensor stood elsewhere."""
        return tuple(self._stations)

    @property
    def notes(self) -> tuple[str, ...]:
        """Plain sentences on what was found and handled; the counts in them grow during an iteration."""
        return (*self._remarks, *(_counted(what, count) for what, count in self._counts.items()))

    def __iter__(self) -> Iterator[Scan]:
        self._counts.clear()
        self._stations.clear()
        empty = True
        with self._guard():
            for make_scan in self._scans():
                try:
                    scan = make_scan()
                except ScanError as error:
                    self._count(f"damaged scans left out ({error})", 1)
                else:
                    empty = False
                    yield masked(scan, self.mask)
        if empty:
            raise self._error("holds no readable scan.")

    def _choose(self, topics: Iterable[str], topic: str | None) -> None:
        """Settle on the topic to read: the one asked for, or the only one. A format without topics has ()."""
        self.topics = tuple(sorted(topics))
        listed = " or ".join(self.topics) or "none, the format has no topics"
        if topic is None and len(self.topics) <= 1:
            self.topic = next(iter(self.topics), None)
        elif topic is None:
            raise TopicError(
                f"{self.path.name} holds several lidars: choose {listed} (--topic, or topic= in Python).",
                self.topics,
            )
        elif topic in self.topics:
            self.topic = topic
        else:
            raise TopicError(f"{self.path.name} has no lidar {topic!r}: choose {listed}.", self.topics)

    def _remark(self, sentence: str) -> None:
        self._remarks[sentence] = None

    def _count(self, what: str, number: int) -> None:
        """Count so many of what is named in the plural: "damaged lines left out"."""
        if number:
            is_counted = what in self._counts or len(self._counts) < MOST_NOTES
            self._counts[what if is_counted else "other oddities"] += number

    def _error(self, trouble: str) -> RecordingError:
        """Make an error that also tells what was noted so far."""
        return RecordingError(" ".join([f"{self.path.name} {trouble}", *self.notes]))

    def _stream(self) -> BufferedReader:
        return open_stream(self.path, self._remark)

    def _content(self) -> bytes:
        """Read the whole file, for the formats that cannot be read piece by piece."""
        with self._stream() as stream:
            most = whole(self.path)
            content = available(stream, most, most)
            if stream.read(1):
                raise self._error(
                    f"is larger than {most // MEBIBYTE} MiB, too large for {self.name}: give a part of it, "
                    "or, if it is packed, unpack it."
                )
        return content

    def _check_beams(self, number: int) -> None:
        """Raise RecordingError if a scan has more beams than any lidar."""
        if number > MOST_BEAMS:
            raise self._error(f"holds a scan of more than {MOST_BEAMS} beams: no 2D lidar sends so many.")

    @contextmanager
    def _guard(self) -> Iterator[None]:
        """Turn whatever a decoder raises on a broken or hostile file into a RecordingError."""
        try:
            yield
        except LidarError:
            raise
        except Exception as error:
            raise self._error(f"cannot be read as {self.name}: {reason(error)}.") from error


def _counted(what: str, number: int) -> str:
    """'2 damaged lines left out.', '1 damaged line left out.': the first plural is that of what was counted."""
    if number == 1:
        what = re.sub(r"(ie)?(?<!s)s\b", lambda ending: "y" if ending[1] else "", what, count=1)
    return f"{number} {what}."
