"""The pictures in the documentation: `python docs/screenshots.py FOLDER [NAME ...]` takes them again.

It starts a server of its own, brings it into each of twelve states, and looks at it with headless Chromium: on a desk
(1400 x 900) in light and dark, and on a phone (390 x 844) in light.
"""

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium-headless-shell"
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--hide-scrollbars"]
LOOKS = (("light", (1400, 900), ""), ("dark", (1400, 900), ""), ("light", (390, 844), "-phone"))
PATIENCE = 600.0  # s
SETTLE = 4.0  # s; software draws the scene slowly, and the camera moves to fit the room
QUALITY = 78  # of WebP: what is written small can still be read
IS_DRAWN = """() => document.querySelector("#readout-frame")?.textContent > 0
  && document.querySelector("#scene").contentWindow.lidarView?.floorToWindow()"""
WALL = """async () => {
  const { lookNow } = await import("/static/js/scene.js");
  const { worldOf } = await import("/static/js/overlay/world.js");
  const { get } = await import("/static/js/store.js");
  const { walls } = worldOf(get("frame"), new Map());
  const { ends: [[x0, y0], [x1, y1]] } = walls.sort((one, other) => other.length - one.length)[0];
  return [[x0, y0], [(x0 + x1) / 2, (y0 + y1) / 2], [x1, y1]].map((place) => lookNow().toScreen(place));
}"""
DEFAULTS = dict.fromkeys(("clusters", "navigation", "view", "repeatability")) | {
    "extraction": {"covariance": None}  # the noise stays what it is for the sensor that plays
}
Json = dict[str, Any]


def _click(*selectors: str) -> Callable[[Page], None]:
    """Click these, also where a phone shows another panel."""

    def act(page: Page) -> None:
        for selector in selectors:
            page.locator(selector).dispatch_event("click")

    return act


def _click_wall(page: Page) -> None:
    """The longest, in its middle."""
    _, (x, y), _ = page.evaluate(WALL)
    _click_scene(page, x, y)
    page.mouse.move(0, 0)


def _measure_wall(page: Page) -> None:
    """The longest, from end to end."""
    page.locator("#measure").dispatch_event("click")
    for x, y in page.evaluate(WALL)[::2]:
        _click_scene(page, x, y)
        page.wait_for_timeout(300)
    page.mouse.move(0, 0)


def _calibrate(page: Page) -> None:
    """Show what was found; the first time it has to be measured."""
    use = page.locator("#calibration [data-key=use]")
    if not use.count():
        page.locator("#calibrate button").dispatch_event("click")
    use.wait_for(state="attached", timeout=1e3 * PATIENCE)
    page.locator("#calibration").evaluate("node => node.scrollIntoView()")


def _click_scene(page: Page, x: float, y: float) -> None:
    box = page.locator("#scene").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + x, box["y"] + y)


@dataclass(frozen=True)
class Shot:
    """One state of the page: what plays, which settings and tab, how long it runs (s), and what is done then."""

    name: str
    tab: str = "setup"
    settings: Json = field(default_factory=dict)
    source: Json = field(default_factory=lambda: {"kind": "emulator"})
    seconds: float = 0.0
    act: Callable[[Page], None] = lambda _: None
    first_visit: bool = False
    path: str = ""


TWO_ROOMS = {"kind": "simulation", "settings": {"world": "two rooms"}}
PUBLISHED = {
    "view": {"compare": True, "methods": ["cwlf", "wctls", "ml"]},
    "extraction": {"covariance": "published"},
}
SHOTS = (
    Shot("welcome", first_visit=True),
    Shot("live"),
    Shot("compare", settings=PUBLISHED),
    Shot(
        "corner",
        tab="repeatability",
        settings=PUBLISHED | {"repeatability": {"running": True}},
        seconds=20,
        act=_click("#corner-table tbody tr:nth-child(2) button"),
    ),
    Shot("wall", settings=PUBLISHED, act=_click_wall),
    Shot("measure", act=_measure_wall),
    Shot("rejected", tab="rejections", settings={"view": {"layers": {"rejected": True}}}),
    Shot("calibration", act=_calibrate),
    Shot("repeatability", tab="repeatability", settings={"repeatability": {"running": True}}, seconds=20),
    Shot("recordings", tab="sources", source={"kind": "recording", "name": "real-rplidar-windsor.npz"}),
    Shot("map", "map", {"navigation": {"mode": "slam", "method": "scans"}}, TWO_ROOMS, seconds=60),
    Shot("landmarks", "map", {"navigation": {"mode": "slam", "method": "landmarks"}}, TWO_ROOMS, seconds=60),
)


def main(folder: Path, names: list[str]) -> None:
    """Take those named, or all, as WebP files named NAME-light, NAME-dark and NAME-light-phone."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as home, _server(Path(home)) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        with httpx.Client(base_url=f"{url}/api/v1", timeout=30) as api:
            for shot in SHOTS:
                if not names or shot.name in names:
                    _prepare(shot, api)
                    for theme, size, suffix in LOOKS:
                        api.put("/selection", json={"corner": None, "landmark": None}).raise_for_status()
                        path = folder / f"{shot.name}-{theme}{suffix}.webp"
                        _save(_picture(browser, url, shot, theme, size), path)
                        print(path, flush=True)
        browser.close()


def _prepare(shot: Shot, api: httpx.Client) -> None:
    api.patch("/settings", json=DEFAULTS).raise_for_status()
    if api.get("/source").json()["kind"] != shot.source["kind"]:
        api.put("/source", json=shot.source).raise_for_status()
    api.patch("/settings", json=shot.settings).raise_for_status()
    time.sleep(shot.seconds)


def _picture(browser: Browser, url: str, shot: Shot, theme: str, size: tuple[int, int]) -> bytes:
    width, height = size
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=theme)  # type: ignore[arg-type]
    if not shot.first_visit:
        context.add_init_script("localStorage.setItem('welcomed', 'yes')")
    page = context.new_page()
    page.goto(url)
    page.wait_for_function(IS_DRAWN, timeout=1e3 * PATIENCE)
    page.locator(f"#tab-{shot.tab}").click()
    _click("#fit")(page)
    page.wait_for_timeout(1e3 * SETTLE)
    shot.act(page)
    page.wait_for_timeout(1e3 * SETTLE)
    picture = page.screenshot()
    context.close()
    return picture


def _save(png: bytes, path: Path) -> None:
    Image.open(BytesIO(png)).convert("RGB").save(path, quality=QUALITY, method=6)


@contextmanager
def _server(home: Path) -> Iterator[str]:
    """`lidarcore serve` with an emulated sensor and folders of its own; its address, once it shows frames."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "lidarcore_app.cli.main",
        "serve",
        "--emulator",
        "--http-port",
        str(port),
    ]
    process = subprocess.Popen([*command, "--recordings", "recordings"], cwd=home)
    url = f"http://127.0.0.1:{port}"
    try:
        _await_frames(url, process)
        yield url
    finally:
        process.terminate()
        process.wait(timeout=30)


def _await_frames(url: str, process: "subprocess.Popen[bytes]") -> None:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if process.poll() is not None:
            raise SystemExit(f"The server ended with {process.returncode}.")
        try:
            if httpx.get(f"{url}/api/v1/frame").is_success:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.5)
    raise SystemExit(f"The server showed no frame within {PATIENCE:g} s.")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python docs/screenshots.py FOLDER [NAME ...]")
    main(Path(sys.argv[1]), sys.argv[2:])
