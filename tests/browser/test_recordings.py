"""Recordings from the page: upload, play, step and seek; what cannot be read is refused with a reason."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from browsing import GOLF, HOKUYO, Server, Visitor, drawn
from playwright.sync_api import expect
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from waiting import wait_until

from lidarcore import open_recording

pytestmark = pytest.mark.real_data

DROP = """([name, text]) => {
  const data = new DataTransfer();
  data.items.add(new File([text], name));
  const options = {dataTransfer: data, bubbles: true, cancelable: true};
  const fire = (node, type) => node.dispatchEvent(new DragEvent(type, options));
  const veil = document.getElementById("drop");
  fire(document.getElementById("scene").contentDocument.body, "dragenter");
  if (!veil.checkVisibility()) throw new Error("nothing takes the drop");
  fire(veil, "drop");
}"""

# Each [name, value, figure] of a progress bar, however short it is there.
WATCH_PROGRESS = """() => {
  window.progressSeen = [];
  new MutationObserver(() => {
    for (const bar of document.querySelectorAll("#uploads progress"))
      window.progressSeen.push([bar.ariaLabel, bar.value, bar.closest("li").querySelector("small").textContent]);
  }).observe(document.getElementById("uploads"), {childList: true, subtree: true, characterData: true});
}"""


def upload(visitor: Visitor, path: Path) -> None:
    visitor.page.get_by_role("tab", name="Source").click()
    visitor.page.get_by_label("Recording to upload").set_input_files(path)
    expect(visitor.page.locator("#readout-source")).to_have_text(path.name)


@pytest.fixture
def golf(visitor: Visitor) -> Visitor:
    """A page that plays a real recording it has uploaded."""
    upload(visitor, GOLF)
    return visitor


@pytest.mark.scene
def test_upload_is_stored_and_plays(golf: Visitor) -> None:
    server, page = golf.server, golf.page
    assert (server.folder / GOLF.name).read_bytes() == GOLF.read_bytes()
    wait_until(lambda: server.get("source")["index"] > 3, "it plays")
    wait_until(lambda: drawn(golf.picture()).mean() > 0.01, "its room is drawn")
    wait_until(lambda: page.locator("#corner-table tbody tr").count() > 0, "corners are listed")
    expect(page.locator("#library-list [aria-current=true]")).to_contain_text(GOLF.name)
    expect(page.locator("#uploads li")).to_have_count(0)  # the progress bar is gone


@pytest.mark.long
def test_upload_shows_its_progress(visitor: Visitor) -> None:
    page = visitor.page
    slow = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 500_000}
    page.context.new_cdp_session(page).send("Network.emulateNetworkConditions", slow)
    page.get_by_role("tab", name="Source").click()
    page.evaluate(WATCH_PROGRESS)
    page.get_by_label("Recording to upload").set_input_files(HOKUYO)
    expect(page.locator("#readout-source")).to_have_text(HOKUYO.name)
    seen = page.evaluate("window.progressSeen")
    parts = [value for name, value, _ in seen if name == f"Uploading {HOKUYO.name}" and 0 < value < 1]
    assert len(parts) >= 2, seen
    assert parts == sorted(parts)
    assert any("of 1.0\u2009MB" in figure for _, _, figure in seen)


@pytest.mark.long
def test_unreadable_upload_is_refused_and_what_played_goes_on(golf: Visitor) -> None:
    golf.tolerated.append("422")
    server, page = golf.server, golf.page
    page.evaluate(DROP, ["holiday.txt", "no lidar was there"])
    message = page.locator(".toast.error")
    expect(message).to_contain_text("holiday.txt")
    assert not (server.folder / "holiday.txt").exists()
    frame = server.get("frame")["sequence"]
    wait_until(lambda: int(golf.readout("frame")) > frame + 3, "the recording goes on")
    assert golf.readout("source") == GOLF.name
    message.get_by_role("button", name="Dismiss this message").click()
    expect(message).to_have_count(0)


@pytest.mark.long
def test_name_that_is_taken_can_be_replaced(golf: Visitor) -> None:
    golf.tolerated.append("409")
    golf.page.get_by_label("Recording to upload").set_input_files(GOLF)
    golf.page.get_by_role("button", name="Replace it").click()
    expect(golf.page.locator(".toast")).to_have_count(0)
    expect(golf.page.locator("#uploads li")).to_have_count(0)
    wait_until(lambda: golf.server.get("source")["state"] == "playing", "it plays again")


@pytest.mark.long
def test_transport_pauses_steps_seeks_and_plays_on(golf: Visitor) -> None:
    server, page = golf.server, golf.page
    wait_until(lambda: server.get("source")["complete"], "all scans are read")
    count = server.get("source")["count"]
    page.get_by_role("button", name="Pause").click()
    wait_until(lambda: server.get("source")["state"] == "paused", "it is paused")
    index = server.get("source")["index"]
    page.get_by_role("button", name="One scan forward").click()
    expect(page.locator("#position")).to_have_text(f"{index + 2}\u2009/\u2009{count}")
    page.get_by_role("button", name="One scan back").click()
    expect(page.locator("#position")).to_have_text(f"{index + 1}\u2009/\u2009{count}")
    page.get_by_label("Position in the recording").fill("600")
    wait_until(lambda: server.get("frame")["source"]["index"] == 600, "it has jumped")
    expect(page.locator("#position")).to_have_text(f"601\u2009/\u2009{count}")
    page.get_by_label("Speed", exact=True).select_option("5")
    page.get_by_role("button", name="Play", exact=True).click()
    wait_until(lambda: server.get("frame")["source"]["index"] > 610, "it plays on")
    assert server.get("source")["speed"] == 5


@pytest.mark.long
def test_end_is_reached_without_loop_and_play_begins_again(golf: Visitor) -> None:
    server, page = golf.server, golf.page
    wait_until(lambda: server.get("source")["complete"], "all scans are read")
    count = server.get("source")["count"]
    expect(page.locator("#position")).to_have_text(re.compile(rf"/.{count}$"))  # as the page knows by now
    page.get_by_role("button", name="Play in a loop").click()
    wait_until(lambda: server.get("source")["loop"] is False, "the loop is off")
    page.get_by_label("Position in the recording").press("End")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
    wait_until(lambda: server.get("source")["state"] == "ended", "it has ended")
    page.get_by_role("button", name="Play", exact=True).click()
    wait_until(lambda: 0 < server.get("frame")["source"]["index"] < 100, "it plays from the beginning")


@pytest.mark.long
def test_recording_can_be_left_and_deleted(golf: Visitor) -> None:
    server, page = golf.server, golf.page
    page.get_by_role("button", name="Emulator").click()
    expect(page.locator("#readout-source")).to_have_text("Emulated S1")
    scans = sum(1 for _ in open_recording(GOLF))
    wait_until(lambda: server.get(f"recordings/{GOLF.name}/facts")["scans"] == scans, "it is read")
    expect(page.locator("#library-list li", has_text=GOLF.name)).to_contain_text(re.compile("9[45]\u2009s"))
    for _ in range(2):
        page.get_by_role("button", name=f"Delete {GOLF.name}").click()
        expect(page.get_by_role("button", name=f"Delete {GOLF.name}")).to_have_count(0)
        assert not (server.folder / GOLF.name).exists()
        page.get_by_role("button", name="Undo").click()
        expect(page.get_by_role("button", name=f"Delete {GOLF.name}")).to_be_visible()
    page.get_by_role("button", name=f"Rename {GOLF.name}").click()
    page.get_by_label(f"New name of {GOLF.name}").fill("golf 1.csv.gz")
    page.get_by_role("button", name="Rename", exact=True).click()
    with page.expect_download() as download:
        page.get_by_role("link", name="Download golf 1.csv.gz").click()
    assert Path(download.value.path()).read_bytes() == GOLF.read_bytes()


@pytest.mark.long
def test_one_of_several_lidars_is_chosen(visitor: Visitor, tmp_path: Path) -> None:
    visitor.tolerated.append("409")
    page, path = visitor.page, write_two_lidars(tmp_path / "two_lidars.bag")
    page.get_by_role("tab", name="Source").click()
    page.get_by_label("Recording to upload").set_input_files(path)
    page.get_by_role("radio", name="/rear").check()
    page.get_by_role("button", name="Play this topic").click()
    expect(page.locator("#readout-source")).to_have_text(path.name)
    expect(page.get_by_label("Lidar topic")).to_have_value("/rear")
    page.get_by_label("Lidar topic").select_option("/front")
    wait_until(lambda: visitor.server.get("source")["topic"] == "/front", "the other lidar plays")


def write_two_lidars(path: Path) -> Path:
    """A ROS 1 bag with two lidars, each in a square room of its own size."""
    store = get_typestore(Stores.ROS1_NOETIC)
    scan, header, stamp = (
        store.types[name]
        for name in ("sensor_msgs/msg/LaserScan", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    with Writer(path) as bag:
        for topic, half in (("/front", 2.0), ("/rear", 3.0)):
            connection = bag.add_connection(topic, scan.__msgtype__, typestore=store)
            ranges = (half / np.maximum(abs(np.cos(bearings)), abs(np.sin(bearings)))).astype(np.float32)
            for turn in range(5):
                head = header(turn, stamp(100 + turn, 0), "laser")
                step = float(bearings[1] - bearings[0])
                angles = float(bearings[0]), float(bearings[-1]), step
                message = scan(head, *angles, 0.0, 0.1, 0.1, 20.0, ranges, ranges[:0])
                bag.write(connection, (100 + turn) * 10**9, store.serialize_ros1(message, scan.__msgtype__))
    return path


def test_files_that_are_not_listed_for_their_names_are_told_of(
    visit: Callable[..., Visitor], server: Server
) -> None:
    names = [f"a<{number}.npz" for number in range(4)] + [f"<{190 * 'x'}"]
    for name in names:
        (server.folder / name).write_bytes(b"any")
    page = visit(390, 844).open().page
    page.get_by_role("tab", name="Source").click()
    told = page.locator("#library-list .fault")
    expect(told).to_contain_text("a<0.npz, a<1.npz and 2 more. Rename without")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert told.evaluate("node => node.scrollWidth <= node.clientWidth")
    for name in names:
        (server.folder / name).unlink()
    page.get_by_role("tab", name="Map").click()
    page.get_by_role("tab", name="Source").click()
    expect(told).to_have_count(0)
