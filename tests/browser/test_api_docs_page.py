"""The REST documentation as a browser shows it: everything from this server, and routes can be tried out."""

import re
from collections.abc import Callable

import pytest
from browsing import Server, Visitor
from playwright.sync_api import expect


@pytest.mark.long
def test_a_route_can_be_tried_out(visit: Callable[..., Visitor], server: Server) -> None:
    visitor = visit()
    page = visitor.page
    page.goto(f"{server.url}/docs")
    route = page.locator("#operations-meta-health_api_v1_health_get")
    route.locator("button.opblock-summary-control").click()
    route.get_by_role("button", name="Execute").click()
    answer = route.locator(".live-responses-table")
    expect(answer.locator("tbody td.response-col_status")).to_have_text(re.compile("200"))
    expect(answer).to_contain_text('"status": "ok"')
    assert f"{server.url}/api/v1/health" in visitor.asked
    assert all(url.startswith((server.url, "data:", "blob:")) for url in visitor.asked)


@pytest.mark.long
def test_every_group_of_routes_is_listed(visit: Callable[..., Visitor], server: Server) -> None:
    page = visit().page
    page.goto(f"{server.url}/docs")
    document = page.evaluate("fetch('openapi.json').then((answer) => answer.json())")
    tags = {o["tags"][0] for methods in document["paths"].values() for o in methods.values()}
    expect(page.locator(".opblock-tag")).to_have_count(len(tags))
    expect(page.locator(".information-container")).to_contain_text("A slow client gets fewer frames")
