"""Whatever the scan: every beam is accounted for, every figure is finite, every rejection has its reason."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from core_scans import assert_same_features, covered, furnished_scans, ring, table
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from lidarcore import FITTERS, ExtractionSettings, Scan, SensorNoise, compare, extract

RANGES = st.one_of(
    st.floats(0.05, 12), st.sampled_from([np.nan, 0.0, np.inf, -1.0, 1e-300, 1e300, 5e-324, 40.0, 2.0])
)
SETTINGS = st.builds(
    ExtractionSettings,
    noise=st.builds(SensorNoise, st.floats(1e-4, 0.1), st.floats(1e-5, 0.02)),
    split_threshold=st.floats(0.005, 0.2),
    gap=st.floats(0.02, 2),
    min_points=st.integers(2, 10),
    min_length=st.floats(0, 0.5),
    corner_angle=st.floats(0.02, 1.5),
    corner_gap=st.floats(0.01, 2),
)


@st.composite
def any_scan(draw, ranges=RANGES):
    """Garbage, or walls with garbage in between, all around or in part, at even or uneven bearings."""
    n = draw(st.integers(1, 120))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    turn = draw(st.sampled_from([0.01, 1.0, 4.2, 2 * np.pi * (n - 1) / n]))
    bearings = draw(st.floats(-np.pi, np.pi)) + np.linspace(0, turn, n)
    if draw(st.booleans()):
        bearings = np.sort(bearings + rng.normal(0, turn / n / 3, n))
    normals = rng.uniform(-np.pi, np.pi, draw(st.integers(1, 6)))
    with np.errstate(all="ignore"):
        distance = rng.uniform(0.3, 8, len(normals)) / np.cos(bearings[:, None] - normals)
    walls = np.min(np.where(distance > 0, distance, 30.0), axis=1) + rng.normal(0, 0.01, n)
    garbage = draw(arrays.arrays(float, n, elements=ranges))
    share = draw(st.sampled_from([0.0, 0.05, 0.5, 1.0]))
    return Scan(np.where(rng.random(n) < share, garbage, walls), bearings)


def assert_sound(features):
    n, scan, limits = len(features.scan), features.scan, features.settings
    segments, corners = features.segments, features.corners
    # Every beam that returned is in exactly one segment or one rejected piece.
    counted = np.zeros(n, int)
    rejected = [r for r in features.rejections if r.kind == "segment"]
    pieces = covered(features) + [ring(r.first_beam, r.last_beam, n) for r in rejected]
    for piece in pieces:
        counted[piece] += 1
    assert (counted[scan.valid] == 1).all()
    assert (counted <= 1).all()
    # Numbers are finite and mean what they say.
    rows, corner_rows, _ = table(features)
    assert np.isfinite(rows).all()
    assert np.isfinite(corner_rows).all()
    assert np.isfinite(features.noise_seen)
    assert 1 <= features.noise_excess < np.inf
    for k, beams in enumerate(covered(features)):
        assert segments.n_points[k] == scan.valid[beams].sum() >= limits.min_points
        normal = segments.lines[k].normal
        for end in (segments.start[k], segments.end[k]):
            assert end @ normal == pytest.approx(segments.lines.r[k], abs=1e-9 * np.abs(end).max())
        assert segments.length[k] >= limits.min_length * (1 - 1e-9)
    assert (corners.angle >= limits.corner_angle - 1e-9).all()
    assert (corners.angle <= np.pi / 2 + 1e-9).all()
    for xy, (j, k) in zip(corners.xy, corners.segments, strict=True):
        assert k == (j + 1) % len(segments)
        for line in (segments.lines[j], segments.lines[k]):
            assert xy @ line.normal == pytest.approx(line.r, abs=1e-6 * (1 + np.abs(xy).max()))
    for C in (*corners.covariance_published, *corners.covariance_consistent):
        assert (np.linalg.eigvalsh(C / np.trace(C)) > -1e-12).all()
    # Every pair of neighbours makes a corner or says why not.
    pairs = len(segments) if len(segments) > 2 else max(len(segments) - 1, 0)
    assert len(corners) + len(features.rejections) - len(rejected) == pairs
    for rejection in features.rejections:
        assert rejection.message.endswith(".")
        assert "{" not in rejection.message
        assert "nan" not in rejection.message
        assert np.isfinite(rejection.xy).all()
        if rejection.reason == "ends too far":
            assert rejection.value > rejection.limit
        elif rejection.reason != "no line":
            assert rejection.value < rejection.limit


@settings(max_examples=300)
@given(scan=any_scan(), parameters=SETTINGS)
def test_any_scan_is_accounted_for_by_every_fitter(scan, parameters):
    for features in compare(scan, parameters).values():
        assert_sound(features)


@pytest.mark.parametrize("name", FITTERS)
def test_rooms_are_accounted_for(name):
    for scan, _ in furnished_scans(0.02, 20, seed=21, missing=0.1):
        assert_sound(extract(scan, ExtractionSettings(fitter=name)))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 920])
@pytest.mark.parametrize("name", FITTERS)
def test_a_scan_without_any_return_has_no_features(n, name):
    features = extract(Scan([np.nan] * n, np.linspace(0, 1, n)), ExtractionSettings(fitter=name))
    assert len(features.segments) == len(features.corners) == len(features.rejections) == 0
    assert np.isfinite(features.noise_seen)
    assert 1 <= features.noise_excess < np.inf


@pytest.mark.parametrize("returns", [1, 2, 3, 4])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 100])
@pytest.mark.parametrize("name", FITTERS)
def test_a_few_beams_are_accounted_for(returns, n, name):
    ranges = np.full(n, np.nan)
    ranges[: min(returns, n)] = 1.5
    for least in (2, 6):
        settings = ExtractionSettings(fitter=name, min_points=least, min_length=0.0)
        assert_sound(extract(Scan(ranges, np.linspace(-0.1, 0.1, n)), settings))


def test_two_beams_make_a_segment_if_asked_for():
    settings = ExtractionSettings(min_points=2, min_length=0.1)
    features = extract(Scan([2.0, 2.0], [-0.05, 0.05]), settings)
    assert len(features.segments) == 1
    assert features.segments.lines.r[0] == pytest.approx(2 * np.cos(0.05))


def evenly(n: int) -> np.ndarray:
    return (np.arange(n) + 0.5) * (2 * np.pi / n) - np.pi


def test_a_hundred_thousand_beams_are_four_walls_and_four_corners():
    bearings = evenly(100_000)
    ranges = np.minimum(3 / np.abs(np.cos(bearings)), 2 / np.abs(np.sin(bearings)))
    ranges += np.random.default_rng(0).normal(0, 0.002, len(bearings))
    settings = ExtractionSettings(noise=SensorNoise(0.002, 1e-5))
    features = extract(Scan(ranges, bearings), settings)
    assert sorted(np.round(features.segments.lines.r, 3)) == [2.0, 2.0, 3.0, 3.0]
    assert np.abs(features.corners.xy) == pytest.approx(np.tile([3.0, 2.0], (4, 1)), abs=0.001)


def test_cost_grows_linearly_with_beams():
    """Ten times the beams take about ten times as long; a quadratic step would take a hundred times."""
    times = []
    for n in (10_000, 100_000):
        bearings = evenly(n)
        ranges = np.minimum(3 / np.abs(np.cos(bearings)), 2 / np.abs(np.sin(bearings)))
        scan = Scan(ranges + np.random.default_rng(1).normal(0, 0.01, n), bearings)
        best = np.inf
        for _ in range(7):
            start = time.perf_counter()
            extract(scan)
            best = min(best, time.perf_counter() - start)
        times.append(best)
    print("10,000 beams", times[0], "s; 100,000 beams", times[1], "s")
    assert times[1] < 20 * times[0]


def test_threads_do_not_disturb_each_other():
    scans = [scan for scan, _ in furnished_scans(0.02, 20, seed=22)]
    scans += [Scan(scan.ranges[: 50 + 20 * k], scan.bearings[: 50 + 20 * k]) for k, scan in enumerate(scans)]
    alone = [extract(scan) for scan in scans]
    found: dict[int, list] = {0: [], 1: []}

    def work(thread):
        for _ in range(10):
            found[thread] = [extract(scan) for scan in scans[:: 1 if thread else -1]]

    threads = [threading.Thread(target=work, args=(k,)) for k in found]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    for results, order in ((found[0][::-1], "backwards"), (found[1], "forwards")):
        assert len(results) == len(alone), order
        for a, b in zip(results, alone, strict=True):
            assert_same_features(a, b)


def test_features_of_an_earlier_scan_stay_as_they_were():
    scans = [scan for scan, _ in furnished_scans(0.02, 10, seed=23)]
    first = extract(scans[0])
    before = [np.array(part) for part in table(first)[:2]]
    for scan in scans[1:]:
        extract(scan)
    for a, b in zip(before, table(first)[:2], strict=True):
        assert np.array_equal(a, b)


def test_warming_up_leaves_nothing_to_compile():
    """Every kernel is there for the arrays that fits and scans bring, also the writable ones of a user."""
    code = """
import sys, lidarcore
def compiled():
    kernels = {k for m in list(sys.modules.values()) if m.__name__.startswith("lidarcore")
               for k in vars(m).values() if hasattr(k, "signatures")}
    return {(k.__name__, str(signature)) for k in kernels for signature in k.signatures}
lidarcore.warm_up()
before = compiled()
beams = [2.0, 2.1, 2.3, 2.6], [0.0, 0.3, 0.5, 0.7]
for fitter in lidarcore.FITTERS.values():
    fitter.fit(*beams, lidarcore.SensorNoise())
lidarcore.compare(lidarcore.Scan(*beams))
print(sorted(compiled() - before))
"""
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=280, check=True
    )
    assert result.stdout.strip() == "[]"
