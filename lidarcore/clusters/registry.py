"""The clustering methods, listed once: settings, command line, REST, page and tests derive from CLUSTERERS.

A new method is one file with one function, one entry here, and its parameters in ClusterSettings.
"""

from collections.abc import Callable
from dataclasses import dataclass

from lidarcore.arrays import Array, Ints
from lidarcore.clusters import dbscan, gmm, heuristic, kmeans


@dataclass(frozen=True, slots=True)
class Clusterer:
    """A clustering method: what it is called, where it comes from, and which of the settings are its own."""

    name: str
    title: str
    reference: str
    summary: str
    method: Callable[..., Ints]
    parameters: tuple[str, ...]

    def label(self, points: Array, settings: object) -> Ints:
        """Cluster (n,) of each of the points (n, 2) m of a ring, in its order, -1 for none; in no particular numbering.

        settings has an attribute for each of `parameters`, as ClusterSettings does.
        """
        return self.method(points, **{name: getattr(settings, name) for name in self.parameters})


CLUSTERERS: dict[str, Clusterer] = {
    clusterer.name: clusterer
    for clusterer in (
        Clusterer(
            "heuristic",
            "Gaps",
            "Urvina et al., eq. 1",
            "A new object begins where the gap between consecutive points exceeds a distance.",
            heuristic.label,
            ("distance",),
        ),
        Clusterer(
            "kmeans",
            "k-means",
            "Urvina et al., eq. 2-4; k by silhouette, Rousseeuw 1987",
            "Each point belongs to the nearest mean; round objects of like size.",
            kmeans.label,
            ("k", "k_max"),
        ),
        Clusterer(
            "gmm",
            "Gaussian mixture",
            "Urvina et al., eq. 5-12; k by BIC, Kass and Raftery 1995",
            "Each point belongs to its most probable Gaussian; long objects, such as walls, too.",
            gmm.label,
            ("k", "k_max", "noise"),
        ),
        Clusterer(
            "dbscan",
            "DBSCAN",
            "Urvina et al., eq. 13; Ester et al. 1996",
            "Points that are dense are connected, whatever shape they make; lone points are noise.",
            dbscan.label,
            ("eps", "min_points"),
        ),
    )
}
