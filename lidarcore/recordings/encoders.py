"""Dead reckoning from the wheel or track encoders of a robot with two driven sides."""

import numpy as np

from lidarcore.arrays import Array


def dead_reckoning(ticks: Array, metres_per_tick: float, track_width: float) -> Array:
    """Poses (M, 3) of the robot's centre from ticks (M, 2) of the left and right side, along arcs."""
    left, right = np.diff(ticks, axis=0, prepend=ticks[:1]).T * metres_per_tick
    turns = (right - left) / track_width
    headings = np.cumsum(turns)
    steps = (left + right) / 2 * np.sinc(turns / (2 * np.pi)) * np.exp(1j * (headings - turns / 2))
    positions = np.cumsum(steps)
    return np.stack([positions.real, positions.imag, headings], -1)


def unwrapped(counts: Array, bits: int) -> Array:
    """Counts (M, ...) of counters with so many bits as if they never wrapped: each step goes the nearer way."""
    span = 2.0**bits
    steps = np.diff(counts, axis=0)
    return np.cumsum(np.concatenate([counts[:1], steps - span * np.round(steps / span)]), axis=0)
