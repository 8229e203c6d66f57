"""The guide's tables."""

from lidarcore import reporting
from lidarcore.evaluation.consistency.trials import Segmentation
from lidarcore.evaluation.intervals import LEVEL
from lidarcore.experiments.corner_study import Method
from lidarcore.lines import FITTERS

from .measurement import Measurement
from .numbers import Told, judged
from .real_wall import walls

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
    return reporting.table(
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
    return reporting.table("What a filter makes of the ellipses; root mean squares", headers, rows, texts=2)


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
    return reporting.table(
        f"Corners fused from {sightings} scans, small room, segments known", headers, rows, texts=2
    )


def real_claims() -> str:
    """What every method claims of the real wall that is drawn."""
    wall = walls()[0]
    rows = []
    for name in FITTERS:
        claims = [
            wall.claim(name, "published", True),
            wall.claim(name, "consistent", True),
            wall.claim(name, "consistent", False),
        ]
        numbers = [f"{Told(float(r)):2mm!}" for _, r in claims] + [
            f"{Told(float(alpha)):2mrad!}" for alpha, _ in claims
        ]
        rows.append([name, *numbers])
    kinds = ("published", "consistent, straight walls", "consistent, uneven walls")
    headers = (
        "method",
        *(f"distance, mm: {kind}" for kind in kinds),
        *(f"angle, mrad: {kind}" for kind in kinds),
    )
    return reporting.table("Standard deviations that are claimed of the wall in the picture", headers, rows)


def real_scatter() -> str:
    """What scatters when parts of real walls are left out, beside what `ml` claims."""
    rows = []
    for wall in walls():
        numbers = (
            wall.claim("ml", "consistent", True),
            wall.claim("ml", "consistent", False),
            wall.scatter(by_beams=True),
            wall.scatter(),
        )
        place = f"{Told(wall.distance):2m} away, {Told(wall.length):2m} long"
        rows.append([place, "distance, mm", *(f"{Told(float(r)):2mm!}" for _, r in numbers)])
        rows.append(["", "angle, mrad", *(f"{Told(float(alpha)):2mrad!}" for alpha, _ in numbers)])
    headers = (
        "wall",
        "",
        "claimed, straight walls",
        "claimed, uneven walls",
        "without single beams",
        "without stretches",
    )
    return reporting.table(
        "Standard deviations of `ml`: claimed, and as parts of the wall tell them", headers, rows, texts=2
    )
