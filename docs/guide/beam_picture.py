"""One beam at a wall: its error ellipse, the shadow of that on the normal, and the slice through its middle."""

import numpy as np

from lidarcore.reporting import WIDTH, svg

from .pictures import dots, ellipse
from .views import GATE
from .wall import WallView

_HEIGHT = 300
_SIGMAS = float(np.sqrt(GATE))  # as the ellipse is drawn


def beam_picture(wall: WallView) -> str:
    """The wall is the line across; shadow and slice are drawn as wide as the ellipse, 95 % in the plane."""
    reach = 1.15 * max(_SIGMAS * wall.shadow, float(np.abs(wall.points[:, 1]).max()))
    scale = _HEIGHT / 2 / reach
    middle = np.array([0.44 * WIDTH, _HEIGHT / 2])
    flip = scale * np.array([1, -1])
    shadow, slice_ = (scale * _SIGMAS * sigma for sigma in (wall.shadow, wall.slice))
    at, beside = middle[0], 0.86 * WIDTH
    lean = scale * _SIGMAS * wall.covariance[0, 1] / wall.shadow  # of the highest point of the ellipse
    parts = [
        f'<path class="reference" d="M{at + lean:.1f} {middle[1] - shadow:.1f}H{beside:.1f}'
        f'M{at - lean:.1f} {middle[1] + shadow:.1f}H{beside:.1f}"/>',
        f'<path class="line" style="stroke: var(--soft)" d="M0 {middle[1]:g}H{WIDTH}"/>',
        dots(middle + wall.points * flip),
        ellipse(middle, wall.covariance * np.outer(flip, flip), "consistent"),
        _height(beside, middle[1], shadow, "m0", "shadow"),
        _height(at, middle[1], slice_, "m1", "slice"),
        f'<text class="tick" x="4" y="{middle[1] - 5}">wall</text>',
    ]
    return svg(WIDTH, _HEIGHT, "".join(parts), "One beam that meets a wall at an angle")


def _height(x: float, y: float, half: float, style: str, name: str) -> str:
    return (
        f'<path class="line {style}" style="stroke-width: 4" d="M{x:.1f} {y - half:.1f}v{2 * half:.1f}"/>'
        f'<text x="{x + 7:.1f}" y="{y - half + 4:.1f}">{name}</text>'
    )
