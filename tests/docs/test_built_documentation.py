"""The built documentation: strict, complete, and nothing in it asks another machine for anything."""

import asyncio
import importlib
import pkgutil
import re
import subprocess
import sys
import threading
import types
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import httpx
import pytest
from lidarcore_app.web.security import Guard
from lidarcore_app.web.server import Documentation
from lidarcore_app.web.serving import listen, uvicorn_server
from playwright.sync_api import sync_playwright

import lidarcore

ROOT = Path(__file__).parents[2]
CHROMIUM = "/usr/bin/chromium-headless-shell"
WHOLE_PAGES = ("guide.html",)  # written by hand or by others: not Sphinx's to check


class Page(HTMLParser):
    """What a page links to, what it loads, and which anchors it has."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.inline_scripts = 0
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif "src" in given or tag == "link":
            self.loads.append(given.get("src") or given["href"])
        self.inline_scripts += tag == "script" and "src" not in given


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built as `make docs` does, a warning being an error."""
    folder = tmp_path_factory.mktemp("documentation")
    options = ["--builder", "html", "--fail-on-warning", "--keep-going", "--quiet", "--fresh-env"]
    command = [sys.executable, "-m", "sphinx", *options, str(ROOT / "docs"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session")
def pages(built: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in built.rglob("*.html")}


def test_make_builds_it_as_strictly() -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    assert "-m sphinx --builder html --fail-on-warning --keep-going --quiet --fresh-env" in makefile


@pytest.mark.long
def test_every_link_leads_somewhere(pages: dict[Path, Page]) -> None:
    dead = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or path.name in WHOLE_PAGES:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file() or (
                parts.fragment and unquote(parts.fragment) not in pages[target].anchors
            ):
                dead.append((path.name, link))
    assert not dead


@pytest.mark.long
def test_nothing_is_loaded_from_elsewhere(built: Path, pages: dict[Path, Page]) -> None:
    for path, page in pages.items():
        assert not [url for url in page.loads if urlsplit(url).netloc], path
        assert path.name in WHOLE_PAGES or not page.inline_scripts, path  # the server's policy forbids them
    for sheet in built.rglob("*.css"):
        assert not re.findall(r"(?:url\(|@import)\s*['\"]?(?:https?:)?//", sheet.read_text("utf-8")), sheet


@pytest.mark.long
def test_every_public_class_and_function_is_described(pages: dict[Path, Page]) -> None:
    """Of the packages that say what is public; what several offer is described in one of them."""
    names = [m.name for m in pkgutil.iter_modules(lidarcore.__path__, "lidarcore.") if m.ispkg]
    packages = [importlib.import_module(name) for name in ["lidarcore", *names]]
    public = {name: getattr(p, name, None) for p in packages for name in getattr(p, "__all__", ())}
    assert len(public) > 50
    described = {anchor.rpartition(".")[2] for page in pages.values() for anchor in page.anchors}
    kinds = (type, types.FunctionType)
    assert not [name for name, value in public.items() if isinstance(value, kinds) and name not in described]


@pytest.mark.long
def test_every_term_of_the_glossary_is_there(pages: dict[Path, Page]) -> None:
    (glossary,) = (page for path, page in pages.items() if path.name == "glossary.html")
    for term in ("scan", "beam", "segment", "wall", "corner", "landmark", "coverage", "ANEES", "NIS", "gate"):
        assert f"term-{term}" in glossary.anchors


@pytest.fixture(scope="module")
def url(built: Path) -> Iterator[str]:
    """The built pages behind the guard of the real server, with its content policy."""
    listening = listen("127.0.0.1", 0)
    server = uvicorn_server(Guard(Documentation((built,)), (), None, ()))  # type: ignore[arg-type]
    thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[listening])), daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    server.should_exit = True
    thread.join(timeout=60)
    assert not thread.is_alive()


@pytest.mark.long
def test_a_browser_shows_it_under_the_content_policy(url: str) -> None:
    asked: list[str] = []
    wrong: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 390, "height": 844}, color_scheme="dark")
        page.set_default_timeout(120_000)
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda message: message.type == "error" and wrong.append(message.text))
        for path in (
            "",
            "tutorial.html",
            "how-to/rest.html",
            "reference/rest.html",
            "reference/python/lidarcore.html",
        ):
            page.goto(f"{url}/{path}")
            assert page.locator("h1").first.inner_text()
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, path
        page.goto(f"{url}/search.html?q=covariance")
        page.locator("#search-results li").first.wait_for()
        browser.close()
    assert not wrong
    assert {urlsplit(one).netloc for one in asked if not one.startswith("data:")} == {urlsplit(url).netloc}


def test_where_there_is_none_the_page_says_how_to_build_it(tmp_path: Path) -> None:
    transport = httpx.ASGITransport(Documentation((tmp_path,)))

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.get("/")

    answer = asyncio.run(ask())
    assert answer.status_code == 404
    assert "make docs" in answer.text
