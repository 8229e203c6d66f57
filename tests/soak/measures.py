"""What a server takes, minute by minute, and whether it grew."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from statistics import median, quantiles

import psutil

EVERY = 1.0  # s between two looks
TOGETHER = 60.0  # s of which the median is taken
# How much more there may be at the end than in the minute after `warm`, and what more a minute in between.
BANDS = {
    "memory MB": (30.0, 1.0), "files": (10, 0), "threads": (5, 0), "processes": (2, 0),
    "p50 ms": (10, 0), "p95 ms": (50, 0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Look:
    """At one moment; memory of the server alone, since what reads files ends."""

    memory: float  # MB
    files: int
    threads: int
    processes: int
    latency: float  # ms


class Measures:
    """Of a server."""

    def __init__(self, process: psutil.Process, warm: float) -> None:
        self._process, self._warm = process, warm
        self.rows: list[dict[str, float]] = []

    async def take(self, latency: Callable[[], Awaitable[float]], seconds: float) -> None:
        """Look for so long, and print a row each minute."""
        began = time.monotonic()
        looks: list[Look] = []
        while time.monotonic() - began < seconds:
            looks.append(self._look(await latency()))
            await asyncio.sleep(EVERY)
            if time.monotonic() - began >= TOGETHER * (len(self.rows) + 1):
                self.rows.append(_row(looks, (time.monotonic() - began) / 60))
                print("  ".join(f"{name} {value:.1f}" for name, value in self.rows[-1].items()), flush=True)
                looks = []

    def grown(self) -> list[str]:
        """What went beyond its band."""
        before, after = self._ends()
        minutes = after["minute"] - before["minute"]
        return [
            name for name, (jump, rate) in BANDS.items() if after[name] - before[name] > jump + rate * minutes
        ]

    def summary(self) -> str:
        """The first minute after `warm`, the last one, and what grew too much."""
        before, after = self._ends()
        lines = [f"{name}: {before[name]:.1f} -> {after[name]:.1f}" for name in before]
        return "\n".join([*lines, f"beyond its band: {', '.join(self.grown()) or 'nothing'}"])

    def _ends(self) -> tuple[dict[str, float], dict[str, float]]:
        return next(row for row in self.rows if row["minute"] > self._warm), self.rows[-1]

    def _look(self, latency: float) -> Look:
        with self._process.oneshot():
            return Look(
                self._process.memory_info().rss / 1e6,
                self._process.num_fds(),
                self._process.num_threads(),
                len(self._process.children(recursive=True)),
                1e3 * latency,
            )


def _row(looks: list[Look], minute: float) -> dict[str, float]:
    waits = [look.latency for look in looks]
    return {
        "minute": minute,
        "memory MB": median(look.memory for look in looks),
        "files": median(look.files for look in looks),
        "threads": median(look.threads for look in looks),
        "processes": median(look.processes for look in looks),
        "p50 ms": median(waits),
        "p95 ms": quantiles(waits, n=20)[-1],
    }
