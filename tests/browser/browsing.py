"""A real server in a process of its own, and real browsers that look at it."""

import contextlib
import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import numpy as np
import psutil
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import ConsoleMessage, Page, expect
from waiting import PATIENCE, free_port, wait_until

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
GOLF = DATA / "rplidar_csv_rooms" / "golf_room.csv.gz"
HOKUYO = DATA / "ccny_hokuyo_rosbag1" / "demo.bag"
CHROMIUM = "/usr/bin/chromium-headless-shell"
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader",
]  # fmt: skip
PIXEL_OF = """async ([kind, id]) => {
  const [{ lookNow }, { worldOf }, { get }] = await Promise.all(
    ["scene.js", "overlay/world.js", "store.js"].map((name) => import(`/static/js/${name}`)));
  const world = worldOf(get("frame"), get("landmarks") ?? new Map());
  return lookNow().toScreen(world[`${kind}s`].find((thing) => thing.id === id).at);
}"""
PIXEL_AT = """async (place) => {
  const { lookNow } = await import("/static/js/scene.js");
  return lookNow().toScreen(place);
}"""
expect.set_options(timeout=1e3 * PATIENCE)
Pixels = NDArray[np.int64]


class Server:
    """`lidarcore serve` on a port that stays its own when it is killed and started again."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.folder, self.url = folder, f"http://127.0.0.1:{self.port}"
        self.api = httpx.Client(base_url=f"{self.url}/api/v1/", timeout=PATIENCE)

    def start(self) -> None:
        self.launch()
        wait_until(self._is_ready, "the server is ready", 120)

    def launch(self) -> None:
        """Start it, and do not wait for it."""
        command = [
            sys.executable,
            "-m",
            "lidarcore_app.cli.main",
            "serve",
            "--http-port",
            str(self.port),
            "--emulator",
        ]
        self._process = subprocess.Popen([*command, "--recordings", str(self.folder)], cwd=ROOT)

    def _is_ready(self) -> bool:
        assert self._process.poll() is None, f"the server ended with {self._process.returncode}"
        with contextlib.suppress(httpx.TransportError):
            return self.get("health")["ready"] and self.api.get("frame").is_success
        return False

    def kill(self) -> None:
        os.kill(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def kill_emulator(self) -> None:
        (emulator,) = (
            child
            for child in psutil.Process(self._process.pid).children(recursive=True)
            # One that has just ended has no command line.
            if child.status() != psutil.STATUS_ZOMBIE and "lidarcore.rplidar.emulator" in child.cmdline()
        )
        emulator.kill()

    def get(self, path: str) -> dict:
        return self.api.get(path).raise_for_status().json()

    def patch(self, path: str, change: dict) -> dict:
        return self.api.patch(path, json=change).raise_for_status().json()

    def show(self, recording: Path, index: int) -> None:
        """Show one scan of a recording, which is put into the folder."""
        (self.folder / recording.name).write_bytes(recording.read_bytes())
        choice = {"kind": "recording", "name": recording.name, "index": index, "paused": True}
        self.api.put("source", json=choice).raise_for_status()
        position = {"kind": "recording", "index": index}
        wait_until(lambda: self.get("frame")["source"].items() >= position.items(), f"scan {index} is shown")

    def pause(self) -> dict:
        """The frame that stays. One scan back and forward again: what was in the making before has been shown then."""
        self.patch("source", {"state": "paused"})
        self.step(-1)
        return self.step(1)

    def step(self, by: int) -> dict:
        """The frame of the scan so many later, or earlier."""
        index = self.api.post("source/step", json={"by": by}).raise_for_status().json()["index"]
        wait_until(lambda: self.get("frame")["source"]["index"] == index, f"scan {index} is shown")
        return self.get("frame")

    def disturb(self, *commands: str) -> None:
        for command in commands:
            self.api.post("emulator", json={"command": command}).raise_for_status()

    def reset(self) -> None:
        """As after its start: the emulator plays, settings are the defaults, the folder is empty, no scan is judged."""
        self.api.post("recorder/stop")
        self.api.put("selection", json={"corner": None, "landmark": None}).raise_for_status()
        groups = ("sensor", "extraction", "clusters", "navigation", "view", "repeatability")
        self.patch("settings", dict.fromkeys(groups))
        self.api.delete("repeatability").raise_for_status()
        self.emulate()
        for recording in self.get("recordings")["recordings"]:
            if not recording["builtin"]:
                self.api.delete(f"recordings/{recording['name']}").raise_for_status()

    def emulate(self) -> None:
        """Starting an emulator takes a second: one that runs is only made whole again."""
        source = self.get("source")
        if source["kind"] != "emulator":
            self.api.put("source", json={"kind": "emulator"}).raise_for_status()
        elif source["device"]["state"] != "streaming":
            self.disturb("replug")
        self.disturb("flip 0", "lose 0")
        self.patch("source", {"state": "playing", "speed": 1, "loop": True, "rpm": 600})
        wait_until(lambda: self.get("source")["device"]["state"] == "streaming", "the emulator streams")


def _told(message: ConsoleMessage) -> str:
    """What a message of the console says, and of which address."""
    return f"{message.text} {message.location['url']}"


class Visitor:
    """A page, everything it asked for, and every error it logged."""

    def __init__(self, page: Page, server: Server) -> None:
        self.page, self.server = page, server
        self.asked: list[str] = []
        self.errors: list[str] = []
        self.tolerated: list[str] = []
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("websocket", lambda websocket: self.asked.append(websocket.url))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda message: message.type == "error" and self.errors.append(_told(message)))

    def open(self, hash: str = "") -> "Visitor":
        """Go there; the page has a frame, all its controls, and has done what the link asks for."""
        self.page.goto(f"{self.server.url}/{hash}")
        expect(self.page.locator("#readout-frame")).to_have_text(re.compile(r"^\d+$"))
        expect(self.page.locator("#setting-extraction-min_points")).to_have_value(re.compile(r"^\d+$"))
        if not hash:  # it writes its own once it is done
            wait_until(lambda: self.page.evaluate("location.hash"), "the address says what is shown")
        return self

    def knows(self, key: str) -> Any:
        """What the page itself knows of "settings", "source", "selection", "recorder", "frame", ..."""
        return self.page.evaluate("key => import('/static/js/store.js').then(({ get }) => get(key))", key)

    def catch_up(self) -> "Visitor":
        """Wait until the page knows what the server knows."""
        server = self.server
        wait_until(lambda: self.knows("settings") == server.get("settings"), "the page has the settings")
        wait_until(lambda: self.knows("selection") == server.get("selection"), "the page has the selection")
        wait_until(
            lambda: self.knows("recorder")["state"] == server.get("recorder")["state"],
            "the page has the recorder",
        )
        names = ("kind", "recording", "state", "speed", "loop")
        wait_until(
            lambda: (
                [self.knows("source")[name] for name in names]
                == [server.get("source")[name] for name in names]
            ),
            "the page has the source",
        )
        return self

    def await_frame(self, frame: dict) -> dict:
        """Wait until the page shows this frame, which stays, or its scan once more: on a map that was behind."""
        index = frame["source"]["index"]
        wait_until(
            lambda: (
                int(self.readout("frame")) >= frame["sequence"]
                and self.knows("frame")["source"]["index"] == index
            ),
            "the page shows the frame that stays",
        )
        return frame

    def readout(self, name: str) -> str:
        return self.page.inner_text(f"#readout-{name}")

    def picture(self) -> Pixels:
        """(H, W, 3) pixels of the scene."""
        image = Image.open(io.BytesIO(self.page.locator("#scene").screenshot()))
        return np.asarray(image.convert("RGB")).astype(np.int64)

    def still_picture(self, differs_from: Pixels | None = None, seconds: float = 0.3) -> Pixels:
        """The picture once nothing has moved in it for so long, and it is no longer the one given."""
        picture, since = self.picture(), time.monotonic()

        def still() -> bool:
            nonlocal picture, since
            before, picture = picture, self.picture()
            changed = differs_from is None or (picture != differs_from).any()
            if not changed or (picture != before).any() or not drawn(picture).any():
                since = time.monotonic()
            return time.monotonic() - since > seconds

        wait_until(still, "the picture stands still")
        return picture

    def fit(self) -> None:
        """Fit the room in the view and wait until the camera has come to rest."""
        self.page.get_by_role("button", name="Fit the room in the view").click()
        self.still_picture(seconds=1.5)  # the scene looks every second whether the room is still in the view

    def pixel_of(self, kind: str, id: int) -> tuple[float, float]:
        """Where on the page a corner or landmark is drawn."""
        x, y = self.page.evaluate(PIXEL_OF, [kind, id])
        box = self.page.locator("#scene").bounding_box()
        return box["x"] + x, box["y"] + y

    def pixel_at(self, place: list[float]) -> tuple[float, float]:
        """Where on the page a place [x, y] of the world, m, is."""
        x, y = self.page.evaluate(PIXEL_AT, place)
        box = self.page.locator("#scene").bounding_box()
        return box["x"] + x, box["y"] + y

    def check(self) -> None:
        """Nothing went out of this machine, and nothing went wrong."""
        hosts = {urlsplit(url).netloc for url in self.asked if not url.startswith(("blob:", "data:"))}
        assert hosts <= {urlsplit(self.server.url).netloc}, hosts
        wrong = [text for text in self.errors if not any(part in text for part in self.tolerated)]
        assert wrong == [], wrong


def drawn(picture: Pixels) -> NDArray[np.bool_]:
    """(H, W) where the picture is not its background, which is its commonest colour."""
    colours, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    return np.abs(picture - colours[counts.argmax()]).sum(axis=2) > 60
