"""A live map over a long drive, told stretch by stretch."""

import pytest
from lidarcore_app.cli.main import cli
from typer.testing import CliRunner

from lidarcore.evaluation.maps.endurance import endurance
from lidarcore.simulation.settings import SimulationSettings


@pytest.mark.long
def test_every_stretch_tells_what_the_map_is_and_how_far_poses_are_off() -> None:
    """A round through two rooms takes 35 s: after it nothing new is seen, and the pose is where the robot is."""
    told = list(endurance(SimulationSettings(world="two rooms", seed=2), 1.2, 3))
    assert [round(one.minute, 9) for one in told] == [0.4, 0.8, 1.2]
    assert all(one.tracked == 1 and one.off < 0.1 and 0 < one.median <= one.p99 for one in told)
    keyframes = [one.keyframes for one in told]
    assert keyframes == sorted(keyframes)
    assert told[-1].free == pytest.approx(told[-2].free, rel=0.05)
    assert 40 < told[-1].free < 60  # two rooms of 5.9 m by 5 m, less tables
    assert told[-1].walls > 40
    assert told[-1].memory > 50e6


def test_the_command_prints_a_row_for_each_stretch() -> None:
    result = CliRunner().invoke(cli, ["evaluate", "endurance", "--world", "two rooms", "--minutes", "0.1"])
    assert result.exit_code == 0, result.output
    assert result.output.count("100.0 %") == 12
    assert "0.1 min" in result.output
    refused = CliRunner().invoke(cli, ["evaluate", "endurance", "--world", "garden"])
    assert refused.exit_code != 0
