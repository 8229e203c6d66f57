"""What [CWLF] claims, beside what was measured."""

from collections.abc import Iterator

import numpy as np

from lidarcore.arrays import Array
from lidarcore.evaluation.intervals import Interval
from lidarcore.experiments.claim_rules import (
    Claim,
    as_large,
    below,
    every,
    in_words,
    judged,
    not_comparable,
    on_coverage,
    percentages,
)
from lidarcore.experiments.cwlf import COMPARED, MEASUREMENTS, CwlfStudy
from lidarcore.experiments.cwlf_steps import STEPS
from lidarcore.experiments.environments import Environment
from lidarcore.experiments.paper_rooms import CWLF_ROOMS

MEANS = ((33.68, 27.98, 23.02, 18.27), (25.32, 27.12, 25.86, 13.92))
"""mm, last rows of tables I and II: Arras-Siegwart x, y, CWLF x, y."""
SMALLER = (21, 14)
"""Corners at which both sigmas of CWLF are the smaller ones in tables I and II."""
FALLS = ((30, 15), (78, 68))
"""%, by which CWLF's sigmas of x and y are smaller for the chosen corners, figures 4 and 5."""


def claims(result: CwlfStudy) -> list[Claim]:
    """The paper's claims in its order; those on its own rooms and on times only where they were simulated."""
    found: list[Claim] = []
    for number, environment in enumerate(result.environments):
        if environment.room is None:
            found.append(_of_corner_by_corner(environment))
        else:
            found.append(_of_corner_by_corner(environment, f", in the paper's table at {SMALLER[number]}"))
            found += _of_means(environment, MEANS[number])
    for environment in result.environments:
        found += [_of_accuracy(environment), _of_realism(environment, result)]
    if result.times:
        found += [*_of_times(result), *_of_steps(result), *_of_chosen_corners(result), _of_number(result)]
    return found


def _of_corner_by_corner(environment: Environment, in_paper: str = "") -> Claim:
    first, second = (environment.study.claimed(name, "published") for name in ("arras_siegwart", "cwlf"))
    smaller = int((second < first).all(axis=1).sum())
    return judged(
        f"Save one corner, the uncertainties by CWLF are smaller than those by Arras-Siegwart ({environment.name}).",
        f"The published ones are smaller in both x and y at {smaller} of {len(first)} corners{in_paper}.",
        smaller >= max(len(first) - 1, 1),
        "How much smaller they are depends on the angles at which the beams meet the walls.",
    )


def _of_means(environment: Environment, paper: tuple[float, ...]) -> Iterator[Claim]:
    study, name = environment.study, environment.name
    before, after = (
        1e3 * study.claimed(fitter, "published").mean(0) for fitter in ("arras_siegwart", "cwlf")
    )
    yield not_comparable(
        f"On average over {name} σx, σy are {paper[0]:g}, {paper[1]:g} mm by Arras-Siegwart and {paper[2]:g}, "
        f"{paper[3]:g} mm by CWLF.",
        f"Published: {before[0]:.1f}, {before[1]:.1f} mm and {after[0]:.1f}, {after[1]:.1f} mm, in a room of that "
        "size with that many corners.",
    )
    claimed = [paper[2] / paper[0], paper[3] / paper[1]]
    measured = study.claimed_ratios("cwlf", "arras_siegwart")
    outlier = (
        " In the paper one corner (138 mm by CWLF, 6 mm by Arras-Siegwart) makes up a third of the mean σx."
        if claimed[0] > 1
        else ""
    )
    yield judged(
        f"By these means CWLF's σx, σy are {claimed[0]:.2f}, {claimed[1]:.2f} times those of Arras-Siegwart ({name}).",
        f"{in_words(measured[0])} and {in_words(measured[1])} times as large, as published.",
        every([as_large(ratio, of) for ratio, of in zip(measured, claimed, strict=True)]),
        "Variances for an x that is known get the smaller the more obliquely beams meet walls, and the walls are "
        f"others here.{outlier}",
    )


def _of_accuracy(environment: Environment) -> Claim:
    study, claim = environment.study, f"CWLF has higher levels of accuracy ({environment.name})."
    error = study.rms_ratio("cwlf", "arras_siegwart")
    if study.bounds is None:
        return (
            claim,
            f"Scatter of CWLF over that of Arras-Siegwart in the same scans: {in_words(error)}. A recording has no "
            "truth to be accurate about.",
            None,
        )
    promised = " and ".join(f"{ratio.value:.2f}" for ratio in study.claimed_ratios("cwlf", "arras_siegwart"))
    return judged(
        claim,
        f"RMS error of CWLF over that of Arras-Siegwart in the same scans: {in_words(error)}; the published σx, σy "
        f"promise {promised}.",
        below(error, 1),
        "A smaller published ellipse does not make a corner more accurate.",
    )


def _of_realism(environment: Environment, result: CwlfStudy) -> Claim:
    study = environment.study
    cwlf, other = (study.coverage(name, "published") for name in ("cwlf", "arras_siegwart"))
    bound = "" if study.bounds is None else (
        f" At {study.below_bound('cwlf')} of {len(study.corners)} corners it is below the Cramér-Rao bound."
    )  # fmt: skip
    claim = f"The correlation of the errors of x and y adds to the realism of the uncertainty ({environment.name})."
    measured = (
        f"Of the corners {in_words(cwlf, 100)} % are inside the published 95 % ellipse of CWLF, {in_words(other, 100)} "
        f"% inside that of Arras-Siegwart, {in_words(study.coverage('cwlf', 'consistent'), 100)} % inside CWLF's "
        f"consistent one.{bound}"
    )
    why = "Variances for an x that is known leave out most of what range noise does to an oblique wall."
    known = study.bounds is not None or not result.design.assumed
    return on_coverage(claim, measured, known, cwlf, other, why)


def _of_times(result: CwlfStudy) -> Iterator[Claim]:
    totals = {key: times.total for key, times in result.times.items()}
    ratios = [totals["cwlf", n] / totals["arras_siegwart", n] for n in MEASUREMENTS]
    library = {name: result.times[name, 90].library for name in ("arras_siegwart", "cwlf")}
    yield judged(
        "The time of CWLF is systematically lower.",
        f"From {MEASUREMENTS[0]} to {MEASUREMENTS[-1]} measurements it takes {min(ratios):.2f} to {max(ratios):.2f} "
        "times as long as Arras-Siegwart with the double sums of equation 17. With these factored, as the library has "
        f"them, compiled, both take much less: {library['cwlf']:.1f} µs (CWLF) and {library['arras_siegwart']:.1f} µs "
        "for 90.",
        max(ratios) < 1,
        "At few measurements numpy's own time for each step outweighs the sums.",
    )
    slow = [n for n in MEASUREMENTS if totals["arras_siegwart", n] >= 1000]
    most = MEASUREMENTS[-1]
    reached = (
        f"1 ms is reached at {slow[0]}" if slow else f"{totals['arras_siegwart', most]:.0f} µs for {most}"
    )
    yield not_comparable(
        "CWLF stays in the order of µs; Arras-Siegwart takes the order of 1 ms from 90 measurements on.",
        f"In numpy {totals['cwlf', 90]:.0f} µs and {totals['arras_siegwart', 90]:.0f} µs for 90; {reached}.",
        "Not comparable: another computer, and the paper does not say in what language its steps were.",
    )


def _of_steps(result: CwlfStudy) -> Iterator[Claim]:
    for fitter, title, step, paper in (("arras_siegwart", "Arras-Siegwart", 1, 70), ("cwlf", "CWLF", 0, 60)):
        cells = [result.step_times[room.name, fitter, n] for room in CWLF_ROOMS for n in COMPARED]
        shares = [100 * times.steps[step] / times.total for times in cells]
        largest = int(np.argmax(np.sum([times.steps for times in cells], axis=0))) == step
        yield judged(
            f"{title} spends {paper} % of its time on this step: {STEPS[step]}.",
            f"{min(shares):.0f} to {max(shares):.0f} %; the longest of its four steps: {'yes' if largest else 'no'}.",
            percentages(shares, paper),
            "It is our implementation, in numpy, that was timed, not the paper's.",
        )


def _of_chosen_corners(result: CwlfStudy) -> Iterator[Claim]:
    for room, paper in zip(CWLF_ROOMS, FALLS, strict=True):
        published, scatter = (_falls(result, room.name, of) for of in ("published", "scatter"))
        yield judged(
            f"At the chosen corner of {room.name} CWLF decreases the uncertainty by about {paper[0]} % in x and "
            f"{paper[1]} % in y.",
            f"What is published decreases by {published[0]:.0f} % in x and {published[1]:.0f} % in y, the true scatter "
            f"by {scatter[0]:.0f} % and {scatter[1]:.0f} %.".replace("-", "−"),
            every([percentages([of], said) for of, said in zip(published, paper, strict=True)]),
            "The corner has the angle of the paper's, but how its walls are turned and where the sensor stands is "
            "ours: with variances for a known x that changes what is published far more than what scatters.",
        )


def _of_number(result: CwlfStudy) -> Claim:
    few, many = (
        np.array([u.scatter for (_, _, n), u in result.uncertainties.items() if n == number])
        for number in COMPARED
    )
    ratios = many / few
    return judged(
        "The more measurements, the smaller the uncertainty.",
        f"The true scatter with {COMPARED[1]} is {ratios.min():.2f} to {ratios.max():.2f} times that with "
        f"{COMPARED[0]}, in x and y of both corners by both methods; √½ is {0.5**0.5:.2f}.",
        below(Interval(float(ratios.mean()), float(ratios.min()), float(ratios.max())), 1),
    )


def _falls(result: CwlfStudy, room: str, of: str) -> Array:
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
