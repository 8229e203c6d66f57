"""The real walls of the guide: what is said of their scatter holds where the truth is known, and is drawn as it is."""

import re
from pathlib import Path

import numpy as np
import pytest

from docs.guide.patterns import pattern
from docs.guide.real_wall import NOISE, STRAIGHT, STRETCHES, WallScan, once, walls
from docs.guide.text import WORDS
from lidarcore import Scan

ALPHA, R = 0.25, 1.5
SPACING = np.radians(0.72)  # of an RPLIDAR C1


def simulated(rng: np.random.Generator, unevenness: float) -> WallScan:
    """A wall of 40 beams with the white noise of the sensor and an Ornstein-Uhlenbeck process along it."""
    bearings = ALPHA + SPACING * np.arange(-20, 20)
    incidence = bearings - ALPHA
    t = R * np.tan(incidence)
    pattern = unevenness**2 * np.exp(-np.abs(t - t[:, None]) / NOISE.unevenness_length)
    off = rng.multivariate_normal(np.zeros(40), pattern + 1e-18 * np.eye(40), method="cholesky")
    ranges = (R + off) / np.cos(incidence)
    return WallScan(
        ranges + rng.normal(0, np.sqrt(NOISE.range_variances(ranges))),
        bearings + rng.normal(0, NOISE.sigma_bearing, 40),
    )


def known(unevenness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Root mean squares of errors, and of what is told without stretches and without single beams: (2,) each."""
    rng = np.random.default_rng(0)
    scans = [simulated(rng, unevenness) for _ in range(300)]
    errors = [[line.alpha - ALPHA, line.r - R] for line in (scan.fit() for scan in scans)]
    told = [[scan.scatter(groups) for scan in scans] for groups in (STRETCHES, 40)]
    errors, by_stretches, by_beams = (np.sqrt(np.mean(np.square(x), 0)) for x in (errors, *told))
    return errors, by_stretches, by_beams


def test_on_straight_walls_beams_and_stretches_tell_how_lines_scatter() -> None:
    errors, by_stretches, by_beams = known(0.0)
    assert by_stretches == pytest.approx(errors, rel=0.2)
    assert by_beams == pytest.approx(errors, rel=0.2)
    claim = np.sqrt(
        np.diag(simulated(np.random.default_rng(1), 0.0).fit(straight=True).covariance_consistent)
    )
    assert claim == pytest.approx(errors, rel=0.15)


def test_on_uneven_walls_stretches_tell_how_lines_scatter_and_beams_tell_too_little() -> None:
    errors, by_stretches, by_beams = known(NOISE.unevenness)
    assert by_stretches == pytest.approx(errors, rel=0.25)
    assert (by_beams < 0.75 * errors).all()


def test_ranges_that_were_written_several_times_are_taken_once() -> None:
    scan = once(Scan([1.0, 1.0, 2.0, 3.0, 3.0, 3.0], [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]))
    assert scan.ranges.tolist() == [1.0, 2.0, 3.0]
    assert scan.bearings == pytest.approx([0.05, 0.2, 0.4])


def test_the_walls_are_the_same_in_both_recordings_and_uneven() -> None:
    for wall in walls():
        one, other = (scan.fit() for scan in wall.scans)
        assert abs(one.alpha - other.alpha) < 0.02
        assert abs(one.r - other.r) < 0.005
        assert wall.repeats() > 0.5
        for scan in wall.scans:
            assert scan.neighbours() > 0.3
            assert STRAIGHT.sigma_range / 2 < scan.profile()[1].std() < 2 * NOISE.unevenness


def test_what_is_drawn_is_what_was_measured() -> None:
    real, white = re.findall("<svg.*?</svg>", pattern())
    for style, scan in zip(("m0", "m1"), walls()[0].scans, strict=True):
        for drawing in (real, white):
            (path,) = re.findall(rf'class="dots {style}" d="(.*?)"', drawing)
            dots = np.array([[float(x), float(y)] for x, y in re.findall(r"M([\d.-]+) ([\d.-]+)h0", path)])
            assert len(dots) == len(scan.ranges)
            profile = scan.profile()
            assert np.corrcoef(dots[:, 0], profile[0])[0, 1] == pytest.approx(1, abs=1e-6)
            if drawing is real:
                assert np.corrcoef(dots[:, 1], profile[1])[0, 1] == pytest.approx(-1, abs=1e-6)


def test_the_words_say_what_came_out() -> None:
    """Lines scatter more than is claimed for straight walls, on each of them; for uneven ones it is near."""
    for wall in walls():
        scatter = wall.scatter()
        assert (scatter > wall.claim("ml", "consistent", straight=True)).all()
        assert (scatter > wall.scatter(by_beams=True)).all()
        assert (np.abs(np.log(scatter / wall.claim("ml", "consistent", straight=False))) < np.log(2)).all()
    licence = Path(__file__).parents[1] / "data" / "tau_rplidar_c1_rooms" / "LICENSE"
    assert "TAU CGL" in licence.read_text("utf-8")
    assert "MIT" in licence.read_text("utf-8")
    assert "TAU CGL" in pattern()
    assert "![pattern]" in WORDS.read_text("utf-8")
