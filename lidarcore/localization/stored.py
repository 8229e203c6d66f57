"""Between the map of a filter and the landmarks of a file or a database."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarcore.landmarks.landmark import Landmark
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.points import Points


def to_stored(landmarks: Landmarks, method: str = "") -> list[Landmark]:
    """The confirmed landmarks as a file or a `LandmarkMap` takes them, without ids; `method` is what found them."""
    confirmed = landmarks.subset(landmarks.confirmed)
    points = confirmed.points
    rows = zip(
        points.xy,
        points.covariance,
        np.asarray(points.kinds).tolist(),
        np.maximum(confirmed.counts, 1).tolist(),
        confirmed.first_seen.tolist(),
        confirmed.last_seen.tolist(),
        strict=True,
    )
    return [
        Landmark.of(xy, covariance, kind, method=method, count=count, first_seen=first, last_seen=last)
        for xy, covariance, kind, count, first, last in rows
    ]


def from_stored(landmarks: Iterable[Landmark]) -> Landmarks:
    """Landmarks of a file or a `LandmarkMap` as a map to localize in, with their ids there, else numbered."""
    found = list(landmarks)

    def column(name: str) -> NDArray[Any]:
        return np.array([getattr(landmark, name) for landmark in found])

    C = np.stack([column("var_x"), column("cov_xy"), column("cov_xy"), column("var_y")], -1).reshape(-1, 2, 2)
    points = Points(np.stack([column("x"), column("y")], -1), C, column("kind").astype(np.str_))
    ids = [place if landmark.id is None else landmark.id for place, landmark in enumerate(found)]
    seen = (column(name) for name in ("count", "first_seen", "last_seen"))
    return Landmarks(np.array(ids), points, np.ones(len(found), np.bool_), *seen)
