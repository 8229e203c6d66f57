"""One estimate from its beginning on: what the navigator said of each scan, and where that is kept."""

import time
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from lidarcore import Array, ExtractionSettings, Features, Scan
from lidarcore.clusters import Clusters
from lidarcore.localization import NavigationSettings, Navigator, TrackingResult, Velocity, deskew
from lidarcore.mapping import MapPicture, WholeScans

from ..sources.timed_scan import TimedScan
from .map_store import MapRun
from .trails import Paths, Trails, thinned

REMEMBERED = 3000  # scans whose localization is shown again when they are


@dataclass(frozen=True, slots=True)
class Localization:
    """What the navigator says after a scan.

    stored  ids in the file of landmarks by their ids in `tracking`; in a known map they are the same
    motion  what was taken out of the scan by deskewing: m/s ahead, rad/s, m/s to the left
    took_us time to estimate the pose and to bring the map up to date; None where newer scans have been seen since
    """

    tracking: TrackingResult
    session: int | None
    stored: Mapping[int, int]
    truth: Array | None
    motion: Velocity | None
    took_us: float | None


@dataclass(slots=True, eq=False)
class Run:
    """One estimate from its beginning on: another source, another mode or a reset begins another one.

    written  where the map that is built goes; None in a known map, whose session is `known`
    """

    source: int
    settings: NavigationSettings
    navigator: Navigator | WholeScans
    written: MapRun | None
    known: int | None
    trails: Trails
    shown: OrderedDict[int, Localization] = field(default_factory=OrderedDict)
    newest: int = -1

    @property
    def session(self) -> int | None:
        """The session of the map that is built, once it has a landmark, or that is localized in."""
        return self.written.session if self.written else self.known

    @property
    def picture(self) -> MapPicture | None:
        """Grid and walls of the map that whole scans make, or are localized in."""
        return self.navigator.picture if isinstance(self.navigator, WholeScans) else None

    @property
    def paths(self) -> Paths:
        """Where the sensor has been; in a map that whole scans make as it has been bent since."""
        paths = self.trails.paths()
        if self.known is not None or not isinstance(self.navigator, WholeScans):
            return paths
        return replace(paths, estimated=thinned(self.navigator.path()))

    def renew(self, extraction: ExtractionSettings) -> None:
        """Go on with what was set meanwhile; landmarks come as they were extracted."""
        if isinstance(self.navigator, WholeScans):
            self.navigator.renew(extraction)

    def end(self) -> None:
        """Let what runs in the background end; returns at once."""
        if isinstance(self.navigator, WholeScans):
            self.navigator.end()

    def close(self) -> None:
        """End, and wait for what runs in the background."""
        if isinstance(self.navigator, WholeScans):
            self.navigator.close()

    def is_continued_by(self, timed: TimedScan, settings: NavigationSettings) -> bool:
        """Whether the scan is the next of this run, or one that it has seen."""
        index = timed.position.index
        same = (self.source, self.settings) == (timed.source, settings)
        return same and (index > self.newest or self.recall(index) is not None)

    def recall(self, index: int) -> Localization | None:
        """What there was to say of a scan that was seen, or when it was passed over."""
        if index > self.newest:
            return None
        return self.shown.get(index) or next(
            (self.shown[known] for known in reversed(self.shown) if known < index), None
        )

    def deskewed(self, index: int, scan: Scan) -> Scan:
        """A scan deskewed as the navigator would do it now, or did it when the scan was new."""
        seen = self.recall(index)
        if seen is None:
            return self.navigator.deskewed(scan)
        return scan if seen.motion is None else deskew(scan, *seen.motion)

    def step(
        self, index: int, scan: Scan, features: Features, clusters: Clusters | None, method: str
    ) -> Localization:
        """Go on by a scan; one that was seen already is shown as it was then, the newest with the time that it took."""
        if (seen := self.recall(index)) is not None:
            return seen if index == self.newest else replace(seen, took_us=None)
        begin = time.perf_counter()
        found = self.navigator.step(scan, features, clusters)
        truth = self.trails.add(found, scan.truth)
        if self.written:
            self.written.put(found.landmarks, method)
        ids = found.landmarks.ids.tolist()
        stored = self.written.ids if self.written else dict(zip(ids, ids, strict=True))
        stamp, velocity = self.navigator.deskewed_by
        motion = velocity if stamp == scan.stamp else None
        took_us = 1e6 * (time.perf_counter() - begin)
        result = Localization(found, self.session, stored, truth, motion, took_us)
        self.newest = max(self.newest, index)
        self.shown[index] = result
        if len(self.shown) > REMEMBERED:
            self.shown.popitem(last=False)
        return result
