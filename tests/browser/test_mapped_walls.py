"""Walls of the map of whole scans in the page: pointed at, clicked, tapped, stepped through, measured, as REST says."""

import re
from collections.abc import Callable, Iterator
from math import degrees, sqrt
from typing import Any

import numpy as np
import pytest
from browsing import Server, Visitor
from lidarcore_app.scene.colours import rgb
from lidarcore_app.scene.palette import PALETTE
from playwright.sync_api import Browser, Locator, expect
from waiting import wait_until

from lidarcore.landmarks import Atlas

ROBOT = {"kind": "simulation", "settings": {"world": "two rooms", "seed": 3}}
WHOLE_SCANS = {"navigation": {"mode": "slam", "method": "scans"}}
MANY, OFTEN = 6, 8  # walls, and keyframes that saw each
Wall = dict[str, Any]


@pytest.fixture(scope="module")
def mapped(running: Server) -> Server:
    """A robot has driven so far that walls of its map have a history, and stands; one map for all tests.

    Beside it there is a map whose server was killed while it built it.
    """
    running.reset()
    Atlas(running.get("sessions")["store"]["path"]).begin("killed", started=1.0)
    running.api.put("source", json=ROBOT).raise_for_status()
    running.patch("settings", WHOLE_SCANS)
    wait_until(lambda: has_history(running), "there are walls with a history", 120)
    running.pause()
    wait_until(lambda: running.get("sessions")["store"]["behind_s"] == 0, "they are on the disk")
    return running


@pytest.fixture
def look(browser: Browser, mapped: Server) -> Iterator[Callable[..., Visitor]]:
    """Opens the page at its map, knowing the walls that the server knows."""
    visitors: list[Visitor] = []

    def open_map(width: int = 1000, height: int = 640, has_scene: bool = False, **options: Any) -> Visitor:
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        context.add_init_script("localStorage.setItem('welcomed', 'yes')")
        if not has_scene:
            context.route("**/viser/**", lambda route: route.fulfill(body="", content_type="text/html"))
        visitor = Visitor(context.new_page(), mapped).open()
        visitors.append(visitor)
        visitor.page.get_by_role("tab", name="Map").click()
        wait_until(lambda: known(visitor) == walls(mapped), "the page has the walls")
        return visitor

    yield open_map
    for visitor in visitors:
        visitor.page.context.close()
    for visitor in visitors:
        visitor.check()


def walls(server: Server) -> list[Wall]:
    answer = server.api.get("walls")
    return answer.json()["walls"] if answer.is_success else []


def seen_often(server: Server) -> list[Wall]:
    """The longest first."""
    often = [wall for wall in walls(server) if wall["count"] >= OFTEN]
    return sorted(often, key=lambda wall: -wall["length"])


def has_history(server: Server) -> bool:
    """Whether there are many walls, and the longest was told more than once; on a busy machine that takes longer."""
    often = seen_often(server)
    return len(often) >= MANY and len(server.get(f"walls/{often[0]['id']}/history")["history"]) > 1


def known(visitor: Visitor) -> list[Wall]:
    rows = visitor.knows("mapped")["walls"]
    return [{name: row[name] for name in row.keys() - {"kind", "ends"}} for row in rows]


def off_middle(wall: Wall) -> list[float]:
    """A place on a wall; in its middle there may be a corner of the scan."""
    return [0.6 * a + 0.4 * b for a, b in zip(wall["start"], wall["end"], strict=True)]


def card(visitor: Visitor, wall: Wall) -> Locator:
    found = visitor.page.get_by_role("complementary", name="Inspector")
    expect(found.get_by_role("heading", name=f"Wall W{wall['id']} of the map")).to_be_visible()
    return found


def numbers(text: str) -> list[float]:
    return [float(found) for found in re.findall(r"-?\d+\.\d+", text.replace("\u2212", "-"))]


def fact(found: Locator, name: str) -> str:
    return found.locator("dl div", has=found.page.get_by_text(name, exact=True)).locator("dd").inner_text()


def sigmas(wall: Wall) -> tuple[float, float, float]:
    """Of length (mm), direction (degrees) and distance (mm)."""
    (alphas, _), (_, rs) = wall["covariance"]
    return 1e3 * sqrt(wall["length_variance"]), degrees(sqrt(alphas)), 1e3 * sqrt(rs)


def in_sight(server: Server) -> Wall:
    """The wall of the map that the longest wall of the scan lies on."""
    frame = server.get("frame")
    pose = frame["localization"]["pose"]
    c, s = np.cos(pose["heading"]), np.sin(pose["heading"])
    live = max(frame["segments"][frame["fitter"]], key=lambda one: one["length"])
    ends = np.array([live["start"], live["end"]]) @ [[c, s], [-s, c]] + [pose["x"], pose["y"]]
    x, y = ends.mean(axis=0)
    dx, dy = ends[1] - ends[0]
    near = server.get(f"walls/nearest?x={x}&y={y}&direction={np.arctan2(dy, dx)}&tolerance=0.05")
    assert near["distances"][0] < 0.1
    return near["walls"][0]


@pytest.mark.long
@pytest.mark.scene
def test_who_comes_when_the_map_is_made_sees_where_one_can_go(look: Callable[..., Visitor]) -> None:
    visitor = look(has_scene=True, color_scheme="dark")
    free = rgb(PALETTE["dark"]["free"])
    wait_until(
        lambda: (np.abs(visitor.picture() - free).max(axis=2) <= 6).mean() > 0.02, "the ground is there"
    )


def test_pointing_at_a_wall_of_the_map_says_what_it_is(look: Callable[..., Visitor], mapped: Server) -> None:
    visitor, wall = look(), seen_often(mapped)[0]
    visitor.page.mouse.move(*visitor.pixel_at(off_middle(wall)))
    said = visitor.page.locator("#hover")
    expect(said).to_contain_text(f"Wall W{wall['id']} of the map")
    text = said.inner_text().split(" of the map")[1]
    length, direction, distance = sigmas(wall)
    assert numbers(text)[:2] == pytest.approx([wall["length"], length], abs=0.051)
    assert numbers(text)[3:5] == pytest.approx([distance, direction], abs=0.051)
    assert f"seen in {wall['count']} keyframes since" in text


def test_all_walls_of_the_map_are_in_the_view_beside_the_legend(
    look: Callable[..., Visitor], mapped: Server
) -> None:
    visitor = look(1400, 900)

    def are_all_in_the_free_part() -> bool:
        stage, legend = (visitor.page.locator(name).bounding_box() for name in ("#stage", "#legend"))
        ends = [place for wall in walls(mapped) for place in (wall["start"], wall["end"])]
        places = np.array([visitor.pixel_at(place) for place in ends])
        is_right = places > [legend["x"] + legend["width"], stage["y"]]
        return bool((is_right & (places < [stage["x"] + stage["width"], stage["y"] + stage["height"]])).all())

    wait_until(are_all_in_the_free_part, "the map lies in the free part of the view", 10)


def test_a_click_tells_all_of_a_wall_and_what_it_was(look: Callable[..., Visitor], mapped: Server) -> None:
    visitor, wall = look(), seen_often(mapped)[0]
    visitor.page.mouse.click(*visitor.pixel_at(off_middle(wall)))
    found = card(visitor, wall)
    length, direction, distance = sigmas(wall)
    assert numbers(fact(found, "Length")) == pytest.approx([wall["length"], length], abs=0.051)
    assert numbers(fact(found, "\u03b1")) == pytest.approx([degrees(wall["alpha"]), direction], abs=6e-4)
    assert numbers(fact(found, "r")) == pytest.approx([wall["r"], distance], abs=0.051)
    ends = zip(("From", "To"), (wall["start"], wall["end"]), wall["ended"], wall["in_corner"], strict=True)
    for name, place, is_end, is_corner in ends:
        assert numbers(fact(found, name)) == pytest.approx(place, abs=6e-4)
        assert fact(found, name).endswith("a corner" if is_corner else "its end" if is_end else "may go on")
    assert fact(found, "Seen").startswith(f"in {wall['count']} keyframes")
    expect(found.locator("canvas")).to_be_visible()
    told = mapped.get(f"walls/{wall['id']}/history")["history"]
    assert visitor.knows("wallHistory") == told
    assert len(told) > 1


@pytest.mark.long
def test_walls_of_map_and_scan_lead_to_each_other_and_keys_step_through_those_of_the_map(
    look: Callable[..., Visitor], mapped: Server
) -> None:
    visitor, wall = look(), in_sight(mapped)
    visitor.page.get_by_role("button", name=f"W{wall['id']}", exact=True).click()
    found = card(visitor, wall)
    found.get_by_role("button", name="In this scan").click()
    expect(found.locator("h2 > span").first).to_have_text("Wall")
    found.get_by_role("button", name=f"Wall W{wall['id']} of the map").click()
    card(visitor, wall)
    visitor.page.keyboard.press("Escape")
    expect(found).to_be_hidden()
    for expected in sorted(walls(mapped), key=lambda one: one["id"])[:2]:
        visitor.page.keyboard.press("ArrowDown")
        card(visitor, expected)


def test_walls_and_corners_of_the_map_are_measured_as_rest_does(
    look: Callable[..., Visitor], mapped: Server
) -> None:
    visitor, (first, *others) = look(), seen_often(mapped)
    corners = visitor.knows("mapped")["corners"]
    corner = next(one for one in corners if first["id"] in one["walls"])
    wall = next(one for one in others if one["id"] not in corner["walls"])
    visitor.page.keyboard.press("d")
    for place in (corner["at"], off_middle(wall)):
        visitor.page.mouse.click(*visitor.pixel_at(place))
        visitor.page.wait_for_timeout(200)
    (u, v), (x, y) = corner["at"], off_middle(wall)
    told = mapped.get(f"measure?first=map-corner@{u:.4f},{v:.4f}&second=map-wall@{x:.4f},{y:.4f}")
    text = visitor.page.locator("#measure-text")
    expect(text).to_have_text(re.compile(f"^{told['distance']:.3f}.m ± "))
    assert numbers(text.inner_text())[1] == pytest.approx(1e3 * told["sigma"], abs=0.51)
    expect(visitor.page.get_by_role("complementary", name="Inspector")).to_be_hidden()


def test_a_finger_selects_a_wall_of_the_map(look: Callable[..., Visitor], mapped: Server) -> None:
    visitor, wall = look(390, 844, has_touch=True), seen_often(mapped)[0]
    visitor.page.touchscreen.tap(*visitor.pixel_at(off_middle(wall)))
    found = card(visitor, wall)
    found.get_by_role("button", name="Close the inspector").click()
    expect(found).to_be_hidden()


def test_a_saved_view_shows_the_walls_of_the_map(look: Callable[..., Visitor], mapped: Server) -> None:
    visitor = look()
    colour = visitor.page.evaluate("import('/static/js/chart.js').then(({ token }) => token('--wall'))")
    with visitor.page.expect_download() as saved:
        visitor.page.locator("#save-svg").click()
    paths = re.findall(rf'<path d="([^"]+)" stroke="{re.escape(colour)}"', saved.value.path().read_text())
    assert len(set(paths)) == len(walls(mapped))


def test_with_the_map_its_walls_and_their_card_go(look: Callable[..., Visitor], mapped: Server) -> None:
    """The last test: the map is given up."""
    visitor, wall = look(), seen_often(mapped)[0]
    visitor.tolerated.append("404")  # the wall whose history it asks for may be gone by then
    visitor.page.get_by_role("button", name=f"W{wall['id']}", exact=True).click()
    found = card(visitor, wall)
    maps = visitor.page.get_by_role("region", name="Maps").get_by_role("listitem")
    expect(maps.filter(has_text="being built")).to_have_count(1)
    expect(maps.filter(has_text="killed")).to_have_count(1)
    expect(maps.filter(has_text="killed")).not_to_contain_text("being built")
    mapped.patch("settings", {"navigation": {"mode": "off"}})
    expect(found).to_be_hidden()
    expect(maps.filter(has_text="being built")).to_have_count(0)
    expect(maps).not_to_have_count(0)
    wait_until(lambda: visitor.knows("mapped") == {"walls": [], "corners": []}, "no wall is known")
    assert visitor.knows("mappedWall") is None, (
        "the next map counts from zero: its wall of that number is another"
    )
    visitor.page.mouse.move(*visitor.pixel_at(off_middle(wall)))
    visitor.page.wait_for_timeout(300)
    assert "of the map" not in visitor.page.locator("#hover").inner_text()
