"""The mask of the robot's own body, in the server and on the command line."""

import json
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np
import pytest
from lidarcore_app.pipeline.settings import Settings
from processes import run
from robot_body import drive, on_posts
from serving import Json, Server, assert_problem, write_room
from waiting import wait_until

from lidarcore import Scan, open_recording
from lidarcore.body_mask import MOST_SECTORS, Sector
from lidarcore.recordings import RecordingWriter

MASK = (Sector(2.9, -3.0, 0.4), Sector(1.1, 1.3, 0.5))
SECTORS = [{"first": 2.9, "last": -3.0, "reach": 0.4}, {"first": 1.1, "last": 1.3, "reach": 0.5}]
NEAR = 0.4  # m: nothing but the posts is nearer


def write(path: Path, mask: tuple[Sector, ...] = (), count: int = 40) -> list[Scan]:
    """A recording of a robot that sees posts of its own, with this mask kept."""
    measured = drive(count)
    with RecordingWriter(path) as recording:
        for scan in measured:
            recording.write(scan, mask=mask)
    return measured


def nearest(frame: Json) -> float:
    return float(np.linalg.norm(frame["points"], axis=1).min())


def paused_at(server: Server, index: int, **settings: object) -> Json:
    """The frame of that scan, once these settings hold."""
    with server.stream() as stream:
        server.change("PATCH", "/source", {"state": "paused", "index": index})
        server.change("PATCH", "/settings", settings)
        sectors = server.get("/settings")["sensor"]["mask"]
        stream.state(lambda state: state["settings"]["sensor"]["mask"] == sectors)
        newest = stream.frame(lambda frame: frame["source"]["index"] == index)
        server.change("PATCH", "/source", {"index": index})  # what was on its way had other settings
        return stream.frame(lambda frame: frame["sequence"] > newest["sequence"])


def test_a_mask_applies_to_what_plays_and_goes_with_it(server: Server) -> None:
    write(server.folder / "robot.mcap")
    assert nearest(server.play(server.folder / "robot.mcap")) < NEAR
    assert server.get("/settings")["sensor"]["mask"] == []
    after = paused_at(server, 7, sensor={"mask": SECTORS})
    (scan,) = [scan for k, scan in enumerate(open_recording(server.folder / "robot.mcap")) if k == 7]
    np.testing.assert_allclose(after["points"], scan.xy[scan.valid & ~on_posts(scan)], atol=2e-3)
    write_room(server.folder / "room.npz", scans=5)
    server.play(server.folder / "room.npz")
    assert server.get("/settings")["sensor"]["mask"] == []
    assert nearest(server.play(server.folder / "robot.mcap")) > NEAR
    assert server.get("/settings")["sensor"]["mask"] == SECTORS


def test_a_recording_plays_with_the_mask_that_it_keeps_until_another_is_set(server: Server) -> None:
    write(server.folder / "kept.mcap", MASK)
    assert nearest(server.play(server.folder / "kept.mcap")) > NEAR
    assert server.get("/settings")["sensor"]["mask"] == SECTORS
    assert nearest(paused_at(server, 3, sensor={"mask": []})) < NEAR
    assert server.get("/settings")["sensor"]["mask"] == []
    assert nearest(paused_at(server, 3, sensor=None)) > NEAR
    assert server.get("/settings")["sensor"]["mask"] == SECTORS


def test_a_mask_given_at_the_start_comes_before_the_one_that_is_kept(
    make_server: Callable[..., Server], tmp_path: Path
) -> None:
    write(tmp_path / "kept.mcap", MASK)
    given = Settings().patched({"sensor": {"mask": SECTORS[:1]}})
    for settings, mask in ((given, SECTORS[:1]), (Settings(), SECTORS)):
        server = make_server(recording=tmp_path / "kept.mcap", settings=settings)
        assert server.get("/settings")["sensor"]["mask"] == mask


def test_whoever_is_told_of_frames_gets_the_scan_without_the_body(server: Server) -> None:
    seen: list[Scan] = []
    server.runtime.frame_listeners.append(lambda frame: seen.append(frame.timed.scan))
    write(server.folder / "kept.mcap", MASK)
    server.play(server.folder / "kept.mcap")
    wait_until(lambda: seen and len(seen[-1]) == len(drive(1)[0]))
    assert not seen[-1].valid[on_posts(seen[-1])].any()


@pytest.mark.long
@pytest.mark.parametrize(
    ("mask", "said"),
    [
        ([{"first": 0, "last": 1, "reach": 0}], "greater than or equal to 0.01"),
        ([{"first": 0, "last": 7, "reach": 1}], "less than or equal to 6.3"),
        ([{"first": 0, "last": 1}], "required"),
        ([SECTORS[0]] * (MOST_SECTORS + 1), f"at most {MOST_SECTORS}"),
        ("left", "valid"),
    ],
)
def test_what_is_no_mask_is_refused_and_nothing_changes(server: Server, mask: object, said: str) -> None:
    before = server.get("/settings")
    response = server.http.patch("/settings", json={"sensor": {"mask": mask}})
    assert said in assert_problem(response, 422)["detail"]
    assert server.get("/settings") == before


def test_what_is_recorded_live_keeps_the_mask_and_the_ranges(server: Server) -> None:
    server.change("PUT", "/source", {"kind": "simulation"})
    server.change("PATCH", "/settings", {"sensor": {"mask": [{"first": -1, "last": 1, "reach": 10}]}})
    server.change("POST", "/recorder/start", {"name": "live"})
    wait_until(lambda: server.get("/recorder")["scans"] >= 5)
    server.change("POST", "/recorder/stop", None)
    path = server.folder / "live.mcap"
    assert open_recording(path).mask == (Sector(-1, 1, 10),)
    assert not next(iter(open_recording(path))).valid[_ahead(path)].any()
    assert next(iter(open_recording(path, mask=()))).valid[_ahead(path)].any()


def _ahead(path: Path) -> np.ndarray:
    """Beams of the first scan that the mask leaves out."""
    scan = next(iter(open_recording(path, mask=())))
    with np.errstate(invalid="ignore"):
        return (np.abs(scan.bearings) < 1) & (scan.ranges < 10)


@pytest.mark.long
def test_commands_take_the_mask_that_is_kept_or_given(tmp_path: Path) -> None:
    write(tmp_path / "kept.mcap", MASK, count=6)
    write(tmp_path / "raw.mcap", count=6)
    chosen = tmp_path / "settings.json"
    chosen.write_text(json.dumps({"sensor": {"mask": SECTORS}}))

    def processed(name: str, *options: object) -> str:
        result = run(
            "process", tmp_path / name, "-o", tmp_path / "out.csv", "--set", "min_length=0", *options
        )
        assert result.returncode == 0, result.stderr
        return (tmp_path / "out.csv").read_text("utf-8")

    kept = processed("kept.mcap")
    assert kept == processed("raw.mcap", "--settings", chosen)
    assert kept == processed("raw.mcap", "--set", f"sensor.mask={json.dumps(SECTORS)}")
    assert processed("raw.mcap") == processed("kept.mcap", "--set", "sensor.mask=[]") != kept
    assert "masked in 2 sectors" in run("info", tmp_path / "kept.mcap").stdout


def test_a_mask_is_part_of_the_settings_that_commands_take() -> None:
    settings = Settings().patched({"sensor": {"mask": SECTORS}})
    assert settings.sensor.mask == MASK
    assert Settings().sensor.mask is None


def test_what_stays_in_its_place_is_suggested(server: Server) -> None:
    measured = write(server.folder / "robot.mcap")
    server.play(server.folder / "robot.mcap")
    wait_until(lambda: server.get("/source")["complete"])
    suggested = server.get("/sensor/mask/suggestion")["mask"]
    assert len(suggested) == 2
    server.change("PATCH", "/settings", {"sensor": {"mask": suggested}})
    assert (
        server.get("/sensor/mask/suggestion")["mask"] == suggested
    )  # by what was measured, not by what is left
    mask = [Sector(**sector) for sector in suggested]
    for scan in measured:
        hidden = np.any([sector.holds(scan.bearings) for sector in mask], axis=0)
        assert hidden[on_posts(scan)].all()
        assert hidden.mean() < 0.2


def test_without_motion_nothing_is_suggested_and_it_is_said_why(server: Server) -> None:
    write_room(server.folder / "still.npz", scans=30)
    server.play(server.folder / "still.npz")
    wait_until(lambda: server.get("/source")["complete"])
    response: httpx.Response = server.http.get("/sensor/mask/suggestion")
    assert "hardly moved" in assert_problem(response, 409)["detail"]
