"""Which way the surfaces of cells lie, by what lies on the same line around them.

A line through half a metre of wall is off by some hundredths of a radian, in each cell of a corridor by others. So
cells seem to tell how far along it a scan was taken, each with an information of 12 over its length squared, however
noisy its points are, for what is known less turns more. Together that was more than odometry tells, and made maps of
corridors shorter. Of lines along metres of wall next to nothing of it is left.
"""

import numpy as np
from scipy.spatial import cKDTree

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import left_of
from lidarcore.mapping.graph.adjustment_cells import Lines

_FAR = 3.0  # m between cells that may lie on one line
_TURNED = 0.2  # rad between their lines
_RELIEF = 0.01  # m by which walls are off lines of that length
_GATE = 9.0  # squared standard deviations across, from which on a cell is of another surface


def line_normals(lines: Lines, islands: Ints) -> Array:
    """Normals (C, 2) of the lines of cells, each of one island (C,); those of cells that tell nothing are 0."""
    shared = np.flatnonzero(lines.shared)
    (a, b), N = lines.fits[shared].T, lines.N[shared]
    normals = lines.frames[shared, 2:]
    along = left_of(normals)
    middles = N[:, 0, 1] / N[:, 0, 0]
    places = lines.frames[shared, :2] + (a + b * middles)[:, None] * normals + middles[:, None] * along
    normals = normals - b[:, None] * along
    normals /= np.hypot(*normals.T)[:, None]
    turn = _turned(
        places, normals, 1 / N[:, 0, 0], N[:, 1, 1] - N[:, 0, 1] ** 2 / N[:, 0, 0], islands[shared]
    )
    found = np.zeros((len(lines.fits), 2))
    found[shared] = normals - turn[:, None] * left_of(normals)
    found[shared] /= np.hypot(*found[shared].T)[:, None]
    return found


def _turned(places: Array, normals: Array, offsets: Array, slopes: Array, islands: Ints) -> Array:
    """Slope (C,) of what lies on the line of each cell around it, against its own line.

    offsets (C,) m² are the variances of lines across, slopes (C,) 1/rad² the information of their directions.
    """
    embedded = np.column_stack([places, _FAR / _TURNED * normals, 2 * _FAR * islands])
    pairs = cKDTree(embedded).query_pairs(_FAR, output_type="ndarray")
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    off, n = places[j] - places[i], normals[i]
    r, t = np.einsum("ni,ni->n", off, n), np.einsum("ni,ni->n", off, left_of(n))
    slope = -np.einsum("ni,ni->n", normals[j], left_of(n))  # of the other line
    across = offsets[j] + _RELIEF**2
    one = r**2 < _GATE * (across + offsets[i] + t**2 / slopes[i])
    i, r, t, slope, w, W = i[one], r[one], t[one], slope[one], 1 / across[one], slopes[j[one]]

    def total(values: Array) -> Array:
        return np.bincount(i, values, len(places)).astype(np.float64)

    S00, S01, S11 = 1 / offsets + total(w), total(w * t), slopes + total(w * t * t + W)
    m0, m1 = total(w * r), total(w * r * t + W * slope)
    found: Array = (S00 * m1 - S01 * m0) / (S00 * S11 - S01**2)
    return found
