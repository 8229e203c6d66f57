"""What the front end says of a scan."""

from dataclasses import dataclass

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose
from lidarcore.mapping.matching.odometry_calibration import Taken
from lidarcore.mapping.matching.patches import Patches
from lidarcore.scan import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """Where a scan was taken, in the local frame.

    number    of scans that were placed before it
    stamp     s
    node      number of the keyframe that the scan hangs on; its own if it is one
    tie       T_node_scan (3,) with its covariance (3, 3), of the keyframe before if the scan is one itself
    moved     T_node_scan as far as motion alone tells: odometry, or the going on of the motion
    wheels    what was taken out of odometry in `moved`; None without odometry
    on        False if it lies on nothing known: only odometry or the last motion says where it is
    scan      as a sensor would see it that stood still at its stamp
    patches   of the scan
    sweep     (3, 3) how far the scan may stand from where the sensor was at its stamp, a part of tie's covariance
    velocity  (3,) m/s, m/s, rad/s that was taken out of the scan
    keyframe  whether the scan is one
    view      whether the scan, while the sensor stands, tells what has changed around it
    island    True if it lies on nothing known, or fits in several places, and its heading is vague: how it, and what
              follows, lies to what was before is open
    first     the first keyframe anew, now that the motion in it is known; told once, with the second scan
    """

    number: int
    stamp: float
    node: int
    tie: UncertainPose
    moved: UncertainPose
    wheels: Taken | None
    on: bool
    scan: Scan
    patches: Patches
    sweep: Array
    velocity: Array
    keyframe: bool
    view: bool
    island: bool
    first: "Tracked | None" = None

    @property
    def is_news(self) -> bool:
        """Whether it says something of the keyframes."""
        return self.keyframe or self.first is not None
