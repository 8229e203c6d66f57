"""The guide's figures of dots and ellipses: one corner by several methods, one beam and one wall."""

from collections.abc import Sequence

import numpy as np

from lidarcore import reporting
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.lines import FITTERS
from lidarcore.settings import Covariance

from .beam_picture import beam_picture
from .measurement import WALL_FITTERS, Measurement
from .numbers import Told
from .pictures import LEGEND, Cloud, draw, reach
from .views import SITUATIONS

_MM = 1e3
_CAPTIONS = {
    "papers": "The small room of [WCTLS] with the noise that the papers assume.",
    "exact": "The same corner with a better sensor.",
    "kind": "A larger room, a middling sensor.",
}


def corner(m: Measurement, situation: str) -> str:
    """The figure of one of SITUATIONS: two methods whose published ellipses are too small, and one where they fit."""
    case = SITUATIONS[situation]
    noise = case.noise
    scans = f"{Told(float(m.design.scans))}"
    caption = (
        f"{_CAPTIONS[situation]} Room {Told(case.length):!} × {Told(case.width):m}, noise {Told(noise.sigma_range):cm} "
        f"in range and {Told(noise.sigma_bearing):1mrad} in bearing. All methods get the same {scans} scans and are "
        "told which points belong to which wall. Ellipses are those of one scan of typical claim, drawn around the "
        "truth; percentages count the dots inside."
    )
    return reporting.figure(caption, _panels(m, situation, ("cwlf", "wctls", "utls"), KINDS), LEGEND)


def likelihood(m: Measurement) -> str:
    """The figure of `ml` beside two others."""
    caption = (
        "The first scans on this page again, all on one scale, with consistent ellipses and the dots inside."
    )
    return reporting.figure(caption, _panels(m, "papers", ("cwlf", "utls", "ml"), ("consistent",)))


def _panels(
    m: Measurement, situation: str, fitters: Sequence[str], kinds: Sequence[Covariance]
) -> list[tuple[str, str]]:
    view = m.views[situation]
    clouds = [
        Cloud(
            f"Estimates of a corner by {FITTERS[name].title}, and ellipses",
            _MM * view.dots[name],
            [(kind, _MM**2 * view.claims[name, kind]) for kind in kinds],
        )
        for name in fitters
    ]
    far = reach(clouds)
    return [
        (_title(name, [(kind, view.inside(name, kind)) for kind in kinds]), draw(cloud, far, ("mm", "mm")))
        for name, cloud in zip(fitters, clouds, strict=True)
    ]


def wall(m: Measurement) -> str:
    """The figure of one beam and one wall."""
    scale = np.array([_MM, _MM])  # mrad and mm
    panels = [("One beam: shadow and slice", beam_picture(m.wall))]
    for name in WALL_FITTERS:
        cloud = Cloud(
            f"Lines fitted to one wall by {FITTERS[name].title}: errors of angle and distance",
            scale * m.wall.fits[name],
            [(kind, np.outer(scale, scale) * m.wall.claims[name, kind]) for kind in KINDS],
        )
        title = _title(name, [(kind, m.wall.inside(name, kind)) for kind in KINDS])
        panels.append((title, draw(cloud, reach([cloud]), ("mrad", "mm"), equal=False)))
    scans = f"{Told(float(m.design.scans))}"
    caption = (
        f"Small room, noise as in the papers. First: {scans} measurements of one beam; shadow and slice are "
        f"those of the ellipse that holds {Told(LEVEL):%}. Second and third: {scans} lines fitted to the whole wall, "
        "the error of the angle across, that of the distance upwards."
    )
    return reporting.figure(caption, panels, LEGEND)


def _title(fitter: str, inside: Sequence[tuple[str, Interval]]) -> str:
    shares = ", ".join(f"{kind} {Told(share):~0%}" for kind, share in inside)
    return f"{FITTERS[fitter].title}: {shares}"
