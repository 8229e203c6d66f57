"""Mixed pixels: beams that meet two surfaces and report something in between, and what they do to the ellipses."""

from itertools import islice

import numpy as np

from lidarcore.evaluation.consistency.design import room
from lidarcore.evaluation.consistency.places import Place, places
from lidarcore.evaluation.intervals import LEVEL, Interval, share
from lidarcore.experiments.corner_study import SAME
from lidarcore.experiments.paper_rooms import BEAMS
from lidarcore.extraction import extract
from lidarcore.geometry import contains, wrap
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation.scene import Optics

ROOM = "furnished room"
_SCANS = 4  # from each place


def covered(noise: SensorNoise, mixed: float, spots: int, seed: int) -> Interval:
    """Coverage of the 95 % ellipses of `ml`, segments found; `mixed` is the share of beams at a step that mix."""
    rng = np.random.default_rng(seed)
    settings = ExtractionSettings(noise=noise)
    optics = Optics(noise, mixed, dropouts=0.0, grazing=0.0)
    counts = np.zeros((spots, 2))
    for spot, place in enumerate(islice(places(room(ROOM), noise, BEAMS, rng), spots)):
        shaking = np.random.default_rng(
            [seed, spot]
        )  # the same for every share of mixed pixels, but for them
        for _ in range(_SCANS):
            counts[spot] += _hits(place, _scan(place, optics, shaking), settings)
    return share(*counts.T)


def _scan(place: Place, optics: Optics, rng: np.random.Generator) -> Scan:
    bearings = wrap(place.bearings + rng.normal(0, optics.noise.sigma_bearing, len(place.bearings)))
    ranges, _ = optics.observe(place.ranges, np.ones(len(place.ranges)), rng)
    order = np.argsort(bearings)
    return Scan(ranges[order], bearings[order])


def _hits(place: Place, scan: Scan, settings: ExtractionSettings) -> tuple[int, int]:
    """Corners that are within their ellipse, and corners found; a corner farther off than SAME is another."""
    corners = extract(scan, settings).corners
    if not len(corners):
        return 0, 0
    off = corners.xy - place.corners[:, None]
    distance = np.linalg.norm(off, axis=-1)
    nearest = distance.argmin(1)
    p = np.flatnonzero(distance.min(1) < SAME)
    e, C = off[p, nearest[p]], corners.covariance_consistent[nearest[p]]
    return int(contains(e, C, LEVEL).sum()), len(p)
