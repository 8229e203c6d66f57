"""Pose, trajectory, initial pose and odometry from outside, on a real server that plays a simulated robot."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2
from serving import ROBOT, Json, Server, assert_problem, chosen, wait_until

from lidarcore.geometry import wrap
from lidarcore.simulation.routes import Limits

SPEED = Limits().speed  # m/s, at most
SLAM = {"navigation": {"mode": "slam", "method": "landmarks"}}
CORNER = {"x": 1, "y": 2, "var_x": 1e-4, "cov_xy": 0, "var_y": 1e-4, "kind": "corner"}
ONE_CORNER = {"format": "lidarcore landmarks", "version": 1, "unit": "m", "landmarks": [CORNER]}
ODOMETRY = {"stamp": 50.0, "x": 0.0, "y": 0.0, "heading": 0.0}


@pytest.fixture(scope="module")
def driving(tmp_path_factory: pytest.TempPathFactory, background: Path) -> Iterator[Server]:
    """A server that maps two rooms through which a robot drives."""
    server = Server(tmp_path_factory.mktemp("driving") / "recordings", recording=background)
    server.change("PATCH", "/settings", SLAM)
    server.change("PUT", "/source", ROBOT)
    yield server
    server.stop()


def located(server: Server, holds: Any = bool) -> Json:
    """A frame of the simulation that has what is asked of its localization."""
    with server.stream() as stream:
        return stream.frame(
            lambda f: f["source"]["kind"] == "simulation" and f["localization"] and holds(f["localization"])
        )


def assert_knows_where_it_is(where: Json) -> None:
    """The true pose lies within the ellipsoid that holds all but one pose in 10^6 of an honest filter.

    And not because that is large: positions are known to a decimetre.
    """
    x, y, heading = where["truth"]
    error = np.array([where["pose"]["x"] - x, where["pose"]["y"] - y, where["pose"]["heading"] - heading])
    error[2] = wrap(error[2])
    covariance = np.array(where["covariance"]) + np.diag([1e-3, 1e-3, 1e-3]) ** 2  # the first pose is exact
    assert error @ np.linalg.solve(covariance, error) < chi2.isf(1e-6, 3)
    assert np.hypot(*error[:2]) < 0.1
    assert np.sqrt(covariance[0, 0] + covariance[1, 1]) < 0.1


def test_the_pose_follows_the_robot_and_says_how_well_it_is_known(driving: Server) -> None:
    frame = located(driving, lambda where: where["state"] == "tracking")
    where = frame["localization"]
    pose = driving.get("/pose")
    assert pose["mode"] == "slam"
    assert pose["stamp"] >= frame["stamp"]
    assert np.linalg.eigvalsh(pose["covariance"]).min() > 0
    low, high = where["nis_band"]
    assert (low, high) == pytest.approx(chi2.ppf([0.025, 0.975], where["dof"]))
    assert len(where["innovations"]) == where["dof"] / 2
    assert_knows_where_it_is(where)


def test_the_trajectory_grows_and_can_be_asked_for_from_a_stamp_on(driving: Server) -> None:
    wait_until(lambda: len(driving.get("/trajectory", limit=10_000)["poses"]) >= 10)
    poses = driving.get("/trajectory", limit=10_000)["poses"]
    stamps = [pose["stamp"] for pose in poses]
    assert stamps == sorted(set(stamps))
    later = driving.get("/trajectory", since=stamps[2], limit=10_000)["poses"]
    assert later[: len(poses) - 3] == poses[3:]
    newest, later = (driving.get("/trajectory", limit=limit)["poses"] for limit in (4, 10_000))
    assert newest in [later[i - 4 : i] for i in range(len(poses), len(later) + 1)]
    grown = located(driving, lambda where: where["state"] == "tracking")["stamp"]
    wait_until(
        lambda: driving.get("/trajectory", limit=10_000)["poses"][-1]["stamp"] > max(grown, stamps[-1])
    )
    answer = driving.http.get("/trajectory", params={"format": "csv", "limit": 5})
    assert answer.headers["content-disposition"] == 'attachment; filename="trajectory.csv"'
    table = answer.text.splitlines()
    assert table[0] == "stamp,x,y,heading,sigma_x,sigma_y,sigma_heading,cov_xy,cov_x_heading,cov_y_heading"
    assert len(table) == 6
    now = driving.get("/pose")
    wait_until(lambda: driving.get("/trajectory")["poses"][-1]["stamp"] > now["stamp"])
    (then,) = [
        row for row in driving.get("/trajectory", limit=10_000)["poses"] if row["stamp"] == now["stamp"]
    ]
    errors = [then[name] for name in ("sigma_x", "sigma_y", "sigma_heading")]
    C = np.diag(np.square(errors))
    C[np.triu_indices(3, 1)] = [then[name] for name in ("cov_xy", "cov_x_heading", "cov_y_heading")]
    np.testing.assert_allclose(np.triu(now["covariance"]), C, rtol=1e-9)


def test_a_reset_begins_another_map_at_the_origin(driving: Server) -> None:
    before = located(driving, lambda where: where["session"] is not None)["localization"]
    told = {driving.change("POST", "/localization/reset", None)["method"] for _ in range(20)}
    assert told == {"landmarks"}  # also of those that no scan has followed yet
    after = located(driving, lambda where: where["session"] not in (None, before["session"]))["localization"]
    assert after["session"] > before["session"]
    first = driving.get("/trajectory", limit=10_000)["poses"][0]
    assert (first["x"], first["y"], first["heading"]) == pytest.approx((0, 0, 0), abs=1e-6)


def test_a_pose_given_by_hand_is_where_the_trajectory_goes_on(driving: Server) -> None:
    stamp = located(driving)["stamp"]
    driving.change("POST", "/localization/reset", None)
    placed = {"x": 500.0, "y": -300.0, "heading": 1.0, "sigma_position": 0.01, "sigma_heading": 0.01}
    before = located(driving, lambda where: abs(where["pose"]["x"]) < 100)
    driving.change("POST", "/pose", placed)
    located(driving, lambda where: where["pose"]["x"] > 400)
    poses = driving.get("/trajectory", since=stamp, limit=10_000)["poses"]
    after = next(pose for pose in poses if pose["x"] > 400)
    drove = SPEED * (after["stamp"] - before["stamp"])
    assert np.hypot(after["x"] - 500, after["y"] + 300) < drove + 0.05


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"x": "far", "y": 0, "heading": 0}, "/x"),
        ({"x": 0, "y": 0}, "/heading"),
        ({"x": 0, "y": 0, "heading": 0, "sigma_heading": 0}, "/sigma_heading"),
        ({"x": 0, "y": 0, "heading": 0, "z": 0}, "/z"),
        ({"x": 1e8, "y": 0, "heading": 0}, "/x"),
        ({"x": 0, "y": -1e200, "heading": 0}, "/y"),
    ],
)
def test_a_pose_that_is_none_is_refused(driving: Server, body: Json, pointer: str) -> None:
    answer = driving.http.post("/pose", json=body)
    assert_problem(answer, 422)
    assert pointer in [error["pointer"] for error in answer.json()["errors"]]


@pytest.mark.parametrize("path", ["/pose", "/odometry"])
def test_nan_is_refused(driving: Server, path: str) -> None:
    stamp = '"stamp": 1, ' if path == "/odometry" else ""
    body = f'{{{stamp}"x": NaN, "y": 0, "heading": 0}}'
    assert_problem(driving.http.post(path, content=body, headers={"Content-Type": "application/json"}), 422)


@pytest.mark.parametrize(
    ("body", "pointers"),
    [
        (ODOMETRY | {"x": 1e8}, ["/x"]),
        (ODOMETRY | {"stamp": 1.8e12, "z": 1}, ["/stamp", "/z"]),
        ([ODOMETRY, ODOMETRY | {"heading": "north"}], ["/1/heading"]),
        ([1], ["/0"]),
        ("north", ["/"]),
    ],
)
def test_wrong_odometry_is_told_once_and_where_it_is(
    shared_server: Server, body: Any, pointers: list[str]
) -> None:
    before = shared_server.get("/localization")["odometry"]["taken"]
    problem = assert_problem(shared_server.http.post("/odometry", json=body), 422)
    assert [error["pointer"] for error in problem["errors"]] == pointers
    assert shared_server.get("/localization")["odometry"]["taken"] == before


def test_a_covariance_that_is_none_is_refused_and_the_pose_stays(driving: Server) -> None:
    located(driving)
    before = driving.get("/pose")
    singular = [[1, 1, 0], [1, 1, 0], [0, 0, 1]]
    answer = driving.http.post("/pose", json={"x": 99, "y": 99, "heading": 0, "covariance": singular})
    assert_problem(answer, 422)
    assert "covariance" in answer.json()["detail"]
    after = driving.get("/pose")
    drove = SPEED * (after["stamp"] - before["stamp"])
    assert np.hypot(after["x"] - before["x"], after["y"] - before["y"]) < drove + 0.2


def test_without_localization_there_is_no_pose_and_none_can_be_set(shared_server: Server) -> None:
    assert_problem(shared_server.http.get("/pose"), 404)
    assert_problem(shared_server.http.post("/pose", json={"x": 0, "y": 0, "heading": 0}), 409)
    assert shared_server.get("/trajectory") == {"poses": []}
    assert shared_server.get("/localization")["mode"] == "off"


def test_localizing_without_a_map_says_what_is_missing(server: Server) -> None:
    server.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
    server.next_frame()
    assert "no map" in server.get("/localization")["problem"]
    assert_problem(server.http.put("/localization/map", json={"session": 12345}), 404)


def test_odometry_that_jumps_or_goes_back_is_refused_and_what_follows_is_taken(shared_server: Server) -> None:
    def send(stamp: float, x: float) -> Any:
        return shared_server.http.post("/odometry", json={"stamp": stamp, "x": x, "y": 0, "heading": 0})

    assert send(100.0, 0.0).status_code == 204
    assert send(100.1, 0.05).status_code == 204
    jump = send(100.2, 300.0)
    assert_problem(jump, 422)
    assert "jumped" in jump.json()["detail"]
    assert "left out" in jump.json()["detail"]
    assert "restart_clock" not in jump.json()["detail"]
    assert send(100.3, 300.05).status_code == 204
    assert_problem(send(99.0, 300.1), 422)
    assert send(99.1, 300.15).status_code == 204
    state = shared_server.get("/localization")["odometry"]
    assert (state["refused"], state["stamp"], state["used"]) == (2, 99.1, False)
    assert "Nothing is localized" in state["problem"]


def test_odometry_over_the_websocket_is_what_dead_reckoning_goes_by(server: Server, room: Path) -> None:
    with server.stream() as stream:
        for stamp in np.arange(99.0, 104.0, 0.1):
            pose = {"x": round(0.5 * (stamp - 99), 6), "y": 0.0, "heading": 0.0}
            stream.websocket.send(json.dumps({"type": "odometry", "stamp": stamp, **pose}))
        stream.websocket.send("nonsense")
        assert "JSON" in stream.until("error", bool)["detail"]
        server.change("PATCH", "/source", {"speed": 0, "loop": False})  # no scan is left out then
        server.change("PATCH", "/settings", SLAM)
        server.change("PUT", "/source", {"kind": "recording", "name": room.name})
        last = stream.frame(lambda frame: chosen(frame) and frame["source"]["index"] == 29)
    assert last["localization"]["dead_reckoned"]["x"] == pytest.approx(0.5 * 2.9, abs=1e-6)
    assert server.get("/localization")["odometry"]["used"]


def test_odometry_by_another_clock_is_said_to_be_of_no_use(server: Server, room: Path) -> None:
    """The room's scans are stamped from 100 s to 102.9 s."""
    for stamp in (107.4, 107.9):
        assert server.http.post("/odometry", json=ODOMETRY | {"stamp": stamp}).status_code == 204
    server.change("PATCH", "/settings", SLAM)
    server.change("PUT", "/source", {"kind": "recording", "name": room.name, "paused": True, "index": 29})
    with server.stream() as stream:
        stream.frame(lambda frame: chosen(frame) and frame["source"]["index"] == 29)
    state = server.get("/localization")["odometry"]
    assert (state["taken"], state["used"]) == (2, False)
    assert "5.0 s ahead of the scans" in state["problem"]


def test_a_map_that_is_deleted_while_it_is_localized_in_is_missed_in_words(driving: Server) -> None:
    session = located(driving, lambda where: where["session"] is not None)["localization"]["session"]
    driving.change("PUT", "/localization/map", {"session": session})
    driving.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
    located(driving, lambda where: where["mode"] == "localize")
    assert driving.http.delete(f"/sessions/{session}").status_code == 204
    with driving.stream() as stream:
        state = stream.state(lambda s: s["localization"]["problem"])["localization"]
    assert f"no session {session}" in state["problem"]
    assert "choose another map" in state["problem"]
    assert state["session"] is None
    assert "no session" in assert_problem(driving.http.get("/pose"), 404)["detail"]
    assert state["map"] == session
    driving.change("PATCH", "/settings", {"navigation": {"mode": "off"}})
    wait_until(lambda: driving.get("/localization")["map"] is None, "it is what is chosen no longer")
    chosen = driving.change("POST", "/map", ONE_CORNER)["id"]
    driving.change("PUT", "/localization/map", {"session": chosen})
    assert driving.http.delete(f"/sessions/{chosen}").status_code == 204
    assert driving.get("/localization")["map"] is None
    driving.change("PATCH", "/settings", SLAM)
    located(driving, lambda where: where["mode"] == "slam")


def test_what_slam_builds_takes_the_place_of_a_map_that_was_localized_in_before(driving: Server) -> None:
    first = located(driving, lambda where: where["session"] is not None)["localization"]["session"]
    driving.change("PUT", "/localization/map", {"session": first})
    driving.change("POST", "/localization/reset", None)  # not used yet: it stays chosen
    located(driving, lambda where: where["session"] not in (None, first))
    assert driving.get("/localization")["map"] == first
    driving.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
    assert located(driving, lambda where: where["mode"] == "localize")["localization"]["session"] == first
    driving.change("PATCH", "/settings", SLAM)
    built = located(driving, lambda where: where["mode"] == "slam" and where["session"] not in (None, first))
    assert driving.get("/localization")["map"] is None
    driving.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
    localized = located(driving, lambda where: where["mode"] == "localize")
    assert localized["localization"]["session"] == built["localization"]["session"]
    driving.change("PATCH", "/settings", SLAM)
    located(driving, lambda where: where["mode"] == "slam")


@pytest.mark.long
def test_a_recording_that_is_opened_again_leaves_one_map_beside_the_one_that_is_built(
    server: Server, room: Path
) -> None:
    def maps() -> list[int]:
        return [session["id"] for session in server.get("/sessions")["sessions"]]

    server.change("PATCH", "/settings", SLAM)
    built: list[int] = []
    for _ in range(4):
        server.change("PUT", "/source", {"kind": "recording", "name": room.name, "paused": True})
        with server.stream() as stream:
            for _ in range(9):  # each map is of the same scans
                server.change("POST", "/source/step", {"by": 3})
                at = server.get("/source")["index"]
                stream.frame(lambda f, at=at: chosen(f) and f["source"]["index"] == at)
        wait_until(lambda: server.get("/localization")["session"] not in (None, *built))
        built.append(server.get("/localization")["session"])
    wait_until(lambda: maps() == built[-2:])


def test_a_scan_that_was_passed_over_does_not_end_the_map_when_it_is_met(server: Server, room: Path) -> None:
    server.change("PATCH", "/settings", SLAM)
    server.change("PUT", "/source", {"kind": "recording", "name": room.name, "paused": True})
    with server.stream() as stream:
        for by in (1, 1, 12, -5):
            server.change("POST", "/source/step", {"by": by})
            at = server.get("/source")["index"]
            frame = stream.frame(lambda f, at=at: chosen(f) and f["source"]["index"] == at)
    assert frame["source"]["index"] == 9
    stamps = [pose["stamp"] for pose in server.get("/trajectory")["poses"]]
    assert stamps[0] < stamps[1] < frame["stamp"] < stamps[-1]  # still the map that was begun first


def test_a_scan_that_is_shown_again_looks_as_it_did(driving: Server) -> None:
    located(driving, lambda where: where["state"] == "tracking" and where["velocity"])
    with driving.stream() as stream:
        driving.change("PATCH", "/source", {"state": "paused"})
        paused = stream.state(lambda s: s["source"]["state"] == "paused")["source"]["index"]
        frames = [stream.frame(lambda f: f["source"]["index"] >= paused)]
        driving.change("PATCH", "/settings", {"view": {"ellipse_scale": 11}})
        frames.append(stream.frame(lambda f: f["sequence"] > frames[0]["sequence"]))
        driving.change("PATCH", "/source", {"state": "playing"})
    assert frames[0]["points"] == frames[1]["points"]
    assert frames[0]["localization"]["pose"] == frames[1]["localization"]["pose"]


def test_between_two_runs_a_pose_can_be_set(driving: Server) -> None:
    driving.change("POST", "/localization/reset", None)
    driving.change("POST", "/pose", {"x": 700.0, "y": 0.0, "heading": 0.0})
    located(driving, lambda where: abs(where["pose"]["x"] - 700) < 50)


def test_the_corrected_poses_of_a_log_are_its_odometry_and_no_truth_to_judge_by(
    server: Server, folder: Path, data: Path
) -> None:
    log = folder / "intel-corrected.log.gz"
    log.write_bytes((data / "carmen_radish_corrected" / log.name).read_bytes())
    server.change("PATCH", "/settings", SLAM)
    where = server.play(log, paused=True)["localization"]
    assert where["dead_reckoned"]
    assert where["truth"] is None
