"""Pictures that take long to make, in a thread of their own: a scan never waits for one."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from lidarcore.threads import FailureLog


class Painter:
    """Paints what was asked for last; what waits when something newer comes is never painted."""

    def __init__(self) -> None:
        self._wanted: Callable[[], None] | None = None
        self._failures = FailureLog("a picture could not be painted")
        self._thread = ThreadPoolExecutor(1, "painter")

    def paint(self, picture: Callable[[], None]) -> None:
        """Paint a picture, by calling it, as soon as the one at hand is done; returns at once."""
        self._wanted = picture
        self._thread.submit(self._work, picture)

    def close(self) -> None:
        """Wait for the picture at hand, and paint no more."""
        self._thread.shutdown(cancel_futures=True)

    def _work(self, picture: Callable[[], None]) -> None:
        if picture is self._wanted:
            with self._failures():
                picture()
