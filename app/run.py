"""One estimate from its beginning on: what the navigator said of each scan, and where that is kept."""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field

from app.landmark_store import LandmarkRun
from app.taken import Taken
from app.trails import Trails
from lidarcore import Features, Scan
from lidarcore.clusters import Clusters
from lidarcore.localization import NavigationSettings, Navigator, Whereabouts, deskew
from lidarcore.localization.reckoning import Velocity
from lidarcore.scan import Array

REMEMBERED = 3000  # scans whose whereabouts are shown again when they are


@dataclass(frozen=True, slots=True)
class Where:
    """What the navigator says after a scan.

    stored  ids in the file of landmarks by their ids in `whereabouts`; in a known map they are the same
    motion  what was taken out of the scan by deskewing: m/s ahead, rad/s, m/s to the left
    """

    whereabouts: Whereabouts
    session: int | None
    stored: Mapping[int, int]
    truth: Array | None
    motion: Velocity | None


@dataclass(slots=True, eq=False)
class Run:
    """One estimate from its beginning on: another source, another mode or a reset begins another one.

    written  where the map that is built goes; None in a known map, whose session is `known`
    """

    source: int
    settings: NavigationSettings
    navigator: Navigator
    written: LandmarkRun | None
    known: int | None
    trails: Trails
    shown: OrderedDict[int, Where] = field(default_factory=OrderedDict)
    newest: int = -1

    @property
    def session(self) -> int | None:
        """The session of the map that is built, once it has a landmark, or that is localized in."""
        return self.written.session if self.written else self.known

    def leads_to(self, taken: Taken, settings: NavigationSettings) -> bool:
        """Whether the scan is the next of this run, or one that it has seen."""
        index = taken.position["index"]
        same = (self.source, self.settings) == (taken.source, settings)
        return same and (index > self.newest or self.recall(index) is not None)

    def recall(self, index: int) -> Where | None:
        """What there was to say of a scan that was seen, or when it was passed over."""
        if index > self.newest:
            return None
        return self.shown.get(index) or next(
            (self.shown[known] for known in reversed(self.shown) if known < index), None
        )

    def deskewed(self, index: int, scan: Scan) -> Scan:
        """As the navigator would have it, or had it."""
        where = self.recall(index)
        if where is None:
            return self.navigator.deskewed(scan)
        return scan if where.motion is None else deskew(scan, *where.motion)

    def step(
        self, index: int, scan: Scan, features: Features, clusters: Clusters | None, method: str
    ) -> Where:
        """Go on by a scan; one that was seen already is shown as it was then."""
        if (seen := self.recall(index)) is not None:
            return seen
        found = self.navigator.step(scan, features, clusters)
        truth = self.trails.add(found, scan.truth)
        if self.written:
            self.written.put(found.landmarks, method)
        ids = found.landmarks.ids.tolist()
        stored = self.written.writer.ids if self.written else dict(zip(ids, ids, strict=True))
        stamp, velocity = self.navigator.deskewed_by
        where = Where(found, self.session, stored, truth, velocity if stamp == scan.stamp else None)
        self.newest = max(self.newest, index)
        self.shown[index] = where
        if len(self.shown) > REMEMBERED:
            self.shown.popitem(last=False)
        return where
