"""SLAM from whole scans on a real server that plays a simulated robot: pose, grid and walls over REST."""

import io
from itertools import islice
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import ezdxf
import numpy as np
import pytest
from lidarcore_app.jobs.maps.wall_writer import CONFIRMED
from PIL import Image
from serving import Server, assert_problem, wait_until

from lidarcore.mapping.grid import read_ros_map, shades_of
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

WHOLE_SCANS = {"navigation": {"mode": "slam", "method": "scans"}}
LANDMARKS = {"navigation": {"mode": "slam", "method": "landmarks"}}


def free_area(server: Server) -> float:
    """m² that the grid says are free; 0 if there is none yet."""
    answer = server.http.get("/map/grid")
    if answer.status_code in (404, 503):
        return 0.0
    shades = np.asarray(Image.open(io.BytesIO(answer.content)))
    return float((shades == 254).sum()) * float(answer.headers["Grid-Resolution"]) ** 2


def first_pose(server: Server) -> dict[str, float]:
    """Where the trajectory begins; at stamp 0 while it has no pose yet."""
    poses = server.get("/trajectory", limit=10_000)["poses"]
    return poses[0] if poses else {"stamp": 0.0, "x": 0.0, "y": 0.0, "heading": 0.0}


def assert_kept_plan_shows_the_walls(server: Server) -> None:
    """The floor plan of the map in the file: a line for each of its walls, and each corner once, where walls end."""
    session = max(server.get("/sessions")["sessions"], key=lambda each: each["id"])
    asked = {"session": session["id"], "format": "dxf"}
    plan = ezdxf.read(io.StringIO(server.http.get("/map", params=asked).text)).modelspace()
    assert len(plan.query("LINE")) == session["walls"] > 4
    corners = np.array([point.dxf.location.vec2 for point in plan.query("POINT")])
    ends = np.array([(line.dxf.start.vec2, line.dxf.end.vec2) for line in plan.query("LINE")]).reshape(-1, 2)
    assert len(corners) >= 2
    for k, corner in enumerate(corners):
        assert np.hypot(*(ends - corner).T).min() < 2e-3
        assert np.hypot(*(np.delete(corners, k, axis=0) - corner).T).min() > 2e-3
    picture = ElementTree.fromstring(server.http.get("/map", params=asked | {"format": "svg"}).text)
    walls = picture.find(".//*[@id='walls']")
    assert walls is not None
    assert len(walls) == session["walls"]


def test_the_map_grows_and_a_new_one_begins_with_another_source_or_method(
    driving: Server, tmp_path: Path
) -> None:
    assert driving.get("/settings")["navigation"]["method"] == "scans"
    assert "scans" in assert_problem(driving.http.get("/map/grid"), 404)["detail"]
    driving.change("PATCH", "/settings", WHOLE_SCANS)

    # A room has 5.9 m by 5 m: from its middle nearly all of it is seen, and more through the doors as the robot goes.
    wait_until(lambda: free_area(driving) > 20, "most of the room is free")
    wait_until(lambda: free_area(driving) > 35, "the room beside it is seen, too")
    wait_until(lambda: driving.http.get("/walls").status_code == 200, "there are walls")
    walls = driving.get("/walls")["walls"]
    longest = max(walls, key=lambda wall: wall["length"])
    assert longest["length"] > 3
    assert np.linalg.eigvalsh(longest["covariance"]).min() > 0
    answer = driving.http.get("/walls", params={"format": "csv"})
    assert answer.headers["content-disposition"] == 'attachment; filename="walls.csv"'
    table = answer.text.splitlines()
    assert table[0].startswith("id,alpha_rad,r_m")

    answer = driving.http.get("/walls/nearest", params={"x": 0, "y": 0, "k": 2, "min_length": 2}).json()
    assert answer["distances"] == sorted(answer["distances"])
    assert min(wall["length"] for wall in answer["walls"]) >= 2
    x, y = np.mean([longest["start"], longest["end"]], axis=0)
    around = driving.http.get(
        "/walls", params={"x": x, "y": y, "radius": 0.3, "format": "csv"}
    ).text.splitlines()
    assert 2 <= len(around) <= len(table)
    assert driving.http.get("/walls", params={"bbox": "90,90,99,99"}).json() == {"walls": []}
    assert_problem(driving.http.get("/walls", params={"min_length": 3, "max_length": 2}), 422)
    alone = assert_problem(driving.http.get("/walls", params={"tolerance": 0.2}), 422)
    assert "give direction, too" in alone["detail"]

    answer = driving.http.get("/map/grid", params={"format": "zip"})
    assert answer.headers["content-disposition"] == 'attachment; filename="map.zip"'
    with ZipFile(io.BytesIO(answer.content)) as archive:
        assert {"map.pgm", "map.yaml", "walls.csv", "plan.svg", "plan.dxf"} <= set(archive.namelist())
        archive.extractall(tmp_path / "map")
    grid = read_ros_map(tmp_path / "map" / "map.yaml")
    assert (shades_of(grid) == 254).sum() * grid.resolution**2 > 35

    def newer() -> list[dict[str, Any]]:
        found = driving.get("/walls")["walls"]
        grown = max(wall["last_seen"] for wall in found) > max(wall["last_seen"] for wall in walls)
        return found if grown else []

    wait_until(newer, "there is a newer picture of the walls")
    later = {wall["id"]: wall for wall in newer()}
    same = [(wall, later[wall["id"]]) for wall in walls if wall["id"] in later]
    assert len(same) > len(walls) / 2
    for first, then in same:
        way, way_then = (np.subtract(wall["end"], wall["start"]) / wall["length"] for wall in (first, then))
        middle = np.add(first["start"], first["end"]) / 2
        assert way @ way_then > 0.9
        assert abs(np.subtract(middle, then["start"]) @ [-way_then[1], way_then[0]]) < 0.3

    driving.change("PATCH", "/source", {"state": "paused"})
    wait_until(lambda: driving.get("/sessions")["store"]["behind_s"] == 0, "the walls are kept")
    assert_kept_plan_shows_the_walls(driving)
    told = [driving.get(f"/walls/{wall['id']}/history") for wall in driving.get("/walls")["walls"]]
    assert any(of["history"] for of in told)
    # A wall that too few keyframes saw is in the map, but nothing of it is kept.
    assert all(of["history"] or of["wall"]["count"] < CONFIRMED for of in told)
    driving.change("PATCH", "/source", {"state": "playing"})

    before = driving.next_frame()
    where = before["localization"]
    assert where["state"] == "tracking"
    x, y, _ = where["truth"]
    assert np.hypot(where["pose"]["x"] - x, where["pose"]["y"] - y) < 0.1
    assert_problem(driving.http.post("/pose", json={"x": 1, "y": 0, "heading": 0}), 409)

    driving.change("PATCH", "/settings", LANDMARKS)
    wait_until(lambda: driving.http.get("/map/grid").status_code == 404, "no stale map stays")
    driving.change("PATCH", "/settings", WHOLE_SCANS)
    wait_until(lambda: free_area(driving) > 20, "a new map grows")
    first = first_pose(driving)
    assert first["stamp"] >= before["stamp"]
    assert (first["x"], first["y"], first["heading"]) == pytest.approx((0, 0, 0), abs=1e-9)

    # The scan in view begins the new map, so there may be no moment without one.
    wait_until(
        lambda: driving.next_frame()["stamp"] > first["stamp"], "the map is older than the scan in view"
    )
    driving.change("POST", "/localization/reset", None)
    wait_until(lambda: first_pose(driving)["stamp"] > first["stamp"], "a reset begins a new map")
    first = first_pose(driving)
    assert (first["x"], first["y"], first["heading"]) == pytest.approx((0, 0, 0), abs=1e-9)


def test_what_the_map_makes_of_the_last_scans_is_shown_when_no_further_one_comes(server: Server) -> None:
    """Walls are sought behind the scans: where a recording has ended, a page has those that REST tells.

    A noise that is set then is that of its walls.
    """
    scans = list(islice(SimulatedRobot(SimulationSettings(world="furnished room", seed=3)), 150))
    np.savez(
        server.folder / "drive.npz",
        ranges=np.array([scan.ranges for scan in scans]),
        bearings=scans[0].bearings,
        stamps=np.array([scan.stamp for scan in scans]),
    )

    def last_seen() -> float:
        answer = server.http.get("/walls")
        walls = answer.json()["walls"] if answer.is_success else []
        return max((wall["last_seen"] for wall in walls), default=0.0)

    server.change("PATCH", "/settings", WHOLE_SCANS)
    server.change("PATCH", "/source", {"speed": 0, "loop": False})
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": "drive.npz"})
        last = scans[-1].stamp  # walls of what was played before were seen at other times
        wait_until(lambda: last - 1 < last_seen() <= last, "the walls know the last scans")
        stream.until("walls", lambda told: told["walls"] == server.get("/walls")["walls"])
    assert server.get("/source")["state"] == "ended"

    def best_known() -> float:
        """m² of the length that is known best."""
        return min(wall["length_variance"] for wall in server.get("/walls")["walls"])

    before = best_known()
    server.change("PATCH", "/settings", {"extraction": {"noise": {"sigma_range": 0.1}}})
    wait_until(lambda: best_known() > 4 * before, "the walls are as noisy as was set")
