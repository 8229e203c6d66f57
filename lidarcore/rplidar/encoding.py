"""Measurements to bytes, as an S1 sends them: for the emulator and for tests."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Q6_TURN = 360 * 64
_CAPSULE = np.dtype([("sync", "u1", 2), ("start", "<u2"), ("distances", "<u2", 40)])
_NODE = np.dtype([("flags", "u1"), ("angle", "<u2"), ("distance", "<u2")])


def encode_dense(start_angle_deg: ArrayLike, distances_mm: ArrayLike, sync: ArrayLike = False) -> bytes:
    """One dense capsule (84 bytes), or P of them in one go.

    start_angle_deg  scalar or (P,), clockwise, of the first sample; kept to 1/64 degree
    distances_mm     (40,) or (P, 40); kept to whole mm; 0 or NaN: no return; none beyond 65,535 mm
    sync             scalar or (P,), true for the first capsule after the scan has started
    """
    distances = np.atleast_2d(np.asarray(distances_mm, np.float64))
    capsules = np.zeros(len(distances), _CAPSULE)
    capsules["start"] = _q6(start_angle_deg) | np.where(sync, 1 << 15, 0)
    capsules["distances"] = _whole(distances)
    checksums = np.bitwise_xor.reduce(capsules.view(np.uint8).reshape(len(capsules), 84)[:, 2:], axis=1)
    capsules["sync"][:, 0] = 0xA0 | checksums & 0xF
    capsules["sync"][:, 1] = 0x50 | checksums >> 4
    return capsules.tobytes()


def encode_nodes(
    angles_deg: ArrayLike, distances_mm: ArrayLike, qualities: ArrayLike, start_flags: ArrayLike
) -> bytes:
    """Nodes of a legacy scan, 5 bytes each; all arguments (N,).

    angles_deg    clockwise; kept to 1/64 degree
    distances_mm  kept to 1/4 mm; 0 or NaN: no return; none beyond 16,383.75 mm
    qualities     0 to 63
    start_flags   true for the first node of a revolution
    """
    starts = np.asarray(start_flags, bool)
    nodes = np.zeros(len(starts), _NODE)
    nodes["flags"] = np.where(starts, 1, 2) | np.clip(qualities, 0, 63).astype(np.uint8) << 2
    nodes["angle"] = _q6(angles_deg) << 1 | 1
    nodes["distance"] = _whole(np.asarray(distances_mm, np.float64) * 4)
    return nodes.tobytes()


def _q6(degrees: ArrayLike) -> NDArray[np.int64]:
    """Whole 1/64 degrees within the turn."""
    return np.rint(np.asarray(degrees, np.float64) * 64).astype(np.int64) % Q6_TURN


def _whole(values: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Whole numbers of 16 bits, 0 for what does not fit."""
    whole = np.rint(values)
    fits = (whole > 0) & (whole <= 0xFFFF)  # NaN does not
    return np.where(fits, whole, 0).astype(np.uint16)
