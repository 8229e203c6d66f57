"""A corner selected in the table is marked in the scene, and the other way round."""

import numpy as np
import pytest
from browsing import HOKUYO, Pixels, Visitor, drawn
from playwright.sync_api import expect
from scipy import ndimage
from waiting import wait_until

pytestmark = pytest.mark.real_data

ONLY_CORNERS = {layer: False for layer in ("points", "segments", "ellipses", "grid", "sensor")}


@pytest.fixture
def still(visitor: Visitor) -> Visitor:
    """A page that shows one scan of a real recording, and of it only the corners' markers."""
    visitor.server.show(HOKUYO, 60)
    visitor.fit()
    visitor.server.patch("settings", {"view": {"layers": ONLY_CORNERS}})
    corners = len(ids_by_x(visitor))
    wait_until(lambda: len(markers(visitor.picture())) == corners, "each corner is a marker of its own")
    return visitor


def markers(picture: Pixels) -> list[tuple[float, float]]:
    """(x, y) pixels of what stands alone in the picture, away from its edge, the buttons and the legend."""
    shown = drawn(picture)
    shown[:, :8] = shown[-3:] = shown[:, -60:] = shown[-90:, :230] = False
    labels, count = ndimage.label(shown)
    return sorted((x, y) for y, x in ndimage.center_of_mass(shown, labels, range(1, count + 1)))


def ids_by_x(visitor: Visitor) -> list[int]:
    corners = visitor.server.get("frame")["corners"]
    main = visitor.server.get("frame")["fitter"]
    return [c["id"] for c in sorted(corners, key=lambda c: c["by_method"][main]["x"])]


def yellow(picture: Pixels) -> Pixels:
    """(K, 2) rows and columns of the pixels that have the colour of the ring around a selected corner."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return np.argwhere((red > 150) & (green > 0.75 * red) & (blue < 0.6 * red))


def test_row_selected_in_the_table_is_ringed_in_the_scene(still: Visitor) -> None:
    picture = still.still_picture()
    found, ids = markers(picture), ids_by_x(still)
    assert len(yellow(picture)) == 0
    for place in (0, len(ids) - 1):
        still.page.get_by_role("button", name=f"C{ids[place]}", exact=True).click()
        wait_until(lambda: len(yellow(still.picture())) > 20, "a ring is drawn")
        ring = yellow(still.still_picture())
        row, column = (ring.min(axis=0) + ring.max(axis=0)) / 2
        assert (column, row) == pytest.approx(found[place], abs=4)
        assert still.server.get("selection")["corner"] == ids[place]
        still.page.keyboard.press("Escape")
        wait_until(lambda: len(yellow(still.picture())) == 0, "the ring is gone")


def test_corner_clicked_in_the_scene_is_selected_in_the_table(still: Visitor) -> None:
    found, ids = markers(still.still_picture()), ids_by_x(still)
    frame = still.page.locator("#scene").bounding_box()
    for place in (0, len(ids) - 1):
        x, y = found[place]
        still.page.mouse.click(frame["x"] + x, frame["y"] + y)
        row = still.page.locator("#corner-table tr.selected")
        expect(row).to_contain_text(f"C{ids[place]}")
        expect(row).to_be_in_viewport(ratio=0.9)
        expect(row.get_by_role("button")).to_have_attribute("aria-pressed", "true")
        assert still.server.get("selection")["corner"] == ids[place]


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
