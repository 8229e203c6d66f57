"""What a LaserScan cannot say: exact bearings and times of the beams, and sectors lost.

A LaserScan's bearings are evenly spaced, an RPLIDAR's are not. Our recordings therefore carry, before each LaserScan
on /scan, a message of this type on /scan/beams with the same header: the LaserScan serves every other program, the two
together give back the scan that was recorded.
"""

from typing import Any, NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.scan import Scan

BEAMS = "lidarcore_msgs/Beams"
BEAMS_DEFINITION = """\
# What the sensor_msgs/LaserScan with the same header cannot say. Counter-clockwise from x forward, REP-103.
std_msgs/Header header
float64[] bearings  # rad, of each of the LaserScan's ranges; NaN where the data of that beam were lost
float32[] times     # s after header.stamp, of each of the LaserScan's ranges; empty if unknown
float64[] gaps      # rad, from and to of each sector whose data were lost
"""
MOST_LOST = 20_000  # beams in a turn: bounds what a scan of a few beams close together could ask for
FINEST = 1e-7  # rad between beams, below which they all have one bearing, and any increment serves


class Grid(NamedTuple):
    """A scan on evenly spaced bearings: beam i of the scan is in place[i] of `size` places."""

    angle_min: float
    increment: float
    size: int
    place: Ints

    def spread(self, values: Array, missing: float = np.nan) -> Array:
        """Values of the beams (N,) at their places (size,)."""
        row = np.full(self.size, missing, np.float64)
        row[self.place] = values
        return row


def grid(scan: Scan) -> Grid:
    """Lay a scan on a grid in the order of time, so that a clockwise sensor gets a negative increment.

    The beams follow each other; a sector lost between two of them keeps the places of the beams lost there.
    """
    steps = np.diff(scan.bearings)
    steps[steps < 0] += 2 * np.pi
    place = np.arange(len(scan)) + np.concatenate([[0], np.cumsum(_lost(scan, steps))])
    size = int(place[-1]) + 1
    increment = float(steps.sum()) / max(size - 1, 1)
    if increment < FINEST:
        increment = 2 * np.pi / size
    times = scan.beam_times
    if times is not None and times[-1] < times[0]:
        return Grid(float(scan.bearings[-1]), -increment, size, size - 1 - place)
    return Grid(float(scan.bearings[0]), increment, size, place)


def _lost(scan: Scan, steps: Array) -> Ints:
    """(N - 1,) how many beams are missing between each beam and the next, going by the usual step."""
    lost = np.zeros(len(steps), np.int64)
    if len(scan.gaps) and len(steps):
        usual = max(float(np.median(steps)), 2 * np.pi / MOST_LOST)
        from_, to = scan.gaps.T
        middles = (from_ + (to - from_) % (2 * np.pi) / 2 - scan.bearings[0]) % (2 * np.pi)
        before = np.searchsorted(np.cumsum(steps), middles, side="right")
        before = before[before < len(steps)]
        lost[before] = np.maximum(np.rint(steps[before] / usual) - 1, 0)
    return lost


def fits(beams: Any, laser: Any) -> bool:
    """Say whether a Beams message belongs to a LaserScan."""
    stamps = (message.header.stamp for message in (beams, laser))
    here, there = ((stamp.sec, stamp.nanosec) for stamp in stamps)
    size = len(laser.ranges)
    return (
        here == there
        and len(beams.bearings) == size
        and len(beams.times) in (0, size)
        and len(beams.gaps) % 2 == 0
    )
