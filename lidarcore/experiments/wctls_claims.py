"""What [WCTLS] claims, beside what was measured."""

from collections.abc import Iterator

import numpy as np

from lidarcore.experiments.cwlf_claims import Claim, in_words
from lidarcore.experiments.environments import Environment
from lidarcore.experiments.wctls import FITTERS, Result
from lidarcore.scan import Array

AREAS = (
    ((4498.5, 330.3), (4594.7, 355.0), (626.2, 178.7)),
    ((8125.3, 914.1), (8123.6, 911.1), (3468.5, 640.9)),
)
"""mm², median and spread of the per-scan median ellipse area by UTLS, WTLS, WCTLS."""
FACTORS = ((3, 6), (2, 4))
"""Of the standard deviations, UTLS over WCTLS: "approximately 3 to 6", "between 2 and 4"."""
_FEW_PER_CENT = 0.05


def claims(result: Result) -> list[Claim]:
    """The paper's claims in its order."""
    found: list[Claim] = []
    for number, environment in enumerate(result.environments):
        found += _of_room(environment, None if environment.room is None else number)
    return [*found, _of_time(result)]


def _of_room(environment: Environment, number: int | None) -> Iterator[Claim]:
    study, name = environment.study, environment.name
    sigma = {fitter: study.claimed(fitter, "published") for fitter in FITTERS}
    same = study.rms_ratio("wctls", "utls")
    yield (
        f"All three methods put the corners in equivalent places ({name}).",
        f"{'Scatter' if study.bounds is None else 'RMS error'} of WCTLS over that of UTLS: {in_words(same)}; "
        "WCTLS and WTLS are the same estimate.",
        abs(same.value - 1) < _FEW_PER_CENT,
    )
    apart = np.abs(sigma["wtls"] / sigma["utls"] - 1)
    yield (
        f"UTLS and WTLS claim nearly the same: they differ by a few per cent ({name}).",
        f"σx and σy differ by {100 * np.median(apart):.1f} % at the median, {100 * apart.max():.1f} % at most.",
        bool(np.median(apart) < _FEW_PER_CENT),
    )
    yield _of_factors(sigma["utls"] / sigma["wctls"], name, number)
    yield from _of_areas(environment, number)
    coverage = {fitter: study.coverage(fitter, "published") for fitter in FITTERS}
    below = "" if study.bounds is None else (
        f" At {study.below_bound('wctls')} of {len(study.corners)} corners that is below the Cramér-Rao bound."
    )  # fmt: skip
    yield (
        f"WCTLS makes landmarks more reliable: its uncertainty estimates are better conditioned ({name}).",
        f"Of the corners {in_words(coverage['wctls'], 100)} % are inside the 95 % ellipse WCTLS publishes, "
        f"{in_words(coverage['utls'], 100)} % inside that of UTLS.{below}",
        coverage["wctls"].contains(0.95),
    )
    exact = np.median(study.scan_areas("wctls", "consistent")) / np.median(
        study.scan_areas("wtls", "consistent")
    )
    yield (
        f"The gain comes from the elimination of the scale ambiguity, not from weights ({name}).",
        f"With the noise propagated in full through each, ellipses of WCTLS are {exact:.3f} times as large as those of "
        "WTLS: the normalisation changes no corner, so it cannot change the covariance of one.",
        bool(exact < 1 - _FEW_PER_CENT),
    )


def _of_factors(factors: Array, name: str, number: int | None) -> Claim:
    low, middle, high = np.quantile(factors, (0.1, 0.5, 0.9))
    least, most = (2, 6) if number is None else FACTORS[number]
    return (
        f"WCTLS claims standard deviations smaller by factors from {least} to {most} ({name}).",
        f"By {middle:.1f} at the median, {low:.1f} to {high:.1f} for eight of ten.",
        bool(least <= middle <= most),
    )


def _of_areas(environment: Environment, number: int | None) -> Iterator[Claim]:
    study, name = environment.study, environment.name
    areas = {fitter: 1e6 * study.scan_areas(fitter, "published") for fitter in FITTERS}
    medians = {fitter: float(np.median(of)) for fitter, of in areas.items()}
    gain = medians["utls"] / medians["wctls"]
    if number is None:
        paper = "The median ellipse of WCTLS is smaller by a factor of 2.3 to 7"
    else:
        utls, wtls, wctls = (area for area, _ in AREAS[number])
        paper = (
            f"The median ellipse area per scan is {utls:.0f} mm² by UTLS, {wtls:.0f} by WTLS, {wctls:.0f} by WCTLS: "
            f"smaller by a factor of {utls / wctls:.1f}"
        )
    yield (
        f"{paper} ({name}).",
        f"{medians['utls']:.0f}, {medians['wtls']:.0f} and {medians['wctls']:.0f} mm² published, a factor of "
        f"{gain:.1f}; the true scatter has {1e6 * study.actual_area('utls'):.0f}, "
        f"{1e6 * study.actual_area('wtls'):.0f} and {1e6 * study.actual_area('wctls'):.0f} mm².",
        gain > 1,
    )
    spread = {fitter: float(of.std(ddof=1)) for fitter, of in areas.items()}
    relative = {fitter: 100 * spread[fitter] / medians[fitter] for fitter in FITTERS}
    said = "" if number is None else (
        f" The paper's own figures give {_relative(number, 0):.0f} and {_relative(number, 2):.0f} %."
    )  # fmt: skip
    yield (
        f"WCTLS is more stable from scan to scan: the dispersion of its areas is lower ({name}).",
        f"{spread['utls']:.0f} mm² by UTLS, {spread['wctls']:.0f} by WCTLS; but in relation to the area itself "
        f"{relative['utls']:.1f} and {relative['wctls']:.1f} %.{said}",
        relative["wctls"] < relative["utls"],
    )


def _relative(number: int, fitter: int) -> float:
    area, spread = AREAS[number][fitter]
    return 100 * spread / area


def _of_time(result: Result) -> Claim:
    t = result.times
    return (
        "WCTLS does not increase the computational complexity.",
        f"A line of 50 points with both covariances, compiled: UTLS {t['utls']:.2f}, WTLS {t['wtls']:.2f}, "
        f"WCTLS {t['wctls']:.2f} µs; all take time proportional to the points.",
        t["wctls"] < 1.5 * t["wtls"],
    )
