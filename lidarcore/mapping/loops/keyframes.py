"""The scans that make a map: keyframes, with what is matched and compared of them, and what was seen there later."""

from typing import NamedTuple

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import UncertainPose
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.matching.sight import Sight
from lidarcore.scan import Scan


class View(NamedTuple):
    """A scan of which grid and walls are made.

    number  of scans that were placed before it
    node    of the keyframe that it hangs on, or is
    tie     T_node_scan with its covariance
    """

    number: int
    node: int
    tie: UncertainPose
    scan: Scan


class Keyframe(NamedTuple):
    """A scan of the map, its patches, and what it saw and looked through.

    number  of scans that were placed before it
    sweep   (3, 3) covariance of where it stands, seen from where the sensor was at its stamp
    """

    number: int
    scan: Scan
    patches: Patches
    sight: Sight
    sweep: Array


class Keyframes(NamedTuple):
    """Scans of a map, where they were taken, and how well that is known.

    numbers      (K,) the how-manieth scan each of them was, from 0
    scans        K scans
    poses        (K, 3) T_map_scan: x m, y m, heading rad; the first scan is the origin
    covariances  (K, 3, 3) of the poses, given the first
    """

    numbers: Ints
    scans: tuple[Scan, ...]
    poses: Array
    covariances: Array
