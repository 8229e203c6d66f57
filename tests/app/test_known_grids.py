"""Localizing in a grid on a real server: an own map, one of ROS, one of `lidarcore map`; and files that are none."""

import csv
import io
import tempfile
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import httpx
import numpy as np
import pytest
from PIL import Image
from processes import Serving, assert_refused, run
from serving import Server, assert_problem, wait_until

from lidarcore import Scan
from lidarcore.geometry import compose
from lidarcore.mapping.export import COVARIANCE_FILE, MAP_FILES, walls_csv, write_map
from lidarcore.mapping.grid import OccupancyGrid, build_grid, read_ros_map, shades_of, write_ros_map
from lidarcore.mapping.walls import find_walls
from lidarcore.recordings.writer import RecordingWriter
from lidarcore.scan import Array
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

FRAME = np.array([20.0, -5.0, 2.5])
"""T_map_world: maps have frames of their own."""
FURNISHED = {"kind": "simulation", "settings": {"world": "furnished room", "seed": 4}}
LOCALIZE = {"navigation": {"mode": "localize"}}
YAML = (
    "image: {}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
)


@pytest.fixture(scope="module")
def scans() -> list[Scan]:
    return list(islice(SimulatedRobot(SimulationSettings(world="furnished room", seed=9), begin=1e9), 200))


def poses(scans: list[Scan]) -> Array:
    return np.array([compose(FRAME, scan.truth) for scan in scans if scan.truth is not None])


@pytest.fixture(scope="module")
def grid(scans: list[Scan]) -> OccupancyGrid:
    later = list(
        islice(SimulatedRobot(SimulationSettings(world="furnished room", seed=9), begin=1e9), 0, 400, 10)
    )
    return build_grid(later, poses(later))


@pytest.fixture(scope="module")
def ros_map(grid: OccupancyGrid, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ros") / "hall.yaml"
    write_ros_map(grid, path)
    return path


def packed(*files: tuple[str, bytes]) -> bytes:
    found = io.BytesIO()
    with ZipFile(found, "w", ZIP_DEFLATED) as archive:
        for name, content in files:
            archive.writestr(name, content)
    return found.getvalue()


@pytest.fixture
def driving(make_server: Callable[..., Server]) -> Server:
    """Plays a simulated robot that drives through the furnished room."""
    server = make_server()
    server.change("PUT", "/source", FURNISHED)
    return server


def tracked(http: httpx.Client) -> bool:
    answer = http.get("/pose")
    return bool(answer.is_success and answer.json()["state"] == "tracking")


def test_a_map_of_ros_is_loaded_and_localized_in(driving: Server, grid: OccupancyGrid, ros_map: Path) -> None:
    image = ros_map.with_suffix(".pgm")
    body = packed(("maps/hall.yaml", ros_map.read_bytes()), ("maps/hall.pgm", image.read_bytes()))
    answer = driving.http.post("/map", params={"format": "zip", "name": "hall.yaml"}, content=body)
    session = answer.json()
    assert (answer.status_code, session["source"], session["grid"], session["landmarks"]) == (
        201, "hall.yaml", True, 0,
    )  # fmt: skip
    driving.change("PUT", "/localization/map", {"session": session["id"]})
    driving.change("PATCH", "/settings", LOCALIZE)
    wait_until(lambda: tracked(driving.http), "it is tracked")
    status = driving.get("/localization")
    assert (status["mode"], status["method"], status["session"]) == ("localize", "scans", session["id"])
    with driving.stream() as stream:
        where = stream.frame(lambda f: f["localization"]["pose"])["localization"]
    x, y, _ = compose(FRAME, np.array(where["truth"]))  # the map's frame is not the robot's
    assert np.hypot(where["pose"]["x"] - x, where["pose"]["y"] - y) < 0.2
    pose = driving.get("/pose")
    assert pose["mode"] == "localize"
    back = driving.http.get("/map", params={"session": session["id"], "format": "zip"})
    with ZipFile(io.BytesIO(back.content)) as archive:
        assert sorted(archive.namelist()) == ["map.pgm", "map.yaml"]
        archive.extractall(ros_map.parent / "back")
    again = read_ros_map(ros_map.parent / "back" / "map.yaml")
    np.testing.assert_array_equal(again.cells, read_ros_map(ros_map).cells)
    np.testing.assert_allclose(again.origin, grid.origin)
    # And to be told where it is: at a wrong place it is not tracked.
    driving.change("POST", "/pose", {"x": pose["x"], "y": pose["y"], "heading": pose["heading"]})
    assert_problem(driving.http.post("/pose", json={"x": 0, "y": 0, "heading": 0, "sigma_position": 0}), 422)


def test_walls_of_a_map_that_is_loaded_again_are_localized_in_and_saved(
    driving: Server, scans: list[Scan], grid: OccupancyGrid
) -> None:
    """What is saved of a map has all that was loaded; a wall that two scans saw at most is not taken for one."""
    spread = np.tile(np.diag([0.01, 0.01, 0.002]) ** 2, (20, 1, 1))
    walls = find_walls(scans[::10], poses(scans)[::10], spread, grid)
    with tempfile.TemporaryDirectory() as folder:
        write_map(folder, grid, walls)
        body = packed(*((path.name, path.read_bytes()) for path in Path(folder).iterdir()))
    kept = np.flatnonzero(walls.count >= 3)
    session = driving.http.post("/map", params={"format": "zip"}, content=body).json()
    assert session["walls"] == len(kept) > 5
    driving.change("PUT", "/localization/map", {"session": session["id"]})
    driving.change("PATCH", "/settings", LOCALIZE)
    wait_until(lambda: tracked(driving.http), "it is tracked")
    told = driving.get("/walls")["walls"]
    assert [wall["id"] for wall in told] == walls.ids[kept].tolist()
    np.testing.assert_allclose([wall["end"] for wall in told], walls.ends[kept, 1], rtol=1e-8)
    with driving.stream() as stream:
        assert stream.until("walls", bool)["walls"] == told
    for path, query, more in (
        ("/map", {"session": session["id"]}, {COVARIANCE_FILE}),
        ("/map/grid", {}, set()),
    ):
        back = driving.http.get(path, params=query | {"format": "zip"}).raise_for_status()
        with ZipFile(io.BytesIO(back.content)) as archive:
            assert set(archive.namelist()) == {*MAP_FILES, *more}
            assert archive.read("walls.csv").decode() == walls_csv(walls, kept)


def test_a_zip_whose_walls_make_no_sense_is_refused_and_leaves_nothing(
    shared_server: Server, ros_map: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # of the process that reads
    before = shared_server.get("/sessions")["sessions"]
    image = ros_map.with_suffix(".pgm").read_bytes()
    files = [("hall.yaml", ros_map.read_bytes()), ("hall.pgm", image)]
    body = packed(*files, ("walls.csv", b"id\n1\n"))
    answer = shared_server.http.post("/map", params={"format": "zip"}, content=body)
    assert "walls.csv: It lacks the columns" in assert_problem(answer, 422)["detail"]
    assert shared_server.get("/sessions")["sessions"] == before
    for _ in range(5):  # the process that reads may end before or after it is killed
        loaded = shared_server.http.post("/map", params={"format": "zip"}, content=packed(*files)).json()
        assert not list(tmp_path.glob("lidarcore-map-*"))  # what was unpacked
        shared_server.http.delete(f"/sessions/{loaded['id']}").raise_for_status()


@pytest.mark.parametrize(
    ("files", "text"),
    [
        ([("a.yaml", b"image: ../secret.pgm\n" + YAML.partition("\n")[2].encode()), ("a.pgm", b"P5")], "outside"),
        ([("a.yaml", YAML.format("a.pgm").encode())], "a.pgm"),
        ([("a.yaml", YAML.format("a.pgm").encode()), ("a.pgm", b"P5\n9 9\n255\nshort")], "says 9 x 9"),
        ([("a.yaml", b"x: 1"), ("b.yaml", b"x: 2")], "2 YAML files"),
        ([("plan.svg", b"<svg/>")], "0 YAML files"),
        ([("a.yaml", YAML.format("a.pgm").encode()), ("a.pgm", bytes(300_000_000))], "bytes"),
        ([(f"{k}.pgm", b"") for k in range(30)] + [("a.yaml", b"x: 1")], "files"),
    ],
)  # fmt: skip
def test_a_zip_that_holds_no_map_is_refused_and_leaves_nothing(
    shared_server: Server, files: list[tuple[str, bytes]], text: str
) -> None:
    before = shared_server.get("/sessions")["sessions"]
    answer = shared_server.http.post("/map", params={"format": "zip"}, content=packed(*files))
    assert text in assert_problem(answer, 422)["detail"]
    assert shared_server.get("/sessions")["sessions"] == before


@pytest.mark.parametrize("declared", ["application/zip", "Application/Zip; charset=binary"])
def test_a_body_is_of_the_format_that_it_is_declared_to_have(
    shared_server: Server, ros_map: Path, declared: str
) -> None:
    body = packed(("hall.yaml", ros_map.read_bytes()), ("hall.pgm", ros_map.with_suffix(".pgm").read_bytes()))
    answer = shared_server.http.post("/map", content=body, headers={"Content-Type": declared})
    assert (answer.status_code, answer.json()["grid"]) == (201, True)
    as_json = shared_server.http.post(
        "/map", params={"format": "json"}, content=body, headers={"Content-Type": declared}
    )
    assert "json cannot be read" in assert_problem(as_json, 422)["detail"]  # what is asked for counts


def test_bytes_that_are_no_zip_are_refused(shared_server: Server) -> None:
    answer = shared_server.http.post("/map", params={"format": "zip"}, content=b"not a zip")
    assert "zip cannot be read" in assert_problem(answer, 422)["detail"]


def test_a_grid_is_no_file_of_landmarks_and_is_drawn_in_its_cells_or_larger_ones(
    shared_server: Server, ros_map: Path, grid: OccupancyGrid
) -> None:
    body = packed(("hall.yaml", ros_map.read_bytes()), ("hall.pgm", ros_map.with_suffix(".pgm").read_bytes()))
    session = shared_server.http.post("/map", params={"format": "zip"}, content=body).json()["id"]
    for format in ("json", "csv", "geojson"):
        answer = shared_server.http.get("/map", params={"session": session, "format": format})
        assert "a grid, in the formats png and zip." in assert_problem(answer, 404)["detail"]
    picture = {"session": session, "format": "png"}
    shades = np.asarray(Image.open(io.BytesIO(shared_server.http.get("/map", params=picture).content)))
    np.testing.assert_array_equal(shades, shades_of(grid))
    coarse = shared_server.http.get("/map", params=picture | {"resolution": 0.21}).content
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(coarse))), shades_of(grid.coarser(4)))
    for format in ("png", "zip"):
        answer = shared_server.http.get("/map", params=picture | {"format": format, "resolution": 0.02})
        assert (
            "cells of 0.05 m, larger than 0.02 m: raise resolution" in assert_problem(answer, 422)["detail"]
        )


@pytest.mark.long
def test_a_map_that_was_built_is_localized_in_after_the_server_was_killed(
    serving: Callable[..., Serving], tmp_path: Path, background: Path
) -> None:
    path = tmp_path / "maps.db"
    server = serving(background, "--map", path)
    with httpx.Client(base_url=f"{server.url}api/v1", timeout=60) as http:
        http.put("/source", json=FURNISHED).raise_for_status()
        http.patch("/settings", json={"navigation": {"mode": "slam", "method": "scans"}}).raise_for_status()
        kept = lambda: [one for one in http.get("/sessions").json()["sessions"] if one["grid"]]  # noqa: E731
        wait_until(lambda: len(kept()) == 1, seconds=120)
        wait_until(lambda: http.get("/localization").json()["method"] == "scans")
    server.process.kill()
    server.process.wait()
    again = serving(background, "--map", path)
    with httpx.Client(base_url=f"{again.url}api/v1", timeout=60) as http:
        http.put("/source", json=FURNISHED).raise_for_status()
        http.patch("/settings", json=LOCALIZE).raise_for_status()
        wait_until(lambda: tracked(http), seconds=120)
        assert http.get("/localization").json()["session"] == 1


def test_a_recording_is_localized_in_a_map_of_ros_by_the_command(
    scans: list[Scan], ros_map: Path, tmp_path: Path
) -> None:
    recording, found = tmp_path / "driven.mcap", tmp_path / "poses.csv"
    with RecordingWriter(recording) as writer:
        for scan in scans[:120]:
            writer.write(scan)
    done = run("localize", recording, "--map", ros_map, "-o", found)
    assert done.returncode == 0, done.stderr
    assert "120 scans" in done.stdout
    with found.open(newline="") as file:
        rows = list(csv.DictReader(file))
    states = [row["state"] for row in rows]
    assert states[-1] == "tracking"
    last = np.array([float(rows[-1][name]) for name in ("x", "y", "heading")])
    assert np.hypot(*(last - poses(scans[:120])[-1])[:2]) < 0.1
    missing = run("localize", recording, "--map", tmp_path / "none.yaml")
    assert_refused(missing, "none.yaml")
    empty = tmp_path / "empty.yaml"
    write_ros_map(OccupancyGrid(np.zeros((5, 5)), 0.05, np.zeros(3)), empty)
    assert_refused(run("localize", recording, "--map", empty), "Nothing is occupied")
