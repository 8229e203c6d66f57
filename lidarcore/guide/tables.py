"""The guide's tables."""

from lidarcore.evaluation.intervals import LEVEL
from lidarcore.evaluation.trials import Segmentation
from lidarcore.experiments import report
from lidarcore.experiments.corner_study import Method
from lidarcore.guide.measurement import Measurement
from lidarcore.guide.numbers import Told, judged
from lidarcore.lines import FITTERS

_PUBLISHED: tuple[Method, ...] = (("cwlf", "published"), ("wctls", "published"))
_CONSISTENT: tuple[Method, ...] = tuple((name, "consistent") for name in FITTERS)
_SEGMENTS = {"known": "segments known", "found": "segments found by the program"}


def believable(m: Measurement, segments: Segmentation) -> str:
    """Coverage of every method at every noise."""
    noises = m.design.table.noises
    rows = [
        [*method, *(judged(m.by_noise[noise, segments, *method]["coverage_95"]) for noise in noises)]
        for method in (*_CONSISTENT, *_PUBLISHED)
    ]
    headers = ["method", "covariance", *(f"range noise {Told(noise.sigma_range):cm}" for noise in noises)]
    return report.table(
        f"Corners inside the {Told(LEVEL):%} ellipse, %: {_SEGMENTS[segments]}", headers, rows, texts=2
    )


def filtered(m: Measurement) -> str:
    """A filter fed by one method or another."""
    rows = [
        [
            *method,
            f"{Told(fed.error):1mm!}",
            f"{Told(fed.claimed):1mm!}",
            f"{Told(fed.anees):2}",
            f"{Told(fed.unused):1%!}",
        ]
        for method, fed in m.filtered.items()
    ]
    headers = (
        "fed by",
        "covariance",
        "error of position, mm",
        "claim, mm",
        "ANEES of the pose",
        "corners not used, %",
    )
    return report.table("What a filter makes of the ellipses; root mean squares", headers, rows, texts=2)


def fused(m: Measurement) -> str:
    """Many sightings made into one."""
    rows = []
    for method in (*_PUBLISHED, *_CONSISTENT):
        noisy, exact = m.fused["papers"][method], m.fused["exact"][method]
        numbers = (
            f"{Told(noisy.error):2mm!}", f"{Told(noisy.claimed):~2mm!}", f"{Told(noisy.coverage):1%!}",
            f"{Told(exact.coverage):1%!}",
        )  # fmt: skip
        rows.append([*method, *numbers])
    headers = (
        "method",
        "covariance",
        "error, mm",
        "claim, mm",
        "inside, %",
        "inside with the better sensor, %",
    )
    sightings = f"{Told(float(m.design.sightings))}"
    return report.table(
        f"Corners fused from {sightings} scans, small room, segments known", headers, rows, texts=2
    )
