"""What is measured in one scan: the value by hand, and its sigma against what scatters."""

import numpy as np
import pytest

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract
from lidarcore.errors import MeasureError
from lidarcore.mapping.measure import Feature
from lidarcore.mapping.scan_measure import angle, distance

SIGMA = 0.01
NOISE = SensorNoise(sigma_range=SIGMA, sigma_bearing=1e-6)
SCANS = 400
# A chi-square of 400 lies outside of 0.68..1.40 times its mean with a probability below 1e-6: a covariance that leaves
# out a shared wall, or counts it twice, is wrong by a factor of two here.
BAND = (0.68, 1.40)


def room(rng: np.random.Generator) -> Scan:
    """A rectangle from (-2.5, -1.8) to (3.5, 2.2) m, seen from inside."""
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    c, s = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide="ignore"):
        ranges = np.minimum(np.maximum(3.5 / c, -2.5 / c), np.maximum(2.2 / s, -1.8 / s))
    return Scan(ranges + rng.normal(0, SIGMA, len(ranges)), bearings)


def nearest(found, kind: str, xy: tuple[float, float]) -> Feature:
    spots = found.corners.xy if kind == "corner" else (found.segments.start + found.segments.end) / 2
    return Feature(kind, int(np.hypot(*(spots - xy).T).argmin()))


@pytest.mark.parametrize(
    ("kinds", "places", "truth"),
    [
        (("corner", "corner"), ((3.5, 2.2), (-2.5, 2.2)), 6.0),  # they share a wall
        (("corner", "corner"), ((3.5, 2.2), (-2.5, -1.8)), np.hypot(6, 4)),
        (("corner", "wall"), ((3.5, 2.2), (0.5, -1.8)), 4.0),
        (("wall", "wall"), ((0.5, 2.2), (0.5, -1.8)), 4.0),
    ],
)
def test_a_distance_scatters_as_it_says(kinds: tuple, places: tuple, truth: float) -> None:
    rng = np.random.default_rng(5)
    settings = ExtractionSettings(noise=NOISE)
    squares = []
    for _ in range(SCANS):
        found = extract(room(rng), settings)
        measured = distance(found, *(nearest(found, *one) for one in zip(kinds, places, strict=True)))
        squares.append(((measured.value - truth) / measured.sigma) ** 2)
    assert BAND[0] < np.mean(squares) < BAND[1]


def test_an_angle_is_that_between_the_lines() -> None:
    found = extract(room(np.random.default_rng(6)), ExtractionSettings(noise=NOISE))
    walls = (nearest(found, "wall", (0.5, 2.2)), nearest(found, "wall", (3.5, 0.2)))
    measured = angle(found, *walls)
    variances = [found.lines.covariance[wall.index, 0, 0] for wall in walls]
    assert measured.value == pytest.approx(np.pi / 2, abs=6 * measured.sigma)
    assert measured.sigma == pytest.approx(np.sqrt(sum(variances)), rel=1e-3)


def test_walls_that_face_each_other_are_parallel() -> None:
    found = extract(room(np.random.default_rng(6)), ExtractionSettings(noise=NOISE))
    measured = angle(found, nearest(found, "wall", (0.5, 2.2)), nearest(found, "wall", (0.5, -1.8)))
    assert measured.value < 6 * measured.sigma < 0.1


def test_what_cannot_be_measured_says_why() -> None:
    found = extract(room(np.random.default_rng(7)))
    wall, corner = Feature("wall", 0), Feature("corner", 0)
    with pytest.raises(MeasureError, match="give two"):
        distance(found, wall, wall)
    with pytest.raises(MeasureError, match="Only walls"):
        angle(found, wall, corner)
    with pytest.raises(MeasureError, match="no corner-99"):
        distance(found, wall, Feature("corner", 99))
