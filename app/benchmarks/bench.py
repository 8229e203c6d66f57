"""`lidarcore bench`: speed, accuracy and server load on this machine, beside the figures they should reach."""

import platform
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from lidarcore import warm_up
from lidarcore.evaluation.accuracy import measure_accuracy
from lidarcore.evaluation.speed.extraction import (
    FULL_ML,
    MODEL_LIMIT,
    Timing,
    time_decoding,
    time_extraction,
    time_fits,
    time_growth,
)
from lidarcore.evaluation.speed.filter import time_localizer, time_slam
from lidarcore.evaluation.speed.landmarks import LIMIT_MS
from lidarcore.evaluation.speed.mapping import MEDIAN_MS, P99_MS, time_front_end, time_map
from lidarcore.evaluation.speed.repeatability import time_repeatability

from ..cli.tables import table
from .map_load import measure_map_queries
from .repeatability_load import LIMIT_PERCENT, measure_repeatability
from .server_load import Load, measure_load

SCANS, SEED = 400, 2026
# Noise (m): least recall and precision of walls.
ACCURACY = {0.01: (0.995, 0.999), 0.02: (0.99, 0.99), 0.03: (0.99, 0.985), 0.05: (0.99, 0.97)}
CORNER_RECALL, CORNER_RMS = 0.985, {0.01: 0.009}
LOAD_SECONDS = 15.0
TAB_SECONDS, TAB_ROUNDS = 10.0, 4
LANDMARKS, QUESTIONS = 1_000_000, 400
MAPPED = 500  # scans
SLAM_MS = {100: 0.3, 1_000: 5.0, 3_000: None}  # landmarks: at most so long a scan


def run() -> None:
    """Measure and print everything; takes about eight minutes."""
    console = Console()
    warm_up()
    console.print(f"{_processor()}, Python {platform.python_version()}, numpy {np.__version__}\n")
    extraction = time_extraction()
    console.print(_timings("Extraction: 920 beams, 9 x 8 m room of 36 wall pieces, 1 cm noise", extraction))
    medians = {row.what: row.median for row in extraction}
    simple, full = medians["compiled call, ml"], medians[FULL_ML]
    ratio = simple / extraction[0].median
    console.print(
        f"Compiled call (ml, with trigonometry of its own) against the yardstick: {ratio:.2f} times (at most 1.4)\n"
        f"With everything that real walls add to the noise: {full / simple:.2f} times that (at most {MODEL_LIMIT})\n"
    )
    console.print(_timings("One line through 100 points, both covariances", time_fits()))
    console.print(
        _timings(
            "RPLIDAR S1: 40 samples, which come in 4,320 us; at most a hundredth of that", time_decoding()
        )
    )
    console.print(_timings("More beams (extract)", time_growth()))
    console.print(_timings("Extended Kalman filter, known map: 3 states, 12 corners", time_localizer()))
    console.print(_slam())
    console.print(_front_end())
    console.print(_map())
    console.print(_accuracy())
    console.print(_load())
    console.print(_timings("Repeatability: the furnished room, 100 scans, six methods", time_repeatability()))
    console.print(_tab())
    console.print(_queries())


def _processor() -> str:
    """The processor's name where the system tells it."""
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _timings(title: str, rows: Sequence[Timing]) -> Table:
    table = _table(title, "", "best us", "median us", "at most")
    for row in rows:
        limit = "" if row.limit is None else _judged(f"{row.limit:g}", row.median <= row.limit)
        table.add_row(row.what, f"{row.best:.2f}", f"{row.median:.2f}", limit)
    return table


def _slam() -> Table:
    table = _table(
        "SLAM: a whole step, association included, on a path through the map; processor time",
        "landmarks", "in sight", "mean ms", "p99 ms", "worst ms", "full filter, numpy, ms",
    )  # fmt: skip
    for landmarks, limit in SLAM_MS.items():
        times = time_slam(landmarks, limit)
        mean = f"{times.mean:.2f}"
        table.add_row(
            f"{landmarks:,}",
            f"{times.in_sight:.0f}",
            mean if limit is None else _judged(f"{mean} (at most {limit:g})", times.mean <= limit),
            f"{times.p99:.2f}",
            f"{times.worst:.2f}",
            f"{times.full:.2f}",
        )
    return table


def _front_end() -> Table:
    table = _table(
        "Maps from whole scans: the front end in the simulated office, 920 beams; processor time of one core",
        "", "median ms", "p99 ms",
    )  # fmt: skip
    took, yardstick = time_front_end()
    median, p99 = np.percentile(yardstick, (50, 99))
    table.add_row("yardstick: nearest points of two scans, scipy", f"{median:.2f}", f"{p99:.2f}")
    median, p99 = np.percentile(took, (50, 99))
    table.add_row(
        "a scan is placed on the map",
        _judged(f"{median:.2f} (at most {MEDIAN_MS:g})", median <= MEDIAN_MS),
        _judged(f"{p99:.2f} (at most {P99_MS:g})", p99 <= P99_MS),
    )
    return table


def _map() -> Table:
    took = time_map(MAPPED)
    table = _table(
        f"A finished map of {took.scans} scans of the simulated office, half a second apart, 920 beams: "
        f"{took.keyframes} keyframes, {took.loops} loops; processor time",
        "", "s",
    )  # fmt: skip
    table.add_row("yardstick: nearest points of each scan and the one before, scipy", f"{took.yardstick:.2f}")
    table.add_row("scans are placed, loops closed", f"{took.steps:.2f}")
    table.add_row("all keyframes are adjusted at once", f"{took.finish:.2f}")
    return table


def _accuracy() -> Table:
    table = _table(
        f"Walls and corners of the room from {SCANS} random poses, default settings",
        "noise", "recall", "precision", "corner recall", "corner RMS mm", "splits at the seam",
    )  # fmt: skip
    for sigma, (recall, precision) in ACCURACY.items():
        found = measure_accuracy(sigma, SCANS, SEED)
        rms = f"{1e3 * found.corner_rms:.1f}"
        limit = CORNER_RMS.get(sigma)
        table.add_row(
            f"{100 * sigma:.0f} cm",
            _judged(f"{found.recall:.4f}", found.recall >= recall),
            _judged(f"{found.precision:.4f}", found.precision >= precision),
            _judged(f"{found.corner_recall:.4f}", found.corner_recall >= CORNER_RECALL),
            rms if limit is None else _judged(rms, found.corner_rms <= limit),
            _judged(f"{found.seam_splits} of {found.seam_walls}", found.seam_splits == 0),
        )
    return table


def _load() -> Table:
    table = _table(
        f"Server with an emulated sensor at 10 Hz, SLAM and all layers on, {LOAD_SECONDS:.0f} s",
        "browsers", "CPU % of a core", "frames/s", "age ms p50", "age ms p99", "frames behind", "memory",
    )  # fmt: skip
    for clients, most in ((1, 15.0), (20, None)):
        load = measure_load(clients, LOAD_SECONDS)
        cpu = f"{load.cpu_percent:.1f}"
        table.add_row(
            str(clients),
            cpu if most is None else _judged(cpu, load.cpu_percent <= most),
            f"{load.rate_hz:.1f}",
            _age(load, 50, 5.0),
            _age(load, 99, 20.0),
            _judged(str(load.lag), load.lag <= 1),
            f"{load.memory_growth / 1e6:+.1f} MB",
        )
    return table


def _tab() -> Table:
    cost = measure_repeatability(TAB_SECONDS, TAB_ROUNDS)
    table = _table(
        f"Server with an emulated sensor at 10 Hz, one browser; in turn {TAB_ROUNDS} times {TAB_SECONDS:.0f} s each",
        "Repeatability tab: 100 scans, six methods", "CPU % of a core",
    )  # fmt: skip
    table.add_row("off", cost.off.text(1))
    table.add_row("on", cost.on.text(1))
    table.add_row("more", _judged(cost.added.text(1), cost.added.value <= LIMIT_PERCENT))
    return table


def _queries() -> Table:
    table = _table(
        f"A map of {LANDMARKS:,} landmarks asked over HTTP, while a live run writes",
        "question", "median ms", "p99 ms", "kB", "GET /version: median ms", "p99 ms",
    )  # fmt: skip
    for row in measure_map_queries(LANDMARKS, QUESTIONS):
        table.add_row(
            row.what,
            f"{row.median:.2f}",
            _judged(f"{row.p99:.2f}", row.p99 <= LIMIT_MS),
            f"{row.kilobytes:.1f}",
            f"{row.yardstick_median:.2f}",
            f"{row.yardstick_p99:.2f}",
        )
    return table


def _age(load: Load, percentile: float, most: float) -> str:
    """ms from a revolution's last byte to its frame on the way to a browser; judged where there is one browser."""
    age = float(np.percentile(load.age_ms, percentile))
    return _judged(f"{age:.1f}", age <= most) if load.clients == 1 else f"{age:.1f}"


def _table(title: str, *columns: str) -> Table:
    return table(title, columns[:1], columns[1:])


def _judged(text: str, good: bool) -> str:
    return f"{text} [green]ok[/]" if good else f"{text} [red]missed[/]"
