"""Files of a map, read by others: ezdxf's audit, an XML parser, JSON, CSV and a reader of ROS maps."""

import csv
import io
import json
import os
import resource
import xml.etree.ElementTree as ElementTree
from dataclasses import fields
from functools import cache

import ezdxf
import numpy as np
import pytest
from nav2_reader import read_nav2
from PIL import Image

from lidarcore import ExtractionSettings, SensorNoise
from lidarcore.errors import MapFileError, MeasureError
from lidarcore.mapping.export import COVARIANCE_FILE, MAP_FILES, read_walls_csv, walls_csv, write_map
from lidarcore.mapping.grid import build_grid
from lidarcore.mapping.measure import Feature, angle, distance, feature, length
from lidarcore.mapping.walls import Walls, WallTable, find_walls, joint_spread
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.rooms import rectangular_room

NOISE = SensorNoise(0.01, 0.001)
POSES = np.column_stack([np.linspace(-2, 2, 8), np.linspace(-0.7, 0.9, 8), np.linspace(0, 3, 8)])


def spread_of_poses() -> np.ndarray:
    """Every pose has an error of its own, and all share a large one."""
    own, shared = np.diag([0.01, 0.01, 0.002]) ** 2, np.diag([0.2, 0.2, 1e-9]) ** 2
    return np.kron(np.eye(8), own) + np.kron(np.ones((8, 8)), shared)


def mapped(seed: int):
    rng = np.random.default_rng(seed)
    sensor = SimulatedSensor(rectangular_room(6, 4), NOISE)
    scans = [sensor.scan(pose, rng, float(k))[0] for k, pose in enumerate(POSES)]
    poses = POSES + rng.multivariate_normal(np.zeros(24), spread_of_poses(), method="cholesky").reshape(8, 3)
    grid, extraction = build_grid(scans, poses), ExtractionSettings(noise=NOISE)
    return grid, find_walls(scans, poses, joint_spread(spread_of_poses()), grid, extraction=extraction)


@cache
def room():
    return mapped(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("maps") / "room"
    write_map(path, *room(), POSES, {"poses.csv": "stamp\n1\n"})
    return path


def test_all_files_are_there_and_nothing_else(folder):
    assert {file.name for file in folder.iterdir()} == {*MAP_FILES, COVARIANCE_FILE, "poses.csv"}


def test_the_dxf_passes_the_audit_and_holds_the_walls_in_metres(folder):
    document = ezdxf.readfile(folder / "plan.dxf")
    assert not document.audit().has_errors
    assert document.units == ezdxf.units.M
    lines = list(document.modelspace().query("LINE[layer=='WALLS']"))
    ends = [[tuple(line.dxf.start)[:2], tuple(line.dxf.end)[:2]] for line in lines]
    np.testing.assert_allclose(ends, room()[1].ends)
    assert len(document.modelspace().query("POINT[layer=='CORNERS']")) == 4
    ways = document.modelspace().query("LWPOLYLINE[layer=='PATH']")
    points = np.array([*np.reshape(ends, (-1, 2)), *(xy[:2] for way in ways for xy in way.get_points())])
    for name, end in (("$EXTMIN", points.min(axis=0)), ("$EXTMAX", points.max(axis=0))):
        np.testing.assert_allclose(document.header[name][:2], end, atol=1e-6)
    assert {"WALLS", "CORNERS", "PATH"} <= {layer.dxf.name for layer in document.layers}


def test_the_svg_is_well_formed_and_shows_every_wall(folder):
    root = ElementTree.parse(folder / "plan.svg").getroot()
    space = "{http://www.w3.org/2000/svg}"
    groups = {group.get("id"): group for group in root.iter(f"{space}g")}
    assert len(groups["walls"]) == len(room()[1])
    assert len(groups["corners"]) == 4
    x, y, width, height = map(float, root.get("viewBox").split())
    corners = room()[1].corners.xy
    assert ((corners[:, 0] > x) & (corners[:, 0] < x + width)).all()
    assert ((-corners[:, 1] > y) & (-corners[:, 1] < y + height)).all()


def test_on_the_plan_y_is_up(folder):
    """A viewer draws the y of an SVG downwards, times what the groups around it say."""
    drawing = ElementTree.parse(folder / "plan.svg").getroot()[-2]
    x_scale, y_scale = map(float, drawing.get("transform").removeprefix("scale(").removesuffix(")").split())
    walls = next(group for group in drawing if group.get("id") == "walls")
    ends = np.array(
        [[place.split() for place in wall.get("d")[1:].split("L")] for wall in walls], np.float64
    ) * (x_scale, -y_scale)
    np.testing.assert_allclose(ends, room()[1].ends, atol=5e-4)


def test_csv_and_geojson_say_the_same(folder):
    walls = room()[1]
    rows = list(csv.DictReader(io.StringIO((folder / "walls.csv").read_text())))
    document = json.loads((folder / "walls.geojson").read_text())
    assert document["unit"] == "m"
    lines = [one for one in document["features"] if one["geometry"]["type"] == "LineString"]
    assert len(rows) == len(lines) == len(walls)
    for i, (row, line) in enumerate(zip(rows, lines, strict=True)):
        np.testing.assert_allclose(line["geometry"]["coordinates"], walls.ends[i], rtol=1e-8)
        assert float(row["length_m"]) == pytest.approx(walls.length[i])
        assert float(row["var_length_m2"]) == pytest.approx(walls.length_variance[i])
        assert line["properties"]["count"] == int(row["count"]) == walls.count[i]
    corners = [one for one in document["features"] if one["geometry"]["type"] == "Point"]
    np.testing.assert_allclose([one["geometry"]["coordinates"] for one in corners], walls.corners.xy)


def test_the_ros_map_and_the_picture_hold_the_grid(folder):
    cells, _, origin = read_nav2(folder / "map.yaml")
    grid = room()[0]
    np.testing.assert_array_equal(cells, grid.cells)
    assert origin == pytest.approx(grid.origin.tolist())
    with Image.open(folder / "map.png") as picture:
        assert picture.width % grid.cells.shape[1] == 0
        colours = {colour for _, colour in picture.getcolors(1000)}
    assert (200, 30, 30) in colours


def test_a_full_disk_leaves_the_folder_as_it_was(folder, tmp_path):
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    child = os.fork()
    if child == 0:  # a limit of the size of files is what a full disk looks like, and cannot be taken back
        resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, 9_000))
        codes = []
        for place in (folder, tmp_path / "new"):
            try:
                write_map(place, *room(), POSES)
            except MapFileError:
                codes.append(0)
        os._exit(0 if codes == [0, 0] else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert not (tmp_path / "new").exists()


def opposite(walls: Walls) -> tuple[Feature, Feature]:
    """The two long walls."""
    first, second = np.argsort(-walls.length)[:2].tolist()
    return Feature("wall", first), Feature("wall", second)


def test_the_clear_width_of_a_room_does_not_know_of_shared_errors():
    walls = room()[1]
    width = distance(walls, *opposite(walls))
    assert abs(width.value - 4) < 4 * width.sigma < 0.06


def test_measured_widths_angles_and_diagonals_err_as_they_say():
    z = []
    for seed in range(60):
        walls = mapped(seed)[1]
        pair = opposite(walls)
        width, turn = distance(walls, *pair), angle(walls, *pair)
        far = int(np.argmax(np.hypot(*(walls.corners.xy - walls.corners.xy[0]).T)))
        diagonal = distance(walls, Feature("corner", 0), Feature("corner", far))
        z.append(
            [
                (width.value - 4) / width.sigma,
                turn.value / turn.sigma,
                (diagonal.value - 52**0.5) / diagonal.sigma,
            ]
        )
    inside = np.abs(z) < 1.96
    # Of 60, fewer than 46 would be inside with a probability of 1e-7 each; three times too small sigmas give 29.
    assert (inside.sum(axis=0) >= 46).all()
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_features_have_names_and_wrong_ones_are_refused():
    walls = room()[1]
    assert feature("wall-3") == Feature("wall", 3)
    assert length(walls, 0).value == walls.length[0]
    for name in ("wall", "door-1", "wall--1", "corner-x"):
        with pytest.raises(MeasureError):
            feature(name)
    for first, second in [("wall-0", "wall-99"), ("corner-0", "corner-0")]:
        with pytest.raises(MeasureError):
            distance(walls, feature(first), feature(second))
    with pytest.raises(MeasureError):
        angle(walls, feature("wall-0"), feature("corner-0"))


def test_walls_are_read_as_they_were_written(folder):
    walls, read = room()[1], read_walls_csv(folder / "walls.csv")
    for field in fields(WallTable):
        np.testing.assert_allclose(getattr(read, field.name), getattr(walls, field.name), rtol=1e-8)
    assert walls_csv(read) == walls_csv(walls)


@pytest.mark.parametrize(
    ("column", "value", "text"),
    [
        ("length_m", "wide", "Line 3 holds what is not a number"),
        ("length_m", "nan", "Wall 2 lacks numbers that are finite"),
        ("id", "0", "Two of the walls have the same id"),
        ("id", "1.5", "Wall 2 lacks an id"),
        ("count", "0", "Wall 2 lacks a count"),
        ("ended_2", "2", "Wall 2 lacks ended and corner"),
        ("var_r_m2", "-1e-6", "Wall 2 lacks variances"),
        ("cov_alpha_r_rad_m", "1", "Wall 2 lacks a covariance"),
    ],
)
def test_a_wall_that_makes_no_sense_is_named(folder, tmp_path, column, value, text):
    rows = list(csv.DictReader(io.StringIO((folder / "walls.csv").read_text())))
    rows[1][column] = value
    with (tmp_path / "walls.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    with pytest.raises(MapFileError, match=text):
        read_walls_csv(tmp_path / "walls.csv")


def test_a_file_that_holds_no_walls_is_refused(folder, tmp_path):
    (tmp_path / "poses.csv").write_text("stamp,x\n1,2\n")
    with pytest.raises(MapFileError, match=r"lacks the columns alpha_rad, .*: save the walls anew"):
        read_walls_csv(tmp_path / "poses.csv")
    with pytest.raises(MapFileError, match=r"none\.csv cannot be read"):
        read_walls_csv(tmp_path / "none.csv")
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(MapFileError, match=r"bytes\.csv cannot be read"):
        read_walls_csv(tmp_path / "bytes.csv")
    header = (folder / "walls.csv").read_text().partition("\n")[0]
    (tmp_path / "empty.csv").write_text(f"{header}\n")
    assert len(read_walls_csv(tmp_path / "empty.csv")) == 0
