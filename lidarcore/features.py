"""What extraction found in one scan: segments, corners, and what it rejected.

Each class is a view over one table written by the compiled kernel (a row for each thing found), so making it
costs next to nothing; fields are cut from the table when they are asked for. All are in the sensor frame.
"""

from functools import cached_property

import numpy as np

from lidarcore import tables
from lidarcore.lines import Lines
from lidarcore.lines.line import ABOUT_MEAN, ABOUT_TRUTH, normal_angle, to_second_order
from lidarcore.rejections import Rejections
from lidarcore.scan import Array, Ints, Scan
from lidarcore.segmentation.noise_expected import noise_expected
from lidarcore.settings import Covariance, ExtractionSettings
from lidarcore.table_view import TableView


class Segments(TableView):
    """M wall segments in the order of the ring; uneven says whether the noise model knows that walls are."""

    def __init__(self, table: Array, which: Covariance, uneven: bool) -> None:
        super().__init__(table, which)
        self._uneven = uneven

    @cached_property
    def lines(self) -> Lines:
        """The fitted lines, with covariances of (alpha, r)."""
        published, consistent, for_maps = (
            self._matrices(c) for c in (tables.LINE_PUBLISHED, tables.LINE_CONSISTENT, tables.LINE_MAP)
        )
        r = self._table[:, tables.DISTANCE]
        if self._uneven:
            consistent = to_second_order(consistent, r, ABOUT_MEAN)
            for_maps = to_second_order(for_maps, r, ABOUT_TRUTH)
        return Lines(
            normal_angle(self._table[:, tables.NORMAL], self._table[:, tables.NORMAL + 1]),
            r,
            published,
            consistent,
            for_maps,
            {"published": published, "consistent": consistent, "map": for_maps}[self._which],
        )

    @property
    def start(self) -> Array:
        """(M, 2) m, the first point projected on the line."""
        return self._table[:, tables.START : tables.START + 2]

    @property
    def end(self) -> Array:
        """(M, 2) m, the last point projected on the line."""
        return self._table[:, tables.END : tables.END + 2]

    @property
    def length(self) -> Array:
        """(M,) m."""
        difference: Array = self.end - self.start
        return np.hypot(difference[:, 0], difference[:, 1])

    @property
    def first_beam(self) -> Ints:
        """(M,) index into the scan; a segment goes from first to last along the ring and may pass its end."""
        return self._table[:, tables.FIRST_BEAM].astype(np.int64)

    @property
    def last_beam(self) -> Ints:
        """(M,) index into the scan."""
        return self._table[:, tables.LAST_BEAM].astype(np.int64)

    @property
    def n_points(self) -> Ints:
        """(M,) number of returns between the two beams."""
        return self._table[:, tables.N_POINTS].astype(np.int64)

    @property
    def rms(self) -> Array:
        """(M,) m, root mean square distance of the fitted points from the line."""
        return self._table[:, tables.RMS]


class Corners(TableView):
    """K corners in the order of the ring."""

    @property
    def xy(self) -> Array:
        """(K, 2) m."""
        return self._table[:, :2]

    @property
    def covariance(self) -> Array:
        """(K, 2, 2) m², the kind the settings ask for."""
        return {
            "published": self.covariance_published,
            "consistent": self.covariance_consistent,
            "map": self.covariance_map,
        }[self._which]

    @property
    def covariance_published(self) -> Array:
        """(K, 2, 2) m², from the lines' published covariances."""
        return self._matrices(tables.CORNER_PUBLISHED)

    @property
    def covariance_consistent(self) -> Array:
        """(K, 2, 2) m², from the lines' consistent covariances."""
        return self._matrices(tables.CORNER_CONSISTENT)

    @property
    def covariance_map(self) -> Array:
        """(K, 2, 2) m², from what is not known of where the walls are: for maps, and for looks from several places."""
        return self._matrices(tables.CORNER_MAP)

    @property
    def sigma(self) -> Array:
        """(K, 2) m, standard deviations of x and y from `covariance`."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def area(self) -> Array:
        """(K,) m², of the one-sigma ellipse of `covariance`: pi times the root of its determinant."""
        c = self.covariance
        return np.pi * np.sqrt(np.maximum(c[:, 0, 0] * c[:, 1, 1] - c[:, 0, 1] * c[:, 1, 0], 0.0))

    @property
    def segments(self) -> Ints:
        """(K, 2) indices of the two segments that meet, in the order of the ring."""
        return self._table[:, tables.SEGMENTS : tables.SEGMENTS + 2].astype(np.int64)

    @property
    def angle(self) -> Array:
        """(K,) rad between the two lines, in (0, pi/2]."""
        return np.arcsin(np.minimum(self._table[:, tables.SINE], 1.0))


class Features:
    """Segments, corners and rejections of one scan, by one fitter.

    noise_seen (m) is a robust estimate of the ranges' standard deviation from this scan alone: where `noise_excess` is
    far above 1, the covariances claim too much.
    """

    def __init__(
        self,
        scan: Scan,
        settings: ExtractionSettings,
        fitter: str,
        table: Array,
        counts: tuple[int, int, int],
        noise_seen: float,
    ) -> None:
        self.scan = scan
        self.settings = settings
        self.fitter = fitter
        n, k, m = counts
        self.segments = Segments(table[:n], settings.covariance, settings.noise.unevenness > 0)
        self.corners = Corners(table[n : n + k], settings.covariance)
        self.rejections = Rejections(table[::-1][:m], settings.covariance)
        self.noise_seen = noise_seen

    def __repr__(self) -> str:
        found = (
            f"{len(self.segments)} segments, {len(self.corners)} corners, {len(self.rejections)} rejections"
        )
        return f"Features({self.fitter}: {found})"

    @cached_property
    def noise_excess(self) -> float:
        """How many times as far as the noise in the settings makes them the ranges scatter; 1 if no farther."""
        expected = noise_expected(self.scan, self.settings.noise)
        return max(1.0, self.noise_seen / expected) if expected else 1.0

    @property
    def lines(self) -> Lines:
        """The lines of the segments."""
        return self.segments.lines
