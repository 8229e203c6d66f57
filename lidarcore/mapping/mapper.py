"""The map of a building from whole scans, live or from a recording."""

from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import LocalizationError
from lidarcore.geometry import HERE, UncertainPose, compose, inverse, relative
from lidarcore.mapping.between import Ties, covariances, kept
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.graph.refinement import Refined
from lidarcore.mapping.loops.back import BackEnd
from lidarcore.mapping.loops.consistency import Loop
from lidarcore.mapping.loops.keyframes import Keyframes
from lidarcore.mapping.matching.distortion import own_variances, pose_shift
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.motion.smoothing import UNTOLD, ScanMotion, smoothed, with_distortion
from lidarcore.mapping.motion.sweep import half_time
from lidarcore.mapping.settings import MapperSettings
from lidarcore.mapping.tracked import Tracked
from lidarcore.scan import Scan

_SEARCHES = 8  # for passes that no loop ties, each of which tells where others lead


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where one scan was taken.

    stamp      s
    pose       (3,) T_map_sensor; the map is the sensor at the first scan
    keyframe   number of the keyframe that the scan hangs on, or is
    connected  False if it lies on nothing known: only odometry or the last motion says where it is
    loops      number of loops that the map has closed since the last scan
    """

    stamp: float
    pose: Array
    keyframe: int
    connected: bool
    loops: int


class Mapper:
    """Takes scans one by one. Odometry is used where scans have it, else the motion is taken to go on.

    mapper = Mapper()
    for scan in open_recording(path):
        mapper.step(scan)
    mapper.finish()
    stamps, poses = mapper.trajectory()
    """

    def __init__(self, settings: MapperSettings | None = None) -> None:
        self._settings = settings or MapperSettings()
        self._front, self._back = FrontEnd(self._settings.front), BackEnd(self._settings)
        self._stamps: list[float] = []
        self._ties: list[tuple[int, UncertainPose]] = []
        self._driven: list[Array] = []  # covariances (3, 3) of the ties by motion alone
        self._motions: list[ScanMotion] = []
        self._numbers: list[int] = []
        self._locals: list[Array] = []  # T_local_keyframe, in the front end's frame
        self._loops = 0
        self._refined: Refined | None = None

    def step(self, scan: Scan) -> Placement:
        """Place a scan. Raises MotionError if the clock went back or odometry jumped; nothing has changed then."""
        tracked, unevenness = self._front.step(scan), self._settings.front.match.unevenness
        local = compose(self._locals[tracked.node], tracked.tie.pose) if self._locals else np.zeros(3)
        tie = tracked.node, tracked.tie
        if tracked.keyframe:
            tie = len(self._numbers), HERE
            self._numbers.append(len(self._ties))
            self._locals.append(local)
            self._refined = None
        if tracked.first is not None:
            self._motions[0] = _motion_of(tracked.first, unevenness)
        if tracked.is_news or tracked.view:
            self._back.add(tracked)
        self._motions.append(_motion_of(tracked, unevenness))
        self._stamps.append(tracked.stamp)
        self._ties.append(tie)
        self._driven.append(tracked.moved.covariance)
        closed, self._loops = len(self._back.loops) - self._loops, len(self._back.loops)
        pose = compose(self._correction, local)
        return Placement(tracked.stamp, pose, tie[0], tracked.on, closed)

    def finish(self) -> None:
        """Look for loops once more, now that all scans are there, and adjust all keyframes at once."""
        if not self._numbers:
            return
        self._smooth_motion()
        self._back.recalibrate(self._front.wheels)
        self._back.search_again()
        for _ in range(_SEARCHES):
            if not self._back.search_beside():
                break
        refined, parts = self._back.refine()
        if any(motion.half > 0 for motion in self._motions):
            self._take_distortion(refined)
            self._smooth_motion()
            refined = self._back.refine_again(parts)
            refined = replace(refined, sweeps=self._sweeps(refined))
        self._refined = refined
        self._loops = len(self._back.loops)

    def _sweeps(self, refined: Refined) -> Array:
        """(K, 3, 3) that poses of keyframes have besides: of where their scans stand."""
        motions = [self._motions[number] for number in self._numbers]
        share = kept(refined, np.array([motion.scatter for motion in motions]))
        return np.array([motion.stands(share) for motion in motions])

    def _take_distortion(self, refined: Refined) -> None:
        """Let motions know what the surfaces that keyframes see again say of them."""
        motions = with_distortion([self._motions[number] for number in self._numbers], refined.speeds)
        for number, motion in zip(self._numbers, motions, strict=True):
            self._motions[number] = motion

    def _smooth_motion(self) -> None:
        """Take out of the scans the motion that all of them show; what hangs on keyframes moves with them."""
        nodes = np.array([node for node, _ in self._ties], np.int64)
        at = compose(np.array(self._locals)[nodes], np.array([tie.pose for _, tie in self._ties]))
        at, after = smoothed(np.array(self._stamps), at, self._motions)
        for node, number in enumerate(self._numbers):
            old, new = self._motions[number], after[number]
            more = new.velocity - old.velocity, new.acceleration - old.acceleration
            self._back.renew(node, *more, new.sweep)
            self._locals[node] = at[number]
        for number, (node, tie) in enumerate(self._ties):
            if number != self._numbers[node]:
                P = tie.covariance - self._motions[number].sweep + after[number].sweep
                self._ties[number] = node, UncertainPose(relative(self._locals[node], at[number]), P)
        self._motions = after

    @property
    def here(self) -> UncertainPose:
        """T_map_sensor of the newest scan in the map as it grows; once that is finished, see `covariances`.

        Raises LocalizationError if there is no scan.
        """
        if not self._ties:
            raise LocalizationError("The map has no scan yet: give it one first.")
        node, tie = self._ties[-1]
        covariance = self._back.graph.covariance(node) if node else np.zeros((3, 3))
        return UncertainPose(self._back.graph.poses[node], covariance).compose(tie)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The loops that were believed, between keyframes."""
        return tuple(self._back.loops)

    @property
    def keyframes(self) -> Keyframes:
        """The scans that make the map, their poses and covariances; takes a while."""
        scans = tuple(keyframe.scan for keyframe in self._back.keyframes.values())
        return Keyframes(
            np.array(self._numbers, np.int64), scans, self._poses, self._known.covariances()[: len(scans)]
        )

    @property
    def views(self) -> Keyframes:
        """The scans that grid and walls are made of: the keyframes, and the last ones where the sensor stood longer."""
        views = self._back.views
        numbers = np.array([view.number for view in views], np.int64)
        poses, covariances = self.trajectory()[1], self.covariances()
        return Keyframes(numbers, tuple(view.scan for view in views), poses[numbers], covariances[numbers])

    def relative(self, i: int, j: int) -> UncertainPose:
        """T_i_j of keyframes i and j with its covariance."""
        return self._known.relative(i, j)

    def trajectory(self) -> tuple[Array, Array]:
        """Stamps (T,) s and poses (T, 3), T_map_sensor, of all scans as the map has them now."""
        stamps = np.array(self._stamps, np.float64)
        if not len(stamps):
            return stamps, np.empty((0, 3))
        nodes = np.array([node for node, _ in self._ties], np.int64)
        return stamps, compose(self._poses[nodes], np.array([tie.pose for _, tie in self._ties]))

    def covariances(self) -> Array:
        """(T, 3, 3) of the poses that `trajectory` gives."""
        if self._refined is None:
            found = self.keyframes
            on = [UncertainPose(found.poses[node], found.covariances[node]) for node, _ in self._ties]
            placed = [pose.compose(tie).covariance for pose, (_, tie) in zip(on, self._ties, strict=True)]
            return np.array(placed).reshape(-1, 3, 3)
        numbers, local = np.array(self._numbers, np.int64), np.array(self._locals)
        return covariances(self._refined, local, numbers, self._all_ties())

    def _all_ties(self) -> Ties:
        """Of keyframes the tie is that to itself, but `matched` what it was found with."""
        nodes = np.array([node for node, _ in self._ties], np.int64)
        poses = np.array([tie.pose for _, tie in self._ties])
        matched = np.array([np.diag(motion.variances) for motion in self._motions])
        for number, (node, tie) in enumerate(self._ties):
            if number != self._numbers[node]:
                matched[number] = tie.covariance - self._motions[number].sweep
        sweeps = np.array([motion.stands(np.ones(3)) for motion in self._motions])
        return Ties(nodes, poses, matched, np.array(self._driven), sweeps)

    @property
    def _known(self) -> Refined | PoseGraph:
        return self._back.graph if self._refined is None else self._refined

    @property
    def _poses(self) -> Array:
        """(K, 3) of the keyframes."""
        return self._back.graph.poses[: len(self._numbers)]

    @property
    def _correction(self) -> Array:
        """T_map_local (3,) by the newest keyframe."""
        return compose(self._back.graph.poses[-1], inverse(self._locals[-1]))


def _motion_of(tracked: Tracked, unevenness: float) -> ScanMotion:
    variances = np.diagonal(tracked.tie.covariance - tracked.sweep)
    return ScanMotion(
        half=half_time(tracked.scan),
        velocity=tracked.velocity,
        acceleration=np.zeros(3),
        variances=variances,
        distorted=UNTOLD,
        own=own_variances(tracked.patches, unevenness),
        scatter=variances,
        sweep=tracked.sweep,
        shared=np.zeros((3, 3)),
        shift=pose_shift(tracked.scan, tracked.patches),
        on=tracked.on,
    )
