"""The pictures in the documentation: `python docs/screenshots.py FOLDER [NAME ...]` takes them anew.

It starts a server of its own, brings it into each of twelve states, and looks at it with headless Chromium: on a desk
(1400 x 900) and on a phone (390 x 844), in light and dark.
"""

import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
from PIL import Image
from playwright.sync_api import Browser, expect, sync_playwright

CHROMIUM = "/usr/bin/chromium-headless-shell"
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--hide-scrollbars"]
DESK, PHONE = (1400, 900), (390, 844)
PATIENCE = 600.0  # s
DEFAULTS = dict.fromkeys(("clusters", "navigation", "view", "repeatability")) | {
    "extraction": {"covariance": None}  # the noise stays what it is for the sensor that plays
}
Json = dict[str, Any]


@dataclass(frozen=True)
class Shot:
    """One state of the page: what plays, which settings, which tab, and how long to let it run.

    clicks are the selectors of what is pressed then.
    """

    name: str
    tab: str = "setup"
    settings: Json = field(default_factory=dict)
    source: Json = field(default_factory=lambda: {"kind": "emulator"})
    seconds: float = 3.0
    settle: float = 6.0
    clicks: tuple[str, ...] = ()
    first_visit: bool = False
    sizes: tuple[tuple[int, int], ...] = (DESK, PHONE)
    themes: tuple[str, ...] = ("light", "dark")


TWO_ROOMS = {"kind": "simulation", "settings": {"world": "two rooms"}}
SHOTS = (
    Shot("welcome", first_visit=True),
    Shot("live"),
    Shot("corner", clicks=("#corner-table tbody tr:nth-child(2) button",)),
    Shot(
        "compare",
        settings={
            "view": {"compare": True, "methods": ["cwlf", "wctls", "ml"]},
            "extraction": {"covariance": "published"},
        },
    ),
    Shot("rejected", tab="rejections", settings={"view": {"layers": {"rejected": True}}}),
    Shot("calibration", seconds=0, clicks=("#calibrate button",), settle=60.0),
    Shot("repeatability", tab="repeatability", settings={"repeatability": {"running": True}}, seconds=20),
    Shot("plots", tab="plots"),
    Shot("recordings", tab="sources", source={"kind": "recording", "name": "real-rplidar-windsor.npz"}),
    Shot("help", clicks=("#help",)),
    Shot(
        "walls",
        tab="map",
        settings={"navigation": {"mode": "slam", "method": "scans"}},
        source=TWO_ROOMS,
        seconds=60,
    ),
    Shot(
        "map",
        tab="map",
        settings={"navigation": {"mode": "slam", "method": "landmarks"}},
        source=TWO_ROOMS,
        seconds=60,
    ),
)


def main(folder: Path, names: list[str]) -> None:
    """Take those named, or all, as WebP files named NAME-THEME.webp and NAME-THEME-phone.webp."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as home, _server(Path(home)) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        with httpx.Client(base_url=f"{url}/api/v1", timeout=30) as api:
            for shot in SHOTS:
                if names and shot.name not in names:
                    continue
                _take(shot, browser, api, url, folder)
        browser.close()


def _take(shot: Shot, browser: Browser, api: httpx.Client, url: str, folder: Path) -> None:
    api.patch("/settings", json=DEFAULTS).raise_for_status()
    if api.get("/source").json()["kind"] != shot.source["kind"]:
        api.put("/source", json=shot.source).raise_for_status()
    api.patch("/settings", json=shot.settings).raise_for_status()
    time.sleep(shot.seconds)
    for theme in shot.themes:
        api.patch("/settings", json={"view": {"theme": theme}}).raise_for_status()
        for size in shot.sizes:
            name = f"{shot.name}-{theme}{'-phone' if size == PHONE else ''}.webp"
            _save(_picture(browser, url, shot, theme, size), folder / name)
            print(folder / name, flush=True)


def _picture(browser: Browser, url: str, shot: Shot, theme: str, size: tuple[int, int]) -> bytes:
    width, height = size
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=theme)  # type: ignore[arg-type]
    if not shot.first_visit:
        context.add_init_script("localStorage.setItem('welcomed', 'yes')")
    page = context.new_page()
    page.goto(url)
    expect(page.locator("#readout-frame")).to_have_text(re.compile(r"^\d+$"), timeout=1e3 * PATIENCE)
    page.locator(f"#tab-{shot.tab}").click()
    if page.locator("#fit").is_visible():
        page.locator("#fit").click()
    for selector in shot.clicks:
        page.locator(selector).dispatch_event("click")  # also where a phone shows another panel
    page.wait_for_timeout(
        1e3 * shot.settle
    )  # software draws the scene slowly, and the camera moves to fit the room
    picture = page.screenshot()
    context.close()
    return picture


def _save(png: bytes, path: Path) -> None:
    Image.open(BytesIO(png)).convert("RGB").save(path, quality=88, method=6)


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
    process = subprocess.Popen([*command, "--recordings", str(home / "recordings")], cwd=home)
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
