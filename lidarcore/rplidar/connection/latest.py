"""The newest revolutions, handed from the thread that reads to whoever takes them."""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """A queue that never makes the giver wait: beyond `size` items the oldest is dropped and counted as an overrun."""

    def __init__(self, size: int) -> None:
        self.overruns = 0
        self._items: deque[T] = deque(maxlen=size)
        self._changed = threading.Condition()
        self._closed = False

    def put(self, item: T) -> None:
        """Append; dropping the oldest if it is full."""
        with self._changed:
            self.overruns += len(self._items) == self._items.maxlen
            self._items.append(item)
            self._changed.notify()

    def get(self) -> T | None:
        """The oldest, waiting for one; None once it is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed)
            return None if self._closed else self._items.popleft()

    def close(self) -> None:
        """Let go whoever waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
