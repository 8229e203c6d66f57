"""Recordings that are a few named arrays: .npz and .mat."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarcore.recordings.base import NOMINAL_PERIOD, Recording
from lidarcore.recordings.streams import allowance
from lidarcore.scan import Array, Scan

NAMES = {
    "ranges": ("ranges",),
    "bearings": ("bearings", "angles"),
    "stamps": ("stamps", "timestamps"),
    "quality": ("quality", "intensities"),
    "beam_times": ("beam_times",),
    "odometry": ("odometry",),
}
"""What an array may be called, in any case of letters."""

EXPECTED = (
    "expected are ranges (N, B) or (B,) m and bearings or angles (B,) or (N, B) rad counter-clockwise, "
    "and, if known, stamps (N,) s, quality (N, B), beam_times (B,) or (N, B) s, odometry (N, 3) m, m, rad"
)

FARTHEST = 100.0
"""m: a median range beyond this is in another unit."""

ONE_TURN = 2 * np.pi + 0.1
"""rad: bearings that span more are in degrees."""


class ArrayRecording(Recording):
    """N scans of B beams as arrays: see EXPECTED. Ranges that are 0, NaN or infinite are no return."""

    @abstractmethod
    def _load(self, wanted: Callable[[str], bool]) -> Mapping[str, NDArray[Any]]:
        """Read the wanted arrays, each after `_check_size`."""

    def _open(self, topic: str | None) -> None:
        self._choose((), topic)
        meaning = {alias: name for name, aliases in NAMES.items() for alias in aliases}
        loaded = self._load(lambda name: name.lower() in meaning)
        for name, array in loaded.items():  # that numbers are complex shows only now
            self._check_size(name, array.shape, array.dtype.kind in "fiu")
        arrays = {meaning[name.lower()]: np.asarray(array, np.float64) for name, array in loaded.items()}
        if not {"ranges", "bearings"} <= arrays.keys():
            raise self._error(f"holds {' and '.join(arrays) or 'nothing'} of use: {EXPECTED}.")
        ranges = np.atleast_2d(arrays.pop("ranges"))
        self._columns = {name: self._shaped(name, array, *ranges.shape) for name, array in arrays.items()}
        self._columns["ranges"] = ranges
        self._check()

    def _check_size(self, name: str, shape: tuple[int, ...], real: bool) -> None:
        """Raise RecordingError if an array is not of real numbers, or claims more than the file can hold."""
        if not real:
            raise self._error(f"has a {name} that is not of real numbers: {EXPECTED}.")
        if 8 * prod(shape) > allowance(self.path):
            raise self._error(
                f"has a {name} that claims the shape {shape}, too large for the size of the file."
            )

    def _shaped(self, name: str, array: Array, scans: int, beams: int) -> Array:
        """One row for each scan."""
        if name == "stamps" and array.size == scans:
            return array.reshape(scans)
        if name == "odometry" and array.size == 3 * scans:
            return array.reshape(scans, 3)
        if name not in ("stamps", "odometry"):
            if array.shape == (scans, beams):
                return array
            if array.size == beams:
                return np.broadcast_to(array.reshape(beams), (scans, beams))
        raise self._error(f"has {name} of shape {array.shape} and ranges of {(scans, beams)}: {EXPECTED}.")

    def _check(self) -> None:
        bearings, ranges = self._columns["bearings"], self._columns["ranges"]
        if not ranges.size:
            raise self._error(f"holds no beam: {EXPECTED}.")
        if not np.isfinite(bearings).all() or np.ptp(bearings) > ONE_TURN:
            raise self._error(
                f"has bearings from {bearings.min():.6g} to {bearings.max():.6g}: expected are radians."
            )
        returned = ranges[(ranges > 0) & (ranges < np.inf)]
        if len(returned) and np.median(returned) > FARTHEST:
            raise self._error(f"has a median range of {np.median(returned):.6g}: expected are metres.")
        if "stamps" not in self._columns:
            self._columns["stamps"] = NOMINAL_PERIOD * np.arange(len(ranges), dtype=np.float64)
            self._remark(f"There are no stamps: scans are taken to be {NOMINAL_PERIOD} s apart.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        names = {name: "stamp" if name == "stamps" else name for name in self._columns}
        for index in range(len(self._columns["ranges"])):
            yield partial(Scan, **{names[name]: column[index] for name, column in self._columns.items()})
