"""The study of calibrations: what it takes for the truth, and what users see of it."""

import json

import numpy as np
from lidarcore_app.cli.main import cli
from typer.testing import CliRunner

from lidarcore import SensorNoise, extract
from lidarcore.evaluation.calibration.true_walls import held
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, World, furnished_room, random_pose

NOISE = SensorNoise(0.002, 0.001)


def test_ellipses_hold_the_walls_where_they_truly_are_and_nowhere_else():
    """About 400 walls and 150 corners: a share of 0.95 is below 0.88 with a probability below 1e-4."""
    rng, sensor = np.random.default_rng(1), SimulatedSensor(furnished_room(), NOISE)
    shifted = World(sensor.world.walls + np.array([0.03, 0.03]))
    here, there = np.zeros((2, 2)), np.zeros((2, 2))
    for _ in range(20):
        pose = random_pose(sensor.world, rng)
        scan, hit = sensor.scan(pose, rng)
        features = extract(scan, ExtractionSettings(noise=NOISE))
        here += held(features, hit, sensor.world, pose)
        there += held(features, hit, shifted, pose)
    print(here, there)
    assert (here[:, 1] > 100).all()
    assert (here[:, 0] > 0.88 * here[:, 1]).all()
    assert (there[:, 0] < 0.1 * there[:, 1]).all()


def test_the_command_prints_and_writes_every_part(tmp_path):
    output = tmp_path / "study.json"
    arguments = ["evaluate", "calibration", "--rooms", "2", "--scans", "10", "--workers", "1"]
    result = CliRunner().invoke(cli, [*arguments, "-o", str(output)])
    assert result.exit_code == 0, result.output
    found = json.loads(output.read_text("utf-8"))
    names = [part["name"] for part in found["parts"]]
    assert {"sigma_range", "range_growth", "sigma_bearing", "unevenness"} <= set(names)
    assert all(name in result.output for name in names)
    assert "Not judged: renewal, resampling" in result.output
    straight, uneven = found["cells"]
    assert (straight["unevenness"], uneven["unevenness"]) == (0, 0.002)
    assert 0.5 < uneven["walls"]["truth_95"]["value"] <= 1
    assert found["design"]["fewer"] == 10
    said = CliRunner().invoke(cli, ["evaluate", "calibration", "--noise", "0.002,0.001"])
    assert "three numbers" in said.output
