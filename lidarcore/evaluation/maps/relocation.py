"""How often a pose in a known map is found without a guess, and whether one that is believed is ever wrong.

The first part of a recording makes the map; every scan of the rest is looked for in it, alone and with the keyframes
before it. Reference poses say where it was, and whether the map knows the place at all.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.maps.accuracy import reference_poses
from lidarcore.geometry import pose_difference
from lidarcore.mapping.grid.builder import build_grid
from lidarcore.mapping.grid.occupancy import Mask, OccupancyGrid
from lidarcore.mapping.relocation import Query, Relocator, query_of
from lidarcore.scan import Scan

KNOWN = 0.6
"""Share of a recording that makes the map."""
SEVERAL = 6
"""Keyframes that a query of several is made of."""
WRONG = (0.5, np.radians(10))
"""m and rad from the reference pose, beyond which a pose that is believed is wrong."""
_STEP = (0.3, np.radians(15))  # m, rad between keyframes
_NEAR = 2.0  # m from a keyframe of the map, within which a place is known
_FAR = 4.0  # m from all keyframes of the map, beyond which, on unknown ground, a place is outside of it


@dataclass(frozen=True, slots=True, eq=False)
class Attempts:
    """N queries of one kind.

    inside    (N,) the map knows the place
    outside   (N,) it does not; where neither is true, nobody can say
    found     (N,) a pose was believed
    wrong     (N,) and it is not the true one
    seconds   (N,) processor time
    verdicts  (N,) why not, where none was
    """

    inside: Mask
    outside: Mask
    found: Mask
    wrong: Mask
    seconds: Array
    verdicts: Sequence[str]

    @property
    def share_found(self) -> float:
        """Share of the queries from places that the map knows that was found, and rightly."""
        return float((self.found & ~self.wrong)[self.inside].mean()) if self.inside.any() else float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class RelocationStudy:
    """One scan alone, the last keyframes together, and scans of other recordings, which are nowhere in this map."""

    single: Attempts
    several: Attempts
    foreign: Attempts


def study_relocation(
    scans: Sequence[Scan], others: Sequence[Scan] = (), progress: Callable[[int], None] = lambda count: None
) -> RelocationStudy:
    """Look for the last part of a recording in a map of the first. Raises EvaluationError without reference poses.

    others  scans of other places, none of which may be found
    """
    poses, _ = reference_poses(list(scans))
    keyframes = _keyframes(poses)
    known = keyframes[keyframes < KNOWN * len(scans)]
    asked = np.arange(int(np.ceil(KNOWN * len(scans))), len(scans))
    if len(known) < 2 or not len(asked):
        raise EvaluationError(
            "The recording is too short: it needs keyframes for a map, and scans to look for."
        )
    grid = build_grid([scans[int(k)] for k in known], poses[known])
    relocator = Relocator(grid)
    inside, outside = _places(poses[asked], poses[known], grid)
    alone = [query_of([scans[int(k)]]) for k in asked]
    together = [_several(scans, poses, keyframes, int(k)) for k in asked]
    strange = [query_of([scan]) for scan in others]
    single = _attempt(relocator, alone, poses[asked], inside, outside, progress)
    several = _attempt(relocator, together, poses[asked], inside, outside, progress)
    nowhere = np.full((len(strange), 3), np.inf)
    foreign = _attempt(
        relocator, strange, nowhere, np.zeros(len(strange), bool), np.ones(len(strange), bool), progress
    )
    return RelocationStudy(single, several, foreign)


def _keyframes(poses: Array) -> Ints:
    kept = [0]
    for k in range(1, len(poses)):
        difference = pose_difference(poses[kept[-1]], poses[k])
        if np.hypot(*difference[:2]) >= _STEP[0] or abs(difference[2]) >= _STEP[1]:
            kept.append(k)
    return np.array(kept, np.int64)


def _several(scans: Sequence[Scan], poses: Array, keyframes: Ints, k: int) -> Query:
    """A scan and the keyframes before it, as they lie to each other."""
    chosen = [*keyframes[keyframes < k][1 - SEVERAL :].tolist(), k]
    return query_of([scans[i] for i in chosen], poses[chosen])


def _places(asked: Array, known: Array, grid: OccupancyGrid) -> tuple[Mask, Mask]:
    """Which poses (N, 3) the map knows the place of, and which are outside of it."""
    nearest = np.hypot(*(asked[:, None, :2] - known[None, :, :2]).transpose(2, 0, 1)).min(axis=1)
    there = grid.at(asked[:, :2])
    return (nearest <= _NEAR) & (there >= 0), (nearest >= _FAR) & (there < 0)


def _attempt(
    relocator: Relocator,
    queries: Sequence[Query],
    truth: Array,
    inside: Mask,
    outside: Mask,
    progress: Callable[[int], None],
) -> Attempts:
    found, wrong = np.zeros(len(queries), bool), np.zeros(len(queries), bool)
    seconds = np.zeros(len(queries))
    verdicts = []
    for k, query in enumerate(queries):
        begin = time.process_time()
        result = relocator.find(query)
        seconds[k], found[k] = time.process_time() - begin, result.found
        if result.found:
            error = (
                pose_difference(truth[k], result.pose) if np.isfinite(truth[k]).all() else np.full(3, np.inf)
            )
            wrong[k] = not (np.hypot(*error[:2]) <= WRONG[0] and abs(error[2]) <= WRONG[1])
        verdicts.append(result.verdict)
        progress(k + 1)
    return Attempts(inside, outside, found, wrong, seconds, verdicts)
