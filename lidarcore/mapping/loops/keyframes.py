"""Keyframes: the scans that make the map, with what is matched and compared of them."""

from typing import NamedTuple

from lidarcore.arrays import Array
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.matching.sight import Sight
from lidarcore.scan import Scan


class Keyframe(NamedTuple):
    """A scan of the map, its patches, and what it saw and looked through.

    sweep  (3, 3) covariance of where it stands, seen from where the sensor was at its stamp
    """

    scan: Scan
    patches: Patches
    sight: Sight
    sweep: Array


class Keyframes(NamedTuple):
    """The scans of a map, where they were taken, and how well that is known.

    numbers      (K,) the how-manieth scan each of them was, from 0
    scans        K scans
    poses        (K, 3) T_map_scan: x m, y m, heading rad; the first scan is the origin
    covariances  (K, 3, 3) of the poses, given the first
    """

    numbers: Array
    scans: tuple[Scan, ...]
    poses: Array
    covariances: Array
