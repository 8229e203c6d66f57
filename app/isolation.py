"""Foreign files are read in a process of their own: it may take MEMORY and QUIET, and is killed beyond that."""

import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Lock
from typing import Generic, TypeVar

from lidarcore import LidarError
from lidarcore.threads import join

MEMORY = 1 << 30  # bytes of data in the process
QUIET = 60.0  # s without an item, after which it is taken to be stuck
END_WITHIN = 5.0  # s that a process may take to go once it is killed

Item = TypeVar("Item")

# A server of processes that has the readers loaded already: a fork of it takes milliseconds, and has no threads.
_processes = get_context("forkserver")
_processes.set_forkserver_preload(["__main__", "lidarcore.recordings"])


class Isolated(Generic[Item]):
    """What a generator function yields for a file, in a process of its own. Iterate once, in one thread; then close.

    Iterating raises what the function raises of LidarError, and `error` if the process takes more than MEMORY,
    yields nothing for QUIET, or dies.
    """

    def __init__(
        self, name: str, error: type[LidarError], function: Callable[..., Iterator[Item]], *arguments: object
    ) -> None:
        """`name` is of the file, for the messages; function and arguments must be picklable."""
        self._name, self._error, self._lock = name, error, Lock()
        self._connection, sending = _processes.Pipe(duplex=False)
        self._process = _processes.Process(target=_work, args=(sending, function, arguments), daemon=True)
        self._process.start()
        sending.close()

    def __iter__(self) -> Iterator[Item]:
        return self

    def __next__(self) -> Item:
        try:
            if not self._connection.poll(QUIET):
                raise self._stopped(f"nothing could be read from it for {QUIET:g} s")
            item, error, is_over = self._connection.recv()
        except (EOFError, OSError) as gone:  # the latter also if it was closed by another thread
            raise self._stopped("the process that read it died") from gone
        if error is None and not is_over:
            return item  # type: ignore[no-any-return]
        self.close()
        if isinstance(error, MemoryError):
            raise self._stopped(f"it takes more than {MEMORY >> 20} MiB of memory")
        raise error or StopIteration

    def kill(self) -> None:
        """End the process, whatever it does: whoever iterates is told that it died. Any thread may call this."""
        self._process.kill()

    def close(self) -> None:
        """End the process, and give up what connects to it. Any thread may call this."""
        self.kill()
        join(self._process, END_WITHIN)
        with self._lock:  # closed twice at a time, it would close what has its number since
            self._connection.close()

    def _stopped(self, why: str) -> LidarError:
        self.close()
        return self._error(f"Reading {self._name} was stopped: {why}.")


def _work(
    sending: Connection, function: Callable[..., Iterator[Item]], arguments: tuple[object, ...]
) -> None:
    """The process: send (item, None, False) for each item, at last (None, error or None, True)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that reads of us
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    end: Exception | None = None
    with suppress(BrokenPipeError):  # nobody wants more
        try:
            for item in function(*arguments):
                sending.send((item, None, False))
        except BrokenPipeError:
            raise
        except LidarError as error:
            end = MemoryError() if isinstance(error.__cause__, MemoryError) else error
        except Exception as error:
            end = error
        sending.send((None, end, True))
