"""From a frame to JSON: made once for each frame, however many clients it is sent to."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import cast

import numpy as np
from pydantic_core import to_json
from scipy.special import chdtri

from lidarcore import Array, Features
from lidarcore.clusters import Clusters
from lidarcore.geometry import squared_mahalanobis

from ...pipeline.frame import Frame
from ...pipeline.slam_run import Localization
from ...pipeline.tables import CORNER_COLUMNS, SEGMENT_COLUMNS, Columns
from ...records import record
from ...scene.point_colours import colour_scale
from ..schemas import (
    ClusterJson,
    CornerJson,
    FrameJson,
    InnovationJson,
    LocalizationJson,
    MeasuredCornerJson,
    PoseJson,
    RejectionJson,
    SegmentJson,
    SummaryJson,
    TimingsJson,
)

BAND = 0.95  # of the normalised innovation squared
KEPT = 2  # frames whose JSON is kept: the newest, and the one before it that is still being sent


@lru_cache(KEPT)
def _frame_json(frame: Frame) -> FrameJson:
    """The frame; its age is taken when it is first asked for, that is when it is sent."""
    scan, chosen = frame.scan, frame.settings.extraction
    return record(
        FrameJson,
        frame,
        stamp=scan.stamp,
        source=frame.timed.position,
        n_beams=len(scan),
        n_valid=int(scan.valid.sum()),
        completeness=scan.completeness,
        gaps=scan.gaps.tolist(),
        noise_seen=frame.main.noise_seen,
        fitter=chosen.fitter,
        covariance=chosen.covariance,
        methods=list(frame.features),
        timings=record(TimingsJson, frame, age_ms=1e3 * frame.age()),
        extent=frame.extent().round(4).tolist(),
        colour_scale=colour_scale(frame),
        segments={name: segments_json(found) for name, found in frame.features.items()},
        corners=corners_json(frame),
        rejections=[record(RejectionJson, one, xy=one.xy.tolist()) for one in frame.main.rejections],
        summary={name: summary_json(found) for name, found in frame.features.items()},
        clusters=None if frame.clusters is None else clusters_json(frame.clusters),
        localization=None if frame.localization is None else localization_json(frame.localization),
    )


@lru_cache(2 * KEPT)
def frame_text(frame: Frame, with_points: bool = False) -> str:
    """The frame as JSON, with the measured points if asked for."""
    found = _frame_json(frame)
    if with_points:
        found = found | {"points": frame.scan.xy[frame.scan.valid].round(4).tolist()}
    return to_json(found).decode()


def corners_json(frame: Frame) -> list[CornerJson]:
    """One row per corner, whichever methods found it."""
    measured = {name: measured_corners_json(found) for name, found in frame.features.items()}
    return [
        {
            "id": row.id,
            "segments": row.segments,
            "selected": row.id == frame.selection.corner,
            "by_method": {name: measured[name][i] for name, i in row.index.items()},
        }
        for row in frame.corners
    ]


def segments_json(features: Features) -> list[SegmentJson]:
    """The segments of one method, in the order of the ring."""
    segments = features.segments
    rows = _rows(
        SegmentJson,
        _columns(SegmentJson, SEGMENT_COLUMNS, features),
        id=range(len(segments)),
        start=segments.start.tolist(),
        end=segments.end.tolist(),
        covariance=segments.lines.covariance.tolist(),
    )
    return cast(list[SegmentJson], rows)


def measured_corners_json(features: Features) -> list[MeasuredCornerJson]:
    """The corners of one method, in its own order."""
    columns = _columns(MeasuredCornerJson, CORNER_COLUMNS, features)
    rows = _rows(MeasuredCornerJson, columns, covariance=features.corners.covariance.tolist())
    return cast(list[MeasuredCornerJson], rows)


def _columns(schema: type, columns: Columns, features: Features) -> dict[str, list[float]]:
    """The columns that the schema asks for."""
    wanted = schema.__annotations__
    return {name: column(features).tolist() for name, column in columns.items() if name in wanted}


def _rows(
    schema: type, columns: Mapping[str, Sequence[object]], **more: Sequence[object]
) -> list[dict[str, object]]:
    """What the schema asks for, an object for each entry of the columns."""
    names, found = schema.__annotations__, {**columns, **more}
    return [dict(zip(names, row, strict=True)) for row in zip(*map(found.__getitem__, names), strict=True)]


def summary_json(features: Features) -> SummaryJson:
    """How many corners, and how large their ellipses are."""
    area = features.corners.area
    return {"corners": len(area), "median_area": float(np.median(area)) if len(area) else None}


def clusters_json(clusters: Clusters) -> list[ClusterJson]:
    """The clusters of a scan, in its order."""
    columns = {
        "x": clusters.means[:, 0].tolist(),
        "y": clusters.means[:, 1].tolist(),
        "covariance": clusters.covariances.tolist(),
        "scatter": clusters.scatters.tolist(),
        "count": clusters.counts.tolist(),
    }
    return cast(list[ClusterJson], _rows(ClusterJson, columns))


def pose_json(pose: Array) -> PoseJson:
    """A pose (3,) that is known."""
    return {"x": float(pose[0]), "y": float(pose[1]), "heading": float(pose[2])}


def localization_json(localization: Localization) -> LocalizationJson:
    """The localization of one scan as JSON."""
    found = localization.tracking
    estimate, confirmed = found.estimate, found.landmarks.confirmed
    return record(
        LocalizationJson,
        found,
        session=localization.session,
        pose=pose_json(estimate.pose),
        covariance=estimate.covariance.tolist(),
        velocity=None if estimate.velocity is None else tuple(estimate.velocity.tolist()),
        sideways=None if estimate.velocity is None else estimate.sideways,
        dead_reckoned=None if found.dead_reckoned is None else pose_json(found.dead_reckoned),
        truth=_truth_json(localization.truth),
        landmarks=len(confirmed),
        confirmed=int(confirmed.sum()),
        tentative=found.landmarks.points.xy[~confirmed].round(4).tolist(),
        observed=len(found.observed),
        ambiguous=len(found.ambiguous),
        unmatched=len(found.unmatched),
        innovations=_innovations_json(localization),
        nis_band=nis_band(found.dof),
    )


def nis_band(dof: int) -> tuple[float, float]:
    """What holds the normalised innovation squared of an honest filter 95 times in a hundred."""
    if dof == 0:
        return 0.0, 0.0
    tail = (1 - BAND) / 2
    return float(chdtri(dof, 1 - tail)), float(chdtri(dof, tail))


def _innovations_json(localization: Localization) -> list[InnovationJson]:
    innovation, pairs = localization.tracking.estimate.innovation, localization.tracking.pairs
    P = len(pairs)
    S = innovation.covariance.reshape(P, 2, P, 2)[np.arange(P), :, np.arange(P)]
    distances = squared_mahalanobis(innovation.value, S)
    ids = (localization.stored.get(id_) for id_ in pairs[:, 1].tolist())
    rows = zip(ids, innovation.value.tolist(), distances.tolist(), strict=True)
    return [{"landmark": id_, "dx": dx, "dy": dy, "squared_distance": d2} for id_, (dx, dy), d2 in rows]


def _truth_json(truth: Array | None) -> tuple[float, float, float | None] | None:
    if truth is None:
        return None
    x, y, heading = truth.tolist()
    return x, y, heading if np.isfinite(heading) else None
