"""Tools of the view that belong to this browser: the sensor in the middle, its heading up, and scans that fade."""

from collections.abc import Callable
from itertools import pairwise
from math import atan2, cos, hypot, sin

import numpy as np
import pytest
from browsing import Pixels, Visitor
from playwright.sync_api import expect
from waiting import wait_until

CLOSE = 2.0  # px
TURNED = 0.4  # rad
MOVED = 0.3  # m
MIDDLE = "Keep the sensor in the middle"
HEADING = "The sensor's heading up"
SENSOR = """async () => {
  const { lookNow } = await import("/static/js/scene.js");
  const { get } = await import("/static/js/store.js");
  const { x, y, heading } = get("frame").localization?.pose ?? { x: 0, y: 0, heading: 0 };
  const look = lookNow();
  const ahead = [x + 0.5 * Math.cos(heading), y + 0.5 * Math.sin(heading)];
  const [at, above] = [[x, y], ahead].map((place) => look.toScreen(place));
  return { pose: [x, y, heading], at, ahead: above, size: [look.width, look.height] };
}"""
ALONE = {"points": True} | dict.fromkeys(
    ("segments", "corners", "ellipses", "clusters", "rejected", "grid", "sensor", "gaps"), False
)

pytestmark = pytest.mark.scene


@pytest.fixture
def robot(visit: Callable[..., Visitor]) -> Visitor:
    """A page that shows how a robot builds a map."""
    visitor = visit().open()
    server = visitor.server
    server.api.put("source", json={"kind": "simulation"}).raise_for_status()
    server.patch("settings", {"navigation": {"mode": "slam", "method": "landmarks"}})
    wait_until(lambda: server.get("frame")["localization"], "there is a pose")
    return visitor


@pytest.mark.long
def test_the_sensor_stays_in_the_middle_until_the_view_is_dragged(robot: Visitor) -> None:
    page = robot.page
    places: list[list[float]] = []

    def is_in_the_middle_of_another_place() -> bool:
        now = page.evaluate(SENSOR)
        (x, y), (width, height) = now["at"], now["size"]
        is_elsewhere = all(hypot(now["pose"][0] - x0, now["pose"][1] - y0) > MOVED for x0, y0, _ in places)
        if not is_elsewhere or hypot(x - width / 2, y - height / 2) > CLOSE:
            return False
        places.append(now["pose"])
        return len(places) == 3

    button = page.get_by_role("button", name=MIDDLE)
    button.click()
    wait_until(is_in_the_middle_of_another_place, "the sensor is in the middle at three places")
    page.reload()
    expect(button).to_have_attribute("aria-pressed", "true")
    places.clear()
    wait_until(is_in_the_middle_of_another_place, "and after a reload")
    page.mouse.move(300, 300)
    page.mouse.down()
    page.mouse.move(360, 340, steps=4)
    page.mouse.up()
    expect(button).to_have_attribute("aria-pressed", "false")


@pytest.mark.long
def test_the_button_that_is_on_is_seen_below_the_pointer(robot: Visitor) -> None:
    button = robot.page.get_by_role("button", name=HEADING)
    colours = "node => ['color', 'backgroundColor'].map((name) => getComputedStyle(node)[name])"
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    robot.page.mouse.move(0, 0)
    robot.page.wait_for_timeout(500)  # colours change slowly
    away = button.evaluate(colours)
    button.hover()
    robot.page.wait_for_timeout(500)
    assert button.evaluate(colours) == away


@pytest.mark.long
def test_the_heading_points_up_however_the_sensor_turns(robot: Visitor) -> None:
    headings: list[float] = []

    def is_up_at_another_heading() -> bool:
        now = robot.page.evaluate(SENSOR)
        (x, y), (x_ahead, y_ahead), heading = now["at"], now["ahead"], now["pose"][2]
        is_turned = all(abs(atan2(sin(heading - one), cos(heading - one))) > TURNED for one in headings)
        if not is_turned or abs(x_ahead - x) > CLOSE or y_ahead > y - 2 * CLOSE:
            return False
        headings.append(heading)
        return len(headings) == 3

    robot.page.get_by_role("button", name=HEADING).click()
    wait_until(is_up_at_another_heading, "the heading is up, whichever it is")


@pytest.mark.long
def test_without_a_pose_the_tools_say_so(visit: Callable[..., Visitor]) -> None:
    visitor = visit().open()
    visitor.page.get_by_role("button", name=MIDDLE).click()
    expect(visitor.page.get_by_role("region", name="Messages")).to_contain_text("No pose")
    visitor.page.get_by_role("button", name="Start SLAM").click()
    wait_until(lambda: visitor.server.get("settings")["navigation"]["mode"] == "slam", "SLAM runs")


@pytest.mark.long
def test_points_of_the_last_scans_fade_out(visit: Callable[..., Visitor]) -> None:
    visitor = visit().open()
    server, page = visitor.server, visitor.page
    server.patch("settings", {"view": {"layers": ALONE}})
    demo = {"kind": "recording", "name": "emulated-s1.mcap", "paused": True}
    server.api.put("source", json=demo).raise_for_status()

    def show(index: int) -> Pixels:
        server.patch("source", {"index": index})
        wait_until(lambda: server.get("frame")["source"]["index"] == index, f"scan {index} is there")
        visitor.await_frame(server.get("frame"))
        return visitor.still_picture()

    page.get_by_label("Fading scans").select_option("The last 5")
    show(0)
    visitor.fit()
    page.mouse.move(300, 300)
    page.mouse.wheel(0, 100)  # from now on the view stays as it is
    first = visitor.still_picture(seconds=1.5)
    ground = first[0, 0]

    def strength(picture: Pixels) -> float:
        """How far from the ground the pixels are that only scan 0 has drawn."""
        return float(np.median(np.abs(picture - ground).sum(axis=2)[only_first]))

    others = [show(index) for index in (40, 41, 42, 43, 44, 45)]
    page.get_by_label("Fading scans").select_option("None")
    bare = visitor.still_picture(differs_from=others[-1])
    only_first = (np.abs(first - ground).sum(axis=2) > 200) & (np.abs(bare - ground).sum(axis=2) == 0)
    assert only_first.sum() > 100
    strengths = [strength(picture) for picture in (first, *others)]
    assert all(now < before for before, now in pairwise(strengths)), strengths
    assert strength(bare) == 0
