"""Where keyframes lie in a known map, in a thread of its own: a scan never waits for a search."""

from collections import deque
from collections.abc import Callable

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import LocalizationError
from lidarcore.geometry import UncertainPose, compose, largest_variance
from lidarcore.localization.tracking_result import State
from lidarcore.mapping.live.background import Background, Corrected, MapPicture
from lidarcore.mapping.live.worker import Worker
from lidarcore.mapping.relocation import Query, Relocation, Relocator, Verdict, query_of
from lidarcore.mapping.settings import VAGUE
from lidarcore.mapping.tracked import Tracked
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.threads import FailureLog

_TOGETHER = 6  # scans that are looked for together
_MISSES = 3  # keyframes in a row that the map contradicts, after which the pose is not believed
_PATH = 10_000  # keyframes of which is kept where they lie: some kilometres
_LOST = 1.0  # m of standard deviation beyond which a predicted pose is none
_NOWHERE = UncertainPose(np.zeros(3), np.diag([10.0, 10.0, np.pi]) ** 2)

_CONFIRMED = 1.0  # m of way after which a pose that was found is believed

_ONCE = "One place of the map fits what is seen: drive a metre on to confirm it, or set the pose there."
_NOT_SEEN = "What is seen does not lie on the map here: the pose is predicted by motion alone."
_WHY_NOT: dict[Verdict, str] = {
    "too few points": "Too little is in view to find the pose in the map: drive on, or set the pose.",
    "no fit": "What is seen fits nowhere in the map: drive on, or set the pose.",
    "several places": "What is seen fits in several places of the map: drive on, or set the pose.",
}


class LocateWorker(Background):
    """Takes keyframes and says where they lie in a map that is known.

    A sensor that stands and was not found is looked for again with each view: who stood in front of it may have left.

    A pose is believed once a search of the whole map has one answer, and the map still agrees a metre further on: where
    rooms look alike and one of them is not in the map, a single view is mistaken for the other. From there on it is
    carried by the front end, and corrected by the map near where it should be. Both are estimates whose errors depend
    on each other, as the same walls of the same map are seen again and again: they are joined by covariance
    intersection, so that the covariance never falls below what the map allows.

    picture     what is known of the building
    drift       (3, 3) covariance that a step from keyframe to keyframe has beside noise
    background  whether searches run in a thread of their own; otherwise `put` waits for them
    """

    mode = "localize"

    def __init__(self, picture: MapPicture, drift: Array, background: bool) -> None:
        self.picture, self._grid, self._drift = picture, picture.grid, drift
        self.corrected = Corrected(1, np.zeros((1, 3)), _NOWHERE.covariance)
        self._relocator: Relocator | None = None
        self._here, self._local = _NOWHERE, np.zeros(3)  # T_map_keyframe, T_local_keyframe
        self._keyframes, self._poses = 0, deque[Array](maxlen=_PATH)
        self._recent: deque[tuple[Scan, Array]] = deque(maxlen=_TOGETHER)  # and T_local_scan
        self._verdict: tuple[State, str | None] = "starting", None
        self._misses = 0
        self._begin, self._is_confirmed = self._local, False  # where the pose was found
        self._failures = FailureLog("a keyframe could not be found in the map")
        self._worker = Worker(self._work, "locate") if background else None

    def place(self, T_map_keyframe: UncertainPose) -> None:
        """Go on from a pose of the last keyframe, or of the first one to come, that someone has told."""
        self.put(T_map_keyframe)

    def renew(self, extraction: ExtractionSettings) -> None:
        """A known map finds no walls."""

    def judge(self, tracked: Tracked, here: UncertainPose) -> tuple[State, str | None]:
        """Whether the pose of a scan is to be believed, and what is to be said about that."""
        if tracked.on or self._verdict[0] != "tracking":
            return self._verdict
        return "coasting", _NOT_SEEN

    def _work(self, item: Tracked | UncertainPose | None, waiting: int) -> None:
        if item is None:
            return
        with self._failures():
            try:
                self._step(item, waiting)
            except LocalizationError as error:  # a map in which nothing can be found
                self._verdict = "lost", str(error)

    def _step(self, item: Tracked | UncertainPose, waiting: int) -> None:
        if isinstance(item, UncertainPose):
            self._here, self._misses, self._begin, self._is_confirmed = item, 0, self._local, True
            self._verdict = "coasting", _NOT_SEEN
        elif item.is_news:
            self._go_on(item)
        elif self._verdict[0] in ("starting", "lost"):
            self._look_again(item)
        else:  # a sensor that stands sees what it has seen
            return
        if self._recent:
            try:
                self._look(waiting)
            finally:  # where nothing can be found, keyframes are done with, too
                self._poses[-1] = self._here.pose
                self.corrected = Corrected(self._keyframes, np.array(self._poses), self._here.covariance)

    def _go_on(self, tracked: Tracked) -> None:
        """Go on to the next keyframe, by the front end alone, or take the first one anew."""
        if tracked.first is not None and self._recent:
            self._recent[-1] = tracked.first.scan, self._local
        if not tracked.keyframe:
            return
        if self._poses:
            way = UncertainPose(tracked.tie.pose, tracked.tie.covariance + self._drift)
            self._here, self._local = self._here.compose(way), compose(self._local, way.pose)
        if tracked.island:  # it may have been carried anywhere
            self._lose()
        self._recent.append((tracked.scan, self._local))
        self._poses.append(self._here.pose)
        self._keyframes += 1

    def _look_again(self, view: Tracked) -> None:
        """Take a view from where the sensor stands in place of the one before it."""
        if self._recent:
            self._recent.pop()
        self._recent.append((view.scan, compose(self._local, view.tie.pose)))

    def _look(self, waiting: int) -> None:
        """Compare the last keyframes with the map: near the pose if there is one, else everywhere."""
        if self._relocator is None:
            self._relocator = Relocator(self._grid)
        relocator, here, state = self._relocator, self._here, self._verdict[0]
        if state in ("tracking", "coasting"):
            self._follow(self._found(lambda query: relocator.find_near(query, here)), relocator)
        elif not waiting:
            found = self._found(relocator.find)
            if found.found:
                self._here, self._begin = UncertainPose(found.pose, found.covariance), self._local
                self._verdict, self._misses = ("coasting", _ONCE), 0
            else:
                self._verdict = state, _WHY_NOT[found.verdict]

    def _found(self, find: Callable[[Query], Relocation]) -> Relocation:
        """Where the last scans together, or the last one alone where those fit nowhere, say that the keyframe lies.

        Together they see more walls, but also whoever walks about in as many places as there are scans.
        """
        scans, at = zip(*self._recent, strict=True)
        poses = np.array(at)
        together = find(query_of(scans, poses, self._local))
        if together.verdict != "no fit" or len(scans) == 1:
            return together
        alone = find(query_of(scans[-1:], poses[-1:], self._local))
        return alone if alone.found else together

    def _follow(self, near: Relocation, relocator: Relocator) -> None:
        if near.found:
            self._here, self._misses = self._here.intersect(UncertainPose(near.pose, near.covariance)), 0
            is_far = np.hypot(*(self._local - self._begin)[:2]) >= _CONFIRMED
            self._is_confirmed |= is_far
            self._verdict = ("tracking", None) if self._is_confirmed else ("coasting", _ONCE)
            return
        self._verdict = "coasting", _NOT_SEEN
        self._misses += near.against > relocator.settings.against
        spread = np.sqrt(largest_variance(self._here.covariance[:2, :2]))
        if self._misses >= _MISSES or spread > _LOST or self._here.covariance[2, 2] > VAGUE**2:
            self._lose()

    def _lose(self) -> None:
        """What was seen before the sensor was lost does not help to find it."""
        if self._verdict[0] != "starting":
            self._verdict = "lost", _WHY_NOT["no fit"]
            self._here = UncertainPose(self._here.pose, _NOWHERE.covariance)
        self._recent.clear()
        self._is_confirmed = False
