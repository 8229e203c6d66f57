"""Where the sensor is and what is clustered, in JSON form."""

from typing import cast

import numpy as np
from scipy.special import chdtri

from app.run import Where
from app.wire import ClusterJson, InnovationJson, LocalizationJson, Matrix3, PoseJson
from lidarcore.clusters import Clusters
from lidarcore.localization.association import squared_distances
from lidarcore.scan import Array

BAND = 0.95


def clusters_json(clusters: Clusters) -> list[ClusterJson]:
    """The clusters of a scan, in its order."""
    rows = zip(clusters.means, clusters.covariances, clusters.scatters, clusters.counts, strict=True)
    return [
        {
            "x": float(mean[0]),
            "y": float(mean[1]),
            "covariance": covariance.tolist(),
            "scatter": scatter.tolist(),
            "count": int(count),
        }
        for mean, covariance, scatter, count in rows
    ]


def pose_json(pose: Array) -> PoseJson:
    """A pose (3,) that is known."""
    return {"x": float(pose[0]), "y": float(pose[1]), "heading": float(pose[2])}


def localization_json(where: Where) -> LocalizationJson:
    """All there is to say of one scan."""
    found = where.whereabouts
    estimate, confirmed = found.estimate, found.landmarks.confirmed
    return {
        "mode": found.mode,
        "state": found.state,
        "message": found.message,
        "session": where.session,
        "pose": pose_json(estimate.pose),
        "covariance": cast(Matrix3, estimate.covariance.tolist()),
        "velocity": None
        if estimate.velocity is None
        else cast("tuple[float, float]", tuple(estimate.velocity.tolist())),
        "dead_reckoned": None if found.dead_reckoned is None else pose_json(found.dead_reckoned),
        "truth": _truth_json(where.truth),
        "landmarks": len(confirmed),
        "confirmed": int(confirmed.sum()),
        "observed": len(found.observed),
        "ambiguous": len(found.ambiguous),
        "unmatched": len(found.unmatched),
        "innovations": _innovations_json(where),
        "nis": found.nis,
        "dof": found.dof,
        "nis_band": nis_band(found.dof),
    }


def nis_band(dof: int) -> tuple[float, float]:
    """What holds the normalised innovation squared of an honest filter 95 times in a hundred."""
    if dof == 0:
        return 0.0, 0.0
    tail = (1 - BAND) / 2
    return float(chdtri(dof, 1 - tail)), float(chdtri(dof, tail))


def _innovations_json(where: Where) -> list[InnovationJson]:
    innovation, pairs = where.whereabouts.estimate.innovation, where.whereabouts.pairs
    P = len(pairs)
    S = innovation.covariance.reshape(P, 2, P, 2)[np.arange(P), :, np.arange(P)]
    distances = squared_distances(innovation.value, S)
    ids = (where.stored.get(id_) for id_ in pairs[:, 1].tolist())
    rows = zip(ids, innovation.value.tolist(), distances.tolist(), strict=True)
    return [{"landmark": id_, "dx": dx, "dy": dy, "squared_distance": d2} for id_, (dx, dy), d2 in rows]


def _truth_json(truth: Array | None) -> tuple[float, float, float | None] | None:
    if truth is None:
        return None
    x, y, heading = truth.tolist()
    return x, y, heading if np.isfinite(heading) else None
