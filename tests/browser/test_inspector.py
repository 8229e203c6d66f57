"""The inspector: what it says of a wall is what REST says."""

import re
from collections.abc import Callable
from math import cos, degrees, hypot, sin, sqrt
from typing import Any

import numpy as np
import pytest
from browsing import Visitor
from playwright.sync_api import Locator, expect
from waiting import wait_until

LONG = 1.5  # m; corners are far from the middle of such a wall
WINDOW = 20


@pytest.fixture
def compared(visitor: Visitor) -> Visitor:
    """All methods, and a full window of repeatability; the sensor stands still."""
    server = visitor.server
    server.api.delete("repeatability").raise_for_status()
    server.patch(
        "settings", {"view": {"compare": True}, "repeatability": {"running": True, "window": WINDOW}}
    )
    wait_until(lambda: server.get("repeatability")["scans"] == WINDOW, "the window is full")
    visitor.await_frame(server.pause())
    return visitor


def whole_wall(frame: dict[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """A long wall of the main method with its two corners."""
    main = frame["fitter"]
    for wall in frame["segments"][main]:
        ends = [
            c["by_method"][main]
            for c in frame["corners"]
            if main in c["by_method"] and wall["id"] in c["segments"]
        ]
        if len(ends) == 2 and wall["length"] > LONG:
            return wall, ends
    raise AssertionError("the room has a wall between two corners")


def alongside(wall: dict[str, Any], other: dict[str, Any]) -> float:
    """How much of another method's wall lies along this one, m; a wall may be in two pieces on one line."""
    normal = np.array([cos(wall["alpha"]), sin(wall["alpha"])])
    ends = np.array([[other["start"], other["end"]], [wall["start"], wall["end"]]])
    if np.abs(ends @ normal - wall["r"]).max() > 0.1:
        return 0.0
    along = np.sort(ends @ np.array([-normal[1], normal[0]]), axis=1)
    return float(along[:, 1].min() - along[:, 0].max())


def click(visitor: Visitor, wall: dict[str, Any]) -> Locator:
    x, y = visitor.pixel_at([(a + b) / 2 for a, b in zip(wall["start"], wall["end"], strict=True)])
    visitor.page.mouse.click(x, y + 2)
    card = visitor.page.get_by_role("complementary", name="Inspector")
    expect(card.get_by_role("heading", name="Wall")).to_be_visible()
    return card


def numbers(text: str) -> list[float]:
    return [float(found) for found in re.findall(r"-?\d+\.\d+", text.replace("−", "-"))]


def test_wall_clicked_tells_what_each_method_says_of_it(compared: Visitor) -> None:
    frame = compared.server.get("frame")
    wall, ends = whole_wall(frame)
    card = click(compared, wall)
    rows = card.get_by_role("table").first.locator("tbody tr")
    expect(rows).to_have_count(len(frame["methods"]))
    for method, row in zip(frame["methods"], rows.all(), strict=True):
        expect(row.get_by_role("rowheader")).to_have_text(method)
        said = max(frame["segments"][method], key=lambda one: alongside(wall, one))
        (alphas, _), (_, rs) = said["covariance"]
        wanted = [degrees(said["alpha"]), degrees(sqrt(alphas)), said["r"], 1e3 * sqrt(rs)]
        assert numbers(" ".join(row.locator("td").all_inner_texts())) == pytest.approx(wanted, abs=0.051)
    first, second = (f"corner@{end['x']:.4f},{end['y']:.4f}" for end in ends)
    told = compared.server.get(f"measure?first={first}&second={second}")
    expect(card).to_contain_text(
        re.compile(rf"Corner to corner{told['distance']:.3f}.m ± {1e3 * told['sigma']:.1f}.mm")
    )
    expect(card).to_contain_text(f"Points{wall['n_points']}")
    expect(card).to_contain_text("Covarianceconsistent")


@pytest.mark.long
def test_wall_shows_its_repeatability(compared: Visitor) -> None:
    frame = compared.server.get("frame")
    wall, _ = whole_wall(frame)
    card = click(compared, wall)
    (mine,) = (
        one
        for one in compared.server.get("repeatability")["walls"]["methods"]
        if one["name"] == frame["fitter"]
    )
    sighted = min(
        mine["walls"], key=lambda one: hypot(one["mean"][0] - wall["alpha"], one["mean"][1] - wall["r"])
    )
    dots = compared.server.get(f"repeatability/walls/{sighted['id']}")["deviations"][frame["fitter"]]
    expect_held(card, frame["fitter"], sighted, len(dots))


@pytest.mark.long
def test_corner_shows_its_repeatability_by_every_method(compared: Visitor) -> None:
    server, frame = compared.server, compared.server.get("frame")
    methods = server.get("repeatability")["methods"]
    main = next(method for method in methods if method["name"] == frame["fitter"])
    corner = next(c for c in frame["corners"] if len(c["by_method"]) == len(methods))
    x, y = (corner["by_method"][main["name"]][axis] for axis in "xy")
    id_ = min(main["corners"], key=lambda one: hypot(one["mean"][0] - x, one["mean"][1] - y))["id"]
    compared.page.get_by_role("button", name=f"C{corner['id']}", exact=True).click()
    card = compared.page.get_by_role("complementary", name="Inspector")
    dots = server.get(f"repeatability/corners/{id_}")["deviations"][main["name"]]
    for method in methods:
        (sighted,) = (one for one in method["corners"] if one["id"] == id_)
        expect_held(card, method["name"], sighted, len(dots))


def expect_held(card: Locator, method: str, sighted: dict[str, Any], dots: int) -> None:
    """The card shows the sightings of a thing, and how many of them a method's ellipses hold."""
    expect(card.locator("circle.dot")).to_have_count(dots)
    for kind, claim in sighted["claims"].items():
        inside = round(claim["judgement"]["coverage_95"]["value"] * sighted["count"])
        cell = card.locator(f"td[data-method={method}][data-kind={kind}]")
        expect(cell).to_have_text(f"{inside} of {sighted['count']}")
        expect(cell).to_have_attribute(
            "title", re.compile(f"{kind}: {inside} of {sighted['count']} inside, ")
        )


@pytest.mark.long
def test_wall_and_corner_lead_to_each_other_and_escape_ends_both(compared: Visitor) -> None:
    wall, _ = whole_wall(compared.server.get("frame"))
    card = click(compared, wall)
    assert compared.server.get("selection")["corner"] is None
    corner = card.get_by_role("button", name=re.compile("^Corner ")).first
    name = corner.inner_text()
    corner.click()
    expect(card.get_by_role("heading", name=name)).to_be_visible()
    card.get_by_role("button", name=re.compile("^Wall ")).first.click()
    expect(card.get_by_role("heading", name="Wall")).to_be_visible()
    compared.page.keyboard.press("Escape")
    expect(card).to_be_hidden()


def test_the_legend_folds_when_the_window_becomes_narrow(visit: Callable[..., Visitor]) -> None:
    page = visit(1400, 900).open().page
    sensor = page.locator("#legend").get_by_text("Sensor")
    expect(sensor).to_be_visible()
    page.set_viewport_size({"width": 390, "height": 844})
    expect(sensor).to_be_hidden()
    page.set_viewport_size({"width": 1400, "height": 900})
    expect(sensor).to_be_visible()


def test_card_and_legend_never_lie_on_each_other(visit: Callable[..., Visitor]) -> None:
    visitor = visit(1400, 900).open()
    visitor.server.patch("settings", {"view": {"compare": True}})
    visitor.await_frame(visitor.server.pause())
    page, sides = visitor.page, set()
    card, legend = page.get_by_role("complementary", name="Inspector"), page.locator("#legend")

    def are_apart() -> bool:
        one, other = card.bounding_box(), legend.bounding_box()
        is_beside = one["x"] + one["width"] <= other["x"] or other["x"] + other["width"] <= one["x"]
        return is_beside or one["y"] + one["height"] <= other["y"] or other["y"] + other["height"] <= one["y"]

    for row in page.locator("#corner-table tbody button").all():
        row.click()
        expect(card).to_contain_text(row.inner_text())
        wait_until(are_apart, "card and legend lie apart", 5)
        sides.add(card.bounding_box()["x"] < legend.bounding_box()["width"])
        if legend.get_attribute("open") is None:
            legend.get_by_text("Legend").click()
            wait_until(are_apart, "the legend has the place", 5)
            card.get_by_role("button", name="Fold the inspector").click()
            wait_until(are_apart, "the card has the place", 5)
    assert sides == {True, False}
    card.get_by_role("button", name="Close the inspector").click()
    expect(legend.get_by_text("Sensor")).to_be_visible()
