"""Waiting for what is to come true, and ports that stay free: with limits that only a failure meets."""

import random
import socket
import time
from collections.abc import Callable

PATIENCE = 60.0  # s; a busy machine may need several for what takes one of half a second
PORTS = range(20_000, 30_000)  # below those that the system gives to connections


def wait_until(
    holds: Callable[[], object], what: str = "what was waited for", seconds: float = PATIENCE
) -> None:
    """Wait for a condition; fail saying what did not come true."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
        time.sleep(0.02)


def free_port() -> int:
    """A port that no connection takes by chance, so that it is still free when a server comes for it."""
    while True:
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port := random.choice(PORTS)))
            except OSError:
                continue
            return port


def soonest(measure: Callable[[], float], limit: float, tries: int = 12) -> float:
    """The least of several durations (s), as soon as one is within the limit: what a busy machine adds is not ours."""
    least = measure()
    for _ in range(tries - 1):
        if least <= limit:
            break
        least = min(least, measure())
    return least
