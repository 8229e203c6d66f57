"""One revolution of the sensor."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.errors import ScanError
from lidarcore.geometry import unit_vectors

__all__ = ["MAX_BEARING", "Array", "Ints", "Scan"]

MAX_BEARING = 8 * np.pi  # rad; beyond a few turns they are surely in another unit


@dataclass(frozen=True, eq=False)
class Scan:
    """One scan in the sensor frame (x forward, y left, bearings counter-clockwise, REP-103).

    Beams are kept in the order of the ring: bearings that grow with at most one wrap are kept as given,
    any other order (clockwise, shuffled) is sorted by bearing. The arrays are read-only.

    ranges      (N,) m; NaN where there was no return (inf and values <= 0 are turned into NaN)
    bearings    (N,) rad, counter-clockwise from x
    stamp       s, of the first beam; 0 if unknown
    quality     (N,) as the sensor reports it, or None
    beam_times  (N,) s after `stamp`, or None
    odometry    (3,) x m, y m, heading rad: T_odom_sensor at `stamp`, or None
    gaps        (G, 2) rad, from and to, counter-clockwise: sectors whose data were lost on the way from the sensor
    truth       (3,) x m, y m, heading rad: T_world_sensor at `stamp` as a simulator or an external reference has it,
                for comparison only, or None; the heading is NaN where only the position is known

    Raises ScanError if the arrays are empty, not of one length, or a bearing is not finite or not in radians.
    """

    ranges: Array
    bearings: Array
    stamp: float = 0.0
    quality: Array | None = None
    beam_times: Array | None = None
    odometry: Array | None = None
    gaps: Array = field(default_factory=lambda: np.empty((0, 2)))
    truth: Array | None = None

    def __post_init__(self) -> None:
        bearings = as_row(self.bearings, "bearings")
        ranges = as_row(self.ranges, "ranges")
        if not len(ranges):
            raise ScanError("The scan is empty: give at least one beam.")
        _check_finite(bearings)
        if np.abs(bearings).max() > MAX_BEARING:
            raise ScanError(f"Bearings reach {np.abs(bearings).max():g} rad: give radians, not degrees.")
        if not (isinstance(self.stamp, int | float) and np.isfinite(self.stamp)):
            raise ScanError(f"The stamp is {self.stamp}: give seconds, or 0 if unknown.")
        with np.errstate(invalid="ignore"):
            ranges = np.where((ranges > 0) & (ranges < np.inf), ranges, np.nan)
        columns = {"ranges": ranges, "bearings": bearings}
        columns |= {
            name: as_row(value, name)
            for name in ("quality", "beam_times")
            if (value := getattr(self, name)) is not None
        }
        for name, column in columns.items():
            if len(column) != len(bearings):
                raise ScanError(
                    f"{name} has {len(column)} entries, bearings has {len(bearings)}: make them equal."
                )
        columns = _along_the_ring(columns)
        if self.odometry is not None:
            columns["odometry"] = _as_pose(self.odometry, "odometry", known=3)
        if self.truth is not None:
            columns["truth"] = _as_pose(self.truth, "truth", known=2)
        columns["gaps"] = _as_sectors(self.gaps)
        self._keep(columns)

    def with_beams(self, ranges: Array, bearings: Array) -> "Scan":
        """The scan with other ranges and bearings (N,) of its beams, arrays that it keeps.

        To check them as those of a new scan takes as long as to compute them: ranges must be above 0, or NaN.
        Raises ScanError if a bearing is not finite.
        """
        _check_finite(bearings)
        scan = object.__new__(Scan)
        vars(scan).update({name: getattr(self, name) for name in self.__dataclass_fields__})
        columns = {
            "ranges": ranges,
            "bearings": bearings,
            "quality": self.quality,
            "beam_times": self.beam_times,
        }
        scan._keep(_along_the_ring({name: column for name, column in columns.items() if column is not None}))
        return scan

    def _keep(self, columns: dict[str, Array]) -> None:
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.ranges)

    def __repr__(self) -> str:
        return f"Scan({len(self)} beams, {int(self.valid.sum())} returns, stamp={self.stamp:.3f} s)"

    @cached_property
    def valid(self) -> Bools:
        """(N,) true where the beam returned."""
        return ~np.isnan(self.ranges)

    @cached_property
    def completeness(self) -> float:
        """Share of the revolution that arrived, 0 to 1."""
        return max(0.0, float(1 - ((self.gaps[:, 1] - self.gaps[:, 0]) % (2 * np.pi)).sum() / (2 * np.pi)))

    @cached_property
    def xy(self) -> Array:
        """(N, 2) m, sensor frame; NaN where there was no return."""
        return self.ranges[:, None] * unit_vectors(self.bearings)


def as_row(values: ArrayLike, name: str) -> Array:
    """A private one-dimensional float copy of the values."""
    try:
        row = np.array(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{name} are not numbers: {error}.") from error
    if row.ndim != 1:
        raise ScanError(f"{name} has shape {row.shape}: give one value for each beam, shape (N,).")
    return row


def _check_finite(bearings: Array) -> None:
    if not np.isfinite(bearings).all():
        raise ScanError("A bearing is not a finite number: give every beam its angle in radians.")


def _as_pose(values: ArrayLike, name: str, known: int) -> Array:
    """A private pose (3,) whose first `known` numbers are finite."""
    pose = as_row(values, name)
    if pose.shape != (3,) or not np.isfinite(pose[:known]).all():
        raise ScanError(f"{name} is {pose}: give x (m), y (m) and heading (rad), all finite.")
    return pose


def _as_sectors(gaps: ArrayLike) -> Array:
    sectors = np.array(gaps, np.float64)
    if sectors.ndim != 2 or sectors.shape[1] != 2 or not np.isfinite(sectors).all():
        raise ScanError(
            f"gaps has shape {sectors.shape}: give from and to of each sector in rad, shape (G, 2)."
        )
    return sectors


def _along_the_ring(columns: dict[str, Array]) -> dict[str, Array]:
    """Columns (N,) of beams as they are if their bearings follow the ring, else sorted by them."""
    bearings = columns["bearings"]
    if _follows_the_ring(bearings):
        return columns
    order = np.argsort(bearings % (2 * np.pi), kind="stable")
    return {name: column[order] for name, column in columns.items()}


def _follows_the_ring(bearings: Array) -> bool:
    """True if bearings grow all the way around, with at most one step back, and stay within one turn."""
    wraps = np.count_nonzero(bearings[1:] < bearings[:-1])
    turn = bearings[-1] - bearings[0] + 2 * np.pi * wraps
    return bool(wraps <= 1 and turn <= 2 * np.pi + 1e-9)
