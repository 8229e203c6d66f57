"""The acquisition thread: owns the source and hands its scans over when they are due."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from lidarcore.threads import join

from ..records import record
from .source import END_WITHIN, DeviceStatus, Source
from .timed_scan import Position, SourceKind, TimedScan

State = Literal["loading", "playing", "paused", "ended", "error"]
LATE = 0.05  # s behind the stamps after which they are not caught up with: no bursts after a stall
LOOP_PAUSE = 0.5  # s that the last scan stays before a loop begins again


@dataclass(frozen=True, slots=True)
class SourceStatus:
    """What plays, where it is, and how."""

    kind: SourceKind
    live: bool
    device: DeviceStatus | None
    recording: str | None
    topic: str | None
    topics: tuple[str, ...]
    format: str | None
    notes: tuple[str, ...]
    state: State
    error: str | None
    index: int
    count: int | None
    complete: bool
    time: float
    duration: float | None
    speed: float
    loop: bool


class Player:
    """Plays a recording by its stamps, a live source as it comes: pause, step, seek, speed, loop; from any thread.

    hand_over   takes each scan when it is due
    is_idle     whether the last scan handed over has been dealt with: the pace at speed 0
    changed     called after every change of state that is not just the next scan
    """

    def __init__(
        self,
        source: Source,
        hand_over: Callable[[TimedScan], None],
        is_idle: Callable[[], bool],
        changed: Callable[[], None],
    ) -> None:
        self._source, self._paused = source, False
        self._hand_over, self._is_idle, self._on_change = hand_over, is_idle, changed
        self._opened = 0  # how many sources before this one
        self._seeks = 0
        self._index = 0
        self._wanted = True  # the scan at the index is still to be handed over
        self._ended = False
        self._shown_at = 0.0
        self._speed, self._loop = 1.0, True
        self._closed = False
        self._condition = threading.Condition(threading.RLock())
        self._thread = threading.Thread(target=self._run, name="player", daemon=True)

    def start(self) -> None:
        """Play what was given, or opened meanwhile."""
        with self._condition:
            self._source.start(self.wake, self._on_change)
            self._thread.start()

    def close(self) -> None:
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._source.close()
        join(self._thread, END_WITHIN)

    @property
    def source(self) -> Source:
        """What plays."""
        return self._source

    def wake(self) -> None:
        """Something that the thread may be waiting for has happened."""
        with self._condition:
            self._condition.notify()

    def open(self, source: Source, index: int = 0, paused: bool = False) -> None:
        """Play another source from the given index."""
        with self._condition:
            before, self._source, self._paused = self._source, source, paused
            self._opened += 1
            self._seek(index)
            if self._thread.is_alive():
                source.start(self.wake, self._on_change)
        self._on_change()
        before.close()  # takes a while if a motor has to be stopped

    def control(
        self,
        state: Literal["playing", "paused"] | None = None,
        index: int | None = None,
        speed: float | None = None,
        loop: bool | None = None,
    ) -> None:
        """Change what is given. Playing on after the end starts again from the beginning."""
        with self._condition:
            if state is not None:
                self._paused = state == "paused"
                self._wanted |= self._paused  # with the settings of now: no later scan will come
            if index is not None or (state == "playing" and self._ended):
                self._seek(index or 0)
            self._speed = self._speed if speed is None else speed
            self._loop = self._loop if loop is None else loop
            self._shown_at = time.monotonic()
            self._condition.notify()
        self._on_change()

    def step(self, by: int) -> None:
        """Pause, and go that many scans on or back."""
        with self._condition:
            self._paused = True
            self._seek(self._index + by)
        self._on_change()

    def refresh(self) -> None:
        """Hand the current scan over again, unless the next one comes anyway."""
        with self._condition:
            if self._paused or self._ended or self._source.live:
                self._wanted = True
                self._condition.notify()

    def status(self) -> SourceStatus:
        """What plays, where it is, and how."""
        with self._condition:
            source, index = self._source, self._index
            return record(
                SourceStatus,
                source,
                device=source.device(),
                recording=source.name,
                state=self._state(),
                index=index,
                count=self._count(),
                time=source.time(index) if self._there(index) else 0.0,
                speed=self._speed,
                loop=self._loop,
            )

    def _state(self) -> State:
        if self._ended:
            return "error" if self._source.error else "ended"
        if self._wanted and not self._there(self._index):
            return "loading"
        return "paused" if self._paused else "playing"

    def _there(self, index: int) -> bool:
        return index < self._source.count

    def _count(self) -> int | None:
        """How many scans there are; None where there is no end."""
        return None if self._source.live else self._source.count

    def _seek(self, index: int) -> None:
        self._index = self._source.nearest(index)
        self._seeks += 1
        self._wanted, self._ended = True, False
        self._condition.notify()

    def _run(self) -> None:
        with self._condition:
            while not self._closed:
                self._condition.wait(self._advance())

    def _advance(self) -> float | None:
        """Do what is due; return the seconds until more is, or None if that takes a change of some kind."""
        if self._wanted:
            self._index = self._source.nearest(self._index)
            if not self._show(time.monotonic()):
                return None
        if self._paused or self._ended:
            return None
        if self._source.live:
            self._catch_up()
            return None
        following = self._index + 1
        if not self._there(following):
            if not self._source.complete:
                return None
            if not self._loop:
                self._ended = True
                self._on_change()
                return None
            return self._due(0, LOOP_PAUSE)
        return self._due(following, self._source.time(following) - self._source.time(self._index))

    def _catch_up(self) -> None:
        """Show the newest, unless it is shown already."""
        newest = self._source.count - 1
        if newest > self._index:
            self._index = newest
            self._show(time.monotonic())

    def _due(self, index: int, interval: float) -> float | None:
        """Go to the index once the interval at the present speed is over."""
        if self._speed == 0:
            return self._go(index, time.monotonic()) if self._is_idle() else None
        due = self._shown_at + interval / self._speed
        wait = due - time.monotonic()
        return wait if wait > 0 else self._go(index, due)

    def _go(self, index: int, due: float) -> float:
        self._index = index
        self._show(max(due, time.monotonic() - LATE))
        return 0.0

    def _show(self, at: float) -> bool:
        scan = self._source.scan(self._index)
        if scan is None:
            return False
        self._wanted, self._shown_at = False, at
        position = Position(self._source.kind, self._index, self._count(), self._source.time(self._index))
        # What is looked at again is not late.
        arrival = time.monotonic() if self._paused else self._source.arrival(self._index)
        name = self._source.name or self._source.kind
        self._hand_over(TimedScan(scan, name, position, self._opened, self._seeks, arrival))
        return True
