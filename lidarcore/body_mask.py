"""The robot's own body in the scan: sectors in which what is near is left out, before everything else."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from lidarcore.arrays import Array
from lidarcore.errors import MaskError
from lidarcore.fields import number
from lidarcore.scan import Scan

MOST_SECTORS = 16  # of a mask
MOST_BYTES = 1 << 13  # of a mask as text

_BINS = 180  # of bearings in a whole turn
_LEAST = 20  # scans
_SHARE = 0.9  # of the scans in which a body is in its place
_STEADY = 0.04  # m between the 5th and the 95th of 100 ranges to a body, at most
_MOVING = 0.3  # m between the same of the room, in half of all bearings at least
_CLEARANCE = 0.05  # m beyond the farthest return from the body
_TURN = 6.3  # rad, and a little


@dataclass(config=ConfigDict(extra="forbid"), frozen=True, slots=True)
class Sector:
    """Bearings from `first` counter-clockwise to `last` (rad, sensor frame), and how far the mask reaches (m).

    Raises pydantic.ValidationError, a ValueError that names the field and its bounds.
    """

    first: Annotated[
        float, number(-_TURN, _TURN, "rad", "bearing at which it begins. More: it begins farther to the left")
    ]
    last: Annotated[
        float,
        number(-_TURN, _TURN, "rad", "bearing at which it ends, to the left of first. More: it is wider"),
    ]
    reach: Annotated[
        float, number(0.01, 10.0, "m", "what is nearer is left out. More: more of the room goes, too")
    ]

    def holds(self, bearings: Array) -> "np.ndarray":
        """(N,) true for bearings (N,) rad within the sector; the whole turn if first and last are a turn apart."""
        width = self.last - self.first
        whole = abs(width) >= 2 * np.pi - 1e-9
        return (
            np.full(len(bearings), True)
            if whole
            else (bearings - self.first) % (2 * np.pi) <= width % (2 * np.pi)
        )


Mask = Annotated[tuple[Sector, ...], Field(max_length=MOST_SECTORS)]
_Mask = TypeAdapter[tuple[Sector, ...]](Mask)


def as_text(mask: Iterable[Sector]) -> str:
    """A mask as JSON, for the metadata of a recording."""
    return _Mask.dump_json(tuple(mask)).decode()


def from_text(text: str) -> tuple[Sector, ...]:
    """The mask that `as_text` wrote. Raises MaskError if the text is none, or too long."""
    if len(text) > MOST_BYTES:
        raise MaskError(f"The mask takes {len(text)} bytes, more than {MOST_BYTES}.")
    try:
        return _Mask.validate_json(text)
    except ValidationError as error:
        raise MaskError(f"The mask is not valid: {error.errors()[0]['msg']}.") from error


def masked(scan: Scan, sectors: Iterable[Sector]) -> Scan:
    """The scan without the returns that are nearer than the reach of a sector; the same object if there are none."""
    ranges = scan.ranges
    for sector in sectors:
        with np.errstate(invalid="ignore"):
            ranges = np.where(sector.holds(scan.bearings) & (ranges < sector.reach), np.nan, ranges)
    hidden = np.isnan(ranges).sum() != np.isnan(scan.ranges).sum()
    return replace(scan, ranges=ranges) if hidden else scan


def suggest_mask(scans: Sequence[Scan], farthest: float = 1.0) -> tuple[Sector, ...]:
    """Sectors of what stays in its place, nearer than `farthest` m, while everything else moves.

    Raises MaskError if there are too few scans, or the sensor did not move enough to tell body and room apart.
    """
    if len(scans) < _LEAST:
        raise MaskError(f"{len(scans)} scans are too few: drive about while at least {_LEAST} are taken.")
    nearest = np.stack([_nearest(scan) for scan in scans])
    seen = np.isfinite(nearest)
    spread, last = np.full(_BINS, np.nan), np.full(_BINS, np.nan)
    for b in np.flatnonzero(seen.sum(axis=0) >= _SHARE * len(scans)):
        low, high = np.quantile(nearest[seen[:, b], b], [0.05, 0.95])
        spread[b], last[b] = high - low, high
    with np.errstate(invalid="ignore"):
        body = (spread <= _STEADY) & (last < farthest)
    room = spread[~body & np.isfinite(spread)]
    if not len(room) or np.median(room) < _MOVING:
        raise MaskError(
            "The sensor hardly moved: drive and turn, so that only its own body stays where it is."
        )
    sectors = _sectors(body, last)
    if len(sectors) > MOST_SECTORS:
        raise MaskError(
            f"{len(sectors)} places stay where they are, more than the {MOST_SECTORS} sectors of a mask: drive farther."
        )
    return sectors


def _nearest(scan: Scan) -> Array:
    """The nearest return (m) in each bin of bearings, inf for none."""
    which = np.floor((scan.bearings[scan.valid] % (2 * np.pi)) * _BINS / (2 * np.pi)).astype(np.int64) % _BINS
    nearest = np.full(_BINS, np.inf)
    np.minimum.at(nearest, which, scan.ranges[scan.valid])
    return nearest


def _sectors(body: "np.ndarray", last: Array) -> tuple[Sector, ...]:
    """Runs of bins around the ring, one bin wider at both sides."""
    if not body.any():
        return ()
    width = 2 * np.pi / _BINS
    begin = int(np.argmin(body))  # a bin that is no body, so that no run goes past the end
    ring = np.roll(body, -begin).astype(np.int64)
    edges = np.diff(np.concatenate([[0], ring, [0]]))
    found = []
    for first, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        reach = float(np.nanmax(np.roll(last, -begin)[first:end])) + _CLEARANCE
        a, b = (first + begin - 1) * width, (end + begin + 1) * width
        found.append(Sector(float(a % (2 * np.pi)), float(b % (2 * np.pi)), reach))
    return tuple(found)
