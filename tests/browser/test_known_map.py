"""A page that localizes in a real map of a large building, which the sensor sees a small part of."""

import gzip
import io
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from browsing import DATA, Server, Visitor
from waiting import wait_until

from lidarcore.mapping.grid import read_ros_map

pytestmark = pytest.mark.real_data
BUILDING = DATA / "turtlebot4_rplidar_rosbag2"
DRIVE = BUILDING / "macfirst_floor_take_2" / "macfirst_floor_take_2_0.db3"
NAME = "mac_1st_floor_final"


@pytest.fixture
def building(server: Server, tmp_path: Path) -> np.ndarray:
    """Where something is known in the map that is localized in, (N, 2) m."""
    (tmp_path / f"{NAME}.pgm").write_bytes(gzip.decompress((BUILDING / f"{NAME}.pgm.gz").read_bytes()))
    (tmp_path / f"{NAME}.yaml").write_bytes((BUILDING / f"{NAME}.yaml").read_bytes())
    packed = io.BytesIO()
    with ZipFile(packed, "w") as archive:
        for path in tmp_path.iterdir():
            archive.write(path, path.name)
    loaded = server.api.post("map", params={"format": "zip"}, content=packed.getvalue())
    session = loaded.raise_for_status().json()["id"]
    server.api.put("localization/map", json={"session": session}).raise_for_status()
    server.patch("settings", {"navigation": {"mode": "localize"}})
    server.show(DRIVE, 0)
    wait_until(lambda: server.get("localization")["session"] == session, "it is localized in")
    grid = read_ros_map(tmp_path / f"{NAME}.yaml")
    return grid.centres(grid.cells >= 0)


def outermost(places: np.ndarray) -> np.ndarray:
    return np.concatenate([places[places.argmin(axis=0)], places[places.argmax(axis=0)]])


def test_all_of_the_known_map_is_in_the_view_when_it_opens_and_is_fitted(visit, building: np.ndarray) -> None:
    visitor: Visitor = visit(1400, 900).open()

    def is_all_in_the_free_part() -> bool:
        stage, legend = (visitor.page.locator(name).bounding_box() for name in ("#stage", "#legend"))
        places = np.array([visitor.pixel_at(place.tolist()) for place in outermost(building)])
        is_right = places > [legend["x"] + legend["width"], stage["y"]]
        return bool((is_right & (places < [stage["x"] + stage["width"], stage["y"] + stage["height"]])).all())

    wait_until(is_all_in_the_free_part, "the map lies in the free part of the view", 10)
    visitor.page.locator("#stage").hover()
    visitor.page.mouse.wheel(0, -1000)
    wait_until(lambda: not is_all_in_the_free_part(), "the view is zoomed in", 10)
    visitor.page.keyboard.press("f")
    wait_until(is_all_in_the_free_part, "it is fitted again", 10)
