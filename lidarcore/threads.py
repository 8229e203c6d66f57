"""What threads that run all the time have in common: how they fail, and how they end."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess

logger = logging.getLogger(__name__)


class FailureLog:
    """Logs a failure once until it works again: one bad scan ends nothing, and a thousand do not fill the log."""

    def __init__(self, message: str) -> None:
        self._message, self._failing = message, False

    @contextmanager
    def __call__(self, *details: object) -> Iterator[None]:
        """Go on after what fails in this context; `details` fill in the message."""
        try:
            yield
        except Exception:
            if not self._failing:
                logger.exception(self._message, *details)
            self._failing = True
        else:
            self._failing = False


def join(thread: threading.Thread | BaseProcess, within: float) -> bool:
    """Wait at most so long (s) for a thread or process to end; whether it has, and a warning in the log if not."""
    if thread is threading.current_thread() or not thread.is_alive():
        return not thread.is_alive()
    thread.join(within)
    if thread.is_alive():
        logger.warning("%r has not ended within %g s", thread.name, within)
    return not thread.is_alive()
