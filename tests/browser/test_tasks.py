"""Tasks from the start page by mouse and keyboard, with nothing but the names that are to be seen."""

import re
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from zipfile import ZipFile

import pytest
from browsing import GOLF, Server, Visitor
from playwright.sync_api import Locator, Page, expect
from waiting import wait_until

from lidarcore.rplidar.emulation.options import EmulatorOptions

MINUTE = 60.0  # s


@pytest.fixture(autouse=True)
def within_a_minute() -> Iterator[None]:
    begin = time.monotonic()
    yield
    assert time.monotonic() - begin < MINUTE


@pytest.fixture
def page(visit: Callable[..., Visitor]) -> Page:
    return visit(1400, 900, first_visit=True).open().page


@pytest.mark.long
def test_why_a_wall_is_missing(page: Page) -> None:
    page.keyboard.press("Space")
    page.get_by_role("tab", name="Rejected").click()
    expect(page.get_by_role("heading", name="Why is my wall missing?")).to_be_visible()
    panel = page.get_by_role("tabpanel", name="Rejected")
    expect(panel).to_contain_text(re.compile(r"(min_points|min_length|corner_gap|corner_angle) (is|allows)"))


@pytest.mark.long
def test_which_methods_ellipse_is_true_here(server: Server, visit: Callable[..., Visitor]) -> None:
    server.patch("settings", {"extraction": {"noise": asdict(EmulatorOptions().noise)}})  # as after a start
    visitor = visit(1400, 900, first_visit=True).open()
    visitor.tolerated.append("404")  # the corner whose sightings it asks for may be gone by then
    page = visitor.page
    page.get_by_role("button", name="Compare methods").click()
    table = page.get_by_role("region", name="Corners: claim and scatter").get_by_role("table")

    def verdict(method: str, kind: str) -> Locator:
        group = table.get_by_role("rowgroup").filter(
            has=page.get_by_role("rowheader", name=method, exact=True)
        )
        return group.get_by_role("row", name=kind).get_by_role("cell").last

    for method in ("cwlf", "wctls"):
        expect(verdict(method, "published")).to_have_text("too small")
    expect(verdict("ml", "consistent")).to_have_text("true")
    card = page.get_by_role("complementary", name="Inspector")
    expect(card.get_by_role("heading", name=re.compile(r"^Corner C\d+"))).to_be_visible()
    told = card.get_by_title(re.compile(r"CWLF published: \d+ of ([5-9]\d|100) inside"))
    title = told.get_attribute("title")
    inside, seen, expected = re.search(r"(\d+) of (\d+) inside, (\d+) expected", title).groups()
    assert int(inside) <= int(seen)  # of this corner alone it may be as many as expected
    assert abs(int(expected) - 0.95 * int(seen)) <= 0.5


def test_how_long_a_wall_is_and_how_sure(page: Page) -> None:
    page.keyboard.press("Space")
    card = page.get_by_role("complementary", name="Inspector")
    length = re.compile(r"Corner to corner\d+\.\d{3}\u2009m ± \d+\.\d\u2009mm")
    for corner in (
        page.get_by_role("region", name="Corners").get_by_role("button", name=re.compile(r"^C\d+$")).all()
    ):
        corner.click()
        expect(card).to_contain_text(corner.inner_text())
        card.get_by_role("button", name=re.compile("^Wall ")).last.click()
        expect(card.get_by_role("heading", name="Wall")).to_be_visible()
        if card.get_by_role("button", name=re.compile("^Corner ")).count() == 2:
            break
    expect(card).to_contain_text(length)


def time_that_stays(page: Page) -> float:
    """The time shown, s, once it no longer changes."""
    before, shown = "", page.locator("#time").inner_text()
    while shown != before:
        page.wait_for_timeout(500)
        before, shown = shown, page.locator("#time").inner_text()
    minutes, seconds = shown.split(":")
    return 60 * int(minutes) + float(seconds)


@pytest.mark.long
@pytest.mark.real_data
def test_a_recording_is_played_and_a_link_to_second_12_sent(
    page: Page, server: Server, visit: Callable[..., Visitor]
) -> None:
    (server.folder / GOLF.name).write_bytes(GOLF.read_bytes())
    page.get_by_role("tab", name="Source").click()
    page.get_by_role("button", name=re.compile(f"^{re.escape(GOLF.name)}")).click()
    wait_until(lambda: server.get("source")["recording"] == GOLF.name, "it plays")
    page.keyboard.press("Space")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
    seek = page.get_by_role("slider", name="Position in the recording")
    seek.focus()
    shown = re.compile(r"^0:12\.")
    for _ in range(20):  # keys are faster than pictures: press, look, correct
        away = 12.5 - time_that_stays(page)
        if abs(away) < 0.4:
            break
        for _ in range(round(10 * abs(away))):
            page.keyboard.press("ArrowRight" if away > 0 else "ArrowLeft")
    expect(page.locator("#time")).to_have_text(shown)
    address = "location.hash"
    wait_until(
        lambda: page.evaluate(address).endswith(f"index={server.get('source')['index']}"), "it says where"
    )
    other = visit().open(page.evaluate(address))
    expect(other.page.locator("#time")).to_have_text(shown)


@pytest.mark.long
def test_a_map_is_built_and_saved_for_ros(page: Page) -> None:
    page.get_by_role("button", name="Build a map").click()
    page.get_by_role("tab", name="Map").click()
    save = page.get_by_role("link", name="Save the map of the building as ROS map")
    expect(save).to_be_visible()
    wait_until(lambda: page.request.get(save.get_attribute("href")).ok, "there are walls", 120)
    with page.expect_download() as saved:
        save.click()
    with ZipFile(saved.value.path()) as archive:
        assert {"map.pgm", "map.yaml"} <= set(archive.namelist())
        assert b"resolution: 0.05" in archive.read("map.yaml")
