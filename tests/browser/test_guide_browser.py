"""The guide as a server hands it out and a browser shows it."""

from collections.abc import Callable

import httpx
import pytest
from browsing import Server, Visitor
from lidarcore_app.web.security import HEADERS
from playwright.sync_api import expect

OVERHANGING = """() => [...document.querySelectorAll("p, li, svg, h1, h2, h3, math, figcaption")]
  .filter((node) => !node.closest(".wide, svg svg, math math"))
  .map((node) => [node.textContent.slice(0, 40), node.getBoundingClientRect()])
  .filter(([, box]) => box.left < 0 || box.right > innerWidth + 0.5)
  .map(([text]) => text)"""


def open_guide(visitor: Visitor) -> Visitor:
    visitor.page.goto(f"{visitor.server.url}/guide")
    expect(visitor.page.get_by_role("heading", level=1)).to_have_text("Which ellipses can be believed?")
    return visitor


@pytest.mark.long
def test_the_server_hands_out_the_guide_under_its_rules(server: Server) -> None:
    answer = httpx.get(f"{server.url}/guide")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    for name, value in HEADERS.items():
        assert answer.headers[name] == value


@pytest.mark.parametrize(("width", "theme"), [(1400, "light"), (390, "dark")])
def test_the_guide_fits_the_screen_and_asks_for_nothing_else(
    visit: Callable[..., Visitor], width: int, theme: str
) -> None:
    visitor = open_guide(visit(width, 844, theme=theme))
    page = visitor.page
    assert visitor.asked == [f"{visitor.server.url}/guide"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(OVERHANGING) == []
    red, *_ = map(
        int, page.evaluate("getComputedStyle(document.body).backgroundColor").strip("rgb()").split(",")
    )
    assert (red > 200) == (theme == "light")
    pictures = page.get_by_role("img")
    assert pictures.count() >= 15
    for picture in pictures.all():
        assert picture.get_attribute("aria-label")
        assert picture.bounding_box()["width"] > 200
    for formula in page.locator("math").all():  # typeset: a fraction or a sum is higher than a line of text
        assert formula.bounding_box()["height"] > 20


@pytest.mark.long
def test_the_dashboard_leads_to_the_guide_and_back(visitor: Visitor) -> None:
    visitor.page.get_by_role("link", name="Guide").click()
    expect(visitor.page).to_have_url(f"{visitor.server.url}/guide")
    visitor.page.get_by_role("link", name="dashboard").click()
    expect(visitor.page.locator("#readout-frame")).to_be_visible()
