"""One state for all: links, further browsers, and connections that break."""

import re
from collections.abc import Callable
from urllib.parse import urlsplit

import pytest
from browsing import GOLF, Server, Visitor
from playwright.sync_api import expect
from waiting import wait_until

pytestmark = pytest.mark.real_data

SHOWN = {"view": {"compare": True, "methods": ["cwlf", "ml"], "colour": "range", "ellipse_scale": 25.0,
                  "layers": {"grid": False, "rejected": True}},
         "extraction": {"fitter": "cwlf", "covariance": "published", "min_points": 9, "corner_gap": 0.31,
                        "noise": {"sigma_range": 0.03}}}  # fmt: skip


@pytest.mark.long
def test_link_restores_the_view_in_a_fresh_browser(server: Server, visit: Callable[..., Visitor]) -> None:
    first = visit().open()
    server.show(GOLF, 123)
    wanted = server.patch("settings", SHOWN)
    first.page.wait_for_url("**#*index=123*corner_gap=*")
    link = "#" + urlsplit(first.page.url).fragment
    first.page.context.close()

    server.show(GOLF, 5)
    server.patch("settings", {"extraction": None, "view": None})
    server.api.put("source", json={"kind": "emulator"}).raise_for_status()
    second = visit().open(link)
    position = {"kind": "recording", "index": 123}.items()
    wait_until(lambda: server.get("frame")["source"].items() >= position, "the scan of the link is shown")
    wait_until(lambda: second.knows("settings") == wanted, "the settings of the link are restored")
    of_browser = ("layers", "ellipse_scale")
    others = server.get("settings")
    assert others == wanted | {"view": wanted["view"] | {name: others["view"][name] for name in of_browser}}
    assert server.get("source")["state"] == "paused"
    expect(second.page.locator("#position")).to_contain_text("124")
    expect(second.page.get_by_label("Fitter")).to_have_value("cwlf")
    expect(second.page.get_by_role("switch", name="Compare methods")).to_be_checked()
    expect(second.page.locator("#corner-table thead")).to_contain_text("ml")
    expect(second.page.get_by_role("spinbutton", name="Corner gap")).to_have_value("0.31")


@pytest.mark.long
def test_link_to_a_recording_that_is_gone_says_so(server: Server, visit: Callable[..., Visitor]) -> None:
    visitor = visit()
    visitor.tolerated.append("404")
    visitor.open("#recording=gone.bag&index=3")
    expect(visitor.page.locator(".toast.error")).to_contain_text("gone.bag")
    assert server.get("source")["kind"] == "emulator"


@pytest.mark.long
def test_plain_address_leaves_what_others_set_up(server: Server, visit: Callable[..., Visitor]) -> None:
    wanted = server.patch("settings", SHOWN)
    visitor = visit().open()
    assert server.get("settings") == wanted
    assert visitor.knows("settings") == wanted
    server.patch("settings", {"extraction": {"corner_gap": 0.1 + 0.2}})
    visitor.page.wait_for_url(re.compile(r"corner_gap=0\.3(&|$)"))


@pytest.mark.long
def test_theme_and_layers_belong_to_each_browser_until_they_are_set_for_all(
    server: Server, visit: Callable[..., Visitor]
) -> None:
    first, second = visit(theme="dark").open(), visit(theme="light").open()
    for visitor, theme in ((first, "dark"), (second, "light")):
        expect(visitor.page.locator("html")).to_have_attribute("data-theme", theme)
    first.page.locator("label.chip", has_text="Points").click()
    for _ in range(2):
        expect(first.page.get_by_role("checkbox", name="Points")).not_to_be_checked()
        expect(second.page.get_by_role("checkbox", name="Points")).to_be_checked()
        assert server.get("settings")["view"]["layers"]["points"]
        first.page.reload()
    server.patch("settings", {"view": {"layers": {"points": False}}})
    expect(second.page.get_by_role("checkbox", name="Points")).not_to_be_checked()
    server.patch("settings", {"view": {"layers": {"points": True}}})
    for visitor in (first, second):
        expect(visitor.page.get_by_role("checkbox", name="Points")).to_be_checked()


@pytest.mark.long
def test_reload_does_not_rewind_what_plays(server: Server, visit: Callable[..., Visitor]) -> None:
    visitor = visit().open()
    server.show(GOLF, 0)
    server.patch("source", {"state": "playing"})
    visitor.page.wait_for_url("**#recording=*")
    index = server.get("source")["index"]
    visitor.page.reload()
    link = "Number(new URLSearchParams(location.hash.slice(1)).get('index'))"  # kept up to date once it was followed
    wait_until(lambda: visitor.page.evaluate(link) > index + 5, "it plays on, as the page says")
    assert server.get("source")["index"] > index + 5
    assert server.get("source")["state"] == "playing"


@pytest.mark.long
def test_second_browser_sees_the_same(server: Server, visit: Callable[..., Visitor]) -> None:
    first, second = visit().open(), visit().open()
    first.page.get_by_label("Fitter").select_option("wctls")
    first.page.get_by_role("switch", name="Compare methods").click()
    first.page.locator("label.chip", has_text="Grid").click()
    first.page.get_by_role("button", name="Pause").click()
    expect(second.page.get_by_label("Fitter")).to_have_value("wctls")
    expect(second.page.get_by_role("switch", name="Compare methods")).to_be_checked()
    expect(second.page.get_by_role("checkbox", name="Grid")).to_be_checked()
    expect(second.page.get_by_role("button", name="Back to live")).to_be_visible()
    frame = server.pause()
    for visitor in (first, second):
        visitor.await_frame(frame)
    table = "#corner-table tbody"
    assert first.page.inner_text(table) == second.page.inner_text(table)
    first.page.locator("#corner-table tbody button").nth(1).click()
    expect(second.page.locator("#corner-table tbody tr").nth(1)).to_have_class("selected")


@pytest.mark.long
@pytest.mark.scene
def test_lost_connection_comes_back_by_itself(own_server: Server, visit: Callable[..., Visitor]) -> None:
    visitor = visit(at=own_server)
    visitor.tolerated += ["net::ERR_", "WebSocket", "Failed to fetch"]
    visitor.open()
    own_server.kill()
    expect(visitor.page.locator("#banner")).to_contain_text("Connection lost")
    expect(visitor.page.locator("#connection")).to_have_text("Connection lost")
    expect(visitor.page.locator("#live")).to_have_text("No signal")
    expect(visitor.page.locator("#readout-rate")).to_have_text("\u2013")
    own_server.start()
    expect(visitor.page.locator("#connection")).to_have_text("Connected")
    expect(visitor.page.locator("#banner")).to_be_hidden()
    stamp, picture = own_server.get("frame")["stamp"], visitor.picture()
    wait_until(lambda: visitor.knows("frame")["stamp"] > stamp + 0.3, "frames advance again")
    wait_until(lambda: (visitor.picture() != picture).mean() > 0.001, "the scene moves again")


@pytest.mark.long
@pytest.mark.scene
def test_page_keeps_its_colours_and_says_what_became_of_the_recording_when_the_server_starts_anew(
    own_server: Server, visit: Callable[..., Visitor]
) -> None:
    visitor = visit(at=own_server, theme="light")
    visitor.tolerated += ["net::ERR_", "WebSocket", "Failed to fetch"]
    page = visitor.open().page
    expect(page.locator("html")).to_have_attribute("data-theme", "light")
    name = own_server.api.post("recorder/start", json={}).raise_for_status().json()["name"]
    expect(page.locator("#recorder-status")).to_contain_text("B/s")
    own_server.kill()
    own_server.launch()
    message = page.locator(".toast")
    expect(message).to_contain_text("Recording ended with the server", timeout=120_000)
    message.get_by_role("button", name="Dismiss this message").focus()  # else it would go in a while
    expect(message).to_contain_text(name)
    expect(message.get_by_role("button", name="Play it")).to_have_count(0)
    wait_until(
        lambda: own_server.get("settings")["view"]["theme"] == "light", "the new server is told the theme"
    )
    expect(page.locator("html")).to_have_attribute("data-theme", "light")
