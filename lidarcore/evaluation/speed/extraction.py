"""How long extraction takes on this machine, beside a yardstick in the same run."""

import timeit
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lidarcore import extraction
from lidarcore.arrays import Array, Ints
from lidarcore.extraction import compare, extract
from lidarcore.lines import FITTER_IDS, FITTERS, LINE_FIELDS, fit_beams
from lidarcore.noise import SensorNoise
from lidarcore.rplidar.protocol import Answer, StreamDecoder, encode_dense
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose

NOISE = SensorNoise(0.01, 0.001)
REAL = replace(
    NOISE, range_growth=0.0003, unevenness=0.004, systematic=0.003, tails=0.25, renewal=0.1, resampling=1.0
)
"""The noise of the papers with every part that real walls and rooms add."""
MODEL_LIMIT = 1.6  # times the compiled call with simple noise: at most so much it may take with all of it
BEAMS = 920
REPEATS = 40


FULL_ML = "compiled call, ml, noise with growth, unevenness, resampling, tails"


@dataclass(frozen=True, slots=True)
class Timing:
    """Best and median time of one call, microseconds, and what it should stay below, if that was set."""

    what: str
    best: float
    median: float
    limit: float | None = None


def time_extraction(scans: int = 50, seed: int = 0) -> list[Timing]:
    """The 9 x 8 m room of 36 wall pieces, 920 beams, 1 cm noise, another pose and other bearings every scan."""
    many = simulated_scans(BEAMS, scans, seed)
    beams = [(scan.ranges, scan.bearings) for scan in many]
    settings = ExtractionSettings(noise=NOISE)
    compiled = extraction.compiled_call(BEAMS, settings)
    rows = [
        time_calls(
            "yardstick: np.cos(b); np.sin(b)", lambda: [(np.cos(b), np.sin(b)) for _, b in beams], scans
        )
    ]
    for name, number in FITTER_IDS.items():
        run = partial(_each, compiled, beams, np.array([number]))
        rows.append(time_calls(f"compiled call, {name}", run, scans, 12))
    run = partial(_each, compiled, beams, np.arange(len(FITTERS)))
    rows.append(time_calls("compiled call, all six fitters", run, scans, 40))
    full = partial(_each, extraction.compiled_call(BEAMS, replace(settings, noise=REAL)), beams)
    rows.append(time_calls(FULL_ML, partial(full, np.array([FITTER_IDS["ml"]])), scans))
    rows.append(time_calls("extract()", partial(_extract_all, many, settings), scans, 30))
    rows.append(
        time_calls("compare(), all six fitters", lambda: [compare(scan, settings) for scan in many], scans)
    )
    return rows


def time_fits(points: int = 100) -> list[Timing]:
    """One line through 100 points with both covariances, for each fitter."""
    rng = np.random.default_rng(0)
    bearings = np.linspace(-0.5, 0.8, points)
    ranges = 2 / np.cos(bearings) + rng.normal(0, NOISE.sigma_range, points)
    out = np.empty(LINE_FIELDS)
    return [
        time_calls(f"one fit, {name}", partial(fit_beams, k, ranges, bearings, NOISE.model(), out), 1, 2)
        for name, k in FITTER_IDS.items()
    ]


def time_growth(beams: Iterable[int] = (1_000, 3_000, 10_000, 30_000, 100_000)) -> list[Timing]:
    """extract() on the same room with more and more beams."""
    settings = ExtractionSettings(noise=NOISE)
    rows = []
    for n in beams:
        many = simulated_scans(n, 5, seed=1)
        rows.append(time_calls(f"{n:,} beams", partial(_extract_all, many, settings), len(many)))
    return rows


def time_decoding(capsules: int = 2000) -> list[Timing]:
    """Dense capsules of an RPLIDAR S1 at 600 rpm into revolutions; it sends one of 40 samples every 4,320 us."""
    stream = [encode_dense(15.552 * k % 360, np.arange(1000, 1040), sync=k == 0) for k in range(capsules)]
    at_once, hundredfold = b"".join(stream), 43.2
    return [
        time_calls("one capsule, many at once", partial(_decode, [at_once]), capsules, hundredfold),
        time_calls("one capsule, as it comes", partial(_decode, stream), capsules, hundredfold),
    ]


def simulated_scans(beams: int, scans: int, seed: int) -> list[Scan]:
    """Scans of the furnished room from random poses."""
    rng = np.random.default_rng(seed)
    sensor = SimulatedSensor(furnished_room(), NOISE, beams)
    return [sensor.scan(random_pose(sensor.world, rng), rng)[0] for _ in range(scans)]


def _decode(pieces: list[bytes]) -> None:
    decoder = StreamDecoder(Answer.DENSE, 108.0)
    for k, piece in enumerate(pieces):
        decoder.feed(piece, 0.00432 * k)


def _each(call: Callable[..., object], beams: list[tuple[Array, Array]], fitters: Ints) -> None:
    for ranges, bearings in beams:
        call(ranges, bearings, fitters)


def _extract_all(scans: list[Scan], settings: ExtractionSettings) -> None:
    for scan in scans:
        extract(scan, settings)


def time_calls(what: str, run: Callable[[], object], calls: int, limit: float | None = None) -> Timing:
    """Time `run`, which makes this many calls, over about half a second."""
    run()
    number = max(1, int(0.01 / min(timeit.repeat(run, number=1, repeat=3))))
    times = np.array(timeit.repeat(run, number=number, repeat=REPEATS)) / (number * calls) * 1e6
    return Timing(what, float(times.min()), float(np.median(times)), limit)
