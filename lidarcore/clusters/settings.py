"""What a user can set about clusters: declared once, with unit, range and meaning."""

from dataclasses import field
from typing import Annotated

from pydantic import Field, field_validator

from lidarcore.clusters.registry import CLUSTERERS
from lidarcore.fields import number, settings, whole
from lidarcore.noise import SensorNoise


@settings
class ClusterSettings:
    """How a scan becomes clusters. Metres; immutable, so a scan never sees a half change.

    Which of them a method uses, beside min_points, max_range and noise, is in `CLUSTERERS[method].parameters`.
    Raises pydantic.ValidationError, a ValueError that names the field and its bounds.
    """

    method: Annotated[
        str, Field(description="clustering method", json_schema_extra={"enum": list(CLUSTERERS)})
    ] = "heuristic"
    distance: float = number(
        0.01,
        10.0,
        "m",
        "heuristic: consecutive points farther apart are different objects. More: fewer, larger clusters",
        default=0.3,
    )
    eps: float = number(
        0.01,
        10.0,
        "m",
        "dbscan: points at most this far apart are neighbours. More: fewer, larger clusters",
        default=0.3,
    )
    min_points: int = whole(
        2,
        1000,
        "a cluster needs at least this many points, as for dbscan a dense neighbourhood does. "
        "More: small things are left out",
        default=3,
    )
    k: int | None = whole(
        1,
        200,
        "kmeans, gmm: number of clusters, fewer where there are fewer points; none to choose it for "
        "every scan from 1 to k_max, kmeans by the silhouette, gmm by the Bayesian information criterion. "
        "More: smaller clusters",
        default=None,
    )
    k_max: int = whole(
        1,
        50,
        "kmeans, gmm: most clusters to choose from. "
        "More: more clusters where there are many things, and more time",
        default=12,
    )
    max_range: float | None = number(
        0.1,
        1000.0,
        "m",
        "points farther from the sensor are left out; none for all. "
        "More: things farther away are clusters, too",
        default=None,
    )
    noise: SensorNoise = field(default_factory=SensorNoise)

    @field_validator("method")
    @classmethod
    def _known_method(cls, name: str) -> str:
        if name not in CLUSTERERS:
            raise ValueError(f"unknown method {name!r}: choose one of {', '.join(CLUSTERERS)}")
        return name
