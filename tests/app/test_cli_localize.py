"""`lidarcore localize` as a process, on a recording of a simulated robot whose true poses are known."""

import csv
import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from processes import assert_refused, run
from serving import ROOT, write_room

from lidarcore import Scan, open_recording
from lidarcore.geometry import compose, inverse
from lidarcore.mapping.export import read_walls
from lidarcore.mapping.grid import build_grid, write_ros_map
from lidarcore.recordings.writer import RecordingWriter
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

NOISE = ("--set", "noise.sigma_range=0.01", "--set", "noise.sigma_bearing=0.001")


@pytest.fixture(scope="module")
def scans() -> list[Scan]:
    return list(islice(SimulatedRobot(SimulationSettings(world="two rooms", seed=5), begin=1e9), 120))


@pytest.fixture(scope="module")
def recording(scans: list[Scan], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("driven") / "driven.mcap"
    with RecordingWriter(path) as writer:
        for scan in scans:
            writer.write(scan)
    return path


def poses_of(path: Path) -> np.ndarray:
    with path.open(newline="") as file:
        return np.array(
            [[float(row[name]) for name in ("x", "y", "heading")] for row in csv.DictReader(file)]
        )


@pytest.mark.long
def test_a_map_that_slam_saved_is_one_to_localize_in(
    scans: list[Scan], recording: Path, tmp_path: Path
) -> None:
    built, poses, again = tmp_path / "map.json", tmp_path / "slam.csv", tmp_path / "localized.csv"
    first = run("localize", recording, "-o", poses, "--save-map", built, *NOISE)
    assert first.returncode == 0, first.stderr
    assert "120 scans" in first.stdout
    assert len(json.loads(built.read_text())["landmarks"]) >= 4
    second = run("localize", recording, "-o", again, "--map", built, *NOISE)
    assert second.returncode == 0, second.stderr
    start = compose(poses_of(poses)[0], inverse(scans[0].truth))
    true = np.array([compose(start, scan.truth) for scan in scans])
    errors = [np.linalg.norm(poses_of(path)[:, :2] - true[:, :2], axis=1) for path in (poses, again)]
    travelled = np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1).sum()
    assert travelled > 4
    assert errors[0].max() < 0.25
    assert np.median(errors[1]) < 0.25


@pytest.mark.long
def test_a_map_of_whole_scans_has_the_poses_of_all_scans(
    scans: list[Scan], recording: Path, tmp_path: Path
) -> None:
    poses = tmp_path / "map" / "poses.csv"
    result = run("map", recording, "-o", poses.parent, *NOISE)
    assert result.returncode == 0, result.stderr
    assert "120 of them tracked" in result.stdout
    true = np.array([compose(inverse(scans[0].truth), scan.truth) for scan in scans])
    assert np.linalg.norm(poses_of(poses)[:, :2] - true[:, :2], axis=1).max() < 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--map", "nowhere.json"), "There is no map nowhere.json: give its file"),
        (("--map", "nowhere.yaml"), "There is no map nowhere.yaml: give its file"),
        (("--save-map", "map.txt"), "should end in one of .json, .csv, .geojson."),
        (("--map", "map.txt"), "should end in one of .json, .csv, .geojson, .yaml, .yml."),
        (("--map", "."), "map.yaml"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(
    recording: Path, arguments: tuple[str, ...], words: str
) -> None:
    assert_refused(run("localize", recording, *arguments), words)


@pytest.mark.real_data
def test_where_corners_do_not_tell_the_way_it_says_what_does(data: Path) -> None:
    told = run("localize", data / "rplidar_rosbag1" / "lidar.bag").stdout
    assert told.endswith("`lidarcore map` finds it from whole scans.\n")
    assert "whole scans" not in run("localize", data / "ccny_hokuyo_rosbag1" / "demo.bag").stdout


@pytest.mark.parametrize("command", [("map", "-o", "out"), ("localize",), ("process", "-o", "out.csv")])
def test_what_was_cut_short_is_noted_once_on_stderr(command: tuple[str, ...], tmp_path: Path) -> None:
    whole = (ROOT / "app" / "demo" / "emulated-s1.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 4])
    name, *output = command
    output = [str(tmp_path / part) if part.startswith("out") else part for part in output]
    result = run(name, tmp_path / "cut.mcap", *output)
    assert result.returncode == 0, result.stderr
    (note,) = result.stderr.splitlines()
    assert note.startswith("cut.mcap: The MCAP file is damaged or cut short")


def test_a_map_of_ranges_in_millimetres_says_to_check_the_unit(tmp_path: Path) -> None:
    rows = [f"{stamp},-2,0.02," + ",".join(["4012.5"] * 200) for stamp in range(5)]
    head = "t,angle_min,angle_increment," + ",".join(f"r{beam}" for beam in range(200))
    (tmp_path / "mm.csv").write_text("\n".join([head, *rows]) + "\n")
    result = run("map", tmp_path / "mm.csv", "-o", tmp_path / "map")
    assert result.returncode == 2
    assert "no scan has a return" in result.stderr
    assert "Check that ranges are in metres; `lidarcore info` shows them." in result.stderr
    assert not (tmp_path / "map").exists()


def test_poses_are_written_as_csv_only(tmp_path: Path) -> None:
    refused = run("localize", "no-recording.npz", "-o", tmp_path / "poses.txt")
    assert_refused(refused, "poses.txt should end in .csv")
    for nameless in ("", ".csv"):
        refused = run("localize", "no-recording.npz", "-o", nameless)
        assert_refused(refused, "The file to write has no name: give one, such as results.csv.")


def test_a_map_to_save_without_a_name_is_told_before_the_work() -> None:
    refused = run("localize", "no-recording.npz", "--save-map", "")
    assert_refused(refused, "The file of the map has no name: give one, such as map.json.")


def test_a_folder_where_a_file_of_a_map_belongs_is_told_before_the_work(tmp_path: Path) -> None:
    """Found at the end, it would leave files of two maps."""
    (tmp_path / "plan.dxf").mkdir()
    refused = run("map", "no-recording.npz", "-o", tmp_path, "--replace")
    assert_refused(refused, "holds a folder plan.dxf, where a file of the map belongs")


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("localize", "room.npz", "--map", ""), "map"),
        (("serve", "--recordings", " "), "folder"),
        (("process", "room.npz", "-o", "room.json", "--settings", ""), "file of settings"),
    ],
)
def test_what_has_no_name_is_not_the_working_folder(arguments: tuple[str, ...], what: str) -> None:
    refused = run(*arguments)
    assert refused.returncode == 2
    assert f"the name of the {what} is empty" in " ".join(refused.stderr.split())


@pytest.mark.parametrize("command", ["info", "localize"])
def test_a_recording_without_a_name_is_not_the_working_folder(command: str) -> None:
    refused = run(command, "")
    assert refused.returncode == 2
    assert "the name of the recording is empty" in refused.stderr


def test_a_map_goes_into_a_folder_with_a_name(tmp_path: Path) -> None:
    """The recording is not even opened."""
    refused = run("map", "no-recording.npz", "-o", "")
    assert refused.returncode == 2
    assert "the name of the folder is empty" in refused.stderr


def test_a_map_takes_the_place_of_another_one_only_if_told_to(recording: Path, tmp_path: Path) -> None:
    """Refused before the recording is opened; no file of the old map is left among those of the new one."""
    drawn = tmp_path / "hall" / "plan.svg"
    drawn.parent.mkdir()
    drawn.write_text("an older plan")
    (tmp_path / "hall" / "walls_covariance.bin").write_bytes(b"of the older walls")
    (tmp_path / "hall" / "notes.txt").write_text("of somebody else")
    refused = run("map", "no-recording.npz", "-o", drawn.parent)
    assert_refused(refused, "hall: holds plan.svg already", "another folder for --output", "--replace")
    assert drawn.read_text() == "an older plan"

    made = run("map", recording, "-o", drawn.parent, "--replace", *NOISE)
    assert made.returncode == 0, made.stderr
    assert drawn.read_text().startswith("<svg")
    assert read_walls(drawn.parent).length.sum() > 10
    assert (tmp_path / "hall" / "notes.txt").exists()


@pytest.mark.parametrize("text", ["", "\n\n"])
def test_an_empty_map_is_said_to_be_empty(room: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "map.csv").write_text(text)
    assert_refused(
        run("localize", room, "--map", tmp_path / "map.csv"), "This CSV of landmarks is empty: export"
    )


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A recording of a sensor that stands, with the grid of what it sees beside it."""
    path = write_room(tmp_path / "room.npz", scans=5)
    scans = list(open_recording(path))
    write_ros_map(build_grid(scans, np.tile([1.0, -2.0, 0.3], (len(scans), 1))), tmp_path / "map.yaml")
    return path


def test_a_sensor_that_is_told_where_it_is_is_tracked_at_once(room: Path, tmp_path: Path) -> None:
    localize = ("localize", room, "--map", tmp_path, "-o", tmp_path / "poses.csv")
    searched = run(*localize)
    assert "fits in several places of the map" in searched.stdout
    assert "give it by --pose." in searched.stdout
    told = run(*localize, "--pose", "1.05,-2.1,0.32")
    assert "5 scans, 5 of them tracked." in told.stdout, told
    assert np.abs(poses_of(tmp_path / "poses.csv") - [1.0, -2.0, 0.3]).max() < 0.05


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("--pose", "0,0,0"), "with --map"), (("--map", "m.yaml", "--pose", "1,2"), "a pose in m, m, rad")],
)
def test_a_pose_that_is_none_or_of_no_map_is_refused(
    room: Path, arguments: tuple[str, ...], words: str
) -> None:
    result = run("localize", room, *arguments)
    assert result.returncode == 2
    assert words in result.stderr


def test_a_map_may_leave_out_what_the_recording_says_of_the_motion(tmp_path: Path) -> None:
    """Along a bare wall that goes on beyond the range nothing tells how far one went but the odometry."""
    path = tmp_path / "wall.mcap"
    bearings = np.linspace(-1.0, 1.0, 200)
    with RecordingWriter(path) as writer:
        for k in range(12):
            odometry = np.array([0.0, 0.1 * k, 0.0])
            writer.write(Scan(2 / np.cos(bearings), bearings, 1e9 + k, odometry=odometry))
    ends = {}
    for odometry in ("recorded", "none"):
        done = run("map", path, "-o", tmp_path / odometry, "--odometry", odometry)
        assert done.returncode == 0, done.stderr
        ends[odometry] = poses_of(tmp_path / odometry / "poses.csv")[-1]
    np.testing.assert_allclose(ends["recorded"], [0, 1.1, 0], atol=0.02)
    np.testing.assert_allclose(ends["none"], [0, 0, 0], atol=0.02)
    refused = run("map", path, "-o", tmp_path / "x", "--odometry", "wheels")
    assert refused.returncode == 2
    assert "'wheels'" in refused.stderr
