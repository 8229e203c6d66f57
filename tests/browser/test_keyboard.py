"""Everything important can be done from the keyboard, and `?` tells how."""

from collections.abc import Callable, Iterator

import pytest
from browsing import Server, Visitor
from playwright.sync_api import Browser, expect
from waiting import wait_until


def view(server: Server) -> dict:
    return server.get("settings")["view"]


OWN = {
    "g": lambda view: not view["layers"]["grid"],
    "+": lambda view: view["ellipse_scale"] > 30,
    "r": lambda view: view["rotate"],
}


def extraction(server: Server) -> dict:
    return server.get("settings")["extraction"]


@pytest.mark.parametrize(
    ("key", "holds"),
    [
        (" ", lambda server: server.get("source")["state"] == "paused"),
        ("ArrowRight", lambda server: server.get("source")["state"] == "paused"),
        ("2", lambda server: extraction(server)["fitter"] == "cwlf"),
        ("Shift+Digit3", lambda server: "utls" not in view(server)["methods"]),
        ("c", lambda server: view(server)["compare"]),
        ("v", lambda server: extraction(server)["covariance"] == "published"),
        ("x", lambda server: view(server)["layers"]["rejected"]),
        ("k", lambda server: view(server)["layers"]["clusters"]),
        ("m", lambda server: server.get("settings")["navigation"]["mode"] == "slam"),
        ("t", lambda server: view(server)["theme"] == "light"),
        ("l", lambda server: not server.get("source")["loop"]),
        ("w", lambda server: server.get("recorder")["state"] == "recording"),
    ],
)
def test_key_does_what_the_help_says(keys: Visitor, key: str, holds: Callable[[Server], bool]) -> None:
    assert not holds(keys.server)
    keys.page.keyboard.press(key)
    wait_until(lambda: holds(keys.server), f"{key} has worked")


@pytest.mark.long
@pytest.mark.parametrize("key", OWN)
def test_key_changes_the_view_of_this_browser_only(keys: Visitor, key: str) -> None:
    before = view(keys.server)
    keys.page.keyboard.press(key)
    wait_until(lambda: OWN[key](keys.knows("settings")["view"]), f"{key} has worked")
    assert view(keys.server) == before


def test_arrow_selects_a_corner(keys: Visitor) -> None:
    keys.await_frame(keys.server.pause())
    keys.page.keyboard.press("ArrowDown")
    wait_until(lambda: keys.server.get("selection")["corner"], "a corner is selected")


@pytest.fixture(scope="module")
def keys_page(browser: Browser, running: Server) -> Iterator[Visitor]:
    """One page for all keys: loading one for each would take a minute."""
    running.reset()
    visitor = Visitor(browser.new_page(viewport={"width": 1000, "height": 640}, color_scheme="dark"), running)
    yield visitor.open()
    visitor.page.close()
    visitor.check()


@pytest.fixture
def keys(keys_page: Visitor) -> Visitor:
    keys_page.server.reset()
    keys_page.page.evaluate("import('/static/js/actions.js').then(({ settings }) => settings.forgetOwn())")
    return keys_page.catch_up()


def test_question_mark_opens_the_help(keys: Visitor) -> None:
    keys.page.keyboard.press("?")
    dialog = keys.page.get_by_role("dialog", name="Keyboard shortcuts")
    expect(dialog).to_contain_text("Play or pause")
    keys.page.keyboard.press("c")
    keys.page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()
    keys.page.keyboard.press("g")
    wait_until(lambda: OWN["g"](keys.knows("settings")["view"]), "once it is closed, keys work again")
    assert not view(keys.server)["compare"], "keys do nothing behind a dialog"


@pytest.mark.scene
def test_keys_pressed_in_the_scene_work_too(keys: Visitor) -> None:
    box = keys.page.locator("#scene").bounding_box()
    keys.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 30)
    keys.page.keyboard.press("c")
    wait_until(lambda: view(keys.server)["compare"], "the page got the key")


def test_space_plays_on_after_a_click_on_step(keys: Visitor) -> None:
    keys.page.get_by_role("button", name="One scan back").click()
    wait_until(lambda: keys.server.get("source")["state"] == "paused", "it is paused")
    keys.catch_up().page.keyboard.press(" ")
    wait_until(lambda: keys.server.get("source")["state"] == "playing", "it plays")


def test_typing_a_number_is_no_shortcut(keys: Visitor) -> None:
    keys.page.get_by_role("spinbutton", name="Min points").fill("")
    keys.page.keyboard.type("12")
    keys.page.keyboard.press("Enter")
    wait_until(lambda: extraction(keys.server)["min_points"] == 12, "the number is set")
    assert extraction(keys.server)["fitter"] == "ml"


def tell(visitor: Visitor, *texts: str, how: str = "toast") -> None:
    """Messages as modules of the page show them; a question, if `how` is "ask"."""
    script = """([how, texts]) => import("/static/js/toasts.js").then((toasts) =>
        texts.forEach((text) => toasts[how](text, { title: "Told", action: { label: "Go", run: () => {} } })))"""
    visitor.page.evaluate(script, [how, list(texts)])


def test_the_focus_returns_to_where_it_was_before_a_message_had_it(visitor: Visitor) -> None:
    page = visitor.page
    back = page.get_by_role("button", name="One scan back")
    for answer, key in (
        ("Dismiss this message", "Enter"),
        ("Go", "Enter"),
        ("Dismiss this message", "Escape"),
    ):
        back.focus()
        tell(visitor, "first", "second")
        page.locator(".toast").last.get_by_role("button", name=answer).focus()
        page.keyboard.press(key)
        expect(page.locator(".toast p")).to_have_text(["first"])
        expect(back).to_be_focused()
        page.keyboard.press("Escape")
        expect(page.locator(".toast")).to_have_count(0)
        expect(back).to_be_focused()
    tell(visitor, "alone")
    page.get_by_role("button", name="Go", exact=True).focus()
    back.evaluate("button => button.remove()")
    page.keyboard.press("Enter")
    expect(page.locator("#stage")).to_be_focused()


def test_escape_refuses_a_question_then_closes_the_newest_message_then_clears_the_selection(
    visitor: Visitor,
) -> None:
    page, server = visitor.page, visitor.server
    visitor.await_frame(server.pause())
    page.keyboard.press("ArrowDown")
    wait_until(lambda: visitor.knows("selection")["corner"], "a corner is selected")
    back = page.get_by_role("button", name="One scan back")
    tell(visitor, "first")
    for focused in (back, page.get_by_role("button", name="Go", exact=True).last):
        back.focus()
        tell(visitor, "Delete it?", how="ask")
        tell(visitor, "second")
        focused.focus()
        page.keyboard.press("Escape")
        expect(page.locator(".toast p")).to_have_text(["first", "second"])
        expect(back).to_be_focused()
        page.keyboard.press("Escape")
        expect(page.locator(".toast p")).to_have_text(["first"])
    page.keyboard.press("?")
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog", name="Keyboard shortcuts")).to_be_hidden()
    expect(page.locator(".toast p")).to_have_text(["first"])
    page.keyboard.press("Escape")
    expect(page.locator(".toast")).to_have_count(0)
    assert server.get("selection")["corner"]
    page.keyboard.press("Escape")
    wait_until(lambda: server.get("selection")["corner"] is None, "nothing is selected")
