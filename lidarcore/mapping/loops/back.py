"""The back end: keyframes become nodes of a pose graph, loops bend it."""

from collections import deque

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import HERE, UncertainPose, compose, pose_difference, relative
from lidarcore.mapping.graph.known import JointPoses, Known, known, known_besides, near_unknown
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.graph.refinement import Refined, refine
from lidarcore.mapping.loops.closure import LoopFinder
from lidarcore.mapping.loops.consistency import Loop
from lidarcore.mapping.loops.islands import Islands, moved
from lidarcore.mapping.loops.keyframes import Keyframe, View
from lidarcore.mapping.loops.steps import Steps
from lidarcore.mapping.loops.thinning import spare
from lidarcore.mapping.matching.distortion import seen_since
from lidarcore.mapping.matching.local_map import is_blind
from lidarcore.mapping.matching.patches import Patches, patches
from lidarcore.mapping.matching.sight import sight
from lidarcore.mapping.motion.sweep import without
from lidarcore.mapping.settings import MapperSettings
from lidarcore.mapping.tracked import Tracked

_AWAY, _TURNED = 0.3, 0.1  # m and rad by which a loop contradicts the finished map
_FOUND = np.diag([0.05, 0.05, 0.02]) ** 2  # how well it is known where an island was found
_LATER = 9  # last views from where a sensor stood: as many as a cell takes to become free, see GridSettings
_SETTLED = 0.01  # m and rad of the last step, after which the poses are far better than that


class BackEnd:
    """A pose graph of keyframes that closes loops.

    graph      PoseGraph of the keyframes
    keyframes  by their nodes, in the order of time; `thin` leaves some nodes without
    loops      the loops that were believed
    """

    def __init__(self, settings: MapperSettings) -> None:
        self._settings = settings
        self.graph = PoseGraph()
        self.loops: list[Loop] = []
        self.keyframes: dict[int, Keyframe] = {}
        self._later: dict[int, deque[View]] = {}  # of a sensor that still stands, by its keyframe's node
        self._steps = Steps(self.graph)
        self._finder = self._finder_in(self.graph)
        self._islands = Islands(self.graph, self.keyframes)
        self._last: Refined | None = None  # to which all keyframes were adjusted

    def add(self, tracked: Tracked) -> None:
        """Append a keyframe, and bend the map if it closes loops; or look again from where the last one was taken.

        The first one is taken anew, if it is told of.
        """
        if tracked.first is not None:
            self.keyframes[0] = _keyframe(tracked.first)
        if tracked.view:
            self._look(tracked)
        if not tracked.keyframe:
            return
        if not self.keyframes:
            self.keyframes[0] = _keyframe(tracked)
            return
        before, tie, moved = tracked.node, tracked.tie, tracked.moved
        if tracked.island:
            before, tie = self._islands.shore(before, tie)
            moved = tie  # nothing was seen that tells more
        node = self.graph.add(compose(self.graph.poses[before], tie.pose))
        self.keyframes[node] = _keyframe(tracked)
        tie = UncertainPose(tie.pose, tie.covariance + self._settings.drift_covariance)
        self._steps.add(before, node, moved, tie)
        if tracked.island:
            self._islands.begin(node, before)
        else:
            self._steps.tell_of_wheels(tracked)
        self._join(node)
        self._close(self._finder.find(node))

    def thin(self) -> None:
        """Let go of the scans that say what others say too; their nodes stay. A map that was thinned is not refined."""
        nodes = np.array(list(self.keyframes), np.int64)
        for node in spare(nodes, self.graph.poses[nodes]).tolist():
            del self.keyframes[node]
            self._later.pop(node, None)

    @property
    def views(self) -> list[View]:
        """The scans of which grid and walls are made, in the order of time: keyframes, and what was seen there last."""
        found = []
        for node, keyframe in self.keyframes.items():
            found.append(View(keyframe.number, node, HERE, keyframe.scan))
            found += self._later.get(node, ())
        return found

    def search_again(self) -> None:
        """Look for loops at all keyframes, now that the map is better; if there are any, once more."""
        finder = self._finder_in(self.graph)
        for _ in range(2):
            found = sum(self._join(node) for node in range(1, len(self.graph)))
            found += sum(self._close(finder.find(node)) for node in range(1, len(self.graph)))
            if not found + self._close(finder.conclude()):
                break

    def renew(self, node: int, velocity: Array, acceleration: Array, sweep: Array) -> None:
        """Take more motion (3,) out of a keyframe's scan, which then stands where it should within sweep (3, 3)."""
        keyframe = self.keyframes[node]
        scan = without(keyframe.scan, velocity, acceleration)
        if scan is not keyframe.scan:
            seen = patches(scan, self._settings.front.match)
            self.keyframes[node] = Keyframe(keyframe.number, scan, seen, sight(scan), sweep)

    def recalibrate(self, errors: Array) -> None:
        """Take out of all steps what odometry does wrong (4,) at each, which was known less well on the way."""
        if self._steps.recalibrate(errors):
            self.graph.optimize(_SETTLED)

    def search_beside(self) -> int:
        """Look for the first loops where passes come near each other that no loop ties. Returns how many were closed.

        Surfaces say far more of where a pass leads than its keyframes' ties do, as long as those of two passes that are
        not known, seen from each other, are not taken for the same ones. What that leaves open may be little enough to
        tell one door of a corridor from the next.
        """
        parts = self._parts()
        nodes = near_unknown(self.graph, parts, self._settings.loops.farthest)
        if not len(nodes):
            return 0
        refined = self._refined(parts)
        loops = self._finder_in(refined).find_first(nodes)
        if loops:
            self.graph.move(refined.poses)
        return self._close(loops)

    def refine(self) -> tuple[Refined, Known]:
        """All keyframes adjusted at once, and the parts that this was done by; loops that do not agree are dropped.

        Passes that the graph does not know, seen from each other, are adjusted apart first, and together only if that
        says where they lie: else surfaces would be taken for the same ones that are not, and the map be wrong and sure.
        """
        self.graph.optimize()
        parts = self._parts()
        while True:
            refined = self._refined(parts)
            self.graph.move(refined.poses)
            more = known_besides(parts, refined, self._settings.front.match.reach)
            if np.array_equal(more.pairs, parts.pairs):
                break
            parts = more
        self.loops = [loop for loop in self.loops if _agrees(loop, refined.poses)]
        return refined, parts

    def refine_again(self, parts: Known) -> Refined:
        """The same once more, now that scans were renewed: loops stay, and so do the parts that `refine` adjusted."""
        refined = self._refined(parts)
        self.graph.move(refined.poses)
        return refined

    def _finder_in(self, graph: JointPoses) -> LoopFinder:
        """One that has looked for nothing yet."""
        return LoopFinder(graph, self.keyframes, self._settings.loops, self._settings.front.match)

    def _parts(self) -> Known:
        reaches = np.array([_reach(keyframe.patches) for keyframe in self.keyframes.values()])
        ties = np.array([(loop.i, loop.j) for loop in self.loops], np.int64).reshape(-1, 2)
        return known(self.graph, self._settings.front.match.reach, self._steps.covariances(), reaches, ties)

    def _refined(self, parts: Known) -> Refined:
        match, sweeps = self._settings.front.match, [keyframe.sweep for keyframe in self.keyframes.values()]
        self._last = refine(
            [keyframe.patches for keyframe in self.keyframes.values()],
            self.graph.poses,
            self._steps.besides(parts),
            self._settings.cell,
            self._islands.numbers,
            np.array(sweeps),
            [seen_since(keyframe.scan, keyframe.patches) for keyframe in self.keyframes.values()],
            match.unevenness,
            parts,
            self._last,
        )
        return self._last

    def _join(self, k: int) -> int:
        """Move the newest island to where node k of it was found. Returns how many loops tie it there: 0 or 1."""
        found = self._islands.find(k)
        if found is None:
            return 0
        numbers, poses = self._islands.numbers, self.graph.poses
        self.graph.move(moved(poses, np.flatnonzero(numbers == numbers[k]), found))
        distances = np.hypot(*(poses[:, :2] - found.pose[:2]).T)
        near = np.flatnonzero((numbers == found.island) & (distances < self._settings.loops.distance))
        loop = self._finder.tie(near, k, _FOUND)
        if loop is None:
            self.graph.move(poses)
            return 0
        self._islands.join(found)
        return self._close([loop])

    def _look(self, tracked: Tracked) -> None:
        later = self._later.setdefault(tracked.node, deque(maxlen=_LATER))
        later.append(View(tracked.number, tracked.node, tracked.tie, tracked.scan))

    def _close(self, loops: list[Loop]) -> int:
        """Tie the graph by loops, but where one of the same two nodes does already: it would count twice."""
        tied = {(loop.i, loop.j) for loop in self.loops} if loops else set()
        new = list({(loop.i, loop.j): loop for loop in loops if (loop.i, loop.j) not in tied}.values())
        for loop in new:
            self.graph.connect(loop.i, loop.j, loop.pose, loop.covariance, doubted=True)
        self.loops += new
        if new:
            self.graph.optimize(_SETTLED)
        return len(new)


def _keyframe(tracked: Tracked) -> Keyframe:
    return Keyframe(tracked.number, tracked.scan, tracked.patches, sight(tracked.scan), tracked.sweep)


def _reach(seen: Patches) -> float:
    """How far (m) patches were seen; 0 if they are too few, as in a first scan that is not whole: they would fit
    anywhere, and a finished map be sure of the place at which it took them for those of others."""
    return 0.0 if is_blind(seen) else float(np.hypot(*seen.means.T).max())


def _agrees(loop: Loop, poses: Array) -> bool:
    """True if the map has the nodes of a loop where the loop says they are."""
    x, y, turn = pose_difference(loop.pose, relative(poses[loop.i], poses[loop.j]))
    return bool(np.hypot(x, y) < _AWAY and abs(turn) < _TURNED)
