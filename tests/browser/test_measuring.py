"""Measuring in the view: the page says what REST says."""

import re

import pytest
from browsing import Visitor
from playwright.sync_api import expect


@pytest.mark.long
def test_two_clicks_measure_as_rest_does(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    frame = visitor.await_frame(server.pause())
    main = frame["fitter"]
    first, second = [corner for corner in frame["corners"] if main in corner["by_method"]][:2]
    page.get_by_role("button", name="Measure between corners and walls").click()
    for corner in (first, second):
        page.mouse.click(*visitor.pixel_of("corner", corner["id"]))
        page.wait_for_timeout(200)
    places = [
        f"corner@{c['by_method'][main]['x']:.4f},{c['by_method'][main]['y']:.4f}" for c in (first, second)
    ]
    told = server.get(f"measure?first={places[0]}&second={places[1]}")
    text = page.locator("#measure-text")
    expect(text).to_have_text(re.compile(f"^{told['distance']:.3f}.m ± {1e3 * told['sigma']:.1f}.mm$"))
    page.keyboard.press("Escape")
    assert server.get("selection")["corner"] is None, "clicks that measure do not select"


def test_what_was_measured_goes_with_the_frame_it_was_measured_in(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    frame = visitor.await_frame(server.pause())
    corners = [corner for corner in frame["corners"] if frame["fitter"] in corner["by_method"]][:2]
    page.get_by_role("button", name="Measure between corners and walls").click()
    text = page.locator("#measure-text")
    for corner in corners:
        page.mouse.click(*visitor.pixel_of("corner", corner["id"]))
        page.wait_for_timeout(200)
    expect(text).to_contain_text("±")
    server.patch("settings", {"navigation": {"mode": "slam"}})
    server.patch("source", {"state": "playing"})
    expect(text).to_have_text("Click two corners or walls")
