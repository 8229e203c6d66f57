"""Walls of maps in the file of maps: kept, told again, and still there after the server was killed."""

import io
import math
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import httpx
import numpy as np
import pytest
from lidarcore_app.jobs.maps.store import LandmarkStore
from lidarcore_app.jobs.maps.wall_writer import CONFIRMED, from_stored, grid_to_stored, to_stored
from processes import Serving
from serving import ROBOT, Server, assert_problem, write_room
from waiting import wait_until

from lidarcore import SensorNoise
from lidarcore.errors import (
    LandmarkError,
    LandmarkMapError,
    MapFileError,
    UnknownSessionError,
    UnknownWallError,
)
from lidarcore.landmarks import Atlas, StoredWall
from lidarcore.mapping.grid import OccupancyGrid, build_grid
from lidarcore.mapping.measure import Feature, Measurement, angle
from lidarcore.mapping.walls import Walls, WallTable, find_walls
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.rooms import rectangular_room

WHOLE_SCANS = {"navigation": {"mode": "slam", "method": "scans"}}


def stored(id: int, x: float = 0.0, count: int = 5) -> StoredWall:
    return StoredWall(
        id, 0.0, x, 1e-6, 1e-7, 1e-5, x, -1.0, x, 1.0, 2.0, 1e-4, 1, 0, 0, 1, 10.0 + id, 20.5, count
    )


GRID = OccupancyGrid(np.array([[0, 100, -1], [37, 0, 0]]), 0.05, np.array([-1.0, 2.0, 0.3]))


def walls(*rows: StoredWall) -> WallTable:
    return from_stored(rows)


def test_walls_are_read_as_they_were_stored_each_session_its_own(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    first = [
        replace(stored(id), alpha=rng.normal(), r=rng.random(), x1=rng.normal(), var_r=rng.random())
        for id in (0, 7, 40)
    ]
    with Atlas(tmp_path / "maps.db") as atlas:
        one, other = atlas.begin("one", 1.0), atlas.begin("other", 2.0)
        one.put_walls([stored(3)])
        one.put_walls(first)  # in place of what was there
        other.put_walls([stored(0, 5.0)])
    with Atlas(tmp_path / "maps.db") as atlas:
        assert atlas[1].walls() == first
        assert atlas[2].walls() == [stored(0, 5.0)]
        assert [session.walls for session in atlas.sessions()] == [3, 1]
        assert to_stored(from_stored(first)) == first
        gone = atlas[1]
        atlas.delete(1)
        assert [session.walls for session in atlas.sessions()] == [1]
        assert gone.walls() == []
        with pytest.raises(UnknownSessionError):
            gone.put_walls(first)
        assert atlas[2].walls() == [stored(0, 5.0)]


def test_walls_that_make_no_sense_leave_those_that_were_there(tmp_path: Path) -> None:
    with Atlas(tmp_path / "maps.db") as atlas:
        kept = atlas.begin("one", 1.0)
        kept.put_walls([stored(0), stored(1)])
        for wrong in (
            [stored(5), replace(stored(6), r=math.nan)],  # nothing is stored of NaN
            [stored(5), stored(5)],  # twice the same id
        ):
            with pytest.raises(LandmarkMapError):
                kept.put_walls(wrong)
            assert kept.walls() == [stored(0), stored(1)]
        with pytest.raises(LandmarkMapError):  # walls and the grid of the same moment: both or none
            kept.put_walls([stored(5)], replace(grid_to_stored(GRID), resolution=math.nan))
        assert kept.walls() == [stored(0), stored(1)]


def test_what_a_wall_was_is_kept_once_a_second_and_stays_when_it_is_gone(tmp_path: Path) -> None:
    states = [
        replace(stored(4), length=length, last_seen=20 + length) for length in (0.0, 0.7, 1.2, 1.9, 3.0)
    ]
    other = stored(5)
    with Atlas(tmp_path / "maps.db") as atlas:
        kept = atlas.begin("one", 1.0)
        for state in states:
            kept.put_walls([state, other])
        kept.put_walls([other])  # the fourth became part of it
        atlas.begin("other", 2.0).put_walls([replace(stored(4), r=9.0)])
    with Atlas(tmp_path / "maps.db") as atlas:
        assert atlas[1].wall_history(4) == [states[1], states[3], states[4]]
        assert atlas[1].wall_history(4, after=20.7, limit=1) == [states[3]]
        assert atlas[1].wall_history(4, after=23.0) == []
        assert atlas[1].wall_history(5) == [other]
        with pytest.raises(UnknownWallError, match="wall 6"):
            atlas[1].wall_history(6)
        with pytest.raises(LandmarkError):
            atlas[1].wall_history(4, limit=0)


def test_the_history_of_walls_goes_with_its_session(tmp_path: Path) -> None:
    path = tmp_path / "maps.db"

    def states() -> list[tuple[int, int]]:
        with closing(sqlite3.connect(path)) as file:
            return file.execute("SELECT session, count(*) FROM wall_history GROUP BY session").fetchall()

    with Atlas(path) as atlas:
        for name in ("one", "other"):
            kept = atlas.begin(name, 1.0)
            for second in range(3):
                kept.put_walls([replace(stored(id), last_seen=float(50 + second)) for id in range(700)])
        assert states() == [(1, 2100), (2, 2100)]
        atlas.delete(1)
        assert states() == [(2, 2100)]
        with closing(sqlite3.connect(path)) as file, file:
            file.execute("DELETE FROM sessions WHERE id = 2")  # as far as a deletion that was interrupted
        atlas.begin("third", 2.0)
        atlas.delete(3)
        assert states() == []


def test_history_of_a_wall_is_told_page_by_page(server: Server) -> None:
    store = server.app.state.server.landmarks
    assert_problem(server.http.get("/walls/4/history"), 404)
    run = store.begin_walls("room.mcap")
    states = [replace(stored(4), length=1.0 + i, last_seen=100.0 + i) for i in range(5)]
    for state in states:
        run.put(GRID, walls(state))
        wait_until(lambda: run.session is not None and store.status.behind_s == 0)
    kept = {"session": run.session}  # without, it is the map of what plays, which localizes nothing
    told = server.get("/walls/4/history", limit=3, **kept)
    assert told["session"] == run.session
    assert told["wall"] == server.get("/walls", session=run.session)["walls"][0]
    assert [wall["length"] for wall in told["history"]] == [1.0, 2.0, 3.0]
    assert told["history"][0]["covariance"] == [[1e-6, 1e-7], [1e-7, 1e-5]]
    rest = server.get("/walls/4/history", limit=3, after=told["next"], **kept)
    assert [wall["last_seen"] for wall in rest["history"]] == [103.0, 104.0]
    assert rest["next"] is None
    where = assert_problem(server.http.get("/map", params=kept), 404)["detail"]
    assert f"walls, in the formats svg and dxf and at /walls?session={run.session}." in where
    run.put(GRID, walls(stored(7)))
    wait_until(lambda: store.status.behind_s == 0)
    gone = server.get("/walls/4/history", **kept)
    assert gone["wall"] is None
    assert gone["history"][-1]["length"] == 5.0
    assert "wall 9" in assert_problem(server.http.get("/walls/9/history", params=kept), 404)["detail"]
    assert_problem(server.http.get("/walls/4/history", params={"session": 99}), 404)
    assert_problem(server.http.get(f"/walls/{2**70}/history", params=kept), 422)


def test_walls_are_those_of_the_map_that_the_sensor_is_localized_in(server: Server) -> None:
    store = server.app.state.server.landmarks
    run = store.begin_walls("room.mcap")
    run.put(GRID, walls(stored(4)))
    wait_until(lambda: run.session is not None and store.status.behind_s == 0)
    server.change("PUT", "/localization/map", {"session": run.session})
    server.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
    wait_until(lambda: server.get("/localization")["session"] == run.session)
    assert server.get("/walls")["walls"][0]["length"] == stored(4).length
    assert server.get("/walls") == server.get("/walls", session=run.session)
    server.next_frame()
    files = server.http.get("/map/grid", params={"format": "zip"}).raise_for_status()
    assert files.headers["content-disposition"] == f'attachment; filename="map-{run.session}.zip"'
    with ZipFile(io.BytesIO(files.content)) as archive:
        assert len(archive.read("walls.csv").splitlines()) == 2
    two = {"first": "map-wall@0,1", "second": "map-wall@1,0"}
    assert "A map that is kept" in assert_problem(server.http.get("/measure", params=two), 404)["detail"]


def test_a_run_keeps_its_confirmed_walls_and_says_when_it_has_ended(tmp_path: Path) -> None:
    with closing(LandmarkStore(tmp_path / "maps.db")) as store:
        run = store.begin_walls("room.mcap")
        run.put(GRID, walls(stored(0, count=CONFIRMED - 1)))
        wait_until(lambda: store.status.behind_s == 0)
        assert store.atlas.sessions() == []
        run.put(GRID, walls(stored(0), stored(1, count=CONFIRMED - 1), stored(2, count=CONFIRMED)))
        wait_until(lambda: run.session is not None and store.status.behind_s == 0)
        assert [wall.id for wall in store.atlas[run.session].walls()] == [0, 2]
        assert store.writes(run.session)
        assert store.newest() == run.session  # its grid can be localized in
        store.use(None)
        run.put(GRID, walls(stored(0), stored(2), stored(3)))  # found while the run ended
        wait_until(lambda: len(store.walls(run.session)) == 3 and store.status.behind_s == 0)
        (session,) = store.atlas.sessions()
        assert (session.source, session.mode, session.walls) == ("room.mcap", "slam", 3)
        assert session.ended is not None


def test_a_map_is_on_the_disk_before_another_run_uses_it(tmp_path: Path) -> None:
    """Many times, as a map that is just being written, or about to be, would be missed only sometimes."""
    with closing(LandmarkStore(tmp_path / "maps.db")) as store:
        for count in range(1, 9):
            run = store.begin_walls("room.mcap")
            for number in range(1, count + 1):
                run.put(GRID, walls(*map(stored, range(number))))
            store.settle()
            assert store.newest() == run.session
            assert len(store.walls(run.session)) == count
            assert store.atlas.sessions()[-1].ended is not None


def test_the_grid_of_a_run_is_kept_with_its_walls(tmp_path: Path) -> None:
    newer = replace(GRID, cells=GRID.cells.T)
    with closing(LandmarkStore(tmp_path / "maps.db")) as store:
        run = store.begin_walls("room.mcap")
        run.put(GRID, walls(stored(0)))
        wait_until(lambda: run.session == 1 and store.status.behind_s == 0)
        run.put(newer, walls(stored(0)))
        wait_until(lambda: store.status.behind_s == 0)
    with closing(LandmarkStore(tmp_path / "maps.db")) as store:
        assert [session.grid for session in store.atlas.sessions()] == [True]
        kept = store.grid(1)
        assert kept is not None
        np.testing.assert_array_equal(kept.cells, newer.cells)
        np.testing.assert_array_equal(kept.origin, GRID.origin)
        assert kept.resolution == GRID.resolution
        other = store.atlas.begin("corners", 2.0)
        assert store.grid(other.session) is None
        with closing(sqlite3.connect(tmp_path / "maps.db")) as file, file:
            file.execute("UPDATE grids SET columns = 4")
        with pytest.raises(MapFileError, match="damaged"):
            store.grid(1)
        store.atlas.delete(1)
        with pytest.raises(UnknownSessionError):
            store.grid(1)
    with closing(sqlite3.connect(tmp_path / "maps.db")) as file:
        assert file.execute("SELECT count(*) FROM grids").fetchone() == (0,)


@pytest.fixture(scope="module")
def found() -> Walls:
    """The walls of a room, of which only the first two were seen often enough."""
    pose, sensor = np.zeros(3), SimulatedSensor(rectangular_room(6, 4), SensorNoise(0.01, 0.001))
    scans = [sensor.scan(pose, np.random.default_rng(seed), float(seed))[0] for seed in range(4)]
    poses, spread = np.zeros((4, 3)), np.tile(np.diag([1e-4, 1e-4, 1e-6]), (4, 1, 1))
    walls = find_walls(scans, poses, spread, build_grid(scans, poses))
    count = np.where(np.arange(len(walls)) < 2, walls.count, CONFIRMED - 1)
    return replace(walls, count=count)


def test_how_walls_err_together_is_kept_once_their_map_is_finished(tmp_path: Path, found: Walls) -> None:
    path, two = tmp_path / "maps.db", [Feature("wall", id) for id in found.ids[:2].tolist()]
    truth = angle(found, *two)

    def measured(store: LandmarkStore, session: int | None) -> Measurement | None:
        assert session is not None
        joint = store.joint_walls(session)
        return joint and angle(joint, *two)

    with closing(LandmarkStore(path)) as store:
        run = store.begin_walls("room.mcap")
        run.put(GRID, found)
        wait_until(lambda: run.session == 1 and store.status.behind_s == 0)
        assert measured(store, 1) is None
        store.settle()  # nothing else has changed since
        for _ in range(2):
            kept = measured(store, 1)
            assert kept is not None
            assert (kept.value, kept.sigma) == pytest.approx((truth.value, truth.sigma), rel=1e-4)
            run.put(GRID, found)  # once more, as when the last map comes after the end
            wait_until(lambda: store.status.behind_s == 0)
        run.put(GRID, replace(found))  # others that are the same
        wait_until(lambda: store.status.behind_s == 0)
        assert measured(store, 1) == kept
        for part in tmp_path.glob("maps.db*"):  # as a server that is killed now leaves it
            shutil.copy(part, tmp_path / part.name.replace("maps", "killed"))
        run.put(GRID, walls(stored(0)))  # of these nobody knows
        wait_until(lambda: store.status.behind_s == 0)
        assert measured(store, 1) is None
    with closing(LandmarkStore(tmp_path / "killed.db")) as store:
        assert measured(store, 1) == kept
        store.atlas.delete(1)
    with closing(sqlite3.connect(tmp_path / "killed.db")) as file:
        assert file.execute("SELECT count(*) FROM wall_covariances").fetchone() == (0,)


def test_a_map_that_is_deleted_while_it_grows_begins_again(tmp_path: Path) -> None:
    with closing(LandmarkStore(tmp_path / "maps.db")) as store:
        run = store.begin_walls("room.mcap")
        run.put(GRID, walls(stored(0)))
        wait_until(lambda: run.session == 1 and store.status.behind_s == 0)
        store.atlas.delete(1)
        run.put(GRID, walls(stored(0), stored(1)))
        wait_until(lambda: run.session == 2 and store.status.behind_s == 0)
        assert [astuple(wall)[0] for wall in store.atlas[2].walls()] == [0, 1]


@pytest.mark.long
def test_what_a_server_told_of_its_walls_is_there_after_it_was_killed(
    serving: Callable[..., Serving], tmp_path: Path
) -> None:
    room, path = write_room(tmp_path / "room.npz"), tmp_path / "maps.db"
    server = serving(room, "--map", path)
    with httpx.Client(base_url=f"{server.url}api/v1", timeout=60) as http:

        def told(**asked: Any) -> list[dict[str, Any]]:
            answer = http.get("/walls", params=asked)
            return answer.json()["walls"] if answer.is_success else []

        def confirmed() -> list[dict[str, Any]]:
            rows = [wall for wall in told() if wall["count"] >= CONFIRMED]
            return sorted(rows, key=lambda wall: wall["id"])

        http.put("/source", json=ROBOT).raise_for_status()
        http.patch("/settings", json=WHOLE_SCANS).raise_for_status()
        wait_until(lambda: len(confirmed()) >= 4, seconds=120)
        http.patch("/source", json={"state": "paused"}).raise_for_status()
        wait_until(lambda: len(before := confirmed()) >= 4 and told(session=1) == before, seconds=60)
        before = told(session=1)
        answer = http.get("/walls", params={"session": 1, "format": "csv"})
        assert answer.headers["content-disposition"] == 'attachment; filename="map-1-walls.csv"'
        table = answer.text
    server.process.kill()
    server.process.wait()

    again = serving(room, "--map", path)
    with httpx.Client(base_url=f"{again.url}api/v1", timeout=60) as http:
        assert http.get("/walls").status_code == 404  # nothing is mapped now
        assert http.get("/walls", params={"session": 1}).json()["walls"] == before
        assert http.get("/walls", params={"session": 1, "format": "csv"}).text == table
        features = http.get("/walls", params={"session": 1, "format": "geojson"}).json()["features"]
        assert [one["id"] for one in features] == [f"wall-{wall['id']}" for wall in before]
        x, y = np.mean([before[0]["start"], before[0]["end"]], axis=0)
        near = http.get("/walls/nearest", params={"session": 1, "x": x, "y": y}).json()
        assert near["walls"] == before[:1]
        assert http.get("/walls", params={"session": 2}).status_code == 404
        (session,) = http.get("/sessions").json()["sessions"]
        assert (session["walls"], session["landmarks"], session["ended"]) == (len(before), 0, None)
        http.delete("/sessions/1").raise_for_status()
        assert http.get("/walls", params={"session": 1}).status_code == 404
