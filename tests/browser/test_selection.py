"""What is drawn over the scene: marks with sizes of the screen, told apart, and selected by a click or a tap."""

import base64
import re
from collections.abc import Callable
from math import hypot

import numpy as np
import pytest
from browsing import HOKUYO, Visitor
from playwright.sync_api import expect
from scipy import ndimage
from waiting import wait_until

pytestmark = pytest.mark.real_data

METHODS = ("arras_siegwart", "cwlf", "utls", "wtls", "wctls", "ml")
NOTHING = {layer: False for layer in ("points", "segments", "corners", "ellipses", "grid", "sensor")}
INK = """() => {
  const canvas = document.getElementById("overlay");
  const {data, width, height} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return [width, height, btoa(Array.from(data, (byte) => String.fromCharCode(byte)).join(""))];
}"""


@pytest.fixture
def still(visitor: Visitor) -> Visitor:
    """A page that shows one scan of a real recording. The scene is a blank page: what is over it needs none."""
    visitor.server.show(HOKUYO, 60)
    visitor.await_frame(visitor.server.get("frame"))
    return visitor


def show(visitor: Visitor, **view: object) -> None:
    """Set the view; the page has drawn it."""
    visitor.server.patch("settings", {"view": view})
    wait_until(lambda: visitor.knows("settings") == visitor.server.get("settings"), "the page has it")
    visitor.page.wait_for_timeout(200)


def inked(visitor: Visitor) -> np.ndarray:
    """(H, W, 4) pixels of what is drawn over the scene."""
    width, height, data = visitor.page.evaluate(INK)
    return np.frombuffer(base64.b64decode(data), np.uint8).reshape(height, width, 4)


def zoom(visitor: Visitor, x: float, y: float, steps: int) -> None:
    visitor.page.mouse.move(x, y)
    for _ in range(abs(steps)):
        visitor.page.mouse.wheel(0, -200 if steps > 0 else 200)
    visitor.page.wait_for_timeout(200)


def ids_by_x(visitor: Visitor) -> list[int]:
    frame = visitor.server.get("frame")
    return [c["id"] for c in sorted(frame["corners"], key=lambda c: c["by_method"][frame["fitter"]]["x"])]


@pytest.mark.long
def test_corners_are_six_pixels_across_at_every_zoom(still: Visitor) -> None:
    show(still, layers=NOTHING | {"corners": True})
    corner = ids_by_x(still)[0]
    spans = []
    for steps in (0, 3, 3):
        zoom(still, *still.pixel_of("corner", corner), steps)
        x, y = still.pixel_of("corner", corner)
        box = still.page.locator("#scene").bounding_box()
        labels, _ = ndimage.label(inked(still)[..., 3] > 127)
        spot = labels == labels[round(y - box["y"]), round(x - box["x"])]
        spans.append([np.ptp(axis) + 1 for axis in spot.nonzero()])
    assert np.abs(np.array(spans) - 6).max() <= 1, spans


def test_six_methods_are_six_outlines_at_every_zoom(still: Visitor) -> None:
    """From the corner outwards, each method's colour is met where no other one is."""
    show(still, compare=True, layers=NOTHING | {"ellipses": True})
    wait_until(lambda: set(still.knows("frame")["methods"]) == set(METHODS), "all methods are in the frame")
    still.page.wait_for_timeout(200)
    methods = {method["name"]: method for method in still.server.get("methods")["fitters"]}
    colours = {name: [int(methods[name]["colour"][i : i + 2], 16) for i in (1, 3, 5)] for name in METHODS}
    corner = ids_by_x(still)[0]
    for steps in (0, 3, 3):
        zoom(still, *still.pixel_of("corner", corner), steps)
        x, y = still.pixel_of("corner", corner)
        box = still.page.locator("#scene").bounding_box()
        row, column = round(y - box["y"]), round(x - box["x"])
        around = inked(still)[max(0, row - 220) : row + 220, max(0, column - 220) : column + 220].astype(int)
        for name, colour in colours.items():
            alike = (np.abs(around[..., :3] - colour).max(axis=2) < 24) & (around[..., 3] > 160)
            assert alike.sum() >= 12, (name, steps)


@pytest.mark.long
def test_row_selected_in_the_table_is_ringed(still: Visitor) -> None:
    ids = ids_by_x(still)
    for id_ in (ids[0], ids[-1]):
        still.page.get_by_role("button", name=f"C{id_}", exact=True).click()
        wait_until(lambda id_=id_: still.server.get("selection")["corner"] == id_, "it is selected")
        x, y = still.pixel_of("corner", id_)
        box = still.page.locator("#scene").bounding_box()
        row, column = round(y - box["y"]), round(x - box["x"])
        wait_until(lambda c=column, r=row: inked(still)[r, c + 12, 3] > 127, "a ring is drawn")
        still.page.keyboard.press("Escape")
        wait_until(lambda c=column, r=row: inked(still)[r, c + 12, 3] < 127, "the ring is gone")


@pytest.mark.long
def test_corner_clicked_over_the_scene_is_selected_in_the_table(still: Visitor) -> None:
    id_ = ids_by_x(still)[1]
    x, y = still.pixel_of("corner", id_)
    still.page.mouse.click(x + 3, y - 3)
    row = still.page.locator("#corner-table tr.selected")
    expect(row).to_contain_text(f"C{id_}")
    expect(row).to_be_in_viewport(ratio=0.9)
    expect(row.get_by_role("button")).to_have_attribute("aria-pressed", "true")
    wait_until(lambda: still.server.get("selection")["corner"] == id_, "the server knows")


@pytest.mark.long
def test_pointer_over_a_corner_says_what_it_is(still: Visitor) -> None:
    frame = still.server.get("frame")
    corner = frame["corners"][0]
    still.page.mouse.move(*still.pixel_of("corner", corner["id"]))
    hover = still.page.locator("#hover")
    expect(hover).to_contain_text(f"Corner C{corner['id']}")
    sigma = 1e3 * corner["by_method"][frame["fitter"]]["sigma_x"]
    expect(hover).to_contain_text(f"± {sigma:.1f}")


def test_tap_on_a_phone_selects_and_the_legend_leaves_the_room_free(visit: Callable[..., Visitor]) -> None:
    phone = visit(390, 844, has_touch=True, is_mobile=True).open()
    phone.server.show(HOKUYO, 60)
    stays = phone.server.get("frame")["sequence"]
    wait_until(lambda: phone.knows("frame")["sequence"] == stays, "the page shows it")
    expect(phone.page.locator("#legend-body")).to_be_hidden()
    id_ = ids_by_x(phone)[0]
    phone.page.touchscreen.tap(*phone.pixel_of("corner", id_))
    wait_until(lambda: phone.server.get("selection")["corner"] == id_, "it is selected")


@pytest.mark.long
def test_arrow_keys_walk_through_the_table(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    server.show(HOKUYO, 60)
    ids = sorted(ids_by_x(visitor))
    page.get_by_role("button", name=f"C{ids[0]}", exact=True).focus()
    page.keyboard.press("Enter")
    for key, expected in (("ArrowDown", ids[1]), ("End", ids[-1]), ("ArrowUp", ids[-2]), ("Home", ids[0])):
        page.keyboard.press(key)
        wait_until(lambda expected=expected: server.get("selection")["corner"] == expected, f"{key} selects")
        expect(page.locator("#corner-table button:focus")).to_have_text(f"C{expected}")


@pytest.mark.long
def test_pointer_over_a_point_says_how_far_its_beam_went(still: Visitor) -> None:
    scan = still.server.get("frame?points=true")
    far = max(scan["points"], key=lambda xy: hypot(*xy))
    still.page.mouse.move(*still.pixel_at(far))
    hover = still.page.locator("#hover")
    expect(hover).to_contain_text("Beam")
    away = float(re.search(r"met something at ([\d.]+) m", hover.inner_text())[1])
    assert away == pytest.approx(hypot(*far), abs=0.1)  # the next one within four pixels may be meant


@pytest.mark.long
def test_pointer_over_the_trail_says_when_the_sensor_was_there(visitor: Visitor) -> None:
    server = visitor.server
    server.patch("settings", {"navigation": {"mode": "slam"}, "view": {"layers": {"sensor": False}}})
    wait_until(lambda: len(server.get("trajectory")["poses"]) > 5, "there is a trail")
    visitor.await_frame(server.pause())
    pose = server.get("trajectory")["poses"][-1]
    visitor.page.mouse.move(*visitor.pixel_at([pose["x"], pose["y"]]))
    hover = visitor.page.locator("#hover")
    expect(hover).to_contain_text(re.compile(r"Trail: the sensor \d+.s ago"))
    expect(hover).to_contain_text(re.compile(r"heading .*° ± "))
