"""SLAM by scan matching: a scan is laid on the last keyframe, keyframes are nodes of a pose graph, loops bend it."""

from dataclasses import dataclass, replace

import numpy as np

from lidarcore.errors import MotionError
from lidarcore.poses import compose, inverse
from lidarcore.scan import Array, Scan
from lidarcore.scanmatching.loops import LoopFinder
from lidarcore.scanmatching.matching import match_scans
from lidarcore.scanmatching.pose_graph import PoseGraph
from lidarcore.scanmatching.settings import ScanSlamSettings
from lidarcore.scanmatching.surface import Surface, surface
from lidarcore.scanmatching.uncertain import Uncertain, chain

_HERE: Uncertain = (np.zeros(3), np.zeros((3, 3)))
_FLOOR = np.diag([0.01, 0.01, 0.005]) ** 2  # what a step is never known better than: the search needs room
_BLIND = 20  # returns: nothing can be laid on a scan that has fewer
_SETTLED = 0.01  # m and rad of the last step, after which the poses are far better than that


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where one scan was taken.

    stamp       s
    pose        (3,) T_world_sensor; the world is the sensor at the first scan
    covariance  (3, 3) of the pose
    node        the keyframe that the scan hangs on, or is
    connected   False if it lies on nothing known: only odometry or the last motion says where it is
    loops       number of loops that were closed with it
    """

    stamp: float
    pose: Array
    covariance: Array
    node: int
    connected: bool
    loops: int


@dataclass(frozen=True, slots=True, eq=False)
class _Tie:
    """How a scan hangs on its keyframe.

    known, driven  T_node_scan by all that is known, and by odometry alone if all scans since the keyframe had it
    motion, dt     how the sensor moved in the s since the scan before
    """

    stamp: float
    odometry: Array | None
    node: int
    known: Uncertain
    driven: Uncertain | None
    motion: Array
    dt: float


class ScanSlam:
    """Takes scans one by one. Odometry is used where scans have it, else the motion is taken to go on.

    graph  PoseGraph of the keyframes
    """

    def __init__(self, settings: ScanSlamSettings | None = None) -> None:
        self._settings = settings or ScanSlamSettings()
        self.graph = PoseGraph()
        self._surfaces: list[Surface] = []
        self._loops = LoopFinder(self.graph, self._surfaces, self._settings)
        self._ties: list[_Tie] = []

    def step(self, scan: Scan) -> Placement:
        """Place a scan, and bend the map if it closes loops.

        Raises MotionError if the clock went back or odometry jumped; nothing has changed then.
        """
        if not self._ties:
            self._surfaces.append(surface(scan, self._settings.match))
            self._ties.append(_Tie(scan.stamp, scan.odometry, 0, _HERE, _HERE, np.zeros(3), 0.0))
            return self._placement(True, 0)
        last, dt, moved = self._ties[-1], self._since(scan), self._driven(scan)
        guess = chain(last.known, moved or self._going_on(dt))
        driven = chain(last.driven, moved) if last.driven and moved else None
        seen = surface(scan, self._settings.match)
        match = match_scans(self._surfaces[last.node], seen, *guess, self._settings.match)
        connected = match.inliers >= self._settings.inliers
        known = (match.pose, match.covariance) if connected else guess
        motion = compose(inverse(last.known[0]), known[0])
        self._ties.append(_Tie(scan.stamp, scan.odometry, last.node, known, driven, motion, dt))
        leaves = len(seen.bearings) >= _BLIND and self._leaves(known[0], match.inliers)
        loops = self._add_keyframe(seen, connected) if leaves else 0
        return self._placement(connected or loops > 0, loops)

    def trajectory(self) -> tuple[Array, Array]:
        """Stamps (T,) s and poses (T, 3), T_world_sensor, of all scans as the graph has them now."""
        poses = self.graph.poses
        stamps = np.array([tie.stamp for tie in self._ties], np.float64)
        return stamps, np.array([compose(poses[tie.node], tie.known[0]) for tie in self._ties]).reshape(-1, 3)

    def covariances(self) -> Array:
        """(T, 3, 3) of the poses that `trajectory` gives."""
        return np.array([self._uncertain(tie)[1] for tie in self._ties]).reshape(-1, 3, 3)

    def _since(self, scan: Scan) -> float:
        dt = scan.stamp - self._ties[-1].stamp
        if dt < 0:
            raise MotionError(f"The clock went back by {-dt:g} s: leave the scan out, or begin a new map.")
        return dt

    def _driven(self, scan: Scan) -> Uncertain | None:
        """The motion since the last scan by odometry."""
        before = self._ties[-1].odometry
        if scan.odometry is None or before is None:
            return None
        motion, most = compose(inverse(before), scan.odometry), self._settings.max_step
        if (way := float(np.hypot(*motion[:2]))) > most:
            raise MotionError(
                f"Odometry jumped by {way:.3g} m: leave the scan out, or raise max_step from {most:g} m."
            )
        return motion, self._settings.odometry.covariance(motion) + _FLOOR

    def _going_on(self, dt: float) -> Uncertain:
        """The motion in dt s if the sensor goes on as it did."""
        last, s = self._ties[-1], self._settings
        change = dt * np.array([s.speed_change, s.speed_change, s.turn_change])
        return last.motion * (dt / last.dt if last.dt > 0 else 0.0), np.diag(change**2) + _FLOOR

    def _leaves(self, pose: Array, inliers: float) -> bool:
        """True if a scan at this pose from its keyframe is to be one itself."""
        s = self._settings
        far = np.hypot(*pose[:2]) >= s.keyframe_distance or abs(pose[2]) >= s.keyframe_turn
        return bool(far or inliers < s.loops.inliers)

    def _add_keyframe(self, seen: Surface, connected: bool) -> int:
        """Make the last scan a node. Returns how many loops it closed."""
        tie, graph = self._ties[-1], self.graph
        node = graph.add(compose(graph.poses[tie.node], tie.known[0]))
        if tie.driven:
            graph.connect(tie.node, node, *tie.driven)
        if connected or not tie.driven:
            graph.connect(tie.node, node, *tie.known, doubted=tie.driven is not None)
        self._surfaces.append(seen)
        self._ties[-1] = replace(tie, node=node, known=_HERE, driven=_HERE)
        loops = self._loops.find(node)
        for loop in loops:
            graph.connect(loop.i, loop.j, loop.pose, loop.covariance, doubted=True)
        if loops:
            graph.optimize(_SETTLED)
        return len(loops)

    def _placement(self, connected: bool, loops: int) -> Placement:
        tie = self._ties[-1]
        return Placement(tie.stamp, *self._uncertain(tie), tie.node, connected, loops)

    def _uncertain(self, tie: _Tie) -> Uncertain:
        """T_world_scan with its covariance."""
        return chain((self.graph.poses[tie.node], self.graph.covariance(tie.node)), tie.known)
