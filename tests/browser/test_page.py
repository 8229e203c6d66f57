"""The page lives: it loads from this machine alone, draws, and follows the frames."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from browsing import GOLF, Visitor, drawn
from playwright.sync_api import expect
from waiting import wait_until

# But those while the camera glides to where it sees all of the room.
COUNT_PICTURES = """() => {
  const { scene, camera } = document.querySelector("#scene").contentWindow.__viserMutable;
  const before = scene.onBeforeRender;
  let seen = "";
  window.pictures = 0;
  scene.onBeforeRender = () => {
    const now = `${camera.matrixWorld.elements}`;
    if (now === seen) window.pictures++;
    seen = now;
    before();
  };
}"""


@pytest.mark.scene
def test_page_loads_and_asks_only_this_machine(visitor: Visitor) -> None:
    expect(visitor.page).to_have_title("Emulated S1 · lidarcore")
    expect(visitor.page.locator("#connection")).to_have_text("Connected")
    expect(visitor.page.locator("#banner")).to_be_hidden()
    paths = [url.removeprefix(visitor.server.url) for url in visitor.asked]
    assert {"/static/js/main.js", "/viser/", "/api/v1/methods"} <= set(paths)
    visitor.check()


def test_of_buttons_in_a_row_only_the_outer_corners_are_round(visitor: Visitor) -> None:
    page = visitor.page
    page.get_by_role("tab", name="Source").click()
    buttons = page.locator("#kinds button")
    expect(buttons).to_have_count(4)
    radii = buttons.evaluate_all("nodes => nodes.map((node) => getComputedStyle(node).borderRadius)")
    assert radii[1:-1] == ["0px", "0px"]
    assert "0px" in radii[0] != "0px"


@pytest.mark.long
@pytest.mark.scene
def test_scene_shows_the_room(visitor: Visitor) -> None:
    def fills_the_scene() -> bool:
        picture = drawn(visitor.picture())
        rows, columns = picture.nonzero()
        height, width = picture.shape
        return picture.mean() > 0.01 and np.ptp(rows) > height / 2 and np.ptp(columns) > width / 3

    wait_until(fills_the_scene, "the room fills the scene")


@pytest.mark.scene
def test_frames_advance_in_figures_and_picture(visitor: Visitor) -> None:
    first, picture = int(visitor.readout("frame")), visitor.picture()
    wait_until(lambda: int(visitor.readout("frame")) > first + 5, "later frames are shown")
    wait_until(lambda: (visitor.picture() != picture).any(), "the picture changes")


@pytest.mark.long
@pytest.mark.scene
def test_the_scene_is_drawn_once_for_each_scan(visitor: Visitor) -> None:
    visitor.server.pause()
    before = visitor.still_picture(seconds=1.5)
    visitor.page.evaluate(COUNT_PICTURES)
    begin = time.monotonic()
    for _ in range(8):
        visitor.await_frame(visitor.server.step(1))
        before = visitor.still_picture(differs_from=before)
    count = visitor.page.evaluate("window.pictures")
    seldom = time.monotonic() - begin  # viser looks once a second whether something was forgotten
    assert count <= 2 * 8 + seldom


@pytest.mark.real_data
def test_while_a_recording_is_paused_nothing_comes_at_any_rate(visitor: Visitor) -> None:
    visitor.server.show(GOLF, 2)
    rate, latency = (visitor.page.locator(f"#readout-{name}") for name in ("rate", "latency"))
    expect(rate).to_have_text("\u2013")
    expect(latency).to_have_text("\u2013")
    visitor.server.patch("source", {"state": "playing"})
    expect(rate).to_contain_text("Hz")
    expect(latency).to_contain_text("ms")


@pytest.mark.long
@pytest.mark.scene
def test_the_stream_alone_brings_the_frames(visitor: Visitor) -> None:
    first = int(visitor.readout("frame"))
    asked = len(visitor.asked)
    wait_until(lambda: int(visitor.readout("frame")) > first + 25, "later frames are shown")
    assert not [url for url in visitor.asked[asked:] if "/frame" in url or "/health" in url]


@pytest.mark.long
def test_figures_are_those_of_the_frame(visitor: Visitor) -> None:
    page, frame = visitor.page, visitor.await_frame(visitor.server.pause())
    assert visitor.readout("corners") == str(len(frame["corners"]))
    assert visitor.readout("segments") == str(len(frame["segments"][frame["fitter"]]))
    assert page.locator("#corner-table tbody tr").count() == len(frame["corners"])


@pytest.mark.long
@pytest.mark.scene
def test_plots_follow_the_frames(visitor: Visitor) -> None:
    page = visitor.page
    page.get_by_role("tab", name="Plots").click()
    expect(page.locator("#plots figure")).to_have_count(3)
    inked = "canvas => canvas.getContext('2d').getImageData(0, 0, 300, 200).data.some(value => value > 0)"
    wait_until(lambda: page.locator("#plots canvas").first.evaluate(inked), "the first one is drawn")
    shown = page.locator("#plots figure").nth(2).locator("output").first
    before = shown.inner_text()
    wait_until(lambda: shown.inner_text() != before, "the median area is updated")


@pytest.mark.real_data
def test_a_long_name_takes_the_place_of_figures_and_not_of_the_panel(visit: Callable[..., Visitor]) -> None:
    visitor = visit(1400, 900).open()
    name = "the_third_floor_of_the_old_building_in_the_afternoon.csv.gz"
    (visitor.server.folder / name).write_bytes(GOLF.read_bytes())
    visitor.server.api.put("source", json={"kind": "recording", "name": name}).raise_for_status()
    expect(visitor.page.locator("#readout-source")).to_have_text(name)
    panel, help_ = (visitor.page.locator(one).bounding_box() for one in ("#setup", "#help"))
    assert panel["x"] + panel["width"] == 1400
    assert help_["x"] + help_["width"] <= 1400
    figures = visitor.page.locator("#readouts").bounding_box()
    links = visitor.page.get_by_role("navigation", name="Page").bounding_box()
    assert figures["x"] + figures["width"] <= links["x"]
