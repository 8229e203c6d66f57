"""From a scan to a frame: masked, deskewed, extracted, clustered, localized, its corners followed."""

import time
from collections import deque
from dataclasses import replace

from lidarcore import Tracker, compare
from lidarcore.body_mask import masked
from lidarcore.clusters import cluster
from lidarcore.evaluation.calibration.noise_check import NoiseCheck

from ..sources.timed_scan import TimedScan
from .frame import Frame
from .navigation import Navigation
from .settings import Settings

# scans, a minute of an S1: how long a corner that is hidden keeps its id while the sensor stands
DORMANT = 600
PAUSE = 2.0  # s without another scan, after which they have no rate


class FrameMaker:
    """Makes frames, one after the other, and remembers of earlier scans what the next one takes."""

    def __init__(self, navigation: Navigation) -> None:
        self._navigation = navigation
        self._tracker, self._source = Tracker(dormant=DORMANT), 0
        self._times: deque[float] = deque(maxlen=20)
        self._sequence = 0
        self._noise_check = NoiseCheck()

    def frame(self, timed: TimedScan, settings: Settings, newest: Frame | None) -> Frame:
        """The frame of a scan under these settings; `newest` is the frame that is shown."""
        timed = replace(timed, scan=masked(timed.scan, settings.sensor.mask or ()))
        if timed.source != self._source:
            self._source = timed.source
            self._tracker.forget()
        scan = self._navigation.deskewed(timed, settings)
        begin = time.perf_counter()
        features = compare(scan, settings.extraction, settings.methods)
        extract_end = time.perf_counter()
        clusters = cluster(scan, settings.clusters) if settings.clustered else None
        cluster_end = time.perf_counter()
        main = next(iter(features.values()))
        localization = self._navigation.step(timed, scan, main, clusters, settings.landmark_method)
        self._sequence += 1
        return Frame(
            sequence=self._sequence,
            timed=timed,
            scan=scan,
            settings=settings,
            features=features,
            corners=self._tracker.rows(features),
            extract_us=1e6 * (extract_end - begin),
            clusters=clusters,
            localization=localization,
            paths=self._navigation.paths,
            picture=self._navigation.picture,
            cluster_us=1e6 * (cluster_end - extract_end),
            rate_hz=self._rate(timed, newest),
            noise_remark=self._noise_check.observe(main, timed.source),
        )

    def _rate(self, timed: TimedScan, newest: Frame | None) -> float:
        """Scans per second over the last ones; 0 after a pause. One that is shown again is not another one."""
        now = time.monotonic()
        if self._times and now - self._times[-1] > PAUSE:
            self._times.clear()
        if newest is None or not timed.is_same(newest.timed):
            self._times.append(now)
        span = now - self._times[0] if self._times else 0.0
        return (len(self._times) - 1) / span if span else 0.0
