"""`lidarcore evaluate map` and `relocation` on a simulated drive: what they print of true poses is what is so."""

import re
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app.cli.main import cli
from typer.testing import CliRunner

from lidarcore.errors import EvaluationError
from lidarcore.geometry import relative
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

EVERY = 4  # scans


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty seconds in the furnished room, saved with the true poses, also in place of odometry."""
    scans = list(islice(SimulatedRobot(SimulationSettings(world="furnished room", seed=3)), 0, 400, EVERY))
    path = tmp_path_factory.mktemp("drive") / "drive.npz"
    np.savez(
        path,
        ranges=np.array([scan.ranges for scan in scans]),
        bearings=scans[0].bearings,
        stamps=np.array([scan.stamp for scan in scans]),
        odometry=np.array([scan.truth for scan in scans]),
        truth=np.array([scan.truth for scan in scans]),
    )
    return path


def said(*arguments: object) -> str:
    result = CliRunner().invoke(cli, ["evaluate", *map(str, arguments)])
    assert result.exit_code == 0, result.output
    return result.output


def test_a_map_is_judged_by_true_poses_and_by_relations(drive: Path, tmp_path: Path) -> None:
    with np.load(drive) as file:
        stamps, poses = file["stamps"], file["odometry"]
    ends = np.array([(k, k + 40) for k in range(0, 60, 6)])
    relations = tmp_path / "relations"
    x, y, turn = relative(poses[ends[:, 0]], poses[ends[:, 1]]).T
    zero = np.zeros(len(ends))
    np.savetxt(relations, np.column_stack([stamps[ends], x, y, zero, zero, zero, turn]), fmt="%.9f")
    told = said("map", drive, "--relations", relations, "--seeds", 2)
    assert re.findall(r"^seed (\d)", told, re.MULTILINE) == ["0", "1"]
    assert told.count("100, 100 of them tracked") == 2
    assert re.findall(r"loops +(\d+), (\d+) of them wrong", told)[0][1] == "0"
    for line in ("relative poses", "relations verified by hand"):
        for count, mean, worst in re.findall(
            rf"{line} +(\d+)[^:]*: mean ([\d.]+) m, .*largest ([\d.]+) m", told
        ):
            assert int(count) == len(ends) or line == "relative poses"
            assert 0 < float(mean) < 0.05  # poor odometry alone errs by 3 % of 10 m and more
            assert float(mean) <= float(worst) < 0.2
    assert len(re.findall("relations verified", told)) == 2
    live = re.findall(r"live poses .*: ([\d.]+)% by the reference, ([\d.]+)% by the finished map", told)
    assert len(live) == 2
    assert min(float(share) for shares in live for share in shares) > 93
    later = tmp_path / "later"
    elsewhere = np.where(np.arange(len(ends)) < 3, 0, 1e6)[:, None] + stamps[ends]
    for rows, said_of in (
        (elsewhere, "3 of 10, the others of another time,"),
        (elsewhere[3:], "none of the 7 has"),
    ):
        np.savetxt(later, np.column_stack([rows, np.zeros((len(rows), 6))]), fmt="%.9f")
        assert f"relations verified by hand {said_of}" in said("map", drive, "--relations", later)
    # The relations are those of the reference.
    assert re.findall(r"by the reference +(\d+): mean 0\.0000 m, 0\.000", told) == 2 * [str(len(ends))]


def test_a_recording_is_judged_backwards(drive: Path, tmp_path: Path) -> None:
    with np.load(drive) as file:
        arrays = {name: file[name] for name in file}
    for name in ("ranges", "odometry", "truth"):
        arrays[name] = arrays[name][::-1]
    arrays["stamps"] = arrays["stamps"].max() - arrays["stamps"][::-1]
    np.savez(tmp_path / "backwards.npz", **arrays)
    found, expected, forwards = (
        re.findall("relative poses .*", said("map", *arguments))
        for arguments in ((drive, "--backwards"), (tmp_path / "backwards.npz",), (drive,))
    )
    assert found == expected != forwards


def test_relations_are_not_looked_for_in_a_recording_that_is_turned_around(drive: Path) -> None:
    asked = ["evaluate", "map", str(drive), "--backwards", "--relations", str(drive)]
    refused = CliRunner().invoke(cli, asked)
    assert refused.exit_code == 2
    assert "leave one out" in " ".join(refused.output.split())


def test_poses_are_found_where_the_robot_came_by_before_and_none_elsewhere_is_believed(drive: Path) -> None:
    rows = re.findall(
        r"(one scan|six keyframes) +(\d+) +(\d+) +([\d.]+)% +(\d+) +(\d+) +(\d+)", said("relocation", drive)
    )
    assert [row[0] for row in rows] == ["one scan", "six keyframes"]
    for _, queries, known, share, outside, found_outside, wrong in rows:
        assert int(known) + int(outside) <= int(queries)
        assert int(known) > 20
        assert float(share) > 80
        assert found_outside == wrong == "0"


def test_raw_odometry_is_no_reference(drive: Path, tmp_path: Path) -> None:
    with np.load(drive) as file:
        arrays = {name: file[name] for name in file}
    assert "reference                  the corrected poses that the log has for odometry" in said(
        "map", drive
    )
    arrays["truth"][:, 2] = np.nan
    np.savez(tmp_path / "positions.npz", **arrays)
    told = said("map", tmp_path / "positions.npz")
    assert re.search("reference +none.* no headings", told)
    del arrays["truth"]
    np.savez(tmp_path / "raw.npz", **arrays)
    told = said("map", tmp_path / "raw.npz")
    assert re.search("reference +none.* no reference poses", told)
    assert "wrong" not in told
    assert "relative poses" not in told


def test_runs_that_would_be_one_and_the_same_are_refused(drive: Path, tmp_path: Path) -> None:
    with np.load(drive) as file:
        arrays = {name: file[name] for name in file}
    del arrays["odometry"]
    without = tmp_path / "without.npz"
    np.savez(without, **arrays)
    for recording, odometry in (("none.npz", "recorded"), ("none.npz", "none"), (without, "auto")):
        asked = ["evaluate", "map", str(recording), "--odometry", odometry, "--seeds", "2"]
        result = CliRunner().invoke(cli, asked)
        assert result.exit_code == 2
        assert "Leave it out" in " ".join(result.output.split())
    refused = CliRunner().invoke(cli, ["evaluate", "map", "none.npz", "--odometry", "none", "--seed", "7"])
    assert refused.exit_code == 2
    assert "--seed is for poor odometry" in " ".join(refused.output.split())
    asked = ["evaluate", "map", str(without), "--odometry", "recorded"]
    with pytest.raises(EvaluationError, match="has no odometry: choose auto, none, or poor"):
        CliRunner().invoke(cli, asked, catch_exceptions=False)


@pytest.mark.parametrize("option", ["--seed", "--seeds"])
def test_poor_odometry_is_advised_only_where_there_is_a_reference_to_make_it_of(
    drive: Path, tmp_path: Path, option: str
) -> None:
    with np.load(drive) as file:
        arrays = {name: file[name] for name in file if name not in ("odometry", "truth")}
    bare = tmp_path / "bare.npz"
    np.savez(bare, **arrays)
    refused = CliRunner().invoke(cli, ["evaluate", "map", str(bare), option, "3"])
    assert refused.exit_code == 2
    told = " ".join(refused.output.replace("│", " ").split())
    assert f"{option} is for poor odometry" in told
    assert "Leave it out: the recording has no reference poses" in told
    assert "--odometry poor" not in told
    asked = ["evaluate", "map", str(bare), "--odometry", "recorded"]
    with pytest.raises(EvaluationError, match=r"has no odometry: choose auto or none\."):
        CliRunner().invoke(cli, asked, catch_exceptions=False)


@pytest.mark.parametrize("own", ["0.02", "nan,nan", "-1,-1", "0.02,inf", "a,b"])
def test_what_is_no_deviation_of_the_reference_is_refused(drive: Path, own: str) -> None:
    result = CliRunner().invoke(cli, ["evaluate", "map", str(drive), "--own", own])
    assert result.exit_code == 2
    assert "two numbers" in result.output


def test_odometry_that_there_is_not_is_refused_before_anything_is_read() -> None:
    result = CliRunner().invoke(cli, ["evaluate", "map", "no-recording.npz", "--odometry", "nope"])
    assert result.exit_code == 2
    assert "'nope'" in result.output


def test_settings_are_not_taken_for_simulated_rooms_that_do_not_use_them() -> None:
    result = CliRunner().invoke(cli, ["evaluate", "walls", "--seeds", "1", "--set", "gap=0.3"])
    assert result.exit_code == 2
    assert "name one, or leave them out" in " ".join(result.output.replace("│", " ").split())


@pytest.mark.parametrize(
    "words",
    [
        ("evaluate", "repeatability", "x", "--scans"),
        ("evaluate", "repeatability", "x", "--skip"),
        ("calibrate", "x", "--scans"),
        ("evaluate", "consistency", "--trials"),
        ("evaluate", "map", "x", "--seeds"),
    ],
)
def test_counts_that_no_recording_has_are_refused(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(cli, [*words, "99999999999999999999999"])
    assert result.exit_code == 2
    assert "less than or equal" in result.output


def test_a_map_leaves_out_a_scan_whose_clock_went_back_and_says_so(drive: Path, tmp_path: Path) -> None:
    with np.load(drive) as file:
        held = dict(file)
    held["stamps"][50] -= 5
    broken = tmp_path / "broken.npz"
    np.savez(broken, **held)
    result = CliRunner().invoke(cli, ["map", str(broken), "-o", str(tmp_path / "map")])
    assert result.exit_code == 0, result.output
    assert "99 scans, 99 of them tracked" in result.output
    assert re.search(
        r"Left out: 1 scan, the first of them scan 51: The clock went back by 4\.\d+ s\.", result.output
    )
    assert len((tmp_path / "map" / "poses.csv").read_text().splitlines()) == 100
