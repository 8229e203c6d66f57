"""The colour of every point: plain, of its segment, or of a number, with the scale that says which number."""

from dataclasses import dataclass

import numpy as np

from ..pipeline.frame import Frame
from .colours import Rgbs, categorical, turbo
from .shapes import Array, beams_between

STOPS = 9  # of a scale that is shown
FAR = 98  # percent of the ranges that a scale covers


@dataclass(frozen=True, slots=True)
class ColourScale:
    """Colours from zero to `high`: `stops` (#rrggbb) at equal distances; what is above looks like `high`."""

    high: float
    unit: str
    stops: tuple[str, ...]


def colour_scale(frame: Frame) -> ColourScale | None:
    """What the colours of the points mean; None if they are no number."""
    found = _numbers(frame)
    if found is None:
        return None
    colours = turbo(np.linspace(0, 1, STOPS)).tolist()
    return ColourScale(found[1], found[2], tuple(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in colours))


def point_colours(frame: Frame, plain: Rgbs) -> Rgbs:
    """One colour (3,) for all valid points, or (N, 3)."""
    if (found := _numbers(frame)) is not None:
        numbers, high, _ = found
        return turbo(numbers / high)
    return _segment_colours(frame, plain) if frame.settings.view.colour == "segment" else plain


def _numbers(frame: Frame) -> tuple[Array, float, str] | None:
    """What colours the valid points (N,), the end of its scale and the unit."""
    scan, mode = frame.scan, frame.settings.view.colour
    if mode == "range":
        ranges = scan.ranges[scan.valid]
        return ranges, _rounded_up(np.percentile(ranges, FAR) if len(ranges) else 1.0), "m"
    if mode == "quality" and scan.quality is not None:
        quality = scan.quality[scan.valid].astype(float)
        return quality, max(float(quality.max(initial=0)), 1e-9), ""
    return None


def _rounded_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten: it stays while the sensor moves about."""
    ten = 10.0 ** np.floor(np.log10(max(value, 0.1)))
    return float(next(step * ten for step in (1, 2, 5, 10) if step * ten >= value))


def _segment_colours(frame: Frame, plain: Rgbs) -> Rgbs:
    """Every point in the colour of the segment it belongs to (N, 3)."""
    scan, segments = frame.scan, frame.main.segments
    colours = np.tile(plain, (len(scan), 1))
    ends = zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True)
    for colour, (first, last) in zip(categorical(len(segments)), ends, strict=True):
        colours[beams_between(scan, first, last)] = colour
    return colours[scan.valid]
