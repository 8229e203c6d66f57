"""Trials on all cores; what comes out does not depend on how many there are."""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

Trial = TypeVar("Trial")
Outcome = TypeVar("Outcome")


def run_all(
    function: Callable[[Trial], Outcome],
    trials: Iterable[Trial],
    workers: int,
    done: Callable[[], None] = lambda: None,
) -> list[Outcome]:
    """The outcome of each trial, in their order; `done` is called as each ends. One worker needs no other process."""
    if workers == 1:
        return [_told(function(trial), done) for trial in trials]
    # Spawned, not forked: threads of numerical libraries do not survive a fork.
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        futures = [pool.submit(function, trial) for trial in trials]
        try:
            for future in as_completed(futures):
                _told(future.result(), done)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return [future.result() for future in futures]


def _told(outcome: Outcome, done: Callable[[], None]) -> Outcome:
    done()
    return outcome
