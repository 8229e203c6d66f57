"""Readable and usable: small screens, light and dark, and by those who do not see the page."""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browsing import Visitor
from playwright.sync_api import expect
from waiting import wait_until

PANELS = ("Corners", "Setup", "Map", "Plots", "Repeatability", "Source", "Rejected")
MAPPED = {"view": {"compare": True}, "navigation": {"mode": "slam"}, "repeatability": {"running": True}}
CONTROLS = {
    "button", "checkbox", "combobox", "link", "radio", "slider", "spinbutton", "switch", "tab", "textbox",
    "DisclosureTriangle", "Iframe",
}  # fmt: skip

AXE = Path(__file__).parent / "vendor/axe-core/axe.min.js"
LOOK_FOR_VIOLATIONS = """async () => {
  const runOnly = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"];
  const { violations } = await axe.run(document, { runOnly, iframes: false });
  return violations.map(({ id, nodes }) => [id, ...nodes.map(({ html }) => html)]);
}"""
UNFOLD = "() => document.querySelectorAll('details').forEach((details) => details.open = true)"

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


@pytest.mark.long
@pytest.mark.scene
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


def test_the_table_of_corners_fits_a_phone(phone: Visitor) -> None:
    """Of one method with all its figures, of several with the areas, also once their answer is there."""
    server, page = phone.server, phone.page
    heads, groups = page.locator("#corner-table thead tr:last-child th"), page.locator("#corner-table .group")
    fits = "node => node.scrollWidth <= node.clientWidth"
    table = page.locator("#corners .table-scroll")
    page.get_by_role("tab", name="Corners").tap()
    expect(groups).to_have_count(1)
    assert heads.all_inner_texts() == ["x", "y", "σx", "σy", "area", "angle"]
    expect(page.locator("#corner-units")).to_contain_text("σ in mm;")
    assert table.evaluate(fits)
    server.patch("settings", {"view": {"compare": True}})
    expect(groups).to_have_count(6)
    assert heads.all_inner_texts() == ["x", "y", *6 * ["area"], "angle"]
    expect(page.locator("#corner-units")).to_have_text(
        "Sensor frame: x, y in m; area of the 1σ ellipse in mm²"
    )
    assert [groups.nth(k).evaluate(LINES) for k in range(6)] == [1, 2, 1, 1, 1, 1]  # arras_ siegwart
    assert table.evaluate(fits)
    server.patch("settings", {"repeatability": {"running": True}})
    expect(page.locator("#answer-coverage_95-ml")).to_have_text(re.compile(r"^\d+.%$"))
    assert table.evaluate(fits)
    server.pause()
    assert table.evaluate(OVERFLOW_OF_THE_LONGEST) == [0, []]
    page.set_viewport_size({"width": 844, "height": 390})
    expect(heads).to_have_count(2 + 6 * 3 + 1)


LINES = """(head) => {
  const tops = [...head.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE).flatMap((node) => {
    const text = document.createRange();
    text.selectNodeContents(node);
    return [...text.getClientRects()].map(({ top }) => Math.round(top));
  });
  return new Set(tops).size;
}"""
OVERFLOW_OF_THE_LONGEST = """(scroll) => {
  const put = (cells, text) => scroll.querySelectorAll(cells).forEach((cell) => cell.textContent = text);
  put("tbody :is(.x, .y)", "\u221212.345");
  put("tbody .angle", "\u2212179.9");
  put(":is(tbody .area, .answer td[id])", "99999");
  const cells = [...scroll.querySelectorAll(":is(tbody td, .answer td[id])")].filter((cell) => {
    const text = document.createRange();
    text.selectNodeContents(cell);
    const [inside, outside] = [text.getBoundingClientRect(), cell.getBoundingClientRect()];
    return inside.left < outside.left || inside.right > outside.right;
  });
  return [scroll.scrollWidth - scroll.clientWidth, cells.map((cell) => `${cell.className}: ${cell.textContent}`)];
}"""

TWO_MESSAGES = """import('/static/js/toasts.js').then(({ toast }) => {
  for (const title of ["Earlier", "Newest"]) toast("It says so.", { title });
})"""


def test_messages_are_shown_one_at_a_time_on_a_phone(phone: Visitor) -> None:
    page = phone.page
    page.evaluate(TWO_MESSAGES)
    earlier, newest = (page.locator(".toast", has_text=title) for title in ("Earlier", "Newest"))
    expect(newest).to_be_visible()
    expect(earlier).to_be_hidden()
    expect(page.locator("#toasts")).to_have_attribute("data-more", "and 1 more")
    newest.get_by_role("button", name="Dismiss this message").tap()
    expect(earlier).to_be_visible()
    expect(page.locator("#toasts")).to_have_attribute("data-more", "")


COVERED = """() => {
  const messages = document.getElementById("toasts");
  const places = [messages, document.getElementById("scene-tools")].map((node) => node.getBoundingClientRect());
  const controls = [...document.querySelectorAll("button, a, select, input, summary, label, .chip")].filter(
    (node) => node.checkVisibility() && !messages.contains(node) && !node.matches(".visually-hidden"));
  const cover = (place, node) => {
    const { left, right, top, bottom } = node.getBoundingClientRect();
    return place.left < right && place.right > left && place.top < bottom && place.bottom > top;
  };
  return controls.filter((node) => places.some((place) => cover(place, node) && !node.closest("#scene-tools")))
    .map((node) => node.outerHTML);
}"""


@pytest.mark.parametrize(("width", "height"), [(390, 844), (390, 667), (844, 390)])
def test_messages_cover_nothing_on_a_phone_that_can_be_tapped(
    visit: Callable[..., Visitor], width: int, height: int
) -> None:
    page = visit(width, height, has_touch=True, is_mobile=True).open().page
    page.get_by_role("tab", name="Setup").tap()
    page.evaluate(TWO_MESSAGES)
    expect(page.locator("#toasts")).to_have_attribute("data-more", "and 1 more")
    assert page.evaluate(COVERED) == []
    tools, messages = (page.locator(name).bounding_box() for name in ("#view-tools", "#toasts"))
    is_beside = messages["x"] + messages["width"] <= tools["x"]
    assert is_beside or messages["y"] + messages["height"] <= tools["y"]
    panel = page.locator("#setup").bounding_box()
    assert panel["y"] + panel["height"] == height
    if height == 844:
        page.locator("#view-tools").tap()
        expect(page.locator("#save-svg")).to_be_visible()
        assert page.evaluate(COVERED) == []


def test_a_message_that_another_one_covers_on_a_phone_is_still_read_afterwards(
    visit: Callable[..., Visitor],
) -> None:
    visitor = visit(390, 844)
    visitor.page.clock.install()
    page = visitor.open().page
    page.evaluate(TWO_MESSAGES)
    page.clock.fast_forward(12_500)
    expect(page.locator(".toast:visible")).to_contain_text(["Earlier"])
    page.clock.fast_forward(12_500)
    expect(page.locator(".toast")).to_have_count(0)


def test_messages_cover_no_table_on_a_desk(visit: Callable[..., Visitor]) -> None:
    page = visit(1400, 900).open().page
    page.evaluate(TWO_MESSAGES)
    expect(page.locator(".toast:visible")).to_have_count(2)
    messages, timeline = (page.locator(name).bounding_box() for name in ("#toasts", "#timeline"))
    assert messages["y"] + messages["height"] <= timeline["y"]
    stage = page.locator("#stage").bounding_box()
    assert stage["x"] <= messages["x"]
    assert messages["x"] + messages["width"] <= stage["x"] + stage["width"]


def test_a_phone_on_its_side_has_the_panel_beside_the_view(visit: Callable[..., Visitor]) -> None:
    page = visit(844, 390, has_touch=True, is_mobile=True).open().page
    page.get_by_role("tab", name="Setup").tap()
    view, panel = (page.locator(name).bounding_box() for name in ("#stage", "#setup"))
    assert view["x"] + view["width"] <= panel["x"]
    assert min(view["height"], panel["height"]) > 390 / 2
    assert panel["y"] + panel["height"] <= 390


def test_what_is_selected_elsewhere_leaves_the_tabs_of_a_phone_free(phone: Visitor) -> None:
    corner = phone.server.pause()["corners"][0]["id"]
    phone.server.api.put("selection", json={"corner": corner}).raise_for_status()
    card = phone.page.get_by_role("complementary", name="Inspector")
    expect(card).to_be_visible()
    tabs = phone.page.get_by_role("tablist").bounding_box()
    assert card.bounding_box()["y"] >= tabs["y"] + tabs["height"]
    fold = card.get_by_role("button", name="Fold the inspector")
    expect(fold).to_have_attribute("aria-expanded", "true")
    phone.page.get_by_role("tab", name="Setup").tap()
    expect(fold).to_have_attribute("aria-expanded", "false")
    fitter = phone.page.get_by_label("Fitter")
    expect(fitter).to_be_in_viewport()
    assert fitter.bounding_box()["y"] + fitter.bounding_box()["height"] <= card.bounding_box()["y"]
    fold.tap()
    expect(card.get_by_role("button", name="Compare with the next scans")).to_be_visible()


@pytest.mark.long
def test_narrow_page_plays_and_selects(phone: Visitor) -> None:
    phone.page.get_by_role("button", name="Pause").tap()
    wait_until(lambda: phone.server.get("source")["state"] == "paused", "it is paused")
    phone.await_frame(phone.server.pause())
    phone.page.locator("#corner-table tbody tr").nth(1).tap()
    wait_until(lambda: phone.server.get("selection")["corner"], "a corner is selected")


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_stands_out_in_the_preferred_theme(visit: Callable[..., Visitor], theme: str) -> None:
    visitor = visit(1400, 900, theme=theme, reduced_motion="reduce").open()  # else colours would fade in
    visitor.tolerated.append("404")  # the corner whose sightings it asks for may be gone by then
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


@pytest.mark.long
@pytest.mark.scene
def test_theme_button_turns_the_page_and_the_scene(visit: Callable[..., Visitor]) -> None:
    visitor = visit(theme="dark").open()
    visitor.server.pause()
    assert visitor.still_picture().mean() < 80
    visitor.page.get_by_role("button", name="Light or dark").click()
    expect(visitor.page.locator("html")).to_have_attribute("data-theme", "light")
    wait_until(lambda: visitor.picture().mean() > 200, "the scene is light")


def controls(nodes: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Role and name of every control in an accessibility tree; a radio button is named with its group."""
    by_id = {node["nodeId"]: node for node in nodes}

    def name(node: dict[str, Any]) -> str:
        return node.get("name", {}).get("value", "").strip()

    def group(node: dict[str, Any]) -> str:
        while node["role"]["value"] not in ("group", "radiogroup"):
            node = by_id[node["parentId"]]
        return name(node)

    shown = [(node["role"]["value"], node) for node in nodes if not node["ignored"]]
    return [
        (role, f"{group(node)}: {name(node)}" if role == "radio" and name(node) else name(node))
        for role, node in shown
        if role in CONTROLS
    ]


@pytest.mark.long
def test_every_control_has_a_name_of_its_own(visitor: Visitor) -> None:
    visitor.server.patch("settings", MAPPED)
    visitor.await_frame(visitor.server.pause())
    visitor.page.keyboard.press("ArrowDown")
    expect(visitor.page.get_by_role("complementary", name="Inspector")).to_be_visible()
    session = visitor.page.context.new_cdp_session(visitor.page)
    for panel in PANELS[1:]:
        visitor.page.get_by_role("tab", name=panel).click()
        visitor.page.evaluate(UNFOLD)
        found = controls(session.send("Accessibility.getFullAXTree")["nodes"])
        assert len(found) > 12
        assert [role for role, name in found if not name] == [], panel
        count = Counter(name for _, name in found)
        assert [name for name in count if count[name] > 1] == [], panel


@pytest.mark.parametrize(
    ("theme", "panels"),
    [
        pytest.param("light", PANELS[1:], marks=pytest.mark.long),
        pytest.param("dark", PANELS[1:], marks=pytest.mark.long),
        ("dark", PANELS[1:2]),
    ],
    ids=["light", "dark", "dark, one tab"],
)
def test_axe_finds_nothing_on_any_tab(
    visit: Callable[..., Visitor], theme: str, panels: tuple[str, ...]
) -> None:
    visitor = visit(1400, 900, theme=theme, reduced_motion="reduce").open()
    expect(visitor.page.locator("html")).to_have_attribute("data-theme", theme)
    visitor.server.patch("settings", MAPPED)
    visitor.await_frame(visitor.server.pause())
    visitor.page.keyboard.press("ArrowDown")
    expect(visitor.page.get_by_role("complementary", name="Inspector")).to_be_visible()
    visitor.page.evaluate(AXE.read_text())
    for panel in panels:
        visitor.page.get_by_role("tab", name=panel).click()
        violations = visitor.page.evaluate(LOOK_FOR_VIOLATIONS)
        assert violations == [], panel


@pytest.mark.long
def test_axe_finds_nothing_on_a_phone(phone: Visitor) -> None:
    phone.server.patch("settings", MAPPED)
    phone.await_frame(phone.server.pause())
    phone.page.locator("#corner-table tbody button").first.dispatch_event("click")
    expect(phone.page.get_by_role("complementary", name="Inspector")).to_be_visible()
    phone.page.evaluate(AXE.read_text())
    assert phone.page.evaluate(LOOK_FOR_VIOLATIONS) == []
    phone.page.get_by_role("button", name="Fold the inspector").tap()
    phone.page.get_by_role("button", name="Tools of the view").tap()
    for panel in PANELS:
        phone.page.get_by_role("tab", name=panel).tap()
        assert phone.page.evaluate(LOOK_FOR_VIOLATIONS) == [], panel


@pytest.mark.long
@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize("path", ["studies", "guide"])
def test_axe_finds_nothing_on_the_other_pages(visit: Callable[..., Visitor], path: str, width: int) -> None:
    visitor = visit(width, 844)
    visitor.page.goto(f"{visitor.server.url}/{path}")
    expect(visitor.page.get_by_role("heading", level=1)).to_be_visible()
    visitor.page.evaluate(AXE.read_text())
    assert visitor.page.evaluate(LOOK_FOR_VIOLATIONS) == []


def test_phone_reaches_all_tools_and_keeps_the_view_free(phone: Visitor) -> None:
    page = phone.page
    phone.await_frame(phone.server.pause())
    fit = page.get_by_role("button", name="Fit the room in the view")
    expect(fit).to_be_hidden()
    page.get_by_role("button", name="Tools of the view").tap()
    for name in ("Keep the sensor in the middle", "Measure between corners and walls", "Full screen"):
        expect(page.get_by_role("button", name=name)).to_be_visible()
    fit.tap()
    expect(fit).to_be_hidden()
    page.locator("#corner-table tbody button").first.dispatch_event("click")
    card = page.get_by_role("complementary", name="Inspector")
    expect(card).to_be_visible()
    assert card.bounding_box()["y"] > page.locator("#stage").bounding_box()["height"] * 1.2
    page.get_by_role("button", name="Fold the inspector").tap()
    wait_until(lambda: card.bounding_box()["height"] < 60, "it is folded")


@pytest.mark.long
def test_page_has_landmarks_and_a_table_that_can_be_read_out(visitor: Visitor) -> None:
    page = visitor.page
    for role in ("banner", "main"):
        expect(page.get_by_role(role)).to_have_count(1)
    for name in ("Scene", "Timeline", "Corners", "Messages"):
        expect(page.get_by_role("region", name=name)).to_have_count(1)
    assert page.locator("#toasts").get_attribute("aria-live") == "polite"
    assert "Corners of the current scan" in page.locator("#corner-table caption").text_content()
    for part in ("thead th[scope]", "tbody th[scope=row]"):
        expect(page.locator(f"#corner-table {part}").first).to_be_visible()
    assert page.locator("#corner-table thead th:not([scope])").count() == 0
    assert page.locator("#corner-table tbody th:not([scope=row])").count() == 0
    assert page.locator("#scene").get_attribute("title")


@pytest.mark.long
def test_reduced_motion_is_respected(visit: Callable[..., Visitor]) -> None:
    still, moving = visit(reduced_motion="reduce").open(), visit(reduced_motion="no-preference").open()
    duration = "getComputedStyle(document.getElementById('help')).transitionDuration"
    assert still.page.evaluate(duration) == "0s"
    assert moving.page.evaluate(duration) != "0s"
