"""Clusters in the page: chosen, set, drawn, and what they cost."""

import re

import pytest
from browsing import HOKUYO, Server, Visitor, drawn
from playwright.sync_api import expect
from waiting import wait_until

PARAMETERS = {
    "Gaps": ["distance"],
    "k-means": ["k", "k_max"],
    "Gaussian mixture": ["k", "k_max"],
    "DBSCAN": ["eps"],
}
OF_ALL = {"min_points", "max_range"}


def shown_parameters(visitor: Visitor) -> set[str]:
    rows = visitor.page.locator("#clusters [data-parameter]:visible")
    return set(rows.evaluate_all("rows => rows.map(row => row.dataset.parameter)"))


def found(server: Server) -> int:
    return len(server.get("frame")["clusters"] or ())


@pytest.mark.long
@pytest.mark.scene
def test_method_is_switched_live_and_shows_only_what_it_uses(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    page.get_by_role("switch", name="Show them in the scene").first.click()
    methods = {method["title"]: method for method in server.get("methods")["clusterers"]}
    assert methods.keys() == PARAMETERS.keys()
    for title, own in PARAMETERS.items():
        page.locator("#clusters .segments label", has_text=title).click()
        expect(page.locator("#clusterer-about")).to_contain_text(methods[title]["summary"])
        wait_until(
            lambda title=title: server.get("settings")["clusters"]["method"] == methods[title]["name"], title
        )
        wait_until(lambda own=own: shown_parameters(visitor) == {*own, *OF_ALL}, f"the parameters of {title}")
        expect(page.locator("#cluster-cost")).to_have_text(
            re.compile(r"^\d+ in this scan, found in [\d.]+.(µs|ms)\.$")
        )


@pytest.mark.long
def test_number_of_clusters_is_chosen_by_the_page_or_for_every_scan(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.patch("settings", {"clusters": {"method": "kmeans"}, "view": {"layers": {"clusters": True}}})
    number = page.get_by_role("spinbutton", name="Clusters, k")
    expect(number).to_have_attribute("placeholder", "auto")
    number.fill("4")
    page.keyboard.press("Enter")
    wait_until(lambda: found(server) == 4, "there are four clusters")
    wait_until(lambda: "k_max" not in shown_parameters(visitor), "there is nothing to choose")
    number.fill("")
    page.keyboard.press("Enter")
    wait_until(lambda: server.get("settings")["clusters"]["k"] is None, "k is chosen for every scan")
    wait_until(lambda: "k_max" in shown_parameters(visitor), "there is something to choose")


@pytest.mark.long
@pytest.mark.scene
@pytest.mark.real_data
def test_clusters_are_drawn_where_they_are_shown(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.show(HOKUYO, 60)
    server.patch("settings", {"view": {"layers": {"segments": False, "corners": False, "ellipses": False}}})
    visitor.fit()
    before = visitor.still_picture()
    page.locator("label.chip", has_text="Clusters").click()
    wait_until(lambda: server.get("frame")["clusters"], "there are clusters")
    assert drawn(visitor.still_picture(differs_from=before)).sum() > drawn(before).sum() + 100
