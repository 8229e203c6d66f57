"""From scans to frames: newest scan first, one immutable settings object for each frame."""

import gc
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from app.frame import Frame
from app.navigation import Navigation
from app.odometry_feed import OdometryPose
from app.player import Player
from app.selection import Selection
from app.settings import Settings
from app.sources import Source
from app.taken import Taken
from app.wire import LocalizationStateJson
from lidarcore import Features, Scan, extract, localization, warm_up
from lidarcore.clusters import cluster
from lidarcore.tracking import Tracker

logger = logging.getLogger(__name__)


class UnknownCornerError(LookupError):
    """There is no corner of that id in the current frame."""


class Slot:
    """Holds the newest scan; one that is overwritten before it was taken is counted."""

    def __init__(self) -> None:
        self._item: Taken | None = None
        self._closed = self._busy = False
        self._condition = threading.Condition()
        self.dropped = 0

    @property
    def idle(self) -> bool:
        """Nothing waits and nothing is being worked on."""
        return self._item is None and not self._busy

    def put(self, item: Taken) -> None:
        with self._condition:
            self.dropped += self._item is not None and self._item.scan is not item.scan
            self._item = item
            self._condition.notify()

    def take(self) -> Taken | None:
        """Wait for a scan; None when closed."""
        with self._condition:
            self._condition.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            self._busy = True
            return None if self._closed else item

    def done(self) -> None:
        """The scan taken last has been dealt with."""
        self._busy = False

    def close(self) -> None:
        with self._condition:
            self._closed = True
            self._condition.notify()


class Runtime:
    """Owns settings, player, selection and the newest frame. Every method may be called from any thread."""

    def __init__(
        self, source: Source, settings: Settings, navigation: Navigation, draw: Callable[[Frame], None]
    ) -> None:
        self.settings = settings
        self.navigation = navigation
        self.selection = Selection()
        self.frame: Frame | None = None
        self.ready = False
        self.frame_listeners: list[Callable[[Frame], None]] = []
        self.change_listeners: list[Callable[[], None]] = []
        self._draw = draw
        self._slot = Slot()
        self.player = Player(source, self._slot.put, lambda: self._slot.idle, self.announce)
        self._tracker, self._source = Tracker(), 0
        self._times: deque[float] = deque(maxlen=20)
        self._sequence = 0
        self._failing = False
        self._lock = threading.Lock()
        self._worker = threading.Thread(target=self._work, name="worker", daemon=True)

    def start(self) -> None:
        """Compile the kernels in the background, then play."""
        self._worker.start()

    def close(self) -> None:
        self.player.close()
        self._slot.close()
        self._worker.join(timeout=0.5)

    def set(self, patch: Mapping[str, Any]) -> Settings:
        """Change settings by a merge patch; the only way there is. Raises pydantic.ValidationError."""
        with self._lock:
            self.settings = self.settings.patched(patch)
        return self._refreshed()

    def select_landmark(self, landmark: int | None) -> None:
        """Select a landmark of the map by its id, or none."""
        self.selection = replace(self.selection, landmark=landmark)
        self._refreshed()

    def select_corner(self, corner: int | None) -> None:
        """Select a corner of the current frame, or none. Raises UnknownCornerError."""
        known = {row.id for row in self.frame.corners} if self.frame else set()
        if corner is not None and corner not in known:
            raise UnknownCornerError(
                f"There is no corner {corner} in the current frame; it has {sorted(known)}."
            )
        self.selection = replace(self.selection, corner=corner)
        self._refreshed()

    def navigate(self, change: Callable[[Navigation], None]) -> None:
        """Change something about localization; what it raises goes through, and then nothing has changed."""
        change(self.navigation)
        self._refreshed()

    def localization(self) -> LocalizationStateJson:
        """What is localized, and in which map."""
        return {
            "mode": self.settings.navigation.mode,
            "session": self.navigation.session,
            "map": self.navigation.map,
            "problem": self.navigation.problem,
            "odometry": self.navigation.odometry.state(self._why_not_fed()),
        }

    def _why_not_fed(self) -> str | None:
        """Why the newest scan takes no odometry from outside, if so."""
        if self.settings.navigation.mode == "off":
            return "Nothing is localized: set navigation.mode to slam or localize."
        if self.frame and self.frame.taken.scan.odometry is not None:
            return "The source has odometry of its own."
        return None

    def feed(self, pose: OdometryPose) -> None:
        """Odometry from outside. Raises MotionError if the clock went back or the pose jumped."""
        limits = replace(self.settings.navigation.filter, motion="odometry")
        self.navigation.odometry.put(pose, limits)

    def open(self, source: Source, index: int = 0, paused: bool = False) -> None:
        """Play another source."""
        self.selection = Selection()
        self.player.open(source, index, paused)

    def _refreshed(self) -> Settings:
        self.player.refresh()
        self.announce()
        return self.settings

    def announce(self) -> None:
        """Tell the listeners that something besides the frame has changed."""
        for listener in self.change_listeners:
            listener()

    def _work(self) -> None:
        try:
            warm_up()
            localization.warm_up()
        except Exception:
            logger.exception("the kernels could not be compiled ahead; they will be when they are needed")
        gc.collect()
        gc.freeze()  # what is here by now stays: searching it again and again delays frames by up to 0.1 s
        self.ready = True
        self.player.start()
        self.announce()
        while (taken := self._slot.take()) is not None:
            self._attempt(taken)
            self._slot.done()
            self.player.wake()

    def _attempt(self, taken: Taken) -> None:
        """One bad scan must not end the show, nor may a thousand of them fill the log."""
        try:
            self._publish(self._process(taken))
            self._failing = False
        except Exception:
            if not self._failing:
                logger.exception("scan %s could not be processed", taken.position)
            self._failing = True

    def _process(self, taken: Taken) -> Frame:
        settings = self.settings
        if taken.source != self._source:
            self._source = taken.source
            self._tracker.forget()
        scan = self.navigation.deskewed(taken, settings)
        features, method_us = _extract_each(scan, settings)
        begin = time.perf_counter()
        clusters = cluster(scan, settings.clusters) if settings.clustered else None
        clustered = time.perf_counter()
        main = next(iter(features.values()))
        where = self.navigation.step(taken, scan, main, clusters, settings.landmark_method)
        located = time.perf_counter()
        self._sequence += 1
        return Frame(
            sequence=self._sequence,
            taken=taken,
            scan=scan,
            settings=settings,
            features=features,
            corners=self._tracker.rows(features),
            selection=self.selection,
            extract_us=sum(method_us.values()),
            method_us=method_us,
            clusters=clusters,
            where=where,
            paths=self.navigation.paths,
            cluster_us=1e6 * (clustered - begin),
            locate_us=1e6 * (located - clustered),
            rate_hz=self._rate(),
            dropped=self._slot.dropped,
        )

    def _publish(self, frame: Frame) -> None:
        begin = time.perf_counter()
        self._draw(frame)
        self.frame = frame.drawn(1e6 * (time.perf_counter() - begin))
        for listener in self.frame_listeners:
            listener(self.frame)

    def _rate(self) -> float:
        """Frames per second over the last ones; 0 after a pause."""
        now = time.monotonic()
        if self._times and now - self._times[-1] > 2:
            self._times.clear()
        self._times.append(now)
        span = now - self._times[0]
        return (len(self._times) - 1) / span if span else 0.0


def _extract_each(scan: Scan, settings: Settings) -> tuple[dict[str, Features], dict[str, float]]:
    """The features by every method and the time each took, us. The segmentation is the same for all."""
    features, times = {}, {}
    chosen = {name: replace(settings.extraction, fitter=name) for name in settings.methods}
    extract(scan, settings.extraction)  # after a pause caches are cold, whatever the method
    for name, extraction in chosen.items():
        begin = time.perf_counter()
        features[name] = extract(scan, extraction)
        times[name] = 1e6 * (time.perf_counter() - begin)
    return features, times
