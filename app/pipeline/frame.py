"""One processed scan: everything that there is to show of it, immutable."""

import time
from dataclasses import dataclass, replace

import numpy as np

from lidarcore import Array, CornerRow, Features, Scan
from lidarcore.clusters import Clusters
from lidarcore.geometry import act
from lidarcore.mapping import MapPicture

from ..sources.timed_scan import TimedScan
from .settings import Settings
from .slam_run import Localization
from .trails import NO_PATHS, Paths

AT_ORIGIN = np.zeros(3)
STRAY = 300  # one in so many points on each side may lie beyond the extent
AROUND = 0.5  # m about the sensor that belong to it


@dataclass(frozen=True, slots=True)
class Selection:
    """Ids of the corner of the frame and of the landmark of the map that someone has chosen, or None."""

    corner: int | None = None
    landmark: int | None = None


NOTHING_SELECTED = Selection()


@dataclass(frozen=True, eq=False)
class Frame:
    """Features of one scan by every method asked for, the main one first, under one set of settings.

    `scan` is the timed one without the distortion by the motion of the sensor, as far as that is known.
    """

    sequence: int
    timed: TimedScan
    scan: Scan
    settings: Settings
    features: dict[str, Features]
    corners: tuple[CornerRow, ...]
    extract_us: float
    selection: Selection = NOTHING_SELECTED
    clusters: Clusters | None = None
    localization: Localization | None = None
    paths: Paths = NO_PATHS
    picture: MapPicture | None = None
    cluster_us: float = 0.0
    draw_us: float = 0.0
    rate_hz: float = 0.0
    dropped: int = 0
    noise_remark: str | None = None

    @property
    def main(self) -> Features:
        """The features by the main method."""
        return next(iter(self.features.values()))

    @property
    def locate_us(self) -> float | None:
        """Time that the pose took; None if none was estimated, or newer scans have been seen since."""
        return None if self.localization is None else self.localization.took_us

    @property
    def pose(self) -> Array:
        """T_world_sensor (3,); the origin where nothing is localized."""
        return AT_ORIGIN if self.localization is None else self.localization.tracking.estimate.pose

    @property
    def is_placed(self) -> bool:
        """Whether what is seen lies at the pose; in a known map it does not until it is found there, nor when lost."""
        found = None if self.localization is None else self.localization.tracking
        return found is None or found.mode == "slam" or found.state not in ("starting", "lost")

    def extent(self) -> Array:
        """Extent (2, 2) m of what is seen and the sensor, without stray points: ends along x and y of the world."""
        pose = self.pose
        ends: Array = pose[:2, None] + np.array([-AROUND, AROUND])
        seen = np.ascontiguousarray(act(pose, self.scan.xy[self.scan.valid]).T)
        if count := seen.shape[1]:
            inner = [count // STRAY, count - 1 - count // STRAY]
            low, high = np.partition(seen, inner, axis=1)[:, inner].T
            ends = np.stack([np.minimum(ends[:, 0], low), np.maximum(ends[:, 1], high)], 1)
        return ends

    def age(self) -> float:
        """Seconds since the last byte of the scan arrived."""
        return time.monotonic() - self.timed.arrival

    def drawn(self, microseconds: float) -> "Frame":
        """This frame with the time that drawing it took."""
        return replace(self, draw_us=microseconds)
