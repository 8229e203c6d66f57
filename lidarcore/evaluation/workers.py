"""Chunks of a study on all cores, or on a Dask cluster; what comes out does not depend on how many there are."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from multiprocessing import get_context, parent_process
from typing import TypeVar

from lidarcore.errors import EvaluationError

Chunk = TypeVar("Chunk")
Outcome = TypeVar("Outcome")


def outcomes(
    function: Callable[[Chunk], Outcome], chunks: Iterable[Chunk], workers: int, scheduler: str | None = None
) -> Generator[tuple[Chunk, Outcome]]:
    """Each chunk with what the function makes of it, as they come ready.

    With the address of a Dask scheduler, such as tcp://host:8786, its workers do the work; they need this package.
    Raises EvaluationError if no scheduler answers there, or dask.distributed is not installed.
    """
    if scheduler is not None:
        yield from _on_cluster(function, chunks, scheduler)
    elif workers == 1:
        yield from ((chunk, function(chunk)) for chunk in chunks)
    else:
        yield from _on_cores(function, chunks, workers)


def run_all(
    function: Callable[[Chunk], Outcome],
    chunks: Iterable[Chunk],
    workers: int,
    done: Callable[[], None] = lambda: None,
) -> list[Outcome]:
    """The outcome of each chunk, in their order; `done` is called as each ends."""
    numbered = list(enumerate(chunks))
    ordered: dict[int, Outcome] = {}
    with closing(outcomes(partial(_of_numbered, function), numbered, workers)) as made:
        for (number, _), outcome in made:
            ordered[number] = outcome
            done()
    return [ordered[number] for number, _ in numbered]


def _of_numbered(function: Callable[[Chunk], Outcome], chunk: tuple[int, Chunk]) -> Outcome:
    return function(chunk[1])


def _on_cores(
    function: Callable[[Chunk], Outcome], chunks: Iterable[Chunk], workers: int
) -> Generator[tuple[Chunk, Outcome]]:
    # Spawned, not forked: threads of numerical libraries do not survive a fork.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _end_with_parent)
    with _interrupts_blocked():
        futures = {pool.submit(function, chunk): chunk for chunk in chunks}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    """Nothing else ends a worker whose parent was killed: the pipe that it waits at is held open by itself."""
    threading.Thread(target=_wait_for_parent, name="parent", daemon=True).start()


def _wait_for_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Processes started in the block never see Ctrl-C; this one sees it when the block ends, and winds them up."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _on_cluster(
    function: Callable[[Chunk], Outcome], chunks: Iterable[Chunk], scheduler: str
) -> Generator[tuple[Chunk, Outcome]]:
    try:  # an extra: few need a cluster, and it takes a second to import
        from distributed import Client
        from distributed import as_completed as dask_as_completed
    except ImportError as error:
        raise EvaluationError(
            "A Dask scheduler needs dask.distributed: pip install 'lidarcore[cluster]'."
        ) from error
    with ExitStack() as stack:
        try:
            client = stack.enter_context(Client(scheduler, timeout=5, set_as_default=False))
        except (OSError, ValueError) as error:
            raise EvaluationError(
                f"No Dask scheduler answers at {scheduler!r}: {error}. Give its address, such as tcp://host:8786."
            ) from error
        futures = dict(zip(client.map(function, chunks := list(chunks), pure=False), chunks, strict=True))
        stack.callback(client.cancel, list(futures))
        for future in dask_as_completed(futures, loop=client.loop):
            yield futures[future], future.result()
