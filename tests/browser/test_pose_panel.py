"""What the page says of the pose, where whole scans tell it."""

import re

import pytest
from browsing import Server, Visitor
from playwright.sync_api import expect
from waiting import wait_until

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
