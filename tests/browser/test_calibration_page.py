"""Calibration in the page: of a sensor whose noise is known, and what becomes of the result."""

import json
import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from browsing import Server, Visitor
from playwright.sync_api import Locator, expect
from waiting import wait_until

from lidarcore import SENSORS, SensorNoise
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.world import World

SIGMA_RANGE, SIGMA_BEARING = 0.015, 0.002
PROFILE = {"extraction": {"noise": {"sigma_range": 0.031, "sigma_bearing": 0.0015}}}


@pytest.fixture(scope="module")
def sensor() -> Iterator[EmulatorProcess]:
    """A sensor that errs as it is told to, with nobody about who would hide a wall."""
    options = {"people": 0, "sigma_range": SIGMA_RANGE, "sigma_bearing": SIGMA_BEARING}
    options |= {"range_growth": 0, "unevenness": 0}
    with EmulatorProcess(**options) as emulator:
        yield emulator


@pytest.fixture(autouse=True)
def clean(server: Server) -> None:
    """No calibration, no profiles."""
    server.api.delete("calibration").raise_for_status()
    for profile in server.get("profiles")["profiles"]:
        server.api.delete(f"profiles/{profile['name']}").raise_for_status()


def noise(server: Server) -> dict[str, float]:
    return server.get("settings")["extraction"]["noise"]


def kept(server: Server, **parts: float) -> dict[str, float]:
    """The noise that is set, after these parts of it were."""
    return server.patch("settings", {"extraction": {"noise": parts}})["extraction"]["noise"]


def used(found: dict[str, float | None], before: dict[str, float]) -> dict[str, float]:
    """What `Use` should set: what was found, and what was set before where nothing could be."""
    return before | {name: value for name, value in found.items() if value is not None}


def profile(visitor: Visitor, name: str) -> Locator:
    return visitor.page.locator("#profile-list li", has_text=name)


def paused(visitor: Visitor) -> None:
    visitor.server.patch("source", {"state": "paused"})


@pytest.mark.long
def test_noise_of_a_sensor_is_found_used_and_kept_as_a_profile(
    visitor: Visitor, sensor: EmulatorProcess
) -> None:
    server, page = visitor.server, visitor.page
    server.api.put("source", json={"kind": "device", "port": sensor.port}).raise_for_status()
    wait_until(lambda: server.get("source")["device"]["state"] == "streaming", "the sensor streams")
    before = kept(server, systematic=0.0021)  # what a sensor at rest never sees
    page.get_by_label("Scans", exact=True).fill("50")
    page.get_by_role("button", name="Calibrate").click()
    expect(page.get_by_role("progressbar", name="Scans collected")).to_be_visible()
    expect(page.get_by_role("button", name="Calibrate")).to_be_disabled()
    facts = page.locator("#calibration-result dl")
    expect(facts).to_be_visible(timeout=120_000)
    expect(page.locator("#calibration-progress")).to_be_hidden()

    found = server.get("calibration")["result"]
    for name, truth in (("sigma_range", SIGMA_RANGE), ("sigma_bearing", SIGMA_BEARING)):
        interval = found[name]
        assert abs(interval["value"] - truth) <= interval["high"] - interval["low"], (name, interval)
    shown = float(re.search(r"Range noise, 1σ([\d.]+)", facts.inner_text().replace("\n", ""))[1])
    assert shown == pytest.approx(1e3 * found["noise"]["sigma_range"], abs=0.006)
    for text in ("Bearing noise, 1σ", "Outliers", "Range bias", "Alignment", "Drift of a wall"):
        expect(facts).to_contain_text(text)
    expect(page.locator("#calibration-result .bands circle")).to_have_count(8)
    expect(page.locator("#calibration-result")).to_contain_text("sensor's x axis")

    visitor.tolerated.append("422")
    page.get_by_label("Name of the profile").fill("../evil")
    page.get_by_role("button", name="Save as profile").click()
    expect(page.locator(".toast.error")).to_contain_text("not a plain file name")
    page.get_by_label("Name of the profile").fill("hall")
    page.get_by_role("button", name="Save as profile").click()
    expect(profile(visitor, "hall")).to_be_visible()
    page.get_by_role("button", name="Use", exact=True).click()
    wanted = used(found["noise"], before)
    wait_until(lambda: noise(server) == wanted, "it is used")
    expect(profile(visitor, "hall")).to_contain_text("in use")

    page.reload()
    expect(page.locator("#calibration-result dl")).to_be_visible()
    expect(page.get_by_role("button", name="In use", exact=True)).to_be_disabled()
    server.patch("settings", {"extraction": {"noise": None}})
    expect(profile(visitor, "hall")).not_to_contain_text("in use")
    page.get_by_role("button", name="hall", exact=False).first.click()
    wait_until(lambda: noise(server) == wanted, "the profile is chosen")
    with page.expect_download() as download:
        page.get_by_role("link", name="Export profile hall").click()
    exported = json.loads(Path(download.value.path()).read_text())
    assert exported["extraction"]["noise"] == wanted
    page.get_by_role("button", name="Delete profile hall").click()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(profile(visitor, "hall")).to_have_count(0)
    assert server.get("profiles")["profiles"] == []
    assert noise(server) == wanted
    page.get_by_role("button", name="RPLIDAR A1 or A2").click()
    wait_until(
        lambda: noise(server) == asdict(SENSORS["rplidar_a1_a2"].noise), "the usual noise of an A1 is used"
    )
    expect(profile(visitor, "RPLIDAR A1 or A2")).to_contain_text("14 places in three recordings")


@pytest.mark.long
def test_what_cannot_be_told_is_said_and_what_is_set_stays(visitor: Visitor, tmp_path: Path) -> None:
    """A narrow view of one wall: a bearing error does nothing there."""
    server, page = visitor.server, visitor.page
    world = World(np.array([[[2.0, -3.0], [2.0, 3.0]]]))
    emitter, rng = SimulatedSensor(world, SensorNoise(0.02, 0.001), beams=3600), np.random.default_rng(0)
    scans = [emitter.scan(np.zeros(3), rng)[0] for _ in range(30)]
    ranges = np.array([np.where(np.abs(s.bearings) < 0.15, s.ranges, np.nan) for s in scans])
    file = tmp_path / "narrow.npz"
    np.savez(file, ranges=ranges, bearings=scans[0].bearings, stamps=0.01 * np.arange(len(scans)))
    server.api.put("recordings/narrow.npz", content=file.read_bytes()).raise_for_status()
    server.api.put("source", json={"kind": "recording", "name": "narrow.npz"}).raise_for_status()
    before = kept(server, sigma_bearing=0.0042, systematic=0.0021)
    page.get_by_role("button", name="Calibrate").click()
    facts = page.locator("#calibration-result dl")
    expect(facts).to_be_visible(timeout=120_000)
    expect(facts).to_contain_text(re.compile(r"Bearing noise, 1σ\s*unknown, at most [\d.]+.°"))
    expect(facts).to_contain_text(re.compile(r"Range bias\s*unknown"))
    expect(page.locator("#calibration-result")).to_contain_text("keep the current setting")
    page.get_by_role("button", name="Use", exact=True).click()
    expect(page.get_by_role("button", name="In use", exact=True)).to_be_disabled()
    found = server.get("calibration")["result"]["noise"]
    assert found["sigma_bearing"] is None
    assert noise(server) == used(found, before)


@pytest.mark.long
def test_a_second_start_is_refused_and_shows_the_one_that_runs(visitor: Visitor) -> None:
    visitor.tolerated.append("409")
    server, page = visitor.server, visitor.page
    paused(visitor)
    server.api.post("calibration", json={"scans": 200}).raise_for_status()  # by another browser
    page.get_by_role("button", name="Calibrate").click()
    expect(page.locator(".toast.error")).to_contain_text("under way")
    expect(page.locator("#calibration-progress output")).to_contain_text("of 200 scans of emulator")
    expect(page.locator("#calibration-message")).to_contain_text("paused")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("#calibration-progress")).to_be_hidden()
    expect(page.locator("#calibration-message")).to_be_hidden()
    assert server.get("calibration")["state"] == "idle"
    expect(page.get_by_role("button", name="Calibrate")).to_be_enabled()


@pytest.mark.long
def test_another_source_ends_it_in_plain_words(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    paused(visitor)
    page.get_by_role("button", name="Calibrate").click()
    expect(page.get_by_role("progressbar", name="Scans collected")).to_be_visible()
    demo = next(entry["name"] for entry in server.get("recordings")["recordings"] if entry["builtin"])
    server.api.put("source", json={"kind": "recording", "name": demo}).raise_for_status()
    expect(page.locator("#calibration-message")).to_contain_text("The source was changed")
    expect(page.get_by_role("button", name="Calibrate")).to_be_enabled()


@pytest.mark.long
def test_files_are_imported_replaced_on_demand_or_refused(visitor: Visitor, tmp_path: Path) -> None:
    visitor.tolerated += ["409", "422"]
    server, page = visitor.server, visitor.page
    good, bad = tmp_path / "lab.json", tmp_path / "bad.json"
    good.write_text(json.dumps(PROFILE))
    bad.write_text('{"view": {}}')
    page.get_by_label("Profile to import").set_input_files(good)
    profile(visitor, "lab").get_by_role("button", name="lab", exact=False).first.click()
    wanted = asdict(SensorNoise(**PROFILE["extraction"]["noise"]))
    wait_until(lambda: noise(server) == wanted, "it is used")
    page.get_by_label("Profile to import").set_input_files(good)
    page.get_by_role("button", name="Replace it").click()
    page.get_by_label("Profile to import").set_input_files(bad)
    toast = page.locator(".toast.error")
    expect(toast).to_contain_text("The file is not a profile: extraction: Field required; ")
    bad.write_text("no JSON")
    page.get_by_label("Profile to import").set_input_files(bad)
    expect(toast.last).to_contain_text(re.compile("The file is not a profile: .*JSON"))
    assert [entry["name"] for entry in server.get("profiles")["profiles"]] == ["lab"]


@pytest.mark.long
def test_a_damaged_file_is_told_of(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    folder = Path(server.get("profiles")["folder"])
    folder.mkdir(exist_ok=True)
    (folder / "broken.json").write_text("{")
    page.reload()
    expect(profile(visitor, "broken")).to_contain_text("damaged")
    expect(profile(visitor, "broken").get_by_role("button")).to_have_count(1)
    page.get_by_role("button", name="Delete profile broken").click()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(profile(visitor, "broken")).to_have_count(0)
