"""A page that localizes in a real map of a large building, which the sensor sees a small part of."""

import gzip
import io
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from browsing import DATA, Server, Visitor
from lidarcore_app.scene.colours import rgb
from lidarcore_app.scene.palette import PALETTE
from playwright.sync_api import expect
from waiting import wait_until

from lidarcore.mapping.grid import read_ros_map

pytestmark = pytest.mark.real_data
BUILDING = DATA / "turtlebot4_rplidar_rosbag2"
DRIVE = BUILDING / "macfirst_floor_take_2" / "macfirst_floor_take_2_0.db3"
ELSEWHERE = DATA / "ccny_hokuyo_rosbag1" / "demo.bag"
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


def pixels_of(visitor: Visitor, name: str) -> int:
    """How many pixels of the scene have a colour of the palette."""
    return int((np.abs(visitor.picture() - rgb(PALETTE["dark"][name])).max(axis=2) <= 3).sum())


def saved_drawing(visitor: Visitor) -> str:
    with visitor.page.expect_download() as saved:
        visitor.page.locator("#save-svg").click()
    return saved.value.path().read_text()


@pytest.mark.scene
def test_a_scan_that_is_not_found_in_the_map_is_drawn_faintly_and_without_an_ellipse(
    visit: Callable[..., Visitor], building: np.ndarray
) -> None:
    visitor = visit(1400, 900).open()
    visitor.server.show(ELSEWHERE, 0)
    visitor.page.get_by_role("tab", name="Map").click()
    expect(visitor.page.locator("#pose-panel-state")).to_have_text("Not found in the map yet")
    wait_until(lambda: pixels_of(visitor, "tentative") > 50, "its points are faint")
    assert pixels_of(visitor, "points") == 0
    expect(visitor.page.locator("#legend")).not_to_contain_text("Position")
    assert "Not placed in the map" in saved_drawing(visitor)


def test_of_a_pose_that_is_lost_the_page_says_so_in_sensible_figures(
    visit: Callable[..., Visitor], building: np.ndarray
) -> None:
    visitor = visit(1400, 900).open()
    server, page = visitor.server, visitor.page
    server.show(ELSEWHERE, 0)
    page.get_by_role("tab", name="Map").click()
    vague = {"x": 0, "y": -20, "heading": 0, "sigma_position": 20, "sigma_heading": 3}
    server.api.post("pose", json=vague).raise_for_status()
    wait_until(lambda: server.step(1)["localization"]["state"] == "lost", "it is lost")
    visitor.await_frame(server.get("frame"))
    expect(page.locator("#pose-sigma-x")).to_have_text("±\u200910.0\u2009m")
    expect(page.locator("#pose-sigma-heading")).to_have_text("unknown")
    expect(page.locator("#legend")).not_to_contain_text("Position")
    assert "Not placed in the map" in saved_drawing(visitor)
