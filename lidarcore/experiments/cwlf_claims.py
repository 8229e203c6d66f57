"""What [CWLF] claims, beside what was measured."""

from collections.abc import Iterator

import numpy as np

from lidarcore.evaluation.intervals import Interval
from lidarcore.experiments.cwlf import COMPARED, MEASUREMENTS, Result
from lidarcore.experiments.cwlf_steps import STEPS
from lidarcore.experiments.environments import Environment
from lidarcore.experiments.paper_rooms import CWLF_ROOMS
from lidarcore.scan import Array

Claim = tuple[str, str, bool | None]
"""What the paper says, what was measured, and whether that agrees; None where it cannot be told."""

MEANS = ((33.68, 27.98, 23.02, 18.27), (25.32, 27.12, 25.86, 13.92))
"""mm, last rows of tables I and II: Arras-Siegwart x, y, CWLF x, y."""
FALLS = ((30, 15), (78, 68))
"""%, by which CWLF's sigmas of x and y are smaller for the chosen corners, figures 4 and 5."""


def claims(result: Result) -> list[Claim]:
    """The paper's claims in its order."""
    found: list[Claim] = []
    for number, environment in enumerate(result.environments):
        found += _of_tables(environment, None if environment.room is None else MEANS[number])
    for environment in result.environments:
        found += _of_accuracy(environment)
    return [*found, *_of_times(result), *_of_corners(result)]


def _of_tables(environment: Environment, paper: tuple[float, ...] | None) -> Iterator[Claim]:
    study, name = environment.study, environment.name
    first, second = (study.claimed(fitter, "published") for fitter in ("arras_siegwart", "cwlf"))
    smaller = int((second < first).all(axis=1).sum())
    yield (
        f"Save one corner, the uncertainties by CWLF are smaller than those by Arras-Siegwart ({name}).",
        f"The published ones are smaller in both x and y at {smaller} of {len(first)} corners.",
        smaller >= len(first) - 1,
    )
    if paper is not None:
        before, after = 1e3 * first.mean(0), 1e3 * second.mean(0)
        yield (
            f"On average over {name} σx, σy are {paper[0]:g}, {paper[1]:g} mm by Arras-Siegwart and {paper[2]:g}, "
            f"{paper[3]:g} mm by CWLF.",
            f"Published: {before[0]:.1f}, {before[1]:.1f} mm and {after[0]:.1f}, {after[1]:.1f} mm, in a room of that "
            "size with that many corners, not the same room.",
            bool((after < before).all()),
        )


def _of_accuracy(environment: Environment) -> Iterator[Claim]:
    study, name = environment.study, environment.name
    error = study.rms_ratio("cwlf", "arras_siegwart")
    what = "Scatter" if study.bounds is None else "RMS error"
    yield (
        f"CWLF has higher levels of accuracy ({name}).",
        f"{what} of CWLF over that of Arras-Siegwart in the same scans: {in_words(error)}.",
        None if error.contains(1) else error.value < 1,
    )
    covered = study.coverage("cwlf", "published")
    below = "" if study.bounds is None else (
        f" At {study.below_bound('cwlf')} of {len(study.corners)} corners it is below the Cramér-Rao bound."
    )  # fmt: skip
    yield (
        f"The correlation of the errors of x and y adds to the realism of the uncertainty ({name}).",
        f"Of the corners {in_words(covered, 100)} % are inside the published 95 % ellipse of CWLF; "
        f"of Arras-Siegwart's {in_words(study.coverage('arras_siegwart', 'published'), 100)} %, "
        f"of CWLF's consistent one {in_words(study.coverage('cwlf', 'consistent'), 100)} %.{below}",
        covered.contains(0.95),
    )


def _of_times(result: Result) -> Iterator[Claim]:
    totals = {key: times.total for key, times in result.times.items()}
    ratios = [totals["cwlf", n] / totals["arras_siegwart", n] for n in MEASUREMENTS]
    yield (
        "The time of CWLF is systematically lower; it stays in the order of µs.",
        f"From {MEASUREMENTS[0]} to {MEASUREMENTS[-1]} measurements it takes {min(ratios):.2f} to {max(ratios):.2f} "
        f"times as long as Arras-Siegwart, {totals['cwlf', 100]:.0f} µs for 100.",
        max(ratios) < 1,
    )
    slow = [n for n in MEASUREMENTS if totals["arras_siegwart", n] >= 1000]
    yield (
        "Arras-Siegwart takes the order of 1 ms from 90 measurements on.",
        f"With the double sums of equation 17, {totals['arras_siegwart', 90]:.0f} µs for 90; "
        + (f"1 ms is reached at {slow[0]}." if slow else f"{totals['arras_siegwart', MEASUREMENTS[-1]]:.0f} µs for "
           f"{MEASUREMENTS[-1]}.")
        + " With the sums factored, as the library has them, compiled: "
        f"{result.times['arras_siegwart', 90].library:.1f} µs (CWLF {result.times['cwlf', 90].library:.1f} µs).",
        totals["arras_siegwart", 90] >= 500,
    )  # fmt: skip
    for fitter, step, paper in (("arras_siegwart", 1, 70), ("cwlf", 0, 60)):
        shares = [
            100
            * result.step_times[room.name, fitter, n].steps[step]
            / result.step_times[room.name, fitter, n].total
            for room in CWLF_ROOMS
            for n in COMPARED
        ]
        title = "Arras-Siegwart" if fitter == "arras_siegwart" else "CWLF"
        yield (
            f"{title} spends {paper} % of its time on this step: {STEPS[step]}.",
            f"{min(shares):.0f} to {max(shares):.0f} % here; the largest of its four steps: "
            f"{'yes' if _largest(result, fitter) == step else 'no'}.",
            _largest(result, fitter) == step,
        )


def _largest(result: Result, fitter: str) -> int:
    steps = sum(
        np.array(result.step_times[room.name, fitter, n].steps) for room in CWLF_ROOMS for n in COMPARED
    )
    return int(np.argmax(steps))


def _of_corners(result: Result) -> Iterator[Claim]:
    for room, (x, y) in zip(CWLF_ROOMS, FALLS, strict=True):
        published, scatter = (_falls(result, room.name, of) for of in ("published", "scatter"))
        yield (
            f"At the chosen corner of {room.name} CWLF decreases the uncertainty by about {x} % in x and {y} % in y.",
            f"What is published decreases by {published[0]:.0f} % in x and {published[1]:.0f} % in y, the true scatter "
            f"by {scatter[0]:.0f} % and {scatter[1]:.0f} %.".replace("-", "−"),
            bool((scatter > published / 2).all()),
        )
    few, many = (
        np.array([u.scatter for (_, _, n), u in result.uncertainties.items() if n == number])
        for number in COMPARED
    )
    ratio = float(np.exp(np.log(many / few).mean()))
    yield (
        "The more measurements, the smaller the uncertainty.",
        f"The true scatter with {COMPARED[1]} is {ratio:.2f} times that with {COMPARED[0]}; √½ is {0.5**0.5:.2f}.",
        ratio < 1,
    )


def _falls(result: Result, room: str, of: str) -> Array:
    """%, of the standard deviations of x and y from Arras-Siegwart to CWLF, both numbers of measurements together."""
    ratios: Array = np.mean(
        [
            getattr(result.uncertainties[room, "cwlf", n], of)
            / getattr(result.uncertainties[room, "arras_siegwart", n], of)
            for n in COMPARED
        ],
        axis=0,
    )
    return 100 * (1 - ratios)


def in_words(figure: Interval, factor: float = 1.0) -> str:
    """A figure with its confidence interval."""
    digits = 1 if factor == 100 else 3
    return f"{factor * figure.value:.{digits}f} ({factor * figure.low:.{digits}f} to {factor * figure.high:.{digits}f})"
