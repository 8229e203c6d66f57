"""Recordings that are a few named arrays: .npz and .mat."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarcore.files.streams import MEBIBYTE
from lidarcore.recordings.base import Recording
from lidarcore.recordings.pace import period
from lidarcore.scan import Scan

NAMES = {
    "ranges": ("ranges",),
    "bearings": ("bearings", "angles"),
    "stamps": ("stamps", "timestamps"),
    "quality": ("quality", "intensities"),
    "beam_times": ("beam_times",),
    "odometry": ("odometry",),
    "truth": ("truth",),
}
"""What an array may be called, in any case of letters."""

EXPECTED = (
    "expected are ranges (N, B) or (B,) m and bearings or angles (B,) or (N, B) rad counter-clockwise, "
    "and, if known, stamps (N,) s, quality (N, B), beam_times (B,) or (N, B) s, odometry (N, 3) m, m, rad, "
    "and truth (N, 3) alike where poses are known"
)

_POSES = ("odometry", "truth")

FARTHEST = 100.0
"""m: a median range beyond this is in another unit."""

SAMPLE = 1 << 20
"""Ranges that tell the unit of all."""

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
            self._check_size(name, array.shape, array.dtype.kind in "fiu", array.dtype.itemsize)
        arrays: dict[str, NDArray[Any]] = {meaning[name.lower()]: array for name, array in loaded.items()}
        if missing := [name for name in ("ranges", "bearings") if name not in arrays]:
            raise self._error(f"has no {' and no '.join(missing)}: {EXPECTED}.")
        ranges = np.atleast_2d(arrays.pop("ranges"))
        if ranges.ndim != 2:
            raise self._error(f"has ranges of shape {ranges.shape}: {EXPECTED}.")
        self._check_beams(ranges.shape[-1])
        self._columns = {name: self._shaped(name, array, *ranges.shape) for name, array in arrays.items()}
        self._columns["ranges"] = ranges
        self._check()

    def _check_size(self, name: str, shape: tuple[int, ...], real: bool, itemsize: int) -> None:
        """Raise RecordingError if an array is not of real numbers, or claims more than the file can hold."""
        if not real:
            raise self._error(f"has a {name} that is not of real numbers: {EXPECTED}.")
        if prod(shape) * itemsize > self._most_bytes():
            raise self._error(
                f"has a {name} that claims the shape {shape}, too large for the size of the file."
            )

    def _most_bytes(self) -> int:
        """Bytes that the arrays may take in all: they are in memory as a whole."""
        return 64 * MEBIBYTE + 2 * self.path.stat().st_size

    def _shaped(self, name: str, array: NDArray[Any], scans: int, beams: int) -> NDArray[Any]:
        """An array with one row for each scan."""
        if name == "stamps" and array.size == scans:
            return array.reshape(scans)
        if name in _POSES and array.size == 3 * scans:
            return array.reshape(scans, 3)
        if name not in ("stamps", *_POSES):
            if array.shape == (scans, beams):
                return array
            if array.size == beams:
                return np.broadcast_to(array.reshape(beams), (scans, beams))
        raise self._error(f"has {name} of shape {array.shape} and ranges of {(scans, beams)}: {EXPECTED}.")

    def _check(self) -> None:
        bearings, ranges = self._columns["bearings"], self._columns["ranges"]
        if not ranges.size:
            raise self._error(f"holds no beam: {EXPECTED}.")
        low, high = float(bearings.min()), float(bearings.max())  # either is NaN if any is
        if not 0 <= high - low <= ONE_TURN:
            raise self._error(f"has bearings from {low:.6g} to {high:.6g}: expected are radians.")
        some = ranges[:: max(1, ranges.size // SAMPLE)]
        returned = some[(some > 0) & (some < np.inf)]
        if len(returned) and np.median(returned) > FARTHEST:
            raise self._error(f"has a median range of {np.median(returned):.6g}: expected are metres.")
        if "stamps" not in self._columns:
            seconds = period(
                next((self._columns[name] for name in _POSES if name in self._columns), np.empty((0, 3)))
            )
            self._columns["stamps"] = seconds * np.arange(len(ranges), dtype=np.float64)
            self._remark(f"There are no stamps: scans are taken to be {seconds:g} s apart.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        names = {name: "stamp" if name == "stamps" else name for name in self._columns}
        for index in range(len(self._columns["ranges"])):
            row = {names[name]: column[index] for name, column in self._columns.items()}
            yield partial(Scan, **row | {"stamp": float(row["stamp"])})
