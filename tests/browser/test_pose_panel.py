"""What the page says of the pose, where whole scans tell it."""

import json
import re
from collections.abc import Callable

import pytest
from browsing import Server, Visitor
from playwright.sync_api import WebSocketRoute, expect
from waiting import wait_until

DEMO = "emulated-s1.mcap"
WINDSOR = "real-rplidar-windsor.npz"  # of a sensor that is mounted sideways
WHOLE_SCANS = {"navigation": {"mode": "slam", "method": "scans"}}


def open_windsor(server: Server, **choice: int) -> None:
    recording = {"kind": "recording", "name": WINDSOR, "paused": True}
    server.api.put("source", json=recording | choice).raise_for_status()
    wait_until(lambda: server.get("source")["recording"] == WINDSOR, "it is open")
    server.patch("settings", WHOLE_SCANS)


def fact(visitor: Visitor, name: str) -> str:
    line = visitor.page.locator("#comparison div", has=visitor.page.get_by_text(name, exact=True))
    return line.locator("dd").inner_text()


def test_speed_is_that_of_the_way_however_the_sensor_is_mounted(visitor: Visitor) -> None:
    server = visitor.server
    open_windsor(server, index=100)
    for _ in range(3):
        frame = server.step(1)
    visitor.await_frame(frame)
    now = frame["localization"]
    (x, y, before), (to_x, to_y, stamp) = (
        (pose["x"], pose["y"], pose["stamp"]) for pose in server.get("trajectory")["poses"][-2:]
    )
    speed = ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5 / (stamp - before)
    assert speed > 0.3
    assert abs(now["velocity"][0]) < 0.3 * speed
    assert abs(now["sideways"]) == pytest.approx(speed, rel=0.1)
    visitor.page.get_by_role("tab", name="Map").click()
    expect(visitor.page.locator("#comparison")).to_contain_text("Speed")
    shown = re.match(r"(\d+\.\d+).m/s", fact(visitor, "Speed"))
    assert shown
    assert float(shown[1]) == pytest.approx(speed, abs=0.02)


def test_a_path_that_nothing_tells_of_has_no_toggle(visitor: Visitor) -> None:
    """A real RPLIDAR's recording has neither odometry nor a truth; a simulated robot has both."""
    server, page = visitor.server, visitor.page
    open_windsor(server, index=10)
    page.get_by_role("tab", name="Map").click()
    names = ("Estimated path", "Odometry path", "True path")
    estimated, *others = (page.locator(".chip", has_text=name) for name in names)
    expect(estimated).to_be_visible()
    for toggle in others:
        expect(toggle).to_be_hidden()
    server.api.put("source", json={"kind": "simulation"}).raise_for_status()
    for toggle in others:
        expect(toggle).to_be_visible()


def test_innovations_are_plotted_only_of_a_filter_that_has_some(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    open_windsor(server, index=10)
    page.get_by_role("tab", name="Plots").click()
    figures = page.locator("#plots figure")
    expect(figures.filter(has_text="Position, mm")).to_be_visible()
    expect(figures.filter(has_text="nnovations")).to_have_count(0)
    server.patch("settings", {"navigation": {"mode": "slam", "method": "landmarks"}})
    expect(figures.filter(has_text="nnovations")).to_have_count(2)


def test_the_time_per_scan_stays_when_a_recording_is_played_again_at_full_speed(visitor: Visitor) -> None:
    """No pose is estimated a second time: what is shown is what the last scan that was new took."""
    server, page = visitor.server, visitor.page
    page.get_by_role("tab", name="Map").click()
    server.api.put("source", json={"kind": "recording", "name": DEMO}).raise_for_status()
    server.patch("source", {"speed": 0, "loop": True})
    server.patch("settings", WHOLE_SCANS)
    wait_until(lambda: visitor.knows("frame")["localization"], "scans are localized")
    wait_until(lambda: visitor.knows("frame")["timings"]["locate_us"] is None, "it is played again")
    expect(page.locator("#count-locate")).to_have_text(re.compile(r"^\d.*s$"))


def test_no_time_per_scan_is_shown_where_only_scans_that_were_seen_before_are(visitor: Visitor) -> None:
    """As by a page that is opened when a recording is played again."""
    server, page = visitor.server, visitor.page
    open_windsor(server, index=10)
    for _ in range(3):
        frame = server.step(1)
    assert frame["timings"]["locate_us"] is not None
    frame = server.step(-1)
    visitor.await_frame(frame)
    assert frame["timings"]["locate_us"] is None
    page.get_by_role("tab", name="Map").click()
    expect(page.locator("#count-locate")).to_have_text(re.compile(r"^\d.*s$"))  # what the last new scan took
    page.reload()
    expect(page.locator("#pose-x")).to_have_text(re.compile(r"\d"))
    expect(page.get_by_text("Time per scan", exact=True).first).to_be_hidden()


def hold_frames(visitor: Visitor) -> Callable[[], None]:
    """What is called keeps all frames to come from the page, as a server does that takes its time with one."""
    is_held = False

    def hold() -> None:
        nonlocal is_held
        is_held = True

    def join(socket: WebSocketRoute) -> None:
        def pass_on(text: str | bytes) -> None:
            if not (is_held and json.loads(text)["type"] == "frame"):
                socket.send(text)

        socket.connect_to_server().on_message(pass_on)

    visitor.page.route_web_socket(re.compile("/api/v1/stream"), join)
    return hold


def test_a_pose_of_slam_is_not_taken_for_one_in_the_map_that_is_localized_in(
    visit: Callable[..., Visitor],
) -> None:
    """The map is finished first, which takes long where it is large: the last frame of SLAM stays meanwhile."""
    visitor = visit()
    hold = hold_frames(visitor)
    server, page = visitor.open().server, visitor.page
    page.get_by_role("tab", name="Map").click()
    open_windsor(server)
    for _ in range(5):
        frame = server.step(1)
    visitor.await_frame(frame)
    expect(page.locator("#pose-panel-state")).to_have_text("Tracking")
    hold()
    server.patch("settings", {"navigation": {"mode": "localize"}})
    expect(page.locator("#pose-panel-state")).to_have_text("Begins with the next scan")
    expect(page.locator("#pose-x")).to_have_text("\N{EN DASH}")
    assert visitor.knows("frame")["localization"]["state"] == "tracking"
