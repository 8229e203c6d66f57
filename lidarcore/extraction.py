"""From a scan to segments and corners: the algorithm on one screen."""

import threading
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.corners import find_corners
from lidarcore.features import Features
from lidarcore.lines import FITTER_IDS, FITTERS, WORK
from lidarcore.noise import NoiseModel
from lidarcore.polar import cos_sin
from lidarcore.scan import Scan
from lidarcore.segmentation import (
    Cuts,
    Pieces,
    Ring,
    compact,
    find_pieces,
    for_pieces,
    mean_increment,
    noise_seen,
)
from lidarcore.settings import ExtractionSettings
from lidarcore.tables import FIELDS
from lidarcore.walls import Least, fit_pieces


class Parameters(NamedTuple):
    """The settings as the kernels take them: variances squared and the angle turned into its sine once."""

    noise: NoiseModel
    cuts: Cuts
    least: Least
    sin_corner_angle: float
    corner_gap: float


def extract(scan: Scan, settings: ExtractionSettings | None = None) -> Features:
    """Find the wall segments of one scan and the corners in which they meet, each with its covariance.

    scan      one revolution, sensor frame
    settings  segmentation, fitter, noise of the sensor; the defaults of ExtractionSettings if None

    Returns `Features`: segments and corners in the sensor frame, and what was rejected and why. A scan without walls
    has none; that is no error.

    >>> import numpy as np
    >>> from lidarcore import Scan, extract
    >>> bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    >>> square = Scan(2 / np.maximum(abs(np.cos(bearings)), abs(np.sin(bearings))), bearings)
    >>> features = extract(square)
    >>> len(features.segments), len(features.corners), features.corners.covariance.shape
    (4, 4, (4, 2, 2))
    """
    settings = settings or ExtractionSettings()
    return compare(scan, settings, (settings.fitter,))[settings.fitter]


def compare(
    scan: Scan, settings: ExtractionSettings | None = None, fitters: Iterable[str] = tuple(FITTERS)
) -> dict[str, Features]:
    """Extract features from one scan by several fitters: it is segmented once, and fitted by each.

    scan      one revolution, sensor frame
    settings  as for `extract`; its fitter is not used
    fitters   names from FITTERS; all of them by default

    Returns the `Features` by each fitter's name. Raises ValueError for a name that is not in FITTERS.

    >>> import numpy as np
    >>> from lidarcore import Scan, compare
    >>> bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    >>> square = Scan(2 / np.maximum(abs(np.cos(bearings)), abs(np.sin(bearings))), bearings)
    >>> {name: len(found.corners) for name, found in compare(square, fitters=["ml", "wctls"]).items()}
    {'ml': 4, 'wctls': 4}
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
    return Parameters(
        settings.noise.model(settings.latent_bearings),
        Cuts(settings.split_threshold, settings.gap),
        Least(float(settings.min_points), settings.min_length),
        float(np.sin(settings.corner_angle)),
        settings.corner_gap,
    )


@kernel
def _extract(
    ranges: Array, bearings: Array, fitters: Ints, settings: Parameters, floats: Array, indices: Ints
) -> tuple[Array, Ints, float]:
    """For each fitter a table of segments, corners and rejections, the numbers of each, and the noise seen.

    A table has rows of segments, then corners; rejections are its last rows, backwards from the end.
    """
    ring, work = Ring(floats[:3], indices[0]), floats[3:]
    pieces, seen = _segment(ranges, bearings, settings, ring, work[0], indices[1:])
    # Of P pieces every one makes a segment or a rejection, and so does every pair of neighbours: 2 P rows are enough.
    tables = np.empty((len(fitters), 2 * len(pieces.first), FIELDS))
    counts = np.empty((len(fitters), 3), np.int64)
    for f in range(len(fitters)):
        table, backwards = tables[f], tables[f, ::-1]
        n, rejected = fit_pieces(
            ring, pieces, fitters[f], settings.noise, settings.least, work, table, backwards
        )
        counts[f, 0] = n
        counts[f, 1], counts[f, 2] = find_corners(
            table, n, settings.sin_corner_angle, settings.corner_gap, table[n:], backwards, rejected
        )
    return tables, counts, seen


@inlined
def _segment(
    ranges: Array,
    bearings: Array,
    settings: Parameters,
    ring: Ring,
    scratch: Array,
    indices: Ints,
) -> tuple[Pieces, float]:
    """Beams to points, points to pieces: first and last point of each, and the noise seen in the ranges."""
    points = ring.points
    cos_sin(bearings, points[1], points[2])
    n = compact(ranges, points, ring.beams)
    seen = noise_seen(points[0, :n], scratch)
    noise = for_pieces(settings.noise, seen)
    increment = mean_increment(bearings)
    return find_pieces(ring, n, noise, settings.cuts, increment, scratch, indices), seen


class _Buffers(threading.local):
    """Scratch for one scan, kept for the next one by the same thread."""

    floats = np.empty((3 + WORK, 0))  # points (rho, c, s), scratch of the fitters
    indices = np.empty((7, 0), np.int64)  # beams, and those of `find_pieces`

    def of(self, beams: int) -> tuple[Array, Ints]:
        """Buffers for a scan of this many beams, and for the ring unrolled."""
        if self.floats.shape[1] < 2 * beams + 2:
            self.floats = np.empty((3 + WORK, 2 * beams + 2))
            self.indices = np.empty((7, 2 * beams + 2), np.int64)
        return self.floats, self.indices


_buffers = _Buffers()
