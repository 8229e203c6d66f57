"""The first minute: a strip of three ways to go on, which goes with one click and does not come back."""

from collections.abc import Callable

import pytest
from browsing import Server, Visitor
from playwright.sync_api import expect
from waiting import wait_until

METHODS = {"arras_siegwart", "cwlf", "utls", "wtls", "wctls", "ml"}


def closed(visitor: Visitor) -> None:
    """The strip is gone, also after a reload."""
    expect(visitor.page.get_by_role("complementary", name="First steps")).to_have_count(0)
    visitor.page.reload()
    expect(visitor.page.locator("#readout-frame")).not_to_have_text("\u2013")
    expect(visitor.page.get_by_role("complementary", name="First steps")).to_have_count(0)


@pytest.fixture
def newcomer(visit: Callable[..., Visitor]) -> Visitor:
    visitor = visit(1400, 900, first_visit=True).open()
    expect(visitor.page.get_by_role("complementary", name="First steps")).to_contain_text("An emulated lidar")
    return visitor


@pytest.mark.long
def test_methods_are_compared_on_a_corner_that_all_found(newcomer: Visitor) -> None:
    server = newcomer.server
    newcomer.tolerated.append("404")  # the corner that it selects, or asks about, may be gone by then
    newcomer.page.get_by_role("button", name="Compare methods").click()
    wait_until(lambda: server.get("selection")["corner"] is not None, "a corner is selected")
    settings = server.get("settings")
    assert settings["view"]["compare"]
    assert settings["repeatability"]["running"]
    assert settings["extraction"]["covariance"] == "published"
    assert set(settings["view"]["methods"]) == METHODS
    wait_until(lambda: server.get("repeatability")["scans"] >= 12, "there are scans to judge by")
    server.pause()
    page = newcomer.page

    def answers_are_those_of_rest() -> bool:
        methods = server.get("repeatability")["methods"]  # the last scans may still be counted
        claims = {method["name"]: method["claims"]["published"]["judgement"] for method in methods}
        wanted = {
            f"answer-area_ratio-{name}": f"{found['area_ratio']['value']:.2f}"
            for name, found in claims.items()
        }
        wanted |= {
            f"answer-coverage_95-{name}": f"{100 * found['coverage_95']['value']:.0f}\u2009%"
            for name, found in claims.items()
        }
        return wanted == {id_: page.locator(f"#{id_}").inner_text() for id_ in wanted}

    wait_until(answers_are_those_of_rest, "the answers are those of REST")
    assert page.locator("#corners .table-scroll").evaluate("node => node.scrollWidth <= node.clientWidth")
    closed(newcomer)


@pytest.mark.long
def test_the_sensor_is_calibrated(newcomer: Visitor) -> None:
    newcomer.page.get_by_role("button", name="Calibrate my sensor").click()
    expect(newcomer.page.get_by_role("progressbar", name="Scans collected")).to_be_in_viewport()
    newcomer.server.api.delete("calibration").raise_for_status()
    closed(newcomer)


@pytest.mark.long
def test_a_map_is_built(newcomer: Visitor) -> None:
    server, page = newcomer.server, newcomer.page
    page.get_by_role("button", name="Build a map").click()
    expect(page.locator("#readout-source")).to_contain_text("Simulat")
    wait_until(lambda: server.get("settings")["navigation"]["mode"] == "slam", "SLAM runs")
    expect(page.get_by_role("tab", name="Map")).to_have_attribute("aria-selected", "true")
    closed(newcomer)
    expect(page.get_by_role("tab", name="Map")).to_have_attribute("aria-selected", "true")


@pytest.mark.long
def test_the_strip_is_closed(newcomer: Visitor) -> None:
    newcomer.page.get_by_role("button", name="Close the first steps").click()
    closed(newcomer)


def test_it_makes_way_for_what_must_be_read_first(own_server: Server, visit: Callable[..., Visitor]) -> None:
    """As at the first start, when kernels are compiled and nothing is seen yet."""
    visitor = visit(1400, 900, first_visit=True, at=own_server)
    visitor.tolerated += ["net::ERR_", "WebSocket", "Failed to fetch"]
    page = visitor.open().page
    strip, banner = page.get_by_role("complementary", name="First steps"), page.locator("#banner")
    expect(strip).to_be_visible()
    own_server.kill()
    expect(banner).to_contain_text("Connection lost")
    expect(strip).to_be_hidden()
    own_server.start()
    expect(banner).to_be_hidden()
    expect(strip).to_be_visible()


def test_nothing_is_explained_before_anything_is_seen(visit: Callable[..., Visitor]) -> None:
    visitor, is_heard = visit(1400, 900, first_visit=True), False
    page = visitor.page
    page.route_web_socket("**", lambda socket: socket.connect_to_server() if is_heard else None)
    page.goto(visitor.server.url)
    expect(page.locator("#setting-extraction-min_points")).to_be_attached()
    explained = [
        page.get_by_text("Legend", exact=True),
        page.get_by_role("img", name="Scale"),
        page.get_by_role("button", name="Build a map"),
    ]
    for part in explained:
        expect(part).to_be_hidden()
    is_heard = True
    visitor.open()
    for part in explained:
        expect(part).to_be_visible()


def test_on_a_phone_it_leaves_view_and_tabs_free_and_its_buttons_are_easy_to_tap(
    visit: Callable[..., Visitor],
) -> None:
    page = visit(390, 844, first_visit=True).open().page
    strip = page.get_by_role("complementary", name="First steps")
    expect(strip.get_by_text("An emulated lidar")).to_be_in_viewport(ratio=1)
    covered, tabs = strip.bounding_box(), page.get_by_role("tablist").bounding_box()
    assert covered["y"] >= tabs["y"] + tabs["height"]
    buttons = [button.bounding_box() for button in strip.get_by_role("button").all()]
    assert len(buttons) == 4
    for box in buttons:
        assert min(box["width"], box["height"]) >= 44
        assert covered["x"] <= box["x"]
        assert box["x"] + box["width"] <= covered["x"] + covered["width"] <= 390
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
