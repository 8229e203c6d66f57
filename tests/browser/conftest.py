"""Servers and browsers for the tests of the page."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browsing import CHROMIUM, FLAGS, Server, Visitor
from playwright.sync_api import Browser, sync_playwright
from waiting import PATIENCE


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="package")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("recordings"))
    server.start()
    yield server
    server.kill()


@pytest.fixture
def server(running: Server) -> Server:
    """The server that the tests share, as after its start."""
    running.reset()
    return running


@pytest.fixture
def visit(
    browser: Browser, server: Server, request: pytest.FixtureRequest
) -> Iterator[Callable[..., Visitor]]:
    """Makes a fresh browser with nothing remembered, looking at the shared server unless told another.

    Only tests marked `scene` have it: without a GPU it takes more time to draw than all the rest of the page.
    """
    visitors: list[Visitor] = []
    has_scene = request.node.get_closest_marker("scene") is not None

    def make(
        width: int = 1000,
        height: int = 640,
        theme: str = "dark",
        at: Server = server,
        first_visit: bool = False,
        **options: bool | str,
    ) -> Visitor:
        context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=theme, **options
        )
        context.set_default_timeout(1e3 * PATIENCE)
        if not first_visit:
            context.add_init_script("localStorage.setItem('welcomed', 'yes')")
        if not has_scene:
            context.route("**/viser/**", lambda route: route.fulfill(body="", content_type="text/html"))
        visitors.append(Visitor(context.new_page(), at))
        return visitors[-1]

    yield make
    for visitor in visitors:
        visitor.page.context.close()
    for visitor in visitors:
        visitor.check()


@pytest.fixture
def visitor(visit: Callable[..., Visitor]) -> Visitor:
    """One browser with the page open."""
    return visit().open()


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """A server for one test alone, which may kill it."""
    server = Server(tmp_path)
    server.start()
    yield server
    server.kill()
