"""Readable and usable: small screens, light and dark, and by those who do not see the page."""

from collections.abc import Callable

import pytest
from browsing import Visitor
from playwright.sync_api import expect
from waiting import wait_until

PANELS = ("Corners", "Setup", "Map", "Plots", "Repeatability", "Source", "Rejected")
MAPPED = {"view": {"compare": True}, "navigation": {"mode": "slam"}, "repeatability": {"running": True}}
CONTROLS = {
    "button", "checkbox", "combobox", "link", "radio", "slider", "spinbutton", "switch", "tab", "Iframe",
}  # fmt: skip

# Effective colours of every visible text: [text, colour, background] with alpha blended over what lies below.
TEXT_COLOURS = """() => {
  const parse = (colour) => {
    const canvas = parse.canvas ??= new OffscreenCanvas(1, 1).getContext("2d", {willReadFrequently: true});
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const ground = (node) => {
    if (!node) return [255, 255, 255];
    const [r, g, b, a] = parse(getComputedStyle(node).backgroundColor);
    if (a === 255) return [r, g, b];
    const below = ground(node.parentElement);
    return [r, g, b].map((value, i) => (value * a + below[i] * (255 - a)) / 255);
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = [];
  while (texts.nextNode()) {
    const node = texts.currentNode.parentElement;
    const text = texts.currentNode.data.trim();
    if (!text || node.closest(":disabled, option, noscript")) continue;
    if (!node.checkVisibility({visibilityProperty: true})) continue;
    found.push([text, parse(getComputedStyle(node).color).slice(0, 3), ground(node)]);
  }
  return found;
}"""

SMALL_TARGETS = """() => [...document.querySelectorAll("button, select, input, a, .chip, .method, .switch")]
  .filter((node) => node.checkVisibility() && !node.matches(".visually-hidden, label input, tbody button"))
  .map((node) => [node.outerHTML.slice(0, 80), node.getBoundingClientRect().height])
  .filter(([, height]) => height < 40)"""


@pytest.fixture
def phone(visit: Callable[..., Visitor]) -> Visitor:
    return visit(390, 844, has_touch=True, is_mobile=True).open()


def luminance(rgb: list[float]) -> float:
    """Relative luminance (WCAG 2)."""
    r, g, b = (c / 3294.6 if c <= 10.31 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in rgb)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(a: list[float], b: list[float]) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def test_narrow_page_does_not_scroll_sideways(phone: Visitor) -> None:
    phone.server.patch("settings", MAPPED)
    expect(phone.page.locator("#corner-table thead .group")).to_have_count(6)
    for panel in PANELS:
        phone.page.get_by_role("tab", name=panel).click()
        assert phone.page.evaluate("document.documentElement.scrollWidth") <= 390
        assert phone.page.evaluate("document.documentElement.scrollHeight") <= 844
        assert phone.page.evaluate(SMALL_TARGETS) == []
        shown = phone.page.locator(".panel:visible")
        expect(shown).to_have_count(1)
        if panel != "Corners":
            assert shown.evaluate("node => node.scrollWidth <= node.clientWidth"), panel
    assert phone.page.locator("#scene").bounding_box()["height"] > 180
    expect(phone.page.frame_locator("#scene").get_by_text("Connected")).to_be_hidden()


def test_narrow_page_plays_and_selects(phone: Visitor) -> None:
    phone.page.get_by_role("button", name="Pause").tap()
    wait_until(lambda: phone.server.get("source")["state"] == "paused", "it is paused")
    phone.await_frame(phone.server.pause())
    phone.page.locator("#corner-table tbody tr").nth(1).tap()
    wait_until(lambda: phone.server.get("selection")["corner"], "a corner is selected")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_stands_out_in_the_preferred_theme(visit: Callable[..., Visitor], theme: str) -> None:
    visitor = visit(1400, 900, theme=theme, reduced_motion="reduce").open()  # else colours would fade in
    wait_until(lambda: visitor.server.get("settings")["view"]["theme"] == theme, "the preference is taken")
    expect(visitor.page.locator("html")).to_have_attribute("data-theme", theme)
    visitor.server.patch("settings", MAPPED)
    visitor.await_frame(visitor.server.pause())  # the corner that is selected stays
    visitor.page.keyboard.press("ArrowDown")
    expect(visitor.page.locator("#corner-table tr.selected")).to_have_count(1)
    for panel in PANELS[1:]:
        visitor.page.get_by_role("tab", name=panel).click()
        texts = visitor.page.evaluate(TEXT_COLOURS)
        assert len(texts) > 40
        weak = [(text, round(contrast(a, b), 2)) for text, a, b in texts if contrast(a, b) < 4.5]
        assert weak == [], panel


def test_theme_button_turns_the_page_and_the_scene(visit: Callable[..., Visitor]) -> None:
    visitor = visit(theme="dark").open()
    visitor.server.pause()
    assert visitor.still_picture().mean() < 80
    visitor.page.get_by_role("button", name="Light or dark").click()
    expect(visitor.page.locator("html")).to_have_attribute("data-theme", "light")
    wait_until(lambda: visitor.picture().mean() > 200, "the scene is light")


def test_every_control_has_a_name(visitor: Visitor) -> None:
    visitor.server.patch("settings", MAPPED)
    session = visitor.page.context.new_cdp_session(visitor.page)
    for panel in PANELS[1:]:
        visitor.page.get_by_role("tab", name=panel).click()
        nodes = session.send("Accessibility.getFullAXTree")["nodes"]
        found = [
            (node["role"]["value"], node.get("name", {}).get("value", ""))
            for node in nodes
            if not node["ignored"]
        ]
        controls = [(role, name) for role, name in found if role in CONTROLS]
        assert len(controls) > 12
        assert [role for role, name in controls if not name.strip()] == [], panel


def test_page_has_landmarks_and_a_table_that_can_be_read_out(visitor: Visitor) -> None:
    page = visitor.page
    for role in ("banner", "main"):
        expect(page.get_by_role(role)).to_have_count(1)
    for name in ("Scene", "Timeline", "Corners", "Messages"):
        expect(page.get_by_role("region", name=name)).to_have_count(1)
    assert page.locator("#toasts").get_attribute("aria-live") == "polite"
    assert "Corners of the current frame" in page.locator("#corner-table caption").text_content()
    for part in ("thead th[scope]", "tbody th[scope=row]"):
        expect(page.locator(f"#corner-table {part}").first).to_be_visible()
    assert page.locator("#corner-table thead th:not([scope])").count() == 0
    assert page.locator("#corner-table tbody th:not([scope=row])").count() == 0
    assert page.locator("#scene").get_attribute("title")


def test_reduced_motion_is_respected(visit: Callable[..., Visitor]) -> None:
    still, moving = visit(reduced_motion="reduce").open(), visit(reduced_motion="no-preference").open()
    duration = "getComputedStyle(document.getElementById('help')).transitionDuration"
    assert still.page.evaluate(duration) == "0s"
    assert moving.page.evaluate(duration) != "0s"
