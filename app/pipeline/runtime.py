"""From scans to frames: newest scan first, one immutable settings object for each frame."""

import gc
import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from lidarcore import SensorNoise, localization, warm_up
from lidarcore.body_mask import Sector, suggest_mask
from lidarcore.threads import FailureLog, join

from ..errors import NotFoundError, NotYetError
from ..sources.player import Player
from ..sources.source import Source
from ..sources.timed_scan import TimedScan
from .frame import Frame, Selection
from .frame_maker import FrameMaker
from .localization_status import LocalizationStatus, status_of
from .navigation import Navigation
from .newest import NewestScan
from .sensor_setups import SensorSetup, SensorSetups
from .settings import Settings

logger = logging.getLogger(__name__)

END_WITHIN = 5.0  # s that the worker may take for the scan at hand


class Runtime:
    """Owns settings, player, selection and the newest frame. Every method may be called from any thread."""

    def __init__(
        self,
        source: Source,
        settings: Settings,
        navigation: Navigation,
        draw: Callable[[Frame], None],
        setups: SensorSetups,
    ) -> None:
        self._setups = setups
        usual = setups.of(source)
        if (wanted := _given(settings, usual)) != usual:
            setups.tell(source, wanted)
        self.settings = settings.with_setup(wanted)
        self.navigation = navigation
        self.selection = Selection()
        self.frame: Frame | None = None
        self.ready = False
        self.frame_listeners: list[Callable[[Frame], None]] = []
        self.change_listeners: list[Callable[[], None]] = []
        self._draw = draw
        self._set_up = source  # whose noise and mask the settings hold, before the player has opened it
        self._newest = NewestScan()
        self.player = Player(source, self._newest.put, lambda: self._newest.idle, self.announce)
        navigation.map_listeners.append(self._show_map)
        self._frames = FrameMaker(navigation)
        self._told: tuple[object, ...] = ()  # of the run that goes on
        self._processing = FailureLog("scan %s could not be processed")
        self._lock = threading.Lock()
        self._worker = threading.Thread(target=self._work, name="worker", daemon=True)

    def start(self) -> None:
        """Compile the kernels in the background, then play."""
        self._worker.start()

    def close(self) -> None:
        self.player.close()
        self._newest.close()
        join(self._worker, END_WITHIN)
        self.navigation.close()

    def newest(self) -> Frame:
        """The newest frame. Raises NotYetError before the first one."""
        if self.frame is None:
            why = "no scan has been processed" if self.ready else "the kernels are still being compiled"
            raise NotYetError(f"There is no frame yet: {why}. Ask again in a while.")
        return self.frame

    def set(self, patch: Mapping[str, Any]) -> Settings:
        """Change settings by a merge patch; the only way there is. Raises pydantic.ValidationError."""
        with self._lock:
            before, source = _setup(self.settings), self._set_up
            settings = self.settings.patched(patch)
            if settings.sensor.mask is None:
                settings = settings.with_setup(SensorSetup(settings.extraction.noise, source.mask))
            self.settings = settings
            if _setup(settings) != before:
                self._setups.tell(source, _setup(settings))
        return self._refreshed()

    def select_landmark(self, landmark: int | None) -> None:
        """Select a landmark of the map by its id, or none."""
        self.selection = replace(self.selection, landmark=landmark)
        self._refreshed()

    def select_corner(self, corner: int | None) -> None:
        """Select a corner of the current frame, or none. Raises NotFoundError, NotYetError."""
        if corner is not None and corner not in (known := {row.id for row in self.newest().corners}):
            raise NotFoundError(f"There is no corner {corner} in the current frame; it has {sorted(known)}.")
        self.selection = replace(self.selection, corner=corner)
        self._refreshed()

    def navigate(self, change: Callable[[Navigation], None]) -> None:
        """Change something about localization; what it raises goes through, and then nothing has changed."""
        change(self.navigation)
        self._refreshed()

    def localization(self) -> LocalizationStatus:
        """What is localized, and in which map."""
        return status_of(self.navigation, self.settings.navigation, self.frame)

    def feed(self, stamp: float, T_odom_sensor: ArrayLike) -> bool:
        """Odometry from outside; False if too much comes. Raises MotionError if the clock or the pose jumped."""
        limits = replace(self.settings.navigation.filter, motion="odometry")
        return self.navigation.odometry.put(stamp, T_odom_sensor, limits)

    def open(self, source: Source, index: int = 0, paused: bool = False) -> None:
        """Play another source, with the noise and the mask of its sensor."""
        self.selection = Selection()
        with self._lock:
            self.settings, self._set_up = self.settings.with_setup(self._setups.of(source)), source
        self.player.open(source, index, paused)

    def suggested_mask(self) -> tuple[Sector, ...]:
        """Where the robot's own body is, by the scans that the source still has. Raises MaskError."""
        return suggest_mask(self.player.source.some())

    def _refreshed(self) -> Settings:
        self.player.refresh()
        self.announce()
        return self.settings

    def _show_map(self) -> None:
        """The map is behind the scans: what it makes of the last ones is shown, too, if no next scan will show it."""
        if self.player.status().state != "playing":
            self.player.refresh()

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
        while (timed := self._newest.take()) is not None:
            with self._processing(timed.position):
                self._publish(self._process(timed))
                self._tell_of_run()
            self._newest.done()
            self.player.wake()

    def _process(self, timed: TimedScan) -> Frame:
        frame = self._frames.frame(timed, self.settings, self.frame)
        return replace(frame, selection=self.selection, dropped=self._newest.dropped)

    def _publish(self, frame: Frame) -> None:
        begin = time.perf_counter()
        self._draw(frame)
        self.frame = frame.drawn(1e6 * (time.perf_counter() - begin))
        for listener in self.frame_listeners:
            listener(self.frame)

    def _tell_of_run(self) -> None:
        """A run begins with its first scan: only then is it known what it localizes by, and in which map."""
        run = self.navigation
        if (now := (run.runs, run.session, run.method, run.problem)) != self._told:
            self._told = now
            self.announce()


def _setup(settings: Settings) -> SensorSetup:
    return SensorSetup(settings.extraction.noise, settings.sensor.mask or ())


def _given(settings: Settings, usual: SensorSetup) -> SensorSetup:
    """What settings say of the sensor; the usual where they say nothing."""
    noise, mask = settings.extraction.noise, settings.sensor.mask
    return SensorSetup(usual.noise if noise == SensorNoise() else noise, usual.mask if mask is None else mask)
