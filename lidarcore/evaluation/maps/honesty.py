"""Whether poses of a map are as far off as they say: robots whose truth is known drive through simulated worlds.

Every run begins elsewhere on the way of its world, and mostly while the robot drives; its scans are mapped twice, with
what its wheels say and without.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, product

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from lidarcore.arrays import Array
from lidarcore.evaluation.intervals import LEVEL, Interval, ratio, share
from lidarcore.evaluation.maps.study import wrong_loops, wrong_poses
from lidarcore.evaluation.workers import run_all
from lidarcore.geometry import chi_square_gate, pose_difference, relative, squared_mahalanobis
from lidarcore.mapping import Mapper, MapperSettings
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.simulation.robot import RATE, SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings
from lidarcore.simulation.worlds import place

ODOMETRY = ("wheels", "none")
APART = {"poses": 0, "next keyframe": 1, "10 keyframes": 10}
"""What is judged: all poses against the first, and relative poses of keyframes by how many they are apart."""
_NOISE = SensorNoise(0.01, 0.001)
_ROUND = 60.0  # s, in which runs begin


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One drive, mapped.

    squares  by what is judged: squared errors (T,) in units of the claimed covariances, three degrees of freedom each
    loops, wrong  counts of those believed
    lost     whether some scan lay on nothing known, or was put more than 0.5 m or 0.2 rad away from its place
    """

    squares: dict[str, Array]
    loops: int
    wrong: int
    lost: bool


@dataclass(frozen=True, slots=True)
class Judged:
    """How true one kind of claim is.

    coverage  share of the 95 % ellipsoids that hold the truth
    anees     squared normalised errors over their three degrees of freedom; honest claims give 1
    band      in which the mean of so many runs as there were lies in 95 % of the steps, if claims are true
    steps     share of the steps whose mean over the runs lies in the band
    median    of the squared normalised errors; honest claims give 2.37
    """

    coverage: Interval
    anees: Interval
    band: tuple[float, float]
    steps: float
    median: float


@dataclass(frozen=True, slots=True)
class Honesty:
    """What came out in one world with one kind of odometry; counts are of all runs, `judged` is by what is judged."""

    world: str
    odometry: str
    runs: int
    lost: int
    loops: int
    wrong: int
    judged: dict[str, Judged]


def study_honesty(
    worlds: Sequence[str],
    runs: int,
    seconds: float,
    seed: int = 0,
    workers: int = 1,
    done: Callable[[], None] = lambda: None,
) -> list[Honesty]:
    """Every world with every kind of odometry; the numbers do not depend on the workers. `done` is told of each run.

    Raises SimulationError if there is no such world.
    """
    for name in worlds:
        place(name)
    chunks = list(product(worlds, range(runs)))
    made = run_all(partial(_runs, seconds, seed), chunks, workers, done)
    return [
        _pooled(
            world,
            odometry,
            [both[odometry] for (name, _), both in zip(chunks, made, strict=True) if name == world],
        )
        for world, odometry in product(worlds, ODOMETRY)
    ]


def drive(world: str, seconds: float, seed: int) -> list[Scan]:
    """Scans, odometry and truth of a robot that drives so long, from anywhere on the way of its world."""
    there = place(world)
    rng = np.random.default_rng(seed)
    begin, path = rng.uniform(0, _ROUND), there.path()
    later = replace(there, paths={"later": lambda times: path(times + begin)})
    settings = SimulationSettings(world=world, seed=int(rng.integers(2**31)), noise=_NOISE)
    return list(islice(SimulatedRobot(settings, later), round(seconds * RATE)))


def judge(scans: Sequence[Scan]) -> Run:
    """Map scans that know where they were taken, and compare."""
    mapper = Mapper(MapperSettings().with_noise(_NOISE))
    tracked = [mapper.step(scan).connected for scan in scans]
    mapper.finish()
    first = scans[0].truth
    assert first is not None
    truth = relative(first, np.array([scan.truth for scan in scans]))
    poses, covariances = mapper.trajectory()[1], mapper.covariances()
    of_keyframes = truth[mapper.keyframes.numbers]
    squares = {
        name: _between(mapper, of_keyframes, apart)
        if apart
        else squared_mahalanobis(pose_difference(poses, truth)[1:], covariances[1:])
        for name, apart in APART.items()
    }
    lost = not all(tracked) or bool(wrong_poses(poses, truth).any())
    return Run(squares, len(mapper.loops), wrong_loops(mapper.loops, of_keyframes), lost)


def _runs(seconds: float, seed: int, chunk: tuple[str, int]) -> dict[str, Run]:
    """Maps of one drive with every kind of odometry, judged."""
    world, number = chunk
    scans = drive(world, seconds, int(np.random.SeedSequence([seed, number]).generate_state(1)[0]))
    blind = [replace(scan, odometry=None) for scan in scans]
    return {odometry: judge(given) for odometry, given in zip(ODOMETRY, (scans, blind), strict=True)}


def _between(mapper: Mapper, truth: Array, apart: int) -> Array:
    """Squared normalised errors of relative poses of keyframes so many apart."""
    squares = []
    for i in range(len(truth) - apart):
        found = mapper.relative(i, i + apart)
        off = pose_difference(found.pose, relative(truth[i], truth[i + apart]))
        squares.append(float(squared_mahalanobis(off, found.covariance)))
    return np.array(squares)


def _pooled(world: str, odometry: str, runs: Sequence[Run]) -> Honesty:
    lost, loops, wrong = (sum(getattr(run, name) for run in runs) for name in ("lost", "loops", "wrong"))
    claims = {name: judged([run.squares[name] for run in runs]) for name in APART}
    return Honesty(world, odometry, len(runs), lost, loops, wrong, claims)


def judged(squares: Sequence[Array]) -> Judged:
    """Claims by their squared normalised errors (T,) of each run, three degrees of freedom each."""
    number = np.array([len(of_run) for of_run in squares], np.float64)
    within = np.array([(of_run <= chi_square_gate(LEVEL, 3)).sum() for of_run in squares], np.float64)
    steps = np.full((len(squares), int(number.max(initial=0))), np.nan)
    for row, of_run in zip(steps, squares, strict=True):
        row[: len(of_run)] = of_run / 3
    there = np.isfinite(steps).sum(axis=0)
    low, high = band(there)
    means = np.nansum(steps, axis=0) / there
    ends = band(len(squares))
    return Judged(
        share(within, number),
        ratio(np.array([of_run.sum() for of_run in squares]), 3 * number),
        (float(ends[0]), float(ends[1])),
        float(((low <= means) & (means <= high)).mean()) if number.any() else float("nan"),
        float(np.median(np.concatenate(squares))) if number.any() else float("nan"),
    )


def band(runs: ArrayLike) -> tuple[Array, Array]:
    """Ends of the interval that holds the ANEES of independent runs (S,) with a probability of 95 %."""
    dof = 3 * np.asarray(runs)
    low, high = (chdtri(dof, tail) / dof for tail in ((1 + LEVEL) / 2, (1 - LEVEL) / 2))
    return low, high
