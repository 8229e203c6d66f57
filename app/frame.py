"""One processed scan: everything that the scene, REST and WebSocket show of it, immutable."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from pydantic_core import to_json

from app.located import clusters_json, localization_json
from app.run import Where
from app.selection import Selection
from app.settings import Settings
from app.taken import Taken
from app.trails import NO_PATHS, Paths
from app.wire import (
    CornerJson,
    FrameJson,
    MeasuredCornerJson,
    RejectionJson,
    SegmentJson,
    SummaryJson,
)
from lidarcore import Features, Scan
from lidarcore.clusters import Clusters
from lidarcore.scan import Array
from lidarcore.tracking import CornerRow


@dataclass(frozen=True, eq=False)
class Frame:
    """Features of one scan by every method asked for, the main one first, under one set of settings.

    `scan` is the one taken, without the distortion by the motion of the sensor as far as that is known.
    """

    sequence: int
    taken: Taken
    scan: Scan
    settings: Settings
    features: dict[str, Features]
    corners: tuple[CornerRow, ...]
    selection: Selection
    extract_us: float
    method_us: Mapping[str, float]
    clusters: Clusters | None = None
    where: Where | None = None
    paths: Paths = NO_PATHS
    cluster_us: float = 0.0
    locate_us: float = 0.0
    draw_us: float = 0.0
    rate_hz: float = 0.0
    dropped: int = 0

    @property
    def main(self) -> Features:
        """The features by the main method."""
        return next(iter(self.features.values()))

    def corner_positions(self) -> list[tuple[int, Array]]:
        """Id and position (2,) m of each corner, by the first method that has it."""
        firsts = ((row.id, *next(iter(row.index.items()))) for row in self.corners)
        return [(id_, self.features[name].corners.xy[i]) for id_, name, i in firsts]

    def age(self) -> float:
        """Seconds since the last byte of the scan arrived."""
        return time.monotonic() - self.taken.arrival

    def drawn(self, microseconds: float) -> "Frame":
        """This frame with the time that drawing it took."""
        return replace(self, draw_us=microseconds)

    @cached_property
    def text(self) -> str:
        """The frame as JSON. Its age is taken when it is first asked for, that is when it is sent."""
        return to_json(self._json).decode()

    @cached_property
    def text_with_points(self) -> str:
        """The same, and the measured points."""
        xy = self.scan.xy[self.scan.valid].round(4).tolist()
        return to_json(self._json | {"points": xy}).decode()

    @cached_property
    def _json(self) -> FrameJson:
        scan = self.scan
        return {
            "sequence": self.sequence,
            "stamp": scan.stamp,
            "source": self.taken.position,
            "n_beams": len(scan),
            "n_valid": int(scan.valid.sum()),
            "completeness": scan.completeness,
            "gaps": scan.gaps.tolist(),
            "noise_seen": next(iter(self.features.values())).noise_seen,
            "fitter": self.settings.extraction.fitter,
            "covariance": self.settings.extraction.covariance,
            "methods": list(self.features),
            "timings": {
                "extract_us": self.extract_us,
                "per_method": dict(self.method_us),
                "cluster_us": self.cluster_us,
                "locate_us": self.locate_us,
                "draw_us": self.draw_us,
                "age_ms": 1e3 * self.age(),
            },
            "rate_hz": self.rate_hz,
            "dropped": self.dropped,
            "segments": {name: segments_json(found) for name, found in self.features.items()},
            "corners": self.corners_json(),
            "rejections": rejections_json(self.main),
            "summary": {name: summary_json(found) for name, found in self.features.items()},
            "clusters": None if self.clusters is None else clusters_json(self.clusters),
            "localization": None if self.where is None else localization_json(self.where),
        }

    def corners_json(self) -> list[CornerJson]:
        """One row per corner, whichever methods found it."""
        measured = {name: measured_corners_json(found) for name, found in self.features.items()}
        return [
            {
                "id": row.id,
                "segments": row.segments,
                "selected": row.id == self.selection.corner,
                "by_method": {name: measured[name][i] for name, i in row.index.items()},
            }
            for row in self.corners
        ]


def segments_json(features: Features) -> list[SegmentJson]:
    """The segments of one method, in the order of the ring."""
    s, lines = features.segments, features.segments.lines
    columns = {
        "id": range(len(s)),
        "alpha": lines.alpha.tolist(),
        "r": lines.r.tolist(),
        "start": s.start.tolist(),
        "end": s.end.tolist(),
        "length": s.length.tolist(),
        "n_points": s.n_points.tolist(),
        "rms": s.rms.tolist(),
        "covariance": lines.covariance.tolist(),
    }
    return cast(list[SegmentJson], _rows(columns))


def measured_corners_json(features: Features) -> list[MeasuredCornerJson]:
    """The corners of one method, in its own order."""
    corners = features.corners
    columns = {
        "x": corners.xy[:, 0].tolist(),
        "y": corners.xy[:, 1].tolist(),
        "sigma_x": corners.sigma[:, 0].tolist(),
        "sigma_y": corners.sigma[:, 1].tolist(),
        "area": corners.area.tolist(),
        "covariance": corners.covariance.tolist(),
        "angle": corners.angle.tolist(),
    }
    return cast(list[MeasuredCornerJson], _rows(columns))


def rejections_json(features: Features) -> list[RejectionJson]:
    """What was rejected and why."""
    return [
        {
            "kind": r.kind,
            "reason": r.reason,
            "message": r.message,
            "xy": (float(r.xy[0]), float(r.xy[1])),
            "first_beam": int(r.first_beam),
            "last_beam": int(r.last_beam),
        }
        for r in features.rejections
    ]


def summary_json(features: Features) -> SummaryJson:
    """How many corners, and how large their ellipses are."""
    area = features.corners.area
    return {"corners": len(area), "median_area": float(np.median(area)) if len(area) else None}


def _rows(columns: Mapping[str, object]) -> list[dict[str, object]]:
    return [
        dict(zip(columns, row, strict=True))
        for row in zip(*cast("list[list[object]]", list(columns.values())), strict=True)
    ]
