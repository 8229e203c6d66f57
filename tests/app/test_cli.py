"""The command as people run it: processes of their own, and what they leave behind."""

import ast
import csv
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import numpy as np
import pyarrow.parquet
import pytest
from lidarcore_app.cli.main import main
from lidarcore_app.web.serving import listen
from processes import Serving, assert_refused, run
from serving import ROOT, write_room

import lidarcore
from lidarcore import ExtractionSettings, compare, open_recording
from lidarcore.mapping.grid import build_grid, write_ros_map


def test_help_is_instant_and_names_every_command() -> None:
    """It waits for nothing that takes long to import."""
    command = [sys.executable, "-c", "import sys, lidarcore_app.cli.main; print(*sys.modules)"]
    loaded = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert {"numpy", "numba", "scipy", "fastapi", "viser", "httpx"} & set(loaded) == set()
    result = run("--help")
    for command in ("serve", "process", "info", "bench"):
        assert command in result.stdout
        assert run(command, "--help").returncode == 0


@pytest.mark.parametrize(("wished", "threads"), [(None, {1}), ("2", {min(2, os.cpu_count() or 1)})])
def test_matrices_take_one_core_unless_told_otherwise(wished: str | None, threads: set[int]) -> None:
    """As the libraries themselves tell it, once a command has begun."""
    begun = "import lidarcore_app.cli.main as command; command.cli = lambda: None; command.main()"
    asked = "import threadpoolctl, scipy.linalg; print(threadpoolctl.threadpool_info())"
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    if wished:
        environment["OPENBLAS_NUM_THREADS"] = wished
    command = [sys.executable, "-c", f"{begun}; {asked}"]
    told = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    ).stdout
    libraries = [library for library in ast.literal_eval(told) if library["user_api"] == "blas"]
    assert {library["num_threads"] for library in libraries} == threads


def test_the_file_of_maps_is_said_to_be_a_file() -> None:
    assert re.search(r"--map +FILE ", run("serve", "--help").stdout)


def test_info_says_what_is_in_a_recording(hokuyo: Path) -> None:
    result = run("info", hokuyo)
    assert result.returncode == 0, result.stderr
    scans = list(open_recording(hokuyo))
    for line in (
        "format +ROS 1 bag",
        r"topic +/scan",
        f"scans +{len(scans)}",
        "beams per scan +681 to 681",
        r"bearings +-\d+\.\d to \d+\.\d degrees",
        "duration +35.8 s",
    ):
        assert re.search(line, result.stdout), (line, result.stdout)


@pytest.mark.parametrize(
    ("degrees", "told"),
    [
        (-np.arange(360.0), "1.0 to 360.0"),
        (-np.arange(90.0), "-89.0 to 0.0"),
        (np.arange(-185.0, 175.0), "-185.0 to 174.0"),
    ],
)
def test_bearings_are_told_as_people_count_them(degrees: np.ndarray, told: str, tmp_path: Path) -> None:
    """Also of a sensor that turns clockwise."""
    np.savez(tmp_path / "room.npz", ranges=np.full((2, len(degrees)), 2.0), bearings=np.radians(degrees))
    assert re.search(rf"bearings +{told} degrees", run("info", tmp_path / "room.npz").stdout)


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same recording processed into every format, by two methods."""
    folder = tmp_path_factory.mktemp("tables")
    room = write_room(folder / "room.npz", scans=7)
    paths = {suffix: folder / f"out.{suffix}" for suffix in ("csv", "parquet", "geojson")}
    for path in paths.values():
        result = run(
            "process", room, "-o", path, "--fitter", "cwlf", "--fitter", "ml", "--set", "min_points=9"
        )
        assert result.returncode == 0, result.stderr
        assert "7 scans" in result.stdout
    return paths


def expected(folder: Path) -> Iterator[dict]:
    """What the library finds, as rows."""
    settings = ExtractionSettings(min_points=9)
    for number, scan in enumerate(open_recording(folder / "room.npz")):
        for fitter, features in compare(scan, settings, ("cwlf", "ml")).items():
            for i in range(len(features.segments)):
                line = features.segments.lines[i]
                yield {"scan": number, "stamp": scan.stamp, "fitter": fitter, "kind": "segment", "id": i,
                       "alpha": line.alpha, "r": line.r, "x_start": features.segments.start[i, 0],
                       "var_r": line.covariance_consistent[1, 1]}  # fmt: skip
            for i in range(len(features.corners)):
                x, y = features.corners.xy[i]
                yield {"scan": number, "stamp": scan.stamp, "fitter": fitter, "kind": "corner", "id": i,
                       "x": x, "y": y, "cov_xy": features.corners.covariance[i, 0, 1],
                       "segment_2": features.corners.segments[i, 1]}  # fmt: skip


def assert_rows(rows: list[dict], folder: Path) -> None:
    for row, wanted in zip(rows, expected(folder), strict=True):
        assert {name: row[name] for name in wanted} == wanted


def test_a_csv_table_holds_every_scan(tables: dict[str, Path]) -> None:
    def typed(name: str, text: str) -> object:
        return text if name in ("fitter", "kind", "covariance") else float(text) if text else None

    with tables["csv"].open(newline="") as file:
        rows = [{name: typed(name, text) for name, text in row.items()} for row in csv.DictReader(file)]
    assert_rows(rows, tables["csv"].parent)
    assert all(row["x"] is None for row in rows if row["kind"] == "segment")


def test_a_parquet_table_holds_every_scan(tables: dict[str, Path]) -> None:
    assert_rows(pyarrow.parquet.read_table(tables["parquet"]).to_pylist(), tables["parquet"].parent)


def test_a_geojson_collection_holds_every_scan(tables: dict[str, Path]) -> None:
    collection = json.loads(tables["geojson"].read_text())
    assert collection["type"] == "FeatureCollection"
    rows = []
    for feature in collection["features"]:
        assert feature["type"] == "Feature"
        kind, coordinates = feature["geometry"]["type"], np.array(feature["geometry"]["coordinates"])
        if kind == "LineString":
            assert coordinates.shape == (2, 2)
            rows.append(feature["properties"] | {"x_start": coordinates[0, 0]})
        else:
            rows.append(feature["properties"] | dict(zip("xy", coordinates, strict=True)))
    assert_rows(rows, tables["geojson"].parent)


@pytest.mark.long
def test_processing_what_breaks_leaves_no_file_and_the_old_one_as_it_was(tmp_path: Path) -> None:
    garbage = tmp_path / "garbage.bag"
    garbage.write_bytes(b"#ROSBAG V2.0\n" + bytes(range(256)) * 20)
    old = tmp_path / "old.csv"
    old.write_text("precious")
    room = write_room(tmp_path / "room.npz", scans=2)
    before = sorted(tmp_path.iterdir())
    assert_refused(run("process", garbage, "-o", tmp_path / "new.csv"), "garbage.bag")
    assert_refused(run("process", garbage, "-o", old), "garbage.bag")
    assert_refused(run("process", room, "-o", tmp_path / "new.xlsx"), ".parquet")
    assert_refused(run("process", room, "-o", tmp_path / "missing" / "new.csv"), "missing")
    assert_refused(run("process", tmp_path / "none.bag", "-o", old), "none.bag")
    assert_refused(run("process", room, "-o", old, "--topic", "/nose"), "/nose")
    assert sorted(tmp_path.iterdir()) == before
    assert old.read_text() == "precious"


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("gap=-1", ["extraction.gap", "0.02"]),
        ("gap=wide", ["extraction.gap"]),
        ("gapp=1", ["extraction.gapp"]),
        ("view.theme=pink", ["view.theme"]),
        ("noise.sigma_range=NaN", ["sigma_range"]),
        ("fitter=magic", ["magic", "wctls"]),
    ],
)
def test_a_bad_setting_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    setting: str,
    words: list[str],
) -> None:
    command = ["lidarcore", "process", "any.bag", "-o", str(tmp_path / "x.csv"), "--set", setting]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as ended:
        main()
    assert_refused(subprocess.CompletedProcess(command, ended.value.code, *capsys.readouterr()), *words)


@pytest.mark.long
def test_settings_come_from_a_file_and_from_the_line(tmp_path: Path) -> None:
    room = write_room(tmp_path / "room.npz", scans=2)
    file = tmp_path / "settings.json"
    file.write_text(
        json.dumps({"extraction": {"fitter": "utls", "covariance": "published", "min_length": 9}})
    )
    output = tmp_path / "out.csv"
    assert run("process", room, "-o", output, "--settings", file, "--set", "min_length=1").returncode == 0
    with output.open(newline="") as csv_file:
        rows = list(csv.DictReader(csv_file))
    assert {(row["fitter"], row["covariance"]) for row in rows} == {("utls", "published")}
    assert len(rows) == 16
    file.write_text('{"extraction": ')
    assert_refused(run("process", room, "-o", output, "--settings", file))
    assert_refused(run("process", room, "-o", output, "--settings", tmp_path / "none.json"), "none.json")


def test_serve_prints_its_address_plays_the_recording_and_ends_on_ctrl_c(
    tmp_path: Path, serving: Callable[..., Serving]
) -> None:
    room = write_room(tmp_path / "given.npz")
    server = serving("--http-port", 0, room, "--set", "fitter=cwlf")
    assert re.fullmatch(r"http://127\.0\.0\.1:[1-9]\d*/", server.url)
    with httpx.Client(base_url=f"{server.url}api/v1", timeout=60) as http:
        assert http.get("/source").json()["recording"] == "given.npz"
        assert http.get("/settings").json()["extraction"]["fitter"] == "cwlf"
    said = server.end()
    assert said == ""
    assert server.process.returncode == 0


@pytest.mark.long
def test_a_busy_port_is_said_to_be(serving: Callable[..., Serving], free_port: Callable[[], int]) -> None:
    with listen("127.0.0.1", 0) as listening:
        port = listening.getsockname()[1]
        assert_refused(run("serve", "--port", port), str(port), "in use", f"--http-port {port + 1}")
    assert_refused(run("serve", "--host", "203.0.113.1"), "203.0.113.1")
    assert_refused(run("serve", "--host", "no.such.host.invalid"), "no.such.host.invalid")


@pytest.mark.long
def test_what_cannot_be_served_is_said_before_anything_listens(tmp_path: Path) -> None:
    assert_refused(run("serve", "--port", 0, tmp_path / "none.bag"), "none.bag")
    (tmp_path / "empty.bag").touch()
    assert_refused(run("serve", "--port", 0, tmp_path / "empty.bag"), "empty")


@pytest.mark.long
def test_beyond_this_machine_a_token_is_demanded(serving: Callable[..., Serving], background: Path) -> None:
    server = serving(background, "--port", 0, "--host", "0.0.0.0")
    port, token = re.fullmatch(r"http://[^/]+:(\d+)/\?token=(\S{20,})", server.url).groups()
    url = f"http://127.0.0.1:{port}/api/v1/health"
    assert httpx.get(url, timeout=60).status_code == 401
    assert httpx.get(url, headers={"authorization": f"Bearer {token}"}).status_code == 200


@pytest.mark.long
def test_a_token_of_ones_own_is_demanded_anywhere(serving: Callable[..., Serving], background: Path) -> None:
    server = serving(background, "--port", 0, "--token", "my-token")
    assert server.url.endswith("/?token=my-token")
    with httpx.Client(timeout=60, follow_redirects=True) as browser:
        assert browser.get(server.url.partition("?")[0]).status_code == 401
        assert browser.get(server.url).status_code == 200
    result = run("serve", "--token", "no spaces")
    assert result.returncode == 2
    assert "Traceback" not in result.stderr


def test_a_recording_is_not_overwritten_with_its_own_result(tmp_path: Path) -> None:
    room = write_room(tmp_path / "room.npz").rename(tmp_path / "room.csv")
    before = room.read_bytes()
    assert_refused(run("process", room, "-o", room), "is the recording itself")
    assert room.read_bytes() == before


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    room = write_room(tmp_path / "room.npz")
    assert_refused(run("process", room, "-o", tmp_path / "none" / "room.csv"), "a folder that exists", "none")
    assert_refused(run("serve", "--port", "0", "--recordings", room), "is not a folder")


def test_the_version_is_told() -> None:
    assert run("--version").stdout == f"lidarcore {lidarcore.__version__}\n"
    assert run("-h").stdout == run("--help").stdout


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("gapp=1", "extraction.gapp: There is no such setting; there is gap."),
        ("foo=1", "There is no such setting; there is corner_angle, corner_gap, "),
        ("view.layer.grid=true", "view.layer: There is no such setting; there is layers."),
    ],
)
def test_an_unknown_setting_is_told_with_those_there_are(assignment: str, words: str, tmp_path: Path) -> None:
    room = write_room(tmp_path / "room.npz", scans=1)
    assert_refused(run("process", room, "-o", tmp_path / "out.csv", "--set", assignment), words)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("calibrate", "cannot be written there"),
        ("process", "cannot be written there"),
        ("localize", "cannot be written there"),
        ("map", "cannot be a folder, since"),
    ],
)
def test_what_cannot_be_written_is_told_before_the_work(command: str, words: str, tmp_path: Path) -> None:
    """The recording is not even opened."""
    (tmp_path / "file").touch()
    outputs = {"map": tmp_path / "file", "calibrate": Path("/proc/x.json")}
    output = outputs.get(command, Path("/proc/x.csv"))
    assert_refused(run(command, "no-recording.npz", "-o", output), words)


def test_a_calibration_across_stations_says_how_to_choose_one(tmp_path: Path) -> None:
    rows = [
        f"{station},{revolution},{angle},{2000 + 500 * station}"
        for station in (0, 1)
        for revolution in range(3)
        for angle in range(0, 360, 2)
    ]
    path = tmp_path / "stations.csv"
    path.write_text("\n".join(["station,rev,angle_deg,distance_mm", *rows]) + "\n")
    assert_refused(
        run("calibrate", path), "From scan 3 on", "--skip and --scans", "lidarcore evaluate stations"
    )


def test_one_is_not_many(tmp_path: Path) -> None:
    room = write_room(tmp_path / "room.npz", scans=1)
    assert run("process", room, "-o", tmp_path / "out.csv").stdout.endswith(" of 1 scan\n")


def test_localizing_where_nothing_fits_says_why(tmp_path: Path) -> None:
    """The map is given as a folder, as `lidarcore map` writes one."""
    room = write_room(tmp_path / "room.npz", scans=1)
    (tmp_path / "map").mkdir()
    grid = build_grid(list(open_recording(room)), np.zeros((1, 3)))
    write_ros_map(grid, tmp_path / "map" / "map.yaml")
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    np.savez(tmp_path / "round.npz", ranges=np.full((5, 360), 9.0), bearings=bearings)
    result = run("localize", tmp_path / "round.npz", "--map", tmp_path / "map")
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("No pose was found. ")
    assert result.stdout.endswith("5 scans, 0 of them tracked.\n")
