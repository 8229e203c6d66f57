"""The Repeatability tab: what it shows is what the server says, and it asks only while it is looked at."""

import re
from collections.abc import Callable
from decimal import ROUND_HALF_UP, Decimal
from math import hypot, log
from typing import Any

import numpy as np
import pytest
from browsing import Server, Visitor
from playwright.sync_api import expect
from waiting import wait_until

KINDS = ("consistent", "published")
SCANS = 20
FIGURES = {"area_ratio": (1, 2), "coverage_50": (100, 0), "coverage_95": (100, 1), "coverage_99": (100, 1)}
LINES = (
    "node => { const all = new Range(); all.selectNodeContents(node); return all.getClientRects().length; }"
)
SIGNS = {
    "too small": "too small",
    "true": "can be believed",
    "too large": "too large",
    "open": "too few sightings",
}


def found(server: Server) -> dict[str, Any]:
    return server.get("repeatability")


@pytest.fixture
def tab(visitor: Visitor) -> Visitor:
    """The tab, switched on by hand, its window full of twenty scans."""
    page = visitor.page
    visitor.server.api.delete("repeatability").raise_for_status()
    page.get_by_role("tab", name="Repeatability").click()
    page.get_by_role("switch", name="Compare with the scatter").click()
    number = page.get_by_role("spinbutton", name="Window")
    number.fill(str(SCANS))
    page.keyboard.press("Enter")
    wait_until(lambda: visitor.server.get("settings")["repeatability"] == {"running": True, "window": SCANS})
    wait_until(lambda: found(visitor.server)["scans"] == SCANS, "the window is full")
    return visitor


def still(visitor: Visitor) -> dict[str, Any]:
    """What is found of twenty scans after which none comes any more, and the page shows it.

    How many scans still wait to be compared, nobody can tell from outside: so it starts over with the first of them.
    """
    server = visitor.server
    server.patch("settings", {"repeatability": {"running": False}})
    server.pause()
    server.step(1 - SCANS)
    server.patch("settings", {"repeatability": {"running": True}})  # starts over with the scan that is shown
    for scans in range(1, SCANS + 1):
        wait_until(lambda scans=scans: found(server)["scans"] == scans, f"{scans} scans are compared")
        if scans < SCANS:
            server.step(1)
    told = found(server)
    server.patch("settings", {"view": {"layers": {"rejected": True}}})  # the page is told, and asks again
    wait_until(lambda: shown(visitor) == rows(told), "the table shows what is found")
    # The corner whose dots the page asked for may have gone with the window before.
    visitor.errors[:] = [error for error in visitor.errors if "404" not in error]
    return told


def text(figure: float | None, factor: float, digits: int) -> str:
    """Of two texts as near, JavaScript takes the larger one."""
    if figure is None:
        return "–"
    return str(Decimal(factor * figure).quantize(Decimal(10) ** -digits, ROUND_HALF_UP))


def rows(told: Any) -> list[list[str]]:
    """The table as it should be: method, then for each covariance the figures with their intervals and the verdict."""
    wanted = []
    for method in told["methods"]:
        wanted.append([method["name"]])
        for kind in KINDS:
            claim = method["claims"][kind]
            cells = []
            for name, (factor, digits) in FIGURES.items():
                value, low, high = (
                    text(claim["judgement"][name][end], factor, digits) for end in ("value", "low", "high")
                )
                cells.append(f"{value}{low}–{high}")
            wanted.append([kind, *cells, claim["verdict"]])
    return wanted


def shown(visitor: Visitor, table: str = "repeatability-table") -> list[list[str]]:
    return visitor.page.locator(f"#{table} tbody tr").evaluate_all(
        "rows => rows.map(row => [...row.cells].map(cell => cell.textContent))"
    )


@pytest.mark.long
def test_while_it_is_off_there_is_nothing_but_the_switch(visitor: Visitor) -> None:
    visitor.server.api.delete("repeatability").raise_for_status()
    visitor.page.get_by_role("tab", name="Repeatability").click()
    expect(visitor.page.get_by_role("switch", name="Compare with the scatter")).not_to_be_checked()
    for part in ("progress", "message", "areas", "claims", "walls", "scatter"):
        expect(visitor.page.locator(f"#repeatability-{part}")).to_be_hidden()


def test_table_and_sentence_say_what_the_server_says(tab: Visitor) -> None:
    told, page = still(tab), tab.page
    expect(page.locator("#repeatability-progress output")).to_have_text("20 of 20 scans")
    expect(page.locator("#repeatability-message")).to_be_hidden()
    assert page.locator("#repeatability-table caption").count() == 1
    assert shown(tab, "repeatability-walls-table") == rows(told["walls"])
    expect(page.locator("#repeatability-walls-verdict")).to_contain_text("of ml hold")
    for kind in KINDS:
        tab.server.patch("settings", {"extraction": {"covariance": kind}})
        claim = next(method for method in told["methods"] if method["name"] == "ml")["claims"][kind]
        most, half = (text(claim["judgement"][f"coverage_{n}"]["value"], 100, 0) for n in (95, 50))
        sentence = page.locator("#repeatability-verdict")
        expect(sentence).to_contain_text(f"The {kind} 95")
        expect(sentence).to_contain_text(
            re.compile(
                rf"of ml hold {most}.% of the scatter, and those of 50.% hold {half}.%: .*{SIGNS[claim['verdict']]}"
            )
        )
        for method in told["methods"]:
            claim = method["claims"][kind]
            if method["name"] != "ml" and claim["verdict"] in ("too small", "too large"):
                held = text(claim["judgement"]["coverage_95"]["value"], 100, 0)
                sort = claim["verdict"].capitalize()
                expect(sentence).to_contain_text(re.compile(rf"{sort}: [^.]*{method['name']} {held}.%"))


def set_noise(visitor: Visitor, sigma_range: float, sigma_bearing: float) -> None:
    noise = {"sigma_range": sigma_range, "sigma_bearing": sigma_bearing}
    visitor.server.patch("settings", {"extraction": {"noise": noise}})


@pytest.mark.long
@pytest.mark.parametrize(
    ("sigmas", "verdict", "noise"),
    [((0.05, 0.01), "too large", "less"), ((0.001, 0.0001), "too small", "more")],
)
def test_where_all_are_wrong_the_way_to_calibration_stands_above_the_table(
    tab: Visitor, sigmas: tuple[float, float], verdict: str, noise: str
) -> None:
    page = tab.page
    set_noise(tab, *sigmas)
    hint = page.locator("#repeatability-hint")
    expect(hint).to_contain_text(
        f"of all methods are {verdict}: the sensor has {noise} noise than Setup says"
    )
    expect(page.locator("section:has(#repeatability-hint) ~ section #repeatability-table")).to_be_attached()
    words = page.locator("#repeatability-table td.verdict")
    muted = page.locator("#repeatability-areas p.muted").evaluate("node => getComputedStyle(node).color")
    expect(words.first).to_have_css("color", muted)
    hint.get_by_role("button", name="Calibrate").click()
    expect(page.get_by_role("tab", name="Setup")).to_have_attribute("aria-selected", "true")
    expect(page.get_by_role("heading", name="Calibration")).to_be_in_viewport()
    wait_until(lambda: tab.server.get("calibration")["state"] != "idle", "it calibrates")
    tab.server.api.delete("calibration").raise_for_status()
    set_noise(tab, 0.01, 0.001)  # what the emulator has, nearly
    page.get_by_role("tab", name="Repeatability").click()
    expect(hint).to_be_hidden()


@pytest.mark.long
def test_no_head_of_the_table_breaks_within_a_percentage(tab: Visitor) -> None:
    still(tab)
    for head in tab.page.locator("#repeatability-table th", has_text="in ").all():
        assert head.evaluate(LINES) == 1


@pytest.mark.long
def test_boxes_stand_where_the_areas_are_on_a_logarithmic_axis(tab: Visitor) -> None:
    told, page = still(tab), tab.page
    wanted, at = [], []
    for row, method in enumerate(told["methods"]):
        for kind in KINDS:
            box = method["claims"][kind]["areas"]
            wanted += [box["first_quartile"], box["third_quartile"]]
            x, width = (
                page.locator(f".boxes .box.{kind}")
                .nth(row)
                .evaluate("box => [box.x, box.width].map(l => l.baseVal.value)")
            )
            at += [x, x + max(width, 0)]
        wanted.append(method["actual_area"])
        at.append(
            float(re.match(r"M([\d.]+)", page.locator(".boxes .actual").nth(row).get_attribute("d"))[1])
        )
    ticks = page.locator(".boxes .tick").evaluate_all(
        "ticks => ticks.map(t => [Number(t.textContent), t.x.baseVal[0].value])"
    )
    wanted += [1e-6 * value for value, _ in ticks]
    at += [x for _, x in ticks]
    assert len(ticks) >= 2
    slope, start = np.polyfit(np.log(wanted), at, 1)
    assert slope > 0
    np.testing.assert_allclose(at, slope * np.log(wanted) + start, atol=1.1)  # a box is at least a pixel wide
    assert page.locator(".boxes").get_attribute("aria-label").startswith("Median claimed ellipse area")


@pytest.mark.long
def test_dots_and_ellipses_of_a_corner_are_to_scale(tab: Visitor) -> None:
    told, page = still(tab), tab.page
    corners = {
        corner["id"]: corner
        for method in told["methods"]
        for corner in method["corners"]
        if method["name"] == "ml"
    }
    choice = page.get_by_label("Corner", exact=True)
    for id, corner in list(corners.items())[:3]:
        choice.select_option(str(id))
        dots = np.array(tab.server.get(f"repeatability/corners/{id}")["deviations"]["ml"])
        expect(page.locator("#repeatability-dots")).to_contain_text(f"{len(dots)} dots, by ml")
        expect(choice).to_have_value(str(id))
        claimed = np.array(corner["claims"]["consistent"]["covariance"])
        half_axes = np.sqrt(-2 * log(0.05) * np.linalg.eigvalsh(claimed)[::-1])

        def drawn() -> list[float]:
            ellipse = page.locator("#repeatability-scatter .scatter .claim.consistent[data-method=ml]")
            return ellipse.evaluate("e => [e.rx.baseVal.value, e.ry.baseVal.value]")

        wait_until(
            lambda half_axes=half_axes: (
                abs(drawn()[0] / drawn()[1] / (half_axes[0] / half_axes[1]) - 1) < 1e-3
            )
        )
        scale = drawn()[0] / half_axes[0]
        xy = page.locator("#repeatability-scatter .scatter .dot").evaluate_all(
            "dots => dots.map(d => [d.cx.baseVal.value, d.cy.baseVal.value])"
        )
        placed = (np.array(xy) - 180) * (1, -1) / scale
        assert 0.9 * len(dots) <= len(placed)
        assert max(min(hypot(*(p - d)) for d in dots) for p in placed) < 1e-6
        assert page.locator("#repeatability-scatter .scatter .claim").count() == 12


@pytest.mark.long
def test_the_corner_selected_is_the_one_shown(tab: Visitor) -> None:
    told, page = still(tab), tab.page
    frame = {corner["id"]: corner["by_method"]["ml"] for corner in tab.server.get("frame")["corners"]}
    means = {corner["id"]: corner["mean"] for corner in told["methods"][-1]["corners"]}
    near = {
        id: min(means, key=lambda k: hypot(means[k][0] - at["x"], means[k][1] - at["y"]))
        for id, at in frame.items()
    }
    near = {
        id: k
        for id, k in near.items()
        if hypot(means[k][0] - frame[id]["x"], means[k][1] - frame[id]["y"]) < 0.1
    }
    assert len(near) > 3
    choice = page.get_by_label("Corner", exact=True)
    for id in list(near)[1:3]:
        page.locator("#corner-table tbody button", has_text=re.compile(f"^C{id}$")).click()
        expect(choice).to_have_value(str(near[id]))
        expect(choice.locator("option:checked")).to_contain_text(f"C{id}, at")
    last = list(near)[-1]
    choice.select_option(str(near[last]))
    wait_until(lambda: tab.server.get("selection")["corner"] == last, "the corner is selected everywhere")


@pytest.mark.long
def test_it_begins_anew_by_hand_and_says_how_far_it_is(tab: Visitor) -> None:
    tab.tolerated.append("404")  # the corner whose sightings it asks for may have gone with the window
    page = tab.page
    tab.server.pause()
    page.get_by_role("button", name="Start over").click()
    expect(page.locator("#repeatability-progress output")).to_have_text(re.compile(r"^[01] of 20 scans$"))
    expect(page.locator("#repeatability-message")).to_contain_text("so far: a corner is judged from 10 on")
    for part in ("areas", "claims", "scatter"):
        expect(page.locator(f"#repeatability-{part}")).to_be_hidden()
    tab.server.patch("source", {"state": "playing"})
    expect(page.locator("#repeatability-progress output")).to_have_text("20 of 20 scans")
    expect(page.locator("#repeatability-claims")).to_be_visible()


@pytest.mark.long
def test_it_asks_only_while_it_runs_and_is_looked_at(tab: Visitor) -> None:
    page, server = tab.page, tab.server

    def asked() -> int:
        page.wait_for_timeout(10)  # requests are told of while the page is waited for
        return sum("/repeatability" in url for url in tab.asked)

    def frames(count: int) -> None:
        since = int(tab.readout("frame"))
        wait_until(lambda: int(tab.readout("frame")) > since + count, "frames pass")

    before = asked()
    wait_until(lambda: asked() > before + 2, "it asks while it runs")
    page.get_by_role("tab", name="Setup").click()
    frames(12)
    before = asked()
    frames(30)
    assert asked() == before
    page.get_by_role("tab", name="Repeatability").click()
    wait_until(lambda: asked() > before, "it asks again")
    page.get_by_role("switch", name="Compare with the scatter").click()
    wait_until(lambda: not server.get("settings")["repeatability"]["running"], "it is off")
    frames(25)
    before = asked()
    frames(30)
    assert asked() == before
    expect(page.locator("#repeatability-claims")).to_be_visible()  # what was found can still be read


@pytest.mark.long
def test_a_link_carries_that_it_runs(tab: Visitor, visit: Callable[..., Visitor]) -> None:
    tab.page.wait_for_url("**#*repeatability=true&window=20*")
    link = tab.page.url.partition("#")[2]
    tab.page.context.close()
    tab.server.patch("settings", {"repeatability": None})
    visit().open(f"#{link}")
    wait_until(lambda: tab.server.get("settings")["repeatability"] == {"running": True, "window": 20})


@pytest.mark.long
def test_on_a_phone_nothing_is_cut_off(tab: Visitor) -> None:
    still(tab)
    tab.page.set_viewport_size({"width": 390, "height": 844})
    tab.page.get_by_role("tab", name="Repeatability").click()
    panel = tab.page.locator("#repeatability")
    expect(panel).to_be_visible()
    assert panel.evaluate("panel => panel.scrollWidth <= panel.clientWidth")
    fits = panel.locator(".table-scroll").evaluate_all("all => all.map(n => n.scrollWidth <= n.clientWidth)")
    assert fits
    assert all(fits), "the tables fit"
