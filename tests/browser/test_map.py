"""Where the sensor is, in the page: SLAM switched on, landmarks looked at, the pose set by hand, maps kept."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
from browsing import HOKUYO, Server, Visitor
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, expect
from waiting import wait_until

from lidarcore.mapping.grid import OccupancyGrid, read_ros_map, write_ros_map

FEW = 8  # landmarks that a furnished room has soon; with fewer than half of what is in view it is not recognised
MAPPED = range(60, 75)  # scans of the real recording that are mapped, one after the other
Row = dict[str, Any]


def landmarks(server: Server) -> list[Row]:
    session = server.get("localization")["session"]
    return server.get(f"landmarks?limit=1000&session={session}")["landmarks"] if session else []


def found_in(server: Server) -> str:
    now = server.get("frame")["localization"]
    return f"{now['mode']}, {now['state']}" if now else ""


def slam(server: Server) -> None:
    """A map of its own is built, and some landmarks of it are recognised."""
    server.patch("settings", {"navigation": {"mode": "slam", "method": "landmarks", "landmarks": "corners"}})
    wait_until(lambda: recognised(server) >= FEW, "there are landmarks")


def map_recording(visitor: Visitor) -> dict:
    """A map of some scans of a real recording, the same every time; the frame of the last one, which stays."""
    server = visitor.server
    server.patch("settings", {"view": None, "clusters": None, "navigation": None})
    server.show(HOKUYO, MAPPED[0])
    server.patch("settings", {"navigation": {"mode": "slam", "method": "landmarks"}})
    for index in MAPPED:
        server.patch("source", {"index": index})
        wait_until(lambda index=index: is_mapped(server, index), f"scan {index} is mapped")
    return visitor.await_frame(server.get("frame"))


def is_mapped(server: Server, index: int) -> bool:
    """The frame is of that scan, and what is confirmed by now is on the disk."""
    frame = server.get("frame")
    now = frame["localization"]
    return (
        frame["source"]["index"] == index and now is not None and len(landmarks(server)) == now["confirmed"]
    )


def recognised(server: Server) -> int:
    """How many landmarks on the disk are in the newest frame."""
    pairs = (server.get("frame")["localization"] or {"innovations": []})["innovations"]
    return len({row["id"] for row in landmarks(server)} & {pair["landmark"] for pair in pairs})


@pytest.fixture(scope="module")
def map_page(browser: Browser, running: Server) -> Iterator[Visitor]:
    """One page for all: loading one for each would take half a minute."""
    running.reset()
    visitor = Visitor(browser.new_page(viewport={"width": 1000, "height": 640}, color_scheme="dark"), running)
    yield visitor.open()
    visitor.page.close()
    visitor.check()


@pytest.fixture
def mapped(map_page: Visitor) -> Visitor:
    """A page with the map's panel open, and a map of the emulator's room."""
    map_page.page.get_by_role("tab", name="Map").click()
    map_page.server.patch("settings", {"view": None, "clusters": None})
    map_page.server.emulate()
    map_page.server.api.post(
        "localization/reset"
    ).raise_for_status()  # poses were set by hand in the map before
    slam(map_page.server)
    return map_page


def row_texts(page: Page) -> list[list[str]]:
    rows = page.locator("#landmark-table tbody tr")
    return rows.evaluate_all("rows => rows.map(row => [...row.cells].map(cell => cell.innerText))")


def number(text: str) -> float:
    return float(text.replace("\u2212", "-"))


def test_slam_is_switched_on_and_landmarks_appear(map_page: Visitor) -> None:
    page, server = map_page.page, map_page.server
    page.get_by_role("tab", name="Map").click()
    layers = page.locator("#navigation").get_by_role("group", name="Layers")
    for part in (page.locator("#pose-panel"), layers, page.get_by_role("button", name="Set pose")):
        expect(part).to_be_hidden()
    page.locator("#navigation .segments label", has_text="Corners").first.click()
    page.locator("#navigation .segments label", has_text="SLAM").click()
    expect(page.locator("#pose-panel-state")).to_have_text("Tracking")
    wait_until(lambda: len(row_texts(page)) >= FEW, "landmarks are listed")
    frame = map_page.await_frame(server.pause())
    listed: dict[str, list[str]] = {}
    rows: list[Row] = []

    def all_are_listed() -> bool:
        rows[:] = landmarks(server)
        listed.clear()
        listed.update({name: rest for name, *rest in row_texts(page)})
        return {name: int(rest[4]) for name, rest in listed.items()} == {
            f"L{row['id']}": row["count"] for row in rows
        }

    wait_until(all_are_listed, "all are listed as they are")
    for row in rows:
        kind, x, y, sigma, *_ = listed[f"L{row['id']}"]
        variances = np.linalg.eigvalsh([[row["var_x"], row["cov_xy"]], [row["cov_xy"], row["var_y"]]])
        assert kind == row["kind"]
        assert (number(x), number(y)) == pytest.approx((row["x"], row["y"]), abs=5.1e-4)
        assert number(sigma) == pytest.approx(1e3 * np.sqrt(variances[-1]), abs=0.51)
    now = frame["localization"]
    expect(page.locator("#count-confirmed")).to_have_text(str(now["confirmed"]))
    expect(page.locator("#count-matched")).to_have_text(str(len(now["innovations"])))
    assert number(page.inner_text("#pose-x").split("\u2009")[0]) == pytest.approx(now["pose"]["x"], abs=6e-4)


def test_without_a_map_there_is_nothing_to_save_or_clear(mapped: Visitor) -> None:
    page, server = mapped.page, mapped.server
    clear, session = page.get_by_role("button", name="Clear"), server.get("localization")["session"]
    expect(clear).to_be_enabled()
    expect(page.locator("#map-save")).to_contain_text(f"Save map {session} as")
    server.patch("settings", {"navigation": {"mode": "off"}})
    expect(clear).to_be_disabled()
    expect(page.locator("#map-save a")).to_have_count(0)


@pytest.mark.long
@pytest.mark.scene
@pytest.mark.real_data
def test_landmark_clicked_shows_its_covariance_and_history(mapped: Visitor) -> None:
    page, server = mapped.page, mapped.server
    map_recording(mapped)
    ids = [f"L{row['id']}" for row in landmarks(server)]
    assert len(ids) > 3
    wait_until(lambda: [name for name, *_ in row_texts(page)] == ids, "landmarks are listed")
    page.locator("#landmark-table tbody tr").nth(2).click()
    expect(page.get_by_role("heading", name=f"Landmark {ids[2]}")).to_be_visible()
    wait_until(lambda: server.get("selection")["landmark"] == int(ids[2][1:]), "it is selected")
    expect(page.locator("#landmark dl")).to_contain_text("Covariance")
    expect(page.locator("#landmark canvas")).to_be_visible()
    page.keyboard.press("ArrowDown")
    wait_until(lambda: server.get("selection")["landmark"] == int(ids[3][1:]), "the next one")
    page.get_by_role("button", name="Close the details").click()
    expect(page.locator("#landmark canvas")).to_have_count(0)
    wait_until(lambda: server.get("selection")["landmark"] is None, "none is selected")


@pytest.mark.long
@pytest.mark.scene
def test_innovations_are_charted_with_the_band_they_should_lie_in(mapped: Visitor) -> None:
    page = mapped.page
    page.get_by_role("tab", name="Plots").click()
    figure = page.locator("#plots figure", has_text="Squared innovations")
    expect(figure.locator("output")).to_have_text(re.compile(r"^\d+$"))
    expect(page.locator("#plots figure", has_text="Innovations, mm").locator("output").first).to_have_text(
        re.compile(r"\d")
    )
    green = """canvas => {
          const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          let count = 0;
          for (let at = 0; at < data.length; at += 4)
            if (data[at + 3] && data[at + 1] > 1.3 * Math.max(data[at], data[at + 2])) count++;
          return count;
        }"""
    wait_until(lambda: figure.locator("canvas").evaluate(green) > 500, "the band is filled")
    mapped.server.patch("settings", {"navigation": {"mode": "off"}})
    expect(figure).to_have_count(0)


@pytest.mark.long
@pytest.mark.scene
@pytest.mark.real_data
def test_pose_is_set_by_dragging_in_the_scene(mapped: Visitor) -> None:
    page = mapped.page
    map_recording(mapped)
    mapped.fit()
    to_world = world_of_pixels(mapped)
    box = page.locator("#scene").bounding_box()
    start, end = np.array([0.45, 0.5]), np.array([0.6, 0.35])
    pixels = [part * [box["width"], box["height"]] for part in (start, end)]
    page.get_by_role("button", name="Set pose").click()
    expect(page.locator("#place-hint")).to_be_visible()
    with page.expect_response("**/api/v1/pose") as told:
        drag(page, *(at + np.array([box["x"], box["y"]]) for at in pixels))
    pose = json.loads(told.value.request.post_data)
    expected, to = (to_world(at) for at in pixels)
    assert told.value.ok
    assert (pose["x"], pose["y"]) == pytest.approx(expected, abs=0.05)
    assert pose["heading"] == pytest.approx(np.arctan2(*(to - expected)[::-1]), abs=0.03)
    expect(page.locator("#place-hint")).to_be_hidden()


def world_of_pixels(visitor: Visitor) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """World (2,) m of a pixel of the scene, by the pixels where the corners of the frame are drawn."""
    frame, box = visitor.server.get("frame"), visitor.page.locator("#scene").bounding_box()
    at = [visitor.pixel_of("corner", corner["id"]) for corner in frame["corners"]]
    pixels = np.array(at) - [box["x"], box["y"]]
    pose, main = frame["localization"]["pose"], frame["fitter"]
    c, s = np.cos(pose["heading"]), np.sin(pose["heading"])
    seen = np.array([[corner["by_method"][main][axis] for axis in "xy"] for corner in frame["corners"]])
    world = seen @ np.array([[c, s], [-s, c]]) + [pose["x"], pose["y"]]
    slope = np.ptp(world[:, 0]) / np.ptp(pixels[:, 0])
    middle_pixel, middle = pixels.mean(0), world.mean(0)
    return lambda at: middle + (at - middle_pixel) * [slope, -slope]


def drag(page: Page, start: NDArray[np.float64], end: NDArray[np.float64]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*((start + end) / 2))
    page.mouse.move(*end)
    page.mouse.up()


@pytest.mark.long
@pytest.mark.real_data
def test_one_click_in_the_scene_selects_the_landmark_and_the_corner_on_top_of_it(mapped: Visitor) -> None:
    page, server = mapped.page, mapped.server
    seen = map_recording(mapped)["localization"]["innovations"]
    mapped.fit()
    to_world, box = world_of_pixels(mapped), page.locator("#scene").bounding_box()
    origin, size = np.array([box["x"], box["y"]]), np.array([box["width"], box["height"]])
    in_view = [row for row in landmarks(server) if row["id"] in {pair["landmark"] for pair in seen}]
    drawn_at = {row["id"]: np.array(mapped.pixel_of("landmark", row["id"])) for row in in_view}
    wanted = min(in_view, key=lambda row: np.linalg.norm(drawn_at[row["id"]] - origin - size / 2))
    pixel = drawn_at[wanted["id"]]  # in the middle: under none of the controls
    assert np.linalg.norm(to_world(pixel - origin) - [wanted["x"], wanted["y"]]) < 0.15

    def one_click_selects_both() -> bool:
        """Once the page has drawn what is clicked."""
        page.mouse.click(*pixel)
        page.wait_for_timeout(1000)
        return server.get("selection")["landmark"] is not None

    wait_until(one_click_selects_both, "something is selected")
    wait_until(lambda: server.get("selection")["corner"] is not None, "the corner too")
    assert server.get("selection")["landmark"] == wanted["id"], (seen, in_view, pixel)
    expect(page.get_by_role("heading", name=f"Landmark L{wanted['id']}")).to_be_in_viewport()


@pytest.mark.long
@pytest.mark.scene
def test_setting_a_pose_is_given_up_by_escape_and_can_be_done_in_numbers(mapped: Visitor) -> None:
    page = mapped.page
    hint, catcher = page.locator("#place-hint"), page.frame_locator("#scene").locator(".pose-catcher")
    page.keyboard.press("i")
    expect(catcher).to_be_visible()
    page.keyboard.press("Escape")
    expect(hint).to_be_hidden()
    expect(catcher).to_have_count(0)
    page.get_by_role("button", name="Set pose").click()
    page.get_by_label("x, m").fill("0.1")
    page.get_by_label("y, m").fill("-0.05")
    page.get_by_label("Heading, °").fill("90")
    with page.expect_response("**/api/v1/pose") as told:
        page.get_by_role("button", name="Set", exact=True).click()
    assert json.loads(told.value.request.post_data) == pytest.approx(
        {"x": 0.1, "y": -0.05, "heading": np.pi / 2}
    )


@pytest.mark.long
def test_map_is_saved_loaded_localized_in_and_deleted(mapped: Visitor) -> None:
    page, server = mapped.page, mapped.server
    session = server.get("localization")["session"]
    with page.expect_download() as saved:
        page.get_by_role("link", name=f"Save map {session} as JSON").click()
    assert saved.value.suggested_filename == f"map-{session}.json"
    kept = json.loads(saved.value.path().read_text())["landmarks"]
    assert len(kept) >= FEW
    file = {"name": "room.json", "mimeType": "application/json", "buffer": saved.value.path().read_bytes()}
    page.locator("#map-file").set_input_files(file)
    expect(page.locator(".toast")).to_contain_text(f"room.json: {len(kept)} landmarks")
    page.get_by_role("button", name="Localize in it").click()
    wait_until(lambda: server.get("localization")["session"] not in (None, session), "it is the map in use")
    loaded = server.get("localization")["session"]
    wait_until(lambda: found_in(server) == "localize, tracking", "the room is recognised")
    expect(page.locator("#pose-panel-state")).to_have_text("Tracking")
    assert server.get("settings")["navigation"]["mode"] == "localize"
    assert {(row["x"], row["y"]) for row in landmarks(server)} == {(row["x"], row["y"]) for row in kept}
    expect(page.locator("#map-list [aria-current]")).to_contain_text(f"Map {loaded}")
    wait_until(lambda: len(row_texts(page)) == len(kept), "its landmarks are listed")
    page.get_by_role("button", name=f"Delete map {session}").click()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.get_by_role("button", name=f"Delete map {session}")).to_have_count(0)
    assert session not in [entry["id"] for entry in server.get("sessions")["sessions"]]


def test_slam_ends_for_another_map_only_after_a_question(mapped: Visitor) -> None:
    page, server = mapped.page, mapped.server
    session = server.get("localization")["session"]
    page.get_by_title(f"Localize in map {session}").click()
    expect(page.locator(".toast")).to_contain_text("cannot be gone on with")
    assert server.get("settings")["navigation"]["mode"] == "slam"
    page.get_by_role("button", name="Localize", exact=True).click()
    wait_until(lambda: server.get("settings")["navigation"]["mode"] == "localize", "it is localized")
    wait_until(lambda: server.get("localization")["session"] == session, "it is that map")


def test_a_map_of_ros_is_loaded_as_two_files_and_localized_in(mapped: Visitor, tmp_path: Path) -> None:
    page, server = mapped.page, mapped.server
    cells = np.full((80, 120), -1)
    cells[10:70, 10:110] = 0
    cells[10, 10:110] = cells[69, 10:110] = cells[10:70, 10] = cells[10:70, 109] = 100
    write_ros_map(OccupancyGrid(cells, 0.05, np.zeros(3)), tmp_path / "hall.yaml")
    page.locator("#map-file").set_input_files([tmp_path / "hall.yaml", tmp_path / "hall.pgm"])
    expect(page.locator(".toast")).to_contain_text("hall.yaml: a grid")
    page.get_by_role("button", name="Localize in it").click()
    wait_until(lambda: server.get("localization")["method"] == "scans", "whole scans look for the pose")
    session = server.get("localization")["session"]
    expect(page.locator("#map-list [aria-current]")).to_contain_text("a grid")
    expect(page.locator("#pose-panel-state")).to_have_text(re.compile("Not found|Coasting|Tracking"))
    with page.expect_download() as saved:
        page.get_by_role("link", name=f"Save map {session} as ROS map").click()
    with ZipFile(saved.value.path()) as archive:
        archive.extractall(tmp_path / "back")
    np.testing.assert_array_equal(read_ros_map(tmp_path / "back" / "map.yaml").cells, cells)


@pytest.mark.long
def test_file_that_is_no_map_is_refused_in_plain_words(mapped: Visitor) -> None:
    mapped.tolerated.append("422")
    file = {"name": "room.json", "mimeType": "application/json", "buffer": b'{"unit": "mm"}'}
    mapped.page.locator("#map-file").set_input_files(file)
    expect(mapped.page.locator(".toast.error")).to_contain_text(
        "unit should be 'm' and is 'mm'. Convert the file"
    )


@pytest.mark.long
def test_link_keeps_the_mode_and_what_the_landmarks_are(
    mapped: Visitor, visit: Callable[..., Visitor]
) -> None:
    page, server = mapped.page, mapped.server
    mode = {"mode": "slam", "method": "landmarks", "landmarks": "clusters"}
    server.patch("settings", {"clusters": {"method": "dbscan"}, "navigation": mode})
    page.wait_for_url("**mode=slam&method=landmarks&landmarks=clusters&clusters=dbscan**")
    link = page.url.partition("#")[2]
    server.patch("settings", {"clusters": None, "navigation": None})
    visit().open(f"#{link}")
    wait_until(lambda: server.get("settings")["clusters"]["method"] == "dbscan", "the method is set")
    assert server.get("settings")["navigation"].items() >= mode.items()


@pytest.mark.long
def test_map_of_the_recording_opened_next_is_shown_at_once(mapped: Visitor) -> None:
    """SLAM goes on from the emulator into a recording, whose map is another one."""
    server, page = mapped.server, mapped.page
    server.reset()
    slam(server)
    before = server.get("localization")["session"]
    expect(page.locator("#landmark-count")).not_to_have_text("0")
    server.api.put("source", json={"kind": "recording", "name": "emulated-s1.mcap"}).raise_for_status()
    wait_until(lambda: server.get("localization")["session"] not in (None, before), "another map is built")
    used = server.get("localization")["session"]
    expect(page.get_by_title(f"Localize in map {used}")).to_have_attribute("aria-current", "true")
    expect(page.locator("#landmark-count")).not_to_have_text("0")
    wait_until(lambda: len(landmarks(server)) >= FEW, "there are landmarks")
    server.pause()
    wait_until(
        lambda: page.locator("#landmark-count").inner_text() == str(len(landmarks(server))), "all are counted"
    )


@pytest.mark.long
def test_simulation_is_set_up_and_started(mapped: Visitor) -> None:
    page, server = mapped.page, mapped.server
    page.get_by_role("tab", name="Source").click()
    page.get_by_label("World").select_option(label="Corridor")
    page.locator("#simulation summary").click()
    page.get_by_role("spinbutton", name="Field of view in °").fill("180")
    page.get_by_role("button", name="Start", exact=True).click()
    expect(page.locator("#readout-source")).to_have_text("Simulated robot")
    page.get_by_role("tab", name="Map").click()
    expect(page.locator("#comparison")).to_contain_text("True pose")
    expect(page.locator("#legend")).to_contain_text("True path")
    wait_until(lambda: server.get("frame")["source"]["kind"] == "simulation", "frames of it come")
    bearings = [np.arctan2(y, x) for x, y in server.get("frame?points=true")["points"]]
    assert max(np.abs(bearings)) == pytest.approx(np.pi / 2, abs=0.05)


@pytest.mark.long
def test_a_recording_that_plays_too_fast_for_a_map_says_so(mapped: Visitor) -> None:
    server, page = mapped.server, mapped.page
    server.patch("settings", {"navigation": {"mode": "slam", "method": "scans"}})
    said = page.locator("#pose-panel-message")
    recording = {"kind": "recording", "name": "real-rplidar-windsor.npz", "paused": True}
    server.api.put("source", json=recording).raise_for_status()
    server.patch("source", {"speed": 100, "loop": False, "state": "playing"})
    wait_until(lambda: server.get("source")["state"] == "ended", "it has been played")
    expect(said).to_contain_text("scans were skipped")
    server.patch("source", {"index": 0, "state": "paused", "speed": 0})
    page.get_by_role("button", name="Reset", exact=True).click()
    expect(said).not_to_contain_text("skipped")
    server.patch("source", {"state": "playing"})
    wait_until(lambda: server.get("source")["state"] == "ended", "it has been played again")
    expect(said).not_to_contain_text("skipped")
