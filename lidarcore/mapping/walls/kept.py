"""How walls err together, as bytes that are kept: the lower triangle of the covariance of their ends, and whose it is.

Compressed by zlib: ids of the W walls (int64), then row by row the triangle of (4 W, 4 W) m² (float32), little-endian.
"""

import zlib

import numpy as np

from lidarcore.errors import MapFileError
from lidarcore.files import reason
from lidarcore.mapping.grid.occupancy import Mask
from lidarcore.mapping.walls.joint import NUMBERS, JointWalls, Singles, joint_walls
from lidarcore.mapping.walls.table import WallTable

MOST_WALLS = 1000
"""Walls of which it is kept how they err together; that takes 32 MB."""
_ID, _NUMBER = np.dtype("<i8"), np.dtype("<f4")


def pack_covariance(walls: JointWalls, chosen: Mask | None = None) -> bytes | None:
    """The covariance of the ends of all or chosen walls (W,) as bytes; None if they are more than MOST_WALLS."""
    which = np.arange(len(walls)) if chosen is None else np.flatnonzero(chosen)
    if len(which) > MOST_WALLS:
        return None
    C = walls.model.covariance(walls.model.ends_of(*which.tolist()))
    ids, lower = walls.ids[which].astype(_ID), C[np.tri(len(C), dtype=np.bool_)].astype(_NUMBER)
    return zlib.compress(ids.tobytes() + lower.tobytes())


def unpack_covariance(packed: bytes, walls: WallTable) -> JointWalls:
    """The same walls, knowing how they err together. Raises MapFileError if that is damaged, or of other walls."""
    try:
        return joint_walls(walls, _checked(_unpacked(packed, walls)))
    except (ValueError, zlib.error) as error:
        raise MapFileError(f"How the walls of this map err together is damaged: {reason(error)}.") from error


def _unpacked(packed: bytes, walls: WallTable) -> Singles:
    """(4 W, 4 W) m². Raises ValueError or zlib.error."""
    count, n = len(walls), NUMBERS * len(walls)
    size = _ID.itemsize * count + _NUMBER.itemsize * n * (n + 1) // 2
    if count > MOST_WALLS:
        raise ValueError(f"there are {count} walls, more than {MOST_WALLS}")
    stream = zlib.decompressobj()
    content = stream.decompress(packed, size + 1)
    if len(content) != size or not stream.eof:
        raise ValueError(f"it has not the {size} bytes that {count} walls take")
    if not np.array_equal(np.frombuffer(content, _ID, count), walls.ids):
        raise ValueError("it is of other walls")
    C, below = np.zeros((n, n), np.float32), np.tri(n, dtype=np.bool_)
    C[below] = C.T[below] = np.frombuffer(content, _NUMBER, offset=_ID.itemsize * count)
    return C


def _checked(C: Singles) -> Singles:
    """The covariance, if it can be one up to the rounding of its numbers. Raises ValueError."""
    variances = np.diag(C)
    if not np.isfinite(C).all() or (variances < 0).any():
        raise ValueError("it has numbers that no covariance has")
    sigmas = np.sqrt(np.where(variances > 0, variances, np.float32(1)))
    correlations = C / sigmas[:, None] / sigmas
    correlations[np.diag_indices(len(C))] += 2 * len(C) * np.finfo(np.float32).eps  # more than rounding takes
    try:
        np.linalg.cholesky(correlations)
    except np.linalg.LinAlgError as error:
        raise ValueError("it is not positive semi-definite") from error
    return C
