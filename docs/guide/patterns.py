"""The pattern of a real wall as two recordings have it, beside white noise of the same size."""

from collections.abc import Callable, Sequence

import numpy as np

from lidarcore import reporting
from lidarcore.reporting import WIDTH, svg
from lidarcore.scan import Array

from .numbers import Told
from .pictures import dots
from .real_wall import walls

_HEIGHT, _LEFT, _BOTTOM = 220, 30, 18  # units of the drawing
_STEPS = (0.2, 0.002)  # m, of the grid along the wall and off its line
_STYLES = ("m0", "m1")


def pattern() -> str:
    """The first wall: how far points are off its line, over their place along it."""
    wall, rng = walls()[0], np.random.default_rng(0)
    real = [scan.profile() for scan in wall.scans]
    white = [np.array([t, rng.normal(0, off.std(), len(t))]) for t, off in real]
    low, high = np.min([p.min(1) for p in real + white], 0), np.max([p.max(1) for p in real + white], 0)
    panels = [
        ("A real wall", _draw(real, low, high, "Distance of points from the line of a real wall")),
        ("White noise", _draw(white, low, high, "The same of simulated white noise of the same size")),
    ]
    caption = (
        f"A wall {Told(wall.distance):2m} from an `RPLIDAR C1` at rest: how far points are off the fitted line, "
        f"mm, over {Told(wall.length):2m} along it, m. Two recordings, on top of each other. Beside it white noise of "
        "the same size at the same places. Beams at the wall's ends are left out. The recorder wrote some ranges "
        "twice, into bins of bearing half a degree apart; they are taken once, between them, so bearings are known to "
        "about a quarter of that. Recorded by TAU CGL (`TAU-CGL/rplidar_recorder`, licence MIT)."
    )
    legend = [
        (name, f"var(--{style})") for name, style in zip(("first recording", "second"), _STYLES, strict=True)
    ]
    return reporting.figure(caption, panels, legend)


def _draw(profiles: Sequence[Array], low: Array, high: Array, title: str) -> str:
    corner = np.array([_LEFT, _HEIGHT - _BOTTOM])
    scale = (np.array([WIDTH - 8, 8]) - corner) / (high - low)

    def at(places: Array) -> Array:
        units: Array = corner + (places - low) * scale
        return units

    parts = [_grid(at, low, high)]
    for profile, style in zip(profiles, _STYLES, strict=True):
        drawn = at(profile[:, np.argsort(profile[0])].T)
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in drawn)
        parts += [f'<path class="line {style}" d="M{path}"/>', dots(drawn, style)]
    return svg(WIDTH, _HEIGHT, "".join(parts), title)


def _grid(at: Callable[[Array], Array], low: Array, high: Array) -> str:
    """Lines at round places, in m along the wall and mm off it; the dashed one is the wall's."""
    parts = []
    for along in _ticks(low[0], high[0], _STEPS[0]):
        x = at(np.array([along, 0.0]))[0]
        text = f'<text class="tick" x="{x:.1f}" y="{_HEIGHT - 4}" text-anchor="middle">{_number(along, 1)}</text>'
        parts.append(f'<path class="grid" d="M{x:.1f} 0V{_HEIGHT - _BOTTOM}"/>{text}')
    for off in _ticks(low[1], high[1], _STEPS[1]):
        y, style = at(np.array([0.0, off]))[1], "grid" if off else "reference"
        text = f'<text class="tick" x="{_LEFT - 5}" y="{y + 3:.1f}" text-anchor="end">{_number(1e3 * off, 0)}</text>'
        parts.append(f'<path class="{style}" d="M{_LEFT} {y:.1f}H{WIDTH}"/>{text}')
    return "".join(parts)


def _ticks(low: float, high: float, step: float) -> list[float]:
    return [step * k for k in range(int(np.ceil(low / step)), int(high // step) + 1)]


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−")
