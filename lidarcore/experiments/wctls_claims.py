"""What [WCTLS] claims, beside what was measured."""

from collections.abc import Iterator

import numpy as np

from lidarcore.evaluation.intervals import Interval, ratio
from lidarcore.experiments.claim_rules import (
    FEW,
    TOLERANCE,
    Claim,
    as_large,
    below,
    in_range,
    in_words,
    judged,
    median_ratio,
    not_comparable,
    on_coverage,
    within,
)
from lidarcore.experiments.environments import Environment
from lidarcore.experiments.wctls import FITTERS, POINTS, WctlsStudy

AREAS = (
    ((4498.5, 330.3), (4594.7, 355.0), (626.2, 178.7)),
    ((8125.3, 914.1), (8123.6, 911.1), (3468.5, 640.9)),
)
"""mm², median and spread of the per-scan median ellipse area by UTLS, WTLS, WCTLS."""
GAINS = tuple(utls / wctls for (utls, _), _, (wctls, _) in AREAS)
"""Ratios of the median areas, UTLS over WCTLS: "approximately sevenfold", "approximately 2.3"."""
FACTORS = ((3, 6), (2, 4))
"""Ratios of the standard deviations, UTLS over WCTLS: "approximately 3 to 6", "between 2 and 4"."""
_ANGLES = (
    "What the paper does not print is replaced by conditional variances, and these gain by the angles at which beams "
    "meet walls and by the bearing noise: the walls are others here, and the paper does not give that noise."
)


def claims(result: WctlsStudy) -> list[Claim]:
    """The paper's claims in its order; those on its own rooms and on times only where they were simulated."""
    found: list[Claim] = []
    for number, environment in enumerate(result.environments):
        found += _of_room(environment, None if environment.room is None else number, result)
    return [*found, _of_time(result)] if result.times else found


def _of_room(environment: Environment, number: int | None, result: WctlsStudy) -> Iterator[Claim]:
    yield _of_places(environment)
    yield _of_weights(environment)
    yield _of_factors(environment, number)
    yield from _of_areas(environment, number)
    yield _of_dispersion(environment, number)
    yield _of_reliability(environment, result)
    yield _of_gain(environment)


def _of_places(environment: Environment) -> Claim:
    study = environment.study
    apart, same = study.apart("wctls", "utls"), study.rms_ratio("wctls", "utls")
    error = "scatter" if study.bounds is None else "RMS error"
    return judged(
        f"All three methods put the corners in equivalent places ({environment.name}).",
        f"Those of WCTLS, which are those of WTLS, are {in_words(apart)} times the {error} away from those of UTLS; "
        f"their {error} is {in_words(same)} times that of UTLS.",
        below(apart, 1),
        "Weights that follow the range move the corners more than the noise does.",
    )


def _of_weights(environment: Environment) -> Claim:
    sigma = {name: environment.study.claimed(name, "published") for name in ("utls", "wtls")}
    apart = np.abs(sigma["wtls"] / sigma["utls"] - 1)
    most = float(np.quantile(apart, 0.9))
    return judged(
        f"UTLS and WTLS claim nearly the same: they differ by a few per cent ({environment.name}).",
        f"σx and σy differ by {100 * np.median(apart):.1f} % at the median, less than {100 * most:.1f} % for nine of "
        f"ten, {100 * apart.max():.1f} % at most.",
        most < FEW,
        "Weights that follow the range matter where a wall is near at one end and far at the other.",
    )


def _of_factors(environment: Environment, number: int | None) -> Claim:
    sigma = {name: environment.study.claimed(name, "published") for name in ("utls", "wctls")}
    low, middle, high = np.quantile(sigma["utls"] / sigma["wctls"], (0.1, 0.5, 0.9)).tolist()
    least, most = (2, 6) if number is None else FACTORS[number]
    return judged(
        f"WCTLS claims standard deviations smaller by factors from {least} to {most} ({environment.name}).",
        f"By {middle:.1f} at the median, {low:.1f} to {high:.1f} for eight of ten.",
        in_range(Interval(middle, low, high), least, most),
        _ANGLES,
    )


def _of_areas(environment: Environment, number: int | None) -> Iterator[Claim]:
    study, name = environment.study, environment.name
    areas = {fitter: 1e6 * study.scan_areas(fitter, "published") for fitter in FITTERS}
    actual = [f"{1e6 * study.actual_area(fitter):.0f}" for fitter in FITTERS]
    medians = [f"{np.median(of):.0f}" for of in areas.values()]
    gain = median_ratio(areas["utls"], areas["wctls"])
    least, most = (GAINS[1], GAINS[0]) if number is None else (GAINS[number], GAINS[number])
    if number is not None:
        utls, wtls, wctls = (area for area, _ in AREAS[number])
        yield not_comparable(
            f"The median ellipse area per scan is {utls:.0f} mm² by UTLS, {wtls:.0f} by WTLS, {wctls:.0f} by WCTLS "
            f"({name}).",
            f"{medians[0]}, {medians[1]} and {medians[2]} mm² published; the true scatter has {actual[0]}, {actual[1]} "
            f"and {actual[2]} mm².",
        )
    said = f"{least:.1f}" if least == most else f"{least:.1f} to {most:.1f}"
    yield judged(
        f"The median ellipse of WCTLS is smaller by a factor of {said} ({name}).",
        f"As published by {in_words(gain)}; that of the true scatter is {actual[0]} mm² by UTLS and {actual[2]} by "
        "WCTLS.",
        as_large(gain, least)
        if least == most
        else within(gain, (1 - TOLERANCE) * least, (1 + TOLERANCE) * most),
        _ANGLES,
    )


def _of_dispersion(environment: Environment, number: int | None) -> Claim:
    areas = {name: 1e6 * environment.study.scan_areas(name, "published") for name in ("utls", "wctls")}
    squares = [(of - of.mean()) ** 2 for of in areas.values()]
    spread = ratio(squares[1], squares[0]).root()
    relative = [100 * float(of.std(ddof=1) / np.median(of)) for of in areas.values()]
    said = "" if number is None else " (the paper's own figures: {:.0f} and {:.0f} %)".format(
        *(100 * AREAS[number][fitter][1] / AREAS[number][fitter][0] for fitter in (0, 2))
    )  # fmt: skip
    return judged(
        f"The dispersion of WCTLS's areas from scan to scan is lower ({environment.name}).",
        f"Their standard deviation is {in_words(spread)} times that of UTLS. But the areas are smaller too: in "
        f"relation to them it is {relative[0]:.1f} % by UTLS, {relative[1]:.1f} % by WCTLS{said}.",
        below(spread, 1),
        "A smaller area scatters less only as far as it follows the noise in the same way.",
    )


def _of_reliability(environment: Environment, result: WctlsStudy) -> Claim:
    study = environment.study
    wctls, utls = (study.coverage(name, "published") for name in ("wctls", "utls"))
    bound = "" if study.bounds is None else (
        f" At {study.below_bound('wctls')} of {len(study.corners)} corners that is below the Cramér-Rao bound."
    )  # fmt: skip
    claim = (
        "WCTLS makes landmarks more reliable: its uncertainty estimates are better conditioned "
        f"({environment.name})."
    )
    measured = (
        f"Of the corners {in_words(wctls, 100)} % are inside the 95 % ellipse WCTLS publishes, {in_words(utls, 100)} % "
        f"inside that of UTLS.{bound}"
    )
    why = "Conditional variances leave out most of what range noise does to an oblique wall."
    known = study.bounds is not None or not result.design.assumed
    return on_coverage(claim, measured, known, wctls, utls, why)


def _of_gain(environment: Environment) -> Claim:
    study = environment.study
    exact = median_ratio(*(study.scan_areas(name, "consistent") for name in ("wctls", "wtls")))
    return judged(
        f"The gain comes from the elimination of the scale ambiguity, not from weights ({environment.name}).",
        f"With the noise propagated in full through each, ellipses of WCTLS are {exact.value:.3f} times as large as "
        "those of WTLS.",
        exact.value < 1 - FEW,
        "The normalisation changes no corner, so it cannot change the covariance of one.",
    )


def _of_time(result: WctlsStudy) -> Claim:
    few, many = POINTS
    growth = {name: result.times[name, many] / result.times[name, few] for name in FITTERS}
    times = ", ".join(
        f"{name.upper()} {result.times[name, few]:.2f} and {result.times[name, many]:.2f}" for name in FITTERS
    )
    return judged(
        "WCTLS does not increase the computational complexity.",
        f"A line of {few} and of {many} points with both covariances, compiled, µs: {times}. Ten times the points take "
        f"{growth['utls']:.1f}, {growth['wtls']:.1f} and {growth['wctls']:.1f} times as long.",
        growth["wctls"] < (1 + TOLERANCE) * growth["wtls"],
        "It is our implementation that was timed, not the paper's.",
    )
