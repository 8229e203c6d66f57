"""Maps of recordings that a real server makes, each in a process of its own, beside what plays."""

import csv
import io
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import psutil
import pytest
from lidarcore_app.jobs.maps.making import Making
from lidarcore_app.pipeline.settings import Settings
from serving import Json, Server, assert_problem, wait_until, write_room
from two_lidars import write_two_lidars

from lidarcore.geometry import pose_difference, relative
from lidarcore.mapping.export import COVARIANCE_FILE, MAP_FILES
from lidarcore.recordings.writer import RecordingWriter
from lidarcore.scan import Array
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

MAKING = "/map/making"
LONGEST = 240  # s: kernels may have to be compiled first


def drive(path: Path, scans: int) -> Array:
    """A recording of a simulated robot, and where it truly was: (scans, 3), seen from its first scan."""
    robot = SimulatedRobot(SimulationSettings(world="furnished room", seed=5), begin=1e9)
    taken = list(islice(robot, scans))
    with RecordingWriter(path) as writer:
        for scan in taken:
            writer.write(scan)
    truth = np.array([scan.truth for scan in taken])
    return relative(truth[0], truth)


def making(server: Server) -> Json:
    """What is made, or was made last."""
    return server.get(MAKING)["making"]


def ended(server: Server) -> Json:
    wait_until(lambda: making(server)["state"] != "running", "it has ended", LONGEST)
    return making(server)


def has_ended(server: Server, id: int) -> bool:
    return id in [one["id"] for one in server.get(MAKING)["ended"]]


def makers(server: Server) -> list[psutil.Process]:
    """The processes that make maps of recordings in its folder."""
    children = psutil.Process().children(recursive=True)
    return [
        child
        for child in children
        if "map" in child.cmdline() and str(server.folder) in " ".join(child.cmdline())
    ]


def test_a_map_of_a_recording_becomes_a_session_and_files_with_honest_poses(server: Server) -> None:
    truth = drive(server.folder / "drive.mcap", 100)
    assert making(server) is None
    begun = server.change("POST", MAKING, {"recording": "drive.mcap"})
    assert (begun["recording"], begun["state"], begun["total"]) == ("drive.mcap", "running", 100)
    again = assert_problem(server.http.post(MAKING, json={"recording": "drive.mcap"}), 409)
    assert "drive.mcap is being made" in again["detail"]
    made = ended(server)
    assert (made["state"], made["error"], made["done"]) == ("finished", None, 100)
    (session,) = server.get("/sessions")["sessions"]
    assert (session["id"], session["source"], session["mode"]) == (made["session"], "drive.mcap", "slam")
    assert session["name"] == "drive"
    assert session["grid"]
    assert len(server.get("/walls", session=made["session"])["walls"]) == session["walls"] > 5

    walls = server.get("/walls", session=made["session"])["walls"]
    longest, *others = sorted(walls, key=lambda wall: -wall["length"])
    for other in others[:4]:
        two = {"first": f"map-wall:{longest['id']}", "second": f"map-wall:{other['id']}"}
        told = server.get("/measure", **two, session=made["session"])
        between = abs((longest["alpha"] - other["alpha"] + np.pi / 2) % np.pi - np.pi / 2)
        assert told["angle"] == pytest.approx(between, abs=1e-6)
        assert 0 < told["angle_sigma"] < 0.01

    answer = server.http.get(f"{MAKING}/files").raise_for_status()
    with ZipFile(io.BytesIO(answer.content)) as archive:
        assert set(archive.namelist()) == {*MAP_FILES, COVARIANCE_FILE, "poses.csv"}
        rows = list(csv.DictReader(io.StringIO(archive.read("poses.csv").decode())))
    poses = np.array([[float(row[name]) for name in ("x", "y", "heading")] for row in rows])
    off = pose_difference(poses, truth)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.05
    assert np.abs(off[:, 2]).max() < 0.02


def test_a_map_that_is_cancelled_is_gone_with_its_process(server: Server) -> None:
    drive(server.folder / "drive.mcap", 60)
    server.change("POST", MAKING, {"recording": "drive.mcap"})
    wait_until(lambda: makers(server), "its process runs")
    (process,) = makers(server)
    assert process.nice() == 10
    folder = Path(next(part for part in process.cmdline() if part.startswith("--output=")).partition("=")[2])
    assert server.http.delete(MAKING).status_code == 204
    assert not makers(server)
    assert making(server)["state"] == "cancelled"
    assert server.get("/sessions")["sessions"] == []
    assert_problem(server.http.delete(MAKING), 404)
    assert "make one first" in assert_problem(server.http.get(f"{MAKING}/files"), 404)["detail"]
    server.app.state.server.map_maker.close()
    assert not folder.parent.exists()


def test_maps_wait_for_each_other_and_can_be_cancelled_meanwhile(server: Server) -> None:
    drive(server.folder / "drive.mcap", 60)
    names = [f"copy-{number}.mcap" for number in range(10)]
    for name in names:
        (server.folder / name).write_bytes((server.folder / "drive.mcap").read_bytes())
    begun = [server.change("POST", MAKING, {"recording": name}) for name in names[:9]]
    assert [one["state"] for one in begun] == ["running", *8 * ["waiting"]]
    assert (
        "8 maps wait" in assert_problem(server.http.post(MAKING, json={"recording": names[9]}), 409)["detail"]
    )
    again = assert_problem(server.http.post(MAKING, json={"recording": names[3]}), 409)
    assert f"{names[3]} is being made, or waits" in again["detail"]
    first, *others = (one["id"] for one in begun)
    for id in others[2:]:
        assert server.http.delete(MAKING, params={"id": id}).status_code == 204
        assert_problem(server.http.delete(MAKING, params={"id": id}), 404)
    found = server.get(MAKING)
    assert found["making"]["id"] == first
    assert [(one["id"], one["state"], one["elapsed_s"]) for one in found["waiting"]] == [
        (id, "waiting", 0.0) for id in others[:2]
    ]

    wait_until(lambda: len(server.get(MAKING)["ended"]) == 9, "all are made", LONGEST)
    found = server.get(MAKING)
    assert [(one["id"], one["recording"], one["state"], one["elapsed_s"]) for one in found["ended"][:6]] == [
        (id, name, "cancelled", 0.0) for id, name in zip(others[2:], names[3:9], strict=True)
    ]
    assert [(one["id"], one["recording"], one["state"]) for one in found["ended"][6:]] == [
        (id, name, "finished") for id, name in zip((first, *others[:2]), names[:3], strict=True)
    ]
    assert found["making"] == found["ended"][-1]
    assert found["waiting"] == []
    finished = found["ended"][6:]
    sessions = [one["session"] for one in finished]
    assert [one["id"] for one in server.get("/sessions")["sessions"]] == sessions
    for one in finished:  # also of the one that was not made last
        answer = server.http.get(f"{MAKING}/files", params={"id": one["id"]}).raise_for_status()
        stem = Path(one["recording"]).stem
        assert f'filename="{stem}-with-poses.zip"' in answer.headers["content-disposition"]
        with ZipFile(io.BytesIO(answer.content)) as archive:
            assert len(archive.read("poses.csv").splitlines()) == 61


def test_files_of_a_finished_map_stay_when_others_begin_fail_or_are_cancelled(server: Server) -> None:
    names = [f"drive-{number}.mcap" for number in range(10)]
    drive(server.folder / names[0], 30)
    for name in names[1:]:
        (server.folder / name).write_bytes((server.folder / names[0]).read_bytes())
    finished = server.change("POST", MAKING, {"recording": names[0]})["id"]
    assert ended(server)["state"] == "finished"
    maker = server.app.state.server.map_maker
    (made,) = maker._ended
    assert {path.name for path in Path(made.folder.name).rglob("*") if path.is_file()} == {
        "map.zip",
        "settings.json",
    }
    others = [server.change("POST", MAKING, {"recording": name})["id"] for name in names[1:]]
    for id in [*others[1:], others[0]]:
        assert server.http.delete(MAKING, params={"id": id}).status_code == 204
    assert [(one["id"], one["state"]) for one in server.get(MAKING)["ended"]] == [
        (finished, "finished"),
        *((id, "cancelled") for id in [*others[2:], others[0]]),  # eight of these nine
    ]
    assert server.http.get(f"{MAKING}/files", params={"id": finished}).status_code == 200


def test_files_of_the_last_eight_maps_are_kept(server: Server) -> None:
    maker = server.app.state.server.map_maker
    for id in range(1, 10):
        making = Making.of(id, server.folder / "hall.mcap", None, None, Settings())
        making.state = "running"
        making.files.write_bytes(b"PK")
        making.end(id, None)
        maker._keep(making)
    assert [one["id"] for one in server.get(MAKING)["ended"]] == [*range(2, 10)]
    assert all(one.files.is_file() for one in maker._ended)
    gone = assert_problem(server.http.get(f"{MAKING}/files", params={"id": 1}), 404)
    assert "No such map" in gone["detail"]


def test_one_whose_process_cannot_be_started_fails_and_the_next_begins(server: Server) -> None:
    path = server.folder / "drive.mcap"
    drive(path, 30)
    (server.folder / "next.mcap").write_bytes(path.read_bytes())
    state = server.app.state.server
    too_long = "/scan" * 100_000  # for the arguments of a process
    alone = state.map_maker.start(path, too_long, None, state.runtime.settings)
    assert (alone.state, alone.session) == ("failed", None)
    assert "cannot be started: Argument list too long" in alone.error
    server.change("POST", MAKING, {"recording": path.name})
    waiting = state.map_maker.start(path, too_long, None, state.runtime.settings)
    assert waiting.state == "waiting"
    server.change("POST", MAKING, {"recording": "next.mcap"})
    wait_until(lambda: len(server.get(MAKING)["ended"]) == 4, "all have ended", LONGEST)
    assert [(one["recording"], one["state"]) for one in server.get(MAKING)["ended"]] == [
        (path.name, "failed"),
        (path.name, "finished"),
        (path.name, "failed"),
        ("next.mcap", "finished"),
    ]


def test_of_a_recording_that_is_deleted_while_its_map_waits_that_is_told(server: Server) -> None:
    for name in ("first.mcap", "gone.mcap"):
        drive(server.folder / name, 30)
        server.change("POST", MAKING, {"recording": name})
    assert server.http.delete("/recordings/gone.mcap").is_success
    wait_until(lambda: len(server.get(MAKING)["ended"]) == 2, "both have ended", LONGEST)
    first, gone = server.get(MAKING)["ended"]
    assert (first["state"], gone["state"]) == ("finished", "failed")
    assert gone["error"] == "gone.mcap was deleted or renamed before its map was made."


def test_the_end_of_a_server_ends_what_is_made_and_what_waits(make_server: Callable[..., Server]) -> None:
    server = make_server()
    for name in ("one.mcap", "two.mcap", "three.mcap"):
        drive(server.folder / name, 60)
        server.change("POST", MAKING, {"recording": name})
    wait_until(lambda: makers(server), "a process runs")
    maker = server.app.state.server.map_maker
    folders = [Path(one.folder.name) for one in (maker._running, *maker._waiting)]
    assert all(folder.is_dir() for folder in folders)
    maker.close()
    assert not makers(server)
    assert not any(folder.exists() for folder in folders)
    assert server.get(MAKING)["waiting"] == []
    assert server.get("/sessions")["sessions"] == []


def test_what_cannot_be_mapped_is_refused_with_the_reason(server: Server) -> None:
    assert_problem(server.http.post(MAKING, json={"recording": "none.mcap"}), 404)
    (server.folder / "broken.npz").write_bytes(b"PK\x03\x04 and no more")
    problem = assert_problem(server.http.post(MAKING, json={"recording": "broken.npz"}), 422)
    assert "broken.npz" in problem["detail"]
    assert_problem(server.http.post(MAKING, content=b" " * (1 << 21)), 413)
    write_two_lidars(server.folder / "two.mcap")
    problem = assert_problem(server.http.post(MAKING, json={"recording": "two.mcap"}), 409)
    assert len(problem["topics"]) == 2
    body = {"recording": "two.mcap", "topic": problem["topics"][0]}
    assert server.change("POST", MAKING, body)["total"] is None
    assert ended(server)["recording"] == "two.mcap"
    refused = assert_problem(server.http.post(MAKING, json=body | {"topic": "/none"}), 409)
    assert "has no lidar '/none': choose /front or /rear" in refused["detail"]
    assert refused["topics"] == ["/front", "/rear"]
    assert_problem(server.http.post(MAKING, json=body | {"topic": ""}), 409)
    write_room(server.folder / "room.npz", scans=2)
    refused = assert_problem(server.http.post(MAKING, json={"recording": "room.npz", "topic": "/scan"}), 409)
    assert "names none, leave it out" in refused["detail"]
    assert [one["recording"] for one in server.get(MAKING)["ended"]] == ["two.mcap"]


def test_the_only_lidar_of_a_recording_is_the_same_one_whether_it_is_named_or_not(server: Server) -> None:
    drive(server.folder / "drive.mcap", 60)
    (topic,) = server.get("/recordings/drive.mcap/facts")["topics"]
    for first, others in ((None, ("", topic)), (topic, (None, ""))):
        begun = server.change("POST", MAKING, {"recording": "drive.mcap", "topic": first})
        for other in others:
            again = server.http.post(MAKING, json={"recording": "drive.mcap", "topic": other})
            assert "drive.mcap is being made" in assert_problem(again, 409)["detail"]
        assert server.http.delete(MAKING, params={"id": begun["id"]}).is_success
        wait_until(partial(has_ended, server, begun["id"]), "it has ended")
