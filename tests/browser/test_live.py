"""Live sources in the page, with the real emulator: switched, unplugged, disturbed, frozen, recorded, replayed."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browsing import GOLF, Server, Visitor
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from playwright.sync_api import Browser, WebSocket, expect
from waiting import wait_until

from lidarcore.rplidar.emulator_process import EmulatorProcess

Frame = dict[str, Any]


class Watched:
    """A page, and the frames it has been sent."""

    def __init__(self, visitor: Visitor) -> None:
        self.page, self.server = visitor.page, visitor.server
        self.frames = list[Frame]()
        self.page.on("websocket", self._listen)
        visitor.open()

    def _listen(self, stream: WebSocket) -> None:
        if stream.url.endswith("/api/v1/stream"):
            stream.on("framereceived", lambda text: self._receive(json.loads(text)))

    def _receive(self, message: Frame) -> None:
        if message["type"] == "frame":
            self.frames.append(message)

    def wait_for(self, holds: Callable[[Frame], object], what: str, since: int | None = None) -> Frame:
        """The first frame from now on, or after so many, of which this holds."""
        seen = len(self.frames) if since is None else since

        def found() -> bool:
            self.page.wait_for_timeout(
                20
            )  # events of the browser are only handled while it is asked something
            return any(holds(frame) for frame in self.frames[seen:])

        wait_until(found, what)
        return next(frame for frame in self.frames[seen:] if holds(frame))

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def expect_streaming(self) -> None:
        """The page says so, and shows it."""
        expect(self.page.locator("#source-state")).to_have_text("Streaming")
        expect(self.page.locator("#live")).to_have_text("Live")
        expect(self.page.locator("#banner")).to_be_hidden()
        self.wait_for(lambda frame: frame["source"]["kind"] != "recording", "live frames arrive")

    def expect_cut_off(self) -> None:
        expect(self.page.locator("#source-state")).to_contain_text("Disconnected, reconnects")
        expect(self.page.locator("#live")).to_have_text("No signal")
        expect(self.page.locator("#banner")).to_contain_text("when the lidar is back")
        for figure in ("readout-rate", "readout-complete", "device-rate", "device-completeness", "dial-text"):
            expect(self.page.locator(f"#{figure}")).to_have_text("\u2013")
        port = self.server.get("source")["device"]["port"]
        expect(self.page.locator("#source-facts .fault")).to_contain_text(port)


@pytest.fixture(scope="module")
def watched(browser: Browser, running: Server) -> Iterator[Watched]:
    """One page for all: loading one for each test would take half a minute."""
    running.reset()
    visitor = Visitor(browser.new_page(viewport={"width": 1000, "height": 640}, color_scheme="dark"), running)
    yield Watched(visitor)
    visitor.page.close()
    visitor.check()


@pytest.fixture
def live(watched: Watched, server: Server) -> Watched:
    """A page with the source's panel open, and the emulator playing."""
    watched.page.get_by_role("tab", name="Source").click()
    watched.expect_streaming()
    return watched


def pressed(live: Watched, name: str) -> None:
    button = live.page.get_by_role("button", name=name, exact=True)
    expect(button).to_have_attribute("aria-pressed", "true")


@pytest.mark.long
@pytest.mark.real_data
def test_source_is_switched_while_it_runs(live: Watched) -> None:
    (live.server.folder / GOLF.name).write_bytes(GOLF.read_bytes())
    pressed(live, "Emulator")
    live.press("Emulated S1")
    live.page.get_by_role("button", name=re.compile(GOLF.name)).first.click()
    expect(live.page.locator("#readout-source")).to_have_text(GOLF.name)
    pressed(live, "Recording")
    live.wait_for(lambda frame: frame["source"]["index"] > 3, "the recording plays")
    expect(live.page.locator("#device")).to_be_hidden()
    live.press("Emulator")
    live.expect_streaming()
    expect(live.page.locator("#readout-source")).to_have_text("Emulated S1")
    live.press("Recording")
    expect(live.page.locator("#readout-source")).to_have_text(GOLF.name)


@pytest.mark.long
def test_demo_that_comes_along_plays_and_cannot_be_deleted(live: Watched) -> None:
    demo, real = (
        entry["name"] for entry in live.server.get("recordings")["recordings"] if entry.get("builtin")
    )
    live.page.get_by_role("button", name=re.compile(real)).first.click()
    expect(live.page.locator("#readout-source")).to_have_text(real)
    live.wait_for(
        lambda frame: frame["source"]["index"] > 3 and frame["corners"], "it plays, and has corners"
    )
    live.page.get_by_role("button", name=re.compile(demo)).first.click()
    expect(live.page.locator("#readout-source")).to_have_text(demo)
    live.wait_for(
        lambda frame: frame["source"]["index"] > 3 and frame["corners"], "it plays, and has corners"
    )
    about = live.page.get_by_role("listitem").filter(has_text=demo)
    expect(about).to_contain_text(re.compile(r"12.s, 1\.5.MB.*RPLIDAR S1"))
    live.press("Emulator")
    expect(live.page.get_by_role("button", name=f"Delete {demo}")).to_have_count(0)


@pytest.mark.long
def test_device_that_is_not_there_is_refused_with_the_cure_and_the_emulator_goes_on(live: Watched) -> None:
    answer = live.server.api.put("source", json={"kind": "device", "port": "/dev/ttyUSB99"})
    assert answer.status_code == 404
    assert "/dev/ttyUSB99" in answer.json()["detail"]
    live.expect_streaming()
    pressed(live, "Emulator")


@pytest.mark.long
def test_device_unplugged_and_plugged_in_again_under_the_page(live: Watched) -> None:
    with EmulatorProcess(seed=3) as lidar:
        choice = {"kind": "device", "port": lidar.port}
        live.server.api.put("source", json=choice).raise_for_status()
        expect(live.page.locator("#readout-source")).to_have_text("RPLIDAR S1")
        pressed(live, "Device")
        expect(live.page.locator("#device-facts")).to_contain_text(lidar.port)
        expect(live.page.locator("#faults")).to_be_hidden()
        live.expect_streaming()
        lidar.command("unplug")
        live.expect_cut_off()
        lidar.command("replug")
        live.expect_streaming()
        reconnects = live.server.get("source")["device"]["reconnects"]
        assert reconnects >= 1  # a machine that is held up for seconds takes a sensor for lost
        expect(live.page.locator("#device-reconnects")).to_have_text(str(reconnects))
        live.press("Emulator")
        expect(live.page.locator("#readout-source")).to_have_text("Emulated S1")
        live.expect_streaming()


@pytest.mark.long
def test_faults_of_the_emulator_are_seen_in_the_page(live: Watched) -> None:
    live.press("Unplug")
    live.expect_cut_off()
    live.press("Plug in again")
    live.expect_streaming()
    live.press("Lose 5 %")
    frame = live.wait_for(lambda frame: frame["gaps"], "a sector is lost")
    assert 0 < frame["completeness"] < 1
    expect(live.page.locator("#device-losses")).to_contain_text("Missing packets")
    expect(live.page.locator("#dial-lost")).to_have_attribute("d", re.compile("M.*A"))
    expect(live.page.locator("#device-completeness")).not_to_have_text("100\u2009%")
    live.press("Flip bits in 2 %")
    expect(live.page.locator("#device-losses")).to_contain_text("Damaged packets")
    live.press("No more faults")
    expect(live.page.locator("#device-completeness")).to_have_text("100\u2009%")
    expect(live.page.locator("#device-losses")).to_contain_text("nothing")


@pytest.mark.long
def test_emulator_that_was_killed_is_told_of_and_another_one_is_started(live: Watched) -> None:
    message = live.page.locator(".toast.error")
    live.server.kill_emulator()
    expect(message).to_contain_text("choose it again")
    expect(live.page.locator("#banner")).to_contain_text("choose it again")
    message.get_by_role("button", name="Dismiss this message").click()
    live.press("Plug in again")
    live.press("Start a new one")
    live.expect_streaming()
    live.server.kill_emulator()
    expect(message).to_contain_text("choose it again")
    live.press("Emulator")
    live.expect_streaming()
    expect(message).to_have_count(0)


@pytest.mark.long
def test_refusal_is_told_in_plain_words_until_something_else_is_opened(visitor: Visitor) -> None:
    visitor.tolerated.append("404")
    page, message = visitor.page, visitor.page.locator(".toast.error")
    tried = (
        "import('/static/js/actions.js').then(({ open }) => open({ kind: 'device', port: '/dev/ttyUSB99' }))"
    )
    assert page.evaluate(tried) is False
    expect(message.locator("strong")).to_have_text("The device could not be opened")
    expect(message).to_contain_text("/dev/ttyUSB99")
    page.get_by_role("tab", name="Source").click()
    page.get_by_role("button", name="Recording", exact=True).click()
    expect(message).to_have_count(0)


@pytest.mark.long
def test_message_goes_by_itself_but_not_while_it_has_the_focus(visit: Callable[..., Visitor]) -> None:
    visitor = visit()
    visitor.page.clock.install()
    page = visitor.open().page
    page.evaluate("import('/static/js/toasts.js').then(({ report }) => report(new Error('No room left.')))")
    message = page.locator(".toast.error")
    message.get_by_role("button", name="Dismiss this message").focus()
    page.clock.fast_forward(15_000)
    expect(message).to_contain_text("No room left.")
    page.get_by_role("tab", name="Source").focus()
    page.clock.fast_forward(3_000)
    expect(message).to_have_count(0)


@pytest.mark.long
def test_speed_changed_in_the_page_is_the_lidars(live: Watched) -> None:
    live.page.get_by_label("Motor speed").fill("720")
    live.page.keyboard.press("Enter")
    expect(live.page.locator("#device-rate")).to_have_text(re.compile(r"^1(1\.[89]|2\.[0-2])"))
    assert live.server.get("source")["device"]["rpm"] == 720


def test_live_view_is_frozen_stepped_back_and_live_again(live: Watched) -> None:
    began = len(live.frames)
    live.wait_for(lambda _: len(live.frames) >= began + 8, "some scans are shown")
    live.press("Pause")
    expect(live.page.locator("#live")).to_have_text("Paused")
    wait_until(lambda: live.server.get("source")["state"] == "paused", "it is paused")
    shown = {frame["source"]["index"]: frame["stamp"] for frame in live.frames[began:]}
    last = live.server.pause()
    index, again = last["source"]["index"], {}
    while len(shown.keys() & again.keys()) < 3:  # a page that is busy is not shown every scan
        since, at = len(live.frames), index - len(again) - 1
        live.page.keyboard.press("ArrowLeft")
        again[at] = live.wait_for(
            lambda frame, at=at: frame["source"]["index"] == at, "an earlier one", since
        )
    assert {at: again[at]["stamp"] for at in again if at in shown}.items() <= shown.items()
    live.press("Back to live")
    newest = live.wait_for(lambda frame: frame["source"]["index"] > index, "newer scans")
    assert newest["stamp"] > last["stamp"]
    live.expect_streaming()


@pytest.mark.long
def test_link_to_a_live_view_shows_what_is_live_now(live: Watched, visit: Callable[..., Visitor]) -> None:
    live.page.wait_for_url("**#live=emulator*")
    assert "recording=" not in live.page.url
    index = live.server.get("source")["index"]
    visit().open("#live=device")
    live.wait_for(lambda frame: frame["source"]["index"] > index, "the same source goes on")
    assert live.server.get("source")["kind"] == "emulator"


@pytest.mark.long
def test_what_is_recorded_is_what_the_page_showed(live: Watched) -> None:
    page, server = live.page, live.server
    page.get_by_text("Raw", exact=True).click()
    began = len(live.frames)
    live.press("Record")
    expect(page.locator("#recorder-status")).to_have_text(re.compile(r"0:0\d\.\d · .*B\n?raw · .*B/s"))
    live.wait_for(lambda _: len(live.frames) >= began + 15, "some scans are shown", began)
    wait_until(lambda: server.get("recorder")["scans"] >= 15, "some scans are recorded")
    live.page.keyboard.press("w")
    expect(page.locator(".toast")).to_contain_text("Recorded")
    page.get_by_role("button", name="Play it").focus()  # a message that has the focus stays
    recorder = server.get("recorder")
    assert (recorder["state"], recorder["dropped"], recorder["error"]) == ("idle", 0, None)
    path = server.folder / recorder["name"]
    files = [path, path.with_suffix(".rplidar")]
    assert sum(file.stat().st_size for file in files) == recorder["size"]
    for file in files:
        expect(page.locator("#library-list")).to_contain_text(file.name)

    recorded = valid_by_stamp(path)
    shown = {stamp_of(f): f for f in live.frames if min(recorded) <= stamp_of(f) <= max(recorded)}
    assert len(shown) >= 10
    assert {stamp: frame["n_valid"] for stamp, frame in shown.items()}.items() <= recorded.items()

    live.press("Play it")
    expect(page.locator("#readout-source")).to_have_text(recorder["name"])
    replayed: dict[int, Frame] = {}

    def all_replayed() -> bool:
        page.wait_for_timeout(50)
        replayed.update((stamp_of(f), f) for f in live.frames if f["source"]["kind"] == "recording")
        return shown.keys() <= replayed.keys()

    wait_until(all_replayed, "every scan that was shown live is shown again")
    for stamp, frame in shown.items():
        assert what_was_found(replayed[stamp]) == pytest.approx(what_was_found(frame), abs=1e-5)


def stamp_of(frame: Frame) -> int:
    """In 0.1 ms, which is as far as a float of Unix seconds can be told from its neighbours with certainty."""
    return round(1e4 * frame["stamp"])


def valid_by_stamp(path: Path) -> dict[int, int]:
    """How many beams of each recorded scan have a return, read by MCAP's own library."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        scans = [message for *_, message in reader.iter_decoded_messages(topics=["/scan"])]
    return {
        round(1e4 * scan.header.stamp.sec + 1e-5 * scan.header.stamp.nanosec): sum(
            scan.range_min <= value <= scan.range_max for value in scan.ranges
        )
        for scan in scans
    }


def what_was_found(frame: Frame) -> list[float]:
    """Numbers of a frame that any change of a single beam would change."""
    walls = [wall for found in frame["segments"].values() for wall in found]
    lines = [value for wall in walls for value in (wall["alpha"], wall["r"], wall["rms"], *wall["start"])]
    return [frame["n_beams"], frame["n_valid"], frame["completeness"], len(walls), *lines]
