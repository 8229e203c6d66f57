"""One simulated room: a sensor in it is calibrated, and its ellipses are judged afterwards."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.calibrate import calibrate
from lidarcore.evaluation.calibration.design import PARTS, Design
from lidarcore.evaluation.calibration.result import Calibration
from lidarcore.evaluation.consistency.design import KINDS, room
from lidarcore.evaluation.consistency.places import CLEARANCE
from lidarcore.evaluation.consistency.trials import most_met
from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.evaluation.stations.study import Figures, seen
from lidarcore.extraction import extract
from lidarcore.features import Features
from lidarcore.geometry import act_inverse, contains, unit_vectors, wrap
from lidarcore.noise import SensorNoise
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, random_pose
from lidarcore.simulation.world import World

_LEAST_SINE = 0.1  # between two walls that truly meet; what lies between others is no corner


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """What came out in one room.

    parts     intervals found, None where nothing was told; by the names in PARTS
    truth     what is so; no unevenness_length where walls are straight
    fewer     the same parts from fewer scans
    held      (2, 2) of walls and corners from other places: within their 95 % ellipses for maps, of how many
    walls, corners   of the sensor standing on: their scatter against the consistent ellipses
    failure   why it could not be calibrated; then nothing was found
    """

    truth: dict[str, float]
    parts: dict[str, Interval | None]
    fewer: dict[str, Interval | None]
    held: Array
    walls: Figures | None
    corners: Figures | None
    failure: str | None = None


def trial(design: Design, number: int) -> Trial:
    """The room of that number: calibrated from the first scans, judged afterwards from there and from other places."""
    cell, name = design.of(number)
    noise, rng = design.cells[cell], np.random.default_rng((design.seed, number))
    world = room(name).uneven(noise, int(rng.integers(2**31)))
    sensor, pose = SimulatedSensor(world, noise), random_pose(world, rng, CLEARANCE)
    scans = [sensor.scan(pose, rng)[0] for _ in range(2 * design.scans)]
    truth = _truth(noise, pose)
    try:
        found, early = calibrate(scans[: design.scans]), calibrate(scans[: design.fewer])
    except EvaluationError as error:
        return Trial(truth, {}, {}, np.zeros((2, 2)), None, None, str(error))
    settings = ExtractionSettings(noise=found.noise)
    again = seen(scans[design.scans :], settings, (settings.fitter,))
    walls, corners = (
        Figures.of(one.scatter(), KINDS.index("consistent"), number, cell)
        for one in (again.walls, again.corners)
    )
    total = _from_elsewhere(sensor, settings, design.views, rng)
    return Trial(truth, _parts(found, truth), _parts(early, truth), total, walls, corners)


def _from_elsewhere(
    sensor: SimulatedSensor, settings: ExtractionSettings, views: int, rng: np.random.Generator
) -> Array:
    """(2, 2) as `held` counts, over one scan from each of so many places in the same room."""
    total = np.zeros((2, 2))
    for _ in range(views):
        pose = random_pose(sensor.world, rng, CLEARANCE)
        scan, hit = sensor.scan(pose, rng)
        total += held(extract(scan, settings), hit, sensor.world, pose)
    return total


def _truth(noise: SensorNoise, pose: Array) -> dict[str, float]:
    """Walls of the rooms, but for a few, are along the world's axes."""
    truth = {name: getattr(noise, name) for name in PARTS if hasattr(noise, name)}
    truth |= {"range_bias": 0.0, "alignment": -float(pose[2])}
    if not noise.unevenness:
        del truth["unevenness_length"]
    return truth


def _parts(found: Calibration, truth: dict[str, float]) -> dict[str, Interval | None]:
    """An alignment is known up to quarter turns: it is told as the one next to the truth."""
    parts = {name: getattr(found, name) for name in PARTS}
    if (turned := parts["alignment"]) is not None:
        quarters = np.pi / 2 * round((truth["alignment"] - turned.value) / (np.pi / 2))
        parts["alignment"] = Interval(turned.value + quarters, turned.low + quarters, turned.high + quarters)
    return parts


def held(features: Features, hit: Ints, world: World, pose: Array) -> Array:
    """(2, 2) of walls, and of corners: how many 95 % ellipses of maps hold the truth, and how many there are.

    A segment is of the wall that most of its beams met (hit (N,), of the scan); with none such it is not judged.
    pose (3,) T_world_sensor. A corner is where the lines of its two walls truly meet.
    """
    segments, corners = features.segments, features.corners
    beams = zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True)
    wall = np.array([most_met(hit, first, last) for first, last in beams], np.int64)
    true = _lines(act_inverse(pose, world.walls))[wall]
    lines = segments.lines
    walls = np.column_stack([wrap(lines.alpha - true[:, 0]), lines.r - true[:, 1]])
    within = [contains(walls, lines.covariance_map, LEVEL)[wall >= 0]]
    first, second = true[corners.segments].transpose(1, 0, 2)
    sine = np.sin(second[:, 0] - first[:, 0])
    meet = (wall[corners.segments] >= 0).all(1) & (np.abs(sine) > _LEAST_SINE)
    errors = corners.xy[meet] - _meeting(first[meet], second[meet])
    within.append(contains(errors, corners.covariance_map[meet], LEVEL))
    return np.array([[inside.sum(), len(inside)] for inside in within], np.float64)


def _lines(walls: Array) -> Array:
    """Alpha rad and r >= 0 m (W, 2) of walls (W, 2, 2), sensor frame."""
    along = walls[:, 1] - walls[:, 0]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(along[:, 0], along[:, 1])[:, None]
    r = (normal * walls[:, 0]).sum(1)
    away = np.where(r < 0, -1.0, 1.0)
    return np.column_stack([np.arctan2(away * normal[:, 1], away * normal[:, 0]), away * r])


def _meeting(first: Array, second: Array) -> Array:
    """(K, 2) m, where lines (K, 2) meet."""
    lines: Array = np.stack([first, second], 1)
    return np.asarray(np.linalg.solve(unit_vectors(lines[..., 0]), lines[..., 1:])[..., 0], np.float64)
