"""Calibration and noise profiles over REST: a real server, recordings whose noise is known, files on the disk."""

import asyncio
import json
import threading
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import httpx
import numpy as np
import pytest
from lidarcore_app.cli.options import settings_from
from lidarcore_app.sources.live import DeviceOptions
from lidarcore_app.web.server import ServerOptions, create_app
from serving import Json, Server, assert_problem, chosen
from waiting import wait_until

from lidarcore import Client, SensorNoise
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.rooms import rectangular_room

NOISE = SensorNoise(0.008, 0.002)
POSE = np.array([0.5, 0.3, 0.2])


def profile_of(sigma_range: float, sigma_bearing: float, **parts: float) -> Json:
    return {"extraction": {"noise": asdict(SensorNoise(sigma_range, sigma_bearing, **parts))}}


PROFILE = profile_of(0.012, 0.0011, range_growth=3e-4, unevenness=0.004, unevenness_length=0.1)
OLD_PROFILE = {"extraction": {"noise": {"sigma_range": 0.012, "sigma_bearing": 0.0011}}}


def write_standing(path: Path, scans: int, since: float = 100.0, step: float = 0.0) -> Path:
    """A sensor in a plain room; with a step it is moved by so much (m) from scan to scan."""
    sensor, rng = SimulatedSensor(rectangular_room(5, 4), NOISE, beams=720), np.random.default_rng(1)
    taken = [sensor.scan(POSE + np.array([step * i, 0, 0]), rng)[0] for i in range(scans)]
    arrays = {name: np.array([getattr(scan, name) for scan in taken]) for name in ("ranges", "bearings")}
    with path.open("wb") as file:
        np.savez(file, **arrays, stamps=since + 0.01 * np.arange(scans))
    return path


@pytest.fixture
def standing(server: Server) -> Path:
    return write_standing(server.folder / "standing.npz", 60)


def ended(server: Server) -> Json:
    """The state once it is done or has failed."""
    wait_until(lambda: server.get("/calibration")["state"] in ("done", "failed"), "it ends", 120)
    return server.get("/calibration")


def test_noise_of_what_plays_is_found(server: Server, standing: Path) -> None:
    assert server.get("/calibration")["state"] == "idle"
    server.play(standing)
    begun = server.change("POST", "/calibration", {"scans": 50})
    assert (begun["state"], begun["source"], begun["wanted"]) == ("collecting", standing.name, 50)
    state = ended(server)
    assert (state["state"], state["scans"], state["message"]) == ("done", 50, None)
    found = state["result"]
    for name in ("sigma_range", "sigma_bearing"):
        interval, truth = found[name], getattr(NOISE, name)
        assert abs(interval["value"] - truth) <= interval["high"] - interval["low"], (name, interval)
        assert found["noise"][name] == interval["value"]
    assert found["range_bias"]["low"] < 0 < found["range_bias"]["high"]
    assert abs(found["alignment"]["value"] + POSE[2]) < 0.01
    assert found["walls"] == 4
    assert not found["by_range"]["differs"]
    assert any("sensor's x axis" in remark for remark in found["remarks"])
    assert server.http.delete("/calibration").status_code == 204
    assert server.get("/calibration")["result"] is None


def test_a_recording_with_fewer_scans_is_taken_once_however_often_it_loops(server: Server) -> None:
    path = write_standing(server.folder / "short.npz", 12)
    with server.stream() as stream:
        server.play(path)
        stream.state(lambda s: s["source"]["recording"] == path.name and s["source"]["complete"])
    server.change("PATCH", "/source", {"loop": True, "speed": 5})
    server.change("POST", "/calibration", {"scans": 300})
    state = ended(server)
    assert (state["state"], state["scans"]) == ("done", 12)


@pytest.mark.long
def test_a_scan_that_is_shown_again_while_paused_counts_once(server: Server, standing: Path) -> None:
    server.play(standing, paused=True)
    server.change("POST", "/calibration", {})
    with server.stream() as stream:
        for scale in (3, 4, 5, 6):
            server.change("PATCH", "/settings", {"view": {"ellipse_scale": scale}})
            stream.frame(chosen)
    wait_until(lambda: server.get("/calibration")["scans"] == 1)
    server.change("POST", "/source/step", {"by": 1})
    wait_until(lambda: server.get("/calibration")["scans"] == 2)
    state = server.get("/calibration")
    assert state["state"] == "collecting"
    wait_until(lambda: "paused" in (server.get("/calibration")["message"] or ""))
    server.change("PATCH", "/source", {"state": "playing"})
    wait_until(lambda: server.get("/calibration")["scans"] > 2)


@pytest.mark.long
def test_before_the_kernels_are_compiled_it_says_so(tmp_path: Path) -> None:
    """An app that was not started yet: nothing is compiled, and nothing plays."""
    app = create_app(ServerOptions(recordings=tmp_path, device=DeviceOptions(emulated=True)))

    async def ask(method: str) -> Json:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1/api/v1") as client:
            body = {"json": {}} if method == "POST" else {}
            return (await client.request(method, "/calibration", **body)).raise_for_status().json()

    try:
        asyncio.run(ask("POST"))
        state = asyncio.run(ask("GET"))
        assert state["state"] == "collecting"
        assert "kernels are still being compiled" in state["message"]
        app.state.server.runtime.ready = True
        assert asyncio.run(ask("GET"))["message"] is None
    finally:
        app.state.server.runtime.player.close()
        app.state.server.viser.server.stop()
        app.state.server.landmarks.close()


def test_one_at_a_time_and_cancelled(server: Server, standing: Path) -> None:
    server.play(standing, paused=True)
    server.change("POST", "/calibration", {"scans": 20})
    problem = assert_problem(server.http.post("/calibration", json={}), 409)
    assert "cancel" in problem["detail"]
    server.http.delete("/calibration").raise_for_status()
    assert server.get("/calibration")["state"] == "idle"
    assert server.change("POST", "/calibration", {"scans": 20})["state"] == "collecting"


def test_another_source_ends_the_collection(server: Server, standing: Path, room: Path) -> None:
    server.play(standing, paused=True)
    server.change("POST", "/calibration", {"scans": 20})
    server.play(room)
    state = server.get("/calibration")
    assert (state["state"], state["result"]) == ("failed", None)
    assert "source was changed" in state["message"]


def test_a_sensor_that_moves_is_told_of(server: Server) -> None:
    server.play(write_standing(server.folder / "moving.npz", 40, step=0.01))
    server.change("POST", "/calibration", {"scans": 30})
    state = ended(server)
    assert state["state"] == "failed"
    assert "stands still" in state["message"]


@pytest.mark.parametrize("body", [{"scans": 9}, {"scans": 301}, {"scans": "many"}, {"scan": 20}, [], None])
def test_a_senseless_number_of_scans_is_refused(shared_server: Server, body: object) -> None:
    assert_problem(shared_server.http.post("/calibration", json=body), 422)


def test_a_profile_is_saved_used_and_deleted(server: Server) -> None:
    assert server.get("/profiles")["profiles"] == []
    entry = {"name": "hall", "noise": PROFILE["extraction"]["noise"], "problem": None}
    assert server.change("PUT", "/profiles/hall", PROFILE) == entry
    assert server.get("/profiles")["profiles"] == [entry]
    assert server.get("/profiles/hall") == PROFILE
    settings = server.change("PATCH", "/settings", server.get("/profiles/hall"))
    assert settings["extraction"]["noise"] == PROFILE["extraction"]["noise"]
    file = server.folder.parent / "profiles" / "hall.json"
    assert asdict(settings_from(file, None).extraction.noise) == PROFILE["extraction"]["noise"]
    assert server.http.delete("/profiles/hall").status_code == 204
    assert not file.exists()
    assert_problem(server.http.delete("/profiles/hall"), 404)
    assert_problem(server.http.get("/profiles/hall"), 404)


def test_a_profile_from_before_walls_were_uneven_is_read_and_says_that_they_are_straight(
    server: Server,
) -> None:
    server.change("PUT", "/profiles/hall", PROFILE)
    server.change("PATCH", "/settings", server.get("/profiles/hall"))
    folder = server.folder.parent / "profiles"
    (folder / "old.json").write_text(json.dumps(OLD_PROFILE))
    settings = server.change("PATCH", "/settings", server.get("/profiles/old"))
    assert settings["extraction"]["noise"] == asdict(SensorNoise(0.012, 0.0011))
    assert settings_from(folder / "old.json", None).extraction.noise == SensorNoise(0.012, 0.0011)


def test_a_name_that_is_taken_is_replaced_only_on_demand(server: Server) -> None:
    server.change("PUT", "/profiles/hall", PROFILE)
    other = profile_of(0.03, 0.002)
    assert_problem(server.http.put("/profiles/hall", json=other), 409)
    assert server.get("/profiles/hall") == PROFILE
    server.http.put("/profiles/hall", json=other, params={"overwrite": True}).raise_for_status()
    assert server.get("/profiles/hall") == other


def put_at_once(server: Server, bodies: list[Json], **params: object) -> list[int]:
    """The statuses of as many requests for one name, all under way at the same time."""
    start, statuses = threading.Barrier(len(bodies)), []

    def put(body: Json) -> None:
        start.wait()
        statuses.append(server.http.put("/profiles/hall", json=body, params=params).status_code)

    threads = [threading.Thread(target=put, args=(body,)) for body in bodies]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sorted(statuses)


def test_many_who_save_at_once_do_not_disturb_each_other(server: Server) -> None:
    bodies = [profile_of(0.01 * n, 0.001) for n in range(1, 17)]
    for _ in range(5):
        assert put_at_once(server, bodies) == [201] + [409] * 15
        assert put_at_once(server, bodies, overwrite=True) == [201] * 16
        assert server.get("/profiles/hall") in bodies
        server.http.delete("/profiles/hall").raise_for_status()
    assert list((server.folder.parent / "profiles").iterdir()) == []


@pytest.mark.parametrize(
    "name", ["..%2Fhall", "a/b", "a%5Cb", ".hidden", "%2Fetc%2Fpasswd", "x" * 200, "a%00b"]
)
def test_a_name_with_a_path_in_it_is_refused(shared_server: Server, name: str) -> None:
    server = shared_server
    for method in ("PUT", "GET", "DELETE"):
        response = server.http.request(method, f"/profiles/{name}", json=PROFILE)
        assert response.status_code == 422
        assert "not a plain file name" in response.json()["detail"]
    assert {path.name for path in server.folder.parent.iterdir()} <= {
        "recordings",
        "profiles",
        "landmarks.db",
    }


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"extraction": {"noise": {"sigma_range": 0.01}}},
        {"extraction": {"noise": {"sigma_range": -1, "sigma_bearing": 0.001}}},
        {"extraction": {"noise": {"sigma_range": 0.01, "sigma_bearing": 0.001}, "gap": 0.2}},
        {"view": {"theme": "light"}} | PROFILE,
        "hall",
    ],
)
def test_what_is_no_profile_is_not_saved(shared_server: Server, body: object) -> None:
    assert_problem(shared_server.http.put("/profiles/hall", json=body), 422)
    assert shared_server.get("/profiles")["profiles"] == []


def test_damaged_files_are_listed_with_their_problems(server: Server) -> None:
    folder = server.folder.parent / "profiles"
    server.change("PUT", "/profiles/good", PROFILE)
    (folder / "a folder.json").mkdir()
    contents = (b"", b"{", b"\xff\xfe", b"[1]", b'{"extraction": {}}', b" " * 70_000)
    for number, content in enumerate(contents):
        (folder / f"bad {number}.json").write_bytes(content)
    *bad, good = server.get("/profiles")["profiles"]
    assert [entry["name"] for entry in bad] == ["a folder", *(f"bad {n}" for n in range(len(contents)))]
    for entry in bad:
        assert entry["noise"] is None
        assert entry["problem"]
        assert server.http.get(f"/profiles/{entry['name']}").status_code == 422
    assert (good["name"], good["problem"]) == ("good", None)


def test_a_folder_that_cannot_be_written_is_a_problem(server: Server) -> None:
    (server.folder.parent / "profiles").write_text("a file in its place")
    assert_problem(server.http.put("/profiles/hall", json=PROFILE), 507)
    assert server.get("/profiles")["profiles"] == []


@pytest.mark.long
def test_the_client_calibrates_saves_and_uses(server: Server, standing: Path) -> None:
    server.play(standing)
    with Client(server.url) as robot:
        assert robot.calibrate(scans=30)["state"] == "collecting"
        wait_until(lambda: robot.calibration()["state"] == "done", "it is done", 120)
        noise = robot.calibration()["result"]["noise"]
        robot.save_profile("hall", **noise)
        assert [profile["name"] for profile in robot.profiles()] == ["hall"]
        assert robot.use_profile("hall")["extraction"]["noise"] == asdict(SensorNoise(**noise))
        robot.delete_profile("hall")
        assert robot.profiles() == []


def test_profiles_of_the_command_are_those_of_the_server(
    server: Server, standing: Path, make_server: Callable[..., Server]
) -> None:
    from lidarcore_app.cli.main import cli
    from typer.testing import CliRunner

    folder = server.folder.parent / "profiles"
    folder.mkdir()
    result = CliRunner().invoke(cli, ["calibrate", str(standing), "-o", str(folder / "cli.json"), "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    (entry,) = server.get("/profiles")["profiles"]
    assert entry["noise"] == asdict(SensorNoise(**found["noise"]))
