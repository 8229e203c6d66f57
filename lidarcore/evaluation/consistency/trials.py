"""Noisy scans of a place, and the corners that every fitter makes of them: segments known, or found by extraction."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.compiled import kernel
from lidarcore.corners import intersect
from lidarcore.evaluation.consistency.places import Place
from lidarcore.extraction import compiled_call
from lidarcore.geometry.kernels import wrap
from lidarcore.lines import FITTER_IDS, FITTERS, LINE_FIELDS, WORK, fit_piece
from lidarcore.lines.regression import NOT_FINITE, OK
from lidarcore.noise import NoiseModel
from lidarcore.polar import cos_sin
from lidarcore.settings import ExtractionSettings
from lidarcore.tables import (
    CORNER_CONSISTENT,
    CORNER_FIELDS,
    CORNER_PUBLISHED,
    FIRST_BEAM,
    LAST_BEAM,
    SEGMENTS,
)

Segmentation = Literal["known", "found"]
SEGMENTATIONS: tuple[Segmentation, ...] = ("known", "found")
CORNER = CORNER_FIELDS  # error (2) and covariances: a corner as `intersect` writes it


@dataclass(frozen=True, slots=True, eq=False)
class Trials(Columns):
    """P corners, each estimated from K independent scans from one place by one method; sensor frame.

    errors       (P, K, 2) m, estimate minus truth; NaN where no corner came out
    covariances  (P, K, 2, 2) m², as claimed
    bounds       (P, 2, 2) m², the Cramér-Rao bound with segments known
    corners      (P, 2) m, where they truly are
    """

    errors: Array
    covariances: Array
    bounds: Array
    corners: Array


def simulate(
    spots: Sequence[Place],
    segmentation: Segmentation,
    settings: ExtractionSettings,
    draws: int,
    rng: np.random.Generator,
) -> dict[tuple[str, str], Trials]:
    """`draws` noisy scans of each place, with the noise of the settings: trials by fitter and kind of covariance.

    Segments known: every beam is of the wall it truly met. Found: a corner is found if most beams of its two
    segments met its two walls, however far off it is.
    """
    observe = _known if segmentation == "known" else _found
    sigmas = np.array([settings.noise.sigma_range, settings.noise.sigma_bearing])
    found = [
        observe(spot, rng.standard_normal((draws, 2, len(spot.ranges))) * sigmas[:, None], settings)
        for spot in spots
    ]
    table = np.concatenate(found)  # (P, K, F, CORNER)
    corners = np.concatenate([spot.corners for spot in spots])
    bounds = np.concatenate([spot.bounds for spot in spots])
    return {
        (name, kind): Trials(
            table[:, :, f, :2], table[:, :, f, at : at + 4].reshape(*table.shape[:2], 2, 2), bounds, corners
        )
        for name, f in FITTER_IDS.items()
        for kind, at in (("published", CORNER_PUBLISHED), ("consistent", CORNER_CONSISTENT))
    }


def _known(spot: Place, errors: Array, settings: ExtractionSettings) -> Array:
    out = np.empty((len(spot.corners), len(errors), len(FITTERS), CORNER))
    _fit_known(
        spot.ranges, spot.bearings, errors, settings.noise.model(settings.latent_bearings),
        spot.first, spot.count, spot.corners, out,
    )  # fmt: skip
    return out


def _found(spot: Place, errors: Array, settings: ExtractionSettings) -> Array:
    out = np.full((len(spot.corners), len(errors), len(FITTERS), CORNER), np.nan)
    beams, fitters = len(spot.ranges), np.arange(len(FITTERS))
    extract = compiled_call(beams, settings)
    ranges, bearings, hit = np.empty(beams), np.empty(beams), np.empty(beams, np.int64)
    for k, error in enumerate(errors):
        measure(spot.ranges, spot.bearings, spot.hit, error, ranges, bearings, hit)
        tables, counts, _ = cast(tuple[Array, Ints, float], extract(ranges, bearings, fitters))
        _match(tables, counts, hit, spot.walls, spot.corners, out[:, k])
    return out


@kernel
def _fit_known(
    ranges: Array,
    bearings: Array,
    errors: Array,
    noise: NoiseModel,
    first: Ints,
    count: Ints,
    corners: Array,
    out: Array,
) -> None:
    fitters, n = out.shape[2], len(ranges)
    fitted, status = np.empty((2, fitters, LINE_FIELDS)), np.empty((2, fitters), np.int64)
    c, s, work = np.empty(n), np.empty(n), np.empty((WORK, n))
    for k in range(len(errors)):
        rho = ranges + errors[k, 0]
        cos_sin(bearings + errors[k, 1], c, s)
        for p in range(len(first)):
            for side in range(2):
                a, b = first[p, side], first[p, side] + count[p, side]
                # It was the second wall of the corner before.
                if side == 0 and p > 0 and first[p - 1, 1] == a:
                    fitted[0], status[0] = fitted[1], status[1]
                    continue
                behind = np.any(rho[a:b] <= 0)
                for f in range(fitters):
                    row = fitted[side, f]
                    # Inlined, not a kernel called: linked copies of one may round differently from process to process.
                    scratch = (work[0, a:b], work[1, a:b], work[2, a:b])
                    fit = fit_piece(f, rho[a:b], c[a:b], s[a:b], noise, scratch, (True, True), row)
                    status[side, f] = NOT_FINITE if behind else fit
            for f in range(fitters):
                out[p, k, f] = np.nan
                if status[0, f] == OK and status[1, f] == OK:
                    intersect(fitted[0, f], fitted[1, f], out[p, k, f])
                    out[p, k, f, :2] -= corners[p]


@kernel
def measure(
    true_ranges: Array,
    true_bearings: Array,
    true_hit: Ints,
    errors: Array,
    ranges: Array,
    bearings: Array,
    hit: Ints,
) -> None:
    """Add errors (2, N) of range and bearing and sort the beams by bearing in (-pi, pi], as a sensor reports them.

    By insertion: noise swaps neighbours, and few beams pass the seam.
    """
    n, seam = len(true_ranges), np.argmin(true_bearings)
    for i in range(n):
        k = (seam + i) % n
        rho, theta = true_ranges[k] + errors[0, k], wrap(true_bearings[k] + errors[1, k])
        at = i
        while at > 0 and bearings[at - 1] > theta:
            ranges[at], bearings[at], hit[at] = ranges[at - 1], bearings[at - 1], hit[at - 1]
            at -= 1
        ranges[at], bearings[at], hit[at] = rho if rho > 0 else np.nan, theta, true_hit[k]


@kernel
def _match(tables: Array, counts: Ints, hit: Ints, walls: Ints, corners: Array, out: Array) -> None:
    """Write found corners into out (P, F, CORNER): those between two segments most of whose beams met their walls."""
    for f in range(len(tables)):
        table, n = tables[f], counts[f, 0]
        wall = np.empty(n, np.int64)
        for j in range(n):
            wall[j] = most_met(hit, int(table[j, FIRST_BEAM]), int(table[j, LAST_BEAM]))
        for q in range(n, n + counts[f, 1]):
            a, b = wall[int(table[q, SEGMENTS])], wall[int(table[q, SEGMENTS + 1])]
            for p in range(len(walls)):
                if walls[p, 0] == a and walls[p, 1] == b:
                    out[p, f] = table[q, :CORNER]
                    out[p, f, :2] -= corners[p]


@kernel
def most_met(hit: Ints, first: int, last: int) -> int:
    """The wall that more than half of the beams from first to last met, around the ring; -1 if there is none."""
    n = (last - first) % len(hit) + 1
    wall, lead = -1, 0
    for i in range(n):  # majority vote of Boyer and Moore
        met = hit[(first + i) % len(hit)]
        if lead == 0:
            wall = met
        lead += 1 if met == wall else -1
    votes = 0
    for i in range(n):
        votes += hit[(first + i) % len(hit)] == wall
    return wall if 2 * votes > n else -1
