"""From a scan to segments and corners: the algorithm on one screen."""

import threading
from collections.abc import Callable, Iterable

import numpy as np

from lidarcore.compiled import inlined, kernel
from lidarcore.corners import find_corners
from lidarcore.features import Features
from lidarcore.lines import FITTER_IDS, FITTERS
from lidarcore.polar import unit_vectors
from lidarcore.scan import Array, Ints, Scan
from lidarcore.segmentation import compact, find_pieces, mean_increment, noise_seen
from lidarcore.settings import ExtractionSettings
from lidarcore.tables import FIELDS
from lidarcore.walls import fit_pieces

Parameters = tuple[float, float, float, float, float, float, float, float]


def extract(scan: Scan, settings: ExtractionSettings | None = None) -> Features:
    """Segments and corners of one scan, with covariances in the sensor frame, and what was rejected and why."""
    settings = settings or ExtractionSettings()
    return compare(scan, settings, (settings.fitter,))[settings.fitter]


def compare(
    scan: Scan, settings: ExtractionSettings | None = None, fitters: Iterable[str] = tuple(FITTERS)
) -> dict[str, Features]:
    """The same scan by several fitters: segmented once, fitted by each; keyed by the fitter's name.

    Raises ValueError for a name that is not in FITTERS.
    """
    settings, names = settings or ExtractionSettings(), tuple(fitters)
    if unknown := [name for name in names if name not in FITTER_IDS]:
        raise ValueError(f"unknown fitters {unknown}: choose from {', '.join(FITTERS)}")
    buffers = _buffers.of(len(scan))
    ids = np.array([FITTER_IDS[name] for name in names])
    tables, counts, seen = _extract(scan.ranges, scan.bearings, ids, _parameters(settings), *buffers)
    return {
        name: Features(scan, settings, name, table, count, seen)
        for name, table, count in zip(names, tables, counts.tolist(), strict=True)
    }


def compiled_call(beams: int, settings: ExtractionSettings) -> Callable[[Array, Array, Ints], object]:
    """The compiled call alone, for scans of this many beams: what `compare` wraps in Python objects."""
    parameters, buffers = _parameters(settings), _buffers.of(beams)
    return lambda ranges, bearings, fitters: _extract(ranges, bearings, fitters, parameters, *buffers)


def warm_up() -> None:
    """Compile every kernel, or load it from the cache: seconds the first time, so do it before the first scan."""
    bearings = np.linspace(-np.pi, np.pi, 100, endpoint=False)
    square = Scan(1 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings))), bearings)
    extract(square)
    FITTERS["ml"].fit(square.ranges[:5], square.bearings[:5], ExtractionSettings().noise)


def _parameters(settings: ExtractionSettings) -> Parameters:
    """The settings as the kernels take them; variances squared and the angle turned into its sine once."""
    return (
        settings.noise.sigma_range**2,
        settings.noise.sigma_bearing**2,
        settings.split_threshold,
        settings.gap,
        float(settings.min_points),
        settings.min_length,
        float(np.sin(settings.corner_angle)),
        settings.corner_gap,
    )


@kernel
def _extract(
    ranges: Array, bearings: Array, fitters: Ints, parameters: Parameters, floats: Array, indices: Ints
) -> tuple[Array, Ints, float]:
    """For each fitter a table of segments, corners and rejections, the numbers of each, and the noise seen.

    A table has rows of segments, then corners; rejections are its last rows, backwards from the end.
    """
    v_rho, v_theta, _, _, min_points, min_length, sin_angle, corner_gap = parameters
    points, weights, beams = floats[:3], floats[3], indices[0]
    first, last, seen = _segment(ranges, bearings, parameters, points, beams, weights, indices[1:])
    # Of P pieces every one makes a segment or a rejection, and so does every pair of neighbours: 2 P rows are enough.
    tables, counts = np.empty((len(fitters), 2 * len(first), FIELDS)), np.empty((len(fitters), 3), np.int64)
    for f in range(len(fitters)):
        table, backwards = tables[f], tables[f, ::-1]
        n, rejected = fit_pieces(
            points,
            beams,
            first,
            last,
            fitters[f],
            v_rho,
            v_theta,
            min_points,
            min_length,
            weights,
            table,
            backwards,
        )
        counts[f, 0] = n
        counts[f, 1], counts[f, 2] = find_corners(
            table, n, sin_angle, corner_gap, table[n:], backwards, rejected
        )
    return tables, counts, seen


@inlined
def _segment(
    ranges: Array,
    bearings: Array,
    parameters: Parameters,
    points: Array,
    beams: Ints,
    scratch: Array,
    indices: Ints,
) -> tuple[Ints, Ints, float]:
    """Beams to points, points to pieces: first and last point of each, and the noise seen in the ranges."""
    v_rho, v_theta, threshold, gap = parameters[:4]
    unit_vectors(bearings, points[1], points[2])
    n = compact(ranges, points, beams)
    # Told too little noise, walls would fall apart: pieces are made for the noise seen, if that is larger.
    seen = noise_seen(points[0, :n], scratch)
    v_rho = max(v_rho, seen * seen)
    increment = mean_increment(bearings)
    first, last = find_pieces(points, beams, n, v_rho, v_theta, threshold, gap, increment, scratch, indices)
    return first, last, seen


class _Buffers(threading.local):
    """Scratch for one scan, kept for the next one by the same thread."""

    floats = np.empty((4, 0))  # points (rho, c, s), weights
    indices = np.empty((7, 0), np.int64)  # beams, and those of `find_pieces`

    def of(self, beams: int) -> tuple[Array, Ints]:
        """Buffers for a scan of this many beams, and for the ring unrolled."""
        if self.floats.shape[1] < 2 * beams + 2:
            self.floats, self.indices = np.empty((4, 2 * beams + 2)), np.empty((7, 2 * beams + 2), np.int64)
        return self.floats, self.indices


_buffers = _Buffers()
