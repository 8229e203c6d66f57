"""The mask of the robot's own body in the page: suggested, seen, edited, cleared."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from browsing import Visitor
from playwright.sync_api import Locator, expect
from robot_body import POSTS, drive
from waiting import wait_until

from lidarcore.recordings import RecordingWriter

SHOWN = 5  # scan
INK = """([x, y]) => {
  const canvas = document.getElementById("overlay");
  const at = [x, y].map((side) => Math.round(side * devicePixelRatio));
  return canvas.getContext("2d").getImageData(...at, 1, 1).data[3];
}"""  # how opaque what is drawn over the scene is


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a robot that drives about and sees two posts of its own."""
    path = tmp_path_factory.mktemp("robot") / "robot.mcap"
    with RecordingWriter(path) as recording:
        for scan in drive(40):
            recording.write(scan)
    return path


def loaded(visitor: Visitor, robot: Path) -> Locator:
    """All of the recording is there, one scan of it is shown; the section of the page."""
    visitor.server.show(robot, SHOWN)
    wait_until(lambda: visitor.server.get("source")["complete"], "all of it is read")
    visitor.catch_up()
    visitor.page.get_by_role("tab", name="Setup").click()
    return visitor.page.locator("#mask")


def nearest(visitor: Visitor) -> float:
    """Range in m of the nearest point of the scan shown."""
    return float(np.linalg.norm(visitor.server.get("frame?points=true")["points"], axis=1).min())


def ink(visitor: Visitor, bearing: float, at: float) -> int:
    """How opaque the overlay is there, rad and m."""
    place = [at * np.cos(bearing), at * np.sin(bearing)]
    pixel = visitor.page.evaluate(
        "place => import('/static/js/scene.js').then(({ lookNow }) => lookNow().toScreen(place))", place
    )
    return int(visitor.page.evaluate(INK, pixel))


@pytest.mark.long
def test_a_suggested_mask_takes_the_robot_out_of_the_scan(visitor: Visitor, robot: Path) -> None:
    others = dict.fromkeys(("grid", "corners", "ellipses"), False)
    visitor.server.patch("settings", {"view": {"layers": others}})
    section = loaded(visitor, robot)
    assert nearest(visitor) < 0.4
    assert [ink(visitor, bearing, at) for bearing, _, at in POSTS] == [0, 0]
    expect(section.get_by_role("button", name="Clear")).to_be_disabled()
    section.get_by_role("button", name="Suggest").click()
    expect(section.get_by_role("group")).to_have_count(len(POSTS))
    wait_until(lambda: nearest(visitor) > 0.4, "the robot is gone")
    for bearing, _, at in POSTS:
        wait_until(lambda b=bearing, r=at: ink(visitor, b, r) > 20, "a wedge is drawn over the post")
    expect(visitor.page.locator("#legend-body li", has_text="Masked")).to_have_count(1)
    assert ink(visitor, -1.5, 0.3) == 0
    section.get_by_role("button", name="Clear").click()
    expect(section.get_by_role("group")).to_have_count(0)
    wait_until(lambda: nearest(visitor) < 0.4, "the robot is back")


@pytest.mark.long
def test_sectors_are_given_as_numbers_in_degrees(visitor: Visitor, robot: Path) -> None:
    section = loaded(visitor, robot)
    section.get_by_role("button", name="Add a sector").click()
    for label, number in (("From, °", "60"), ("To, °", "-170.5"), ("Reach, m", "0.4")):
        section.get_by_label(label).fill(number)
        section.get_by_label(label).press("Tab")
    given = {"first": np.radians(60), "last": np.radians(-170.5), "reach": 0.4}

    def taken() -> bool:
        mask = visitor.server.get("settings")["sensor"]["mask"]
        return len(mask) == 1 and all(np.isclose(mask[0][name], given[name]) for name in given)

    wait_until(taken, "the numbers are taken")
    wait_until(lambda: nearest(visitor) > 0.4, "the robot is gone")
    section.get_by_label("Reach, m").fill("-1")
    section.get_by_label("Reach, m").press("Tab")
    assert taken(), "what is no reach changes nothing"
    visitor.server.patch("settings", {"sensor": {"mask": [given | {"reach": 0.3}, given]}})
    expect(section.get_by_label("Reach, m").nth(0)).to_have_value("0.3")
    section.get_by_role("button", name="Delete sector 1").click()
    wait_until(taken, "the first is deleted")


@pytest.mark.long
def test_why_there_is_no_suggestion_is_said(visitor: Visitor) -> None:
    """The sensor that plays stands still."""
    visitor.tolerated.append("409")
    visitor.page.get_by_role("tab", name="Setup").click()
    wait_until(lambda: visitor.server.get("source")["index"] > 25, "there are scans enough")
    visitor.page.locator("#mask").get_by_role("button", name="Suggest").click()
    expect(visitor.page.locator("#toasts")).to_contain_text("The sensor hardly moved")


@pytest.mark.long
def test_on_a_phone_nothing_is_cut_off(visit: Callable[..., Visitor], robot: Path) -> None:
    phone = visit(390, 844, has_touch=True, is_mobile=True).open()
    section = loaded(phone, robot)
    section.get_by_role("button", name="Suggest").tap()
    expect(section.get_by_role("group")).to_have_count(len(POSTS))
    assert phone.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert phone.page.locator("#setup").evaluate("node => node.scrollWidth <= node.clientWidth")
    cut = "nodes => nodes.filter((node) => node.scrollWidth > node.clientWidth).map((node) => node.outerHTML)"
    assert section.locator("input, label, button").evaluate_all(cut) == []
    heights = "nodes => nodes.map((node) => node.getBoundingClientRect().height)"
    assert min(section.locator("input, button").evaluate_all(heights)) >= 40
