"""`lidarcore.Client` against a real server."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from serving import CORNERS, ROOT, Server, wait_until, write_room

import lidarcore
from lidarcore import Client
from lidarcore.client import PastPose
from lidarcore.errors import (
    ClientError,
    LandmarkError,
    MapFileError,
    ServerUnreachableError,
    UnknownLandmarkError,
)
from lidarcore.landmarks import Atlas, Box, Circle, Landmark

GOOD = {"var_x": 1e-4, "cov_xy": 2e-5, "var_y": 4e-4, "method": "ml"}


@pytest.fixture(scope="module")
def marks() -> list[Landmark]:
    rng = np.random.default_rng(5)
    return [
        Landmark(
            float(x), float(y), kind="corner" if i % 3 else "post", count=i + 1, last_seen=float(i), **GOOD
        )
        for i, (x, y) in enumerate(rng.uniform(-20, 20, (2300, 2)))
    ]


@pytest.fixture(scope="module")
def atlas(shared_server: Server) -> Iterator[Atlas]:
    with Atlas(shared_server.get("/sessions")["store"]["path"]) as opened:
        yield opened


@pytest.fixture(scope="module")
def large(atlas: Atlas, marks: list[Landmark]) -> list[Landmark]:
    """What is in the newest session."""
    atlas.begin("before", 1.0).put([Landmark(0.0, 0.0, 1e-4, 0.0, 1e-4, "tree")])
    landmark_map = atlas.begin("large", 2.0, "slam")
    landmark_map.put(marks)
    return list(landmark_map)


@pytest.fixture
def client(shared_server: Server) -> Iterator[Client]:
    with Client(shared_server.url) as opened:
        yield opened


def test_landmarks_come_as_they_are_over_all_pages(client: Client, large: list[Landmark]) -> None:
    assert list(client.landmarks()) == large
    assert list(client.landmarks(box=(-5, -5, 5, 5))) == [m for m in large if max(abs(m.x), abs(m.y)) <= 5]
    assert list(client.landmarks(box=Box(*np.array([-5, -5, 5, 5.5])))) == [
        m for m in large if abs(m.x) <= 5 and -5 <= m.y <= 5.5
    ]
    near = [m for m in large if np.hypot(m.x - 1, m.y - 2) <= 7]
    assert (
        list(client.landmarks(circle=(1, 2, 7)))
        == list(client.landmarks(circle=Circle(1, 2, 7)))
        == near
        != []
    )
    assert list(client.landmarks(kind="post", min_count=100, until=900)) == [
        m for m in large if m.kind == "post" and m.count >= 100 and m.first_seen <= 900
    ]
    assert list(client.landmarks(kind=["post", "corner"], since=2000)) == [
        m for m in large if m.last_seen >= 2000
    ]
    assert [m.kind for m in client.landmarks(session=client.sessions()[0].id)] == ["tree"]
    with pytest.raises(LandmarkError, match="x_min"):
        next(client.landmarks(box=(1, 0, 0, 1)))


def test_the_nearest_come_with_their_distances(client: Client, large: list[Landmark]) -> None:
    def distance(m: Landmark) -> float:
        return float(np.hypot(m.x - 1, m.y - 2))

    found = client.nearest(1, 2, k=5)
    assert [one.landmark for one in found] == sorted(large, key=distance)[:5]
    assert [one.distance for one in found] == pytest.approx([distance(one.landmark) for one in found])
    (mahalanobis,) = client.nearest(1, 2, metric="mahalanobis", sigma=0.02, kind="post")
    d, C = mahalanobis.landmark.xy - (1, 2), mahalanobis.landmark.covariance + 0.02**2 * np.eye(2)
    assert mahalanobis.distance == pytest.approx(np.sqrt(d @ np.linalg.inv(C) @ d))
    assert client.nearest(1, 2, within=1e-9) == []


def test_a_landmark_and_its_history(client: Client, atlas: Atlas, large: list[Landmark]) -> None:
    landmark_map = atlas.begin("moving", 3.0)
    (id,) = landmark_map.put([Landmark(0.0, 0.0, 1e-4, 0.0, 1e-4, "corner")])
    landmark_map.put(
        Landmark(i / 10, 0.0, 1e-4, 0.0, 1e-4, "corner", last_seen=float(i), id=id) for i in range(1, 1200)
    )
    assert client.landmark(id).x == 119.9
    assert client.history(id) == landmark_map.history(id, limit=10_000)
    landmark_map.remove([id])
    with pytest.raises(UnknownLandmarkError, match="removed"):
        client.landmark(id)
    assert len(client.history(id)) == 1200
    client.delete_session(landmark_map.session)
    with pytest.raises(ClientError) as refused:
        client.history(id)
    assert (refused.value.status, refused.value.title) == (404, "Not Found")
    assert str(id) in refused.value.detail


def test_sessions_and_maps_come_and_go(client: Client, large: list[Landmark], tmp_path: Path) -> None:
    before = client.sessions()
    assert [(one.source, one.landmarks) for one in before] == [("before", 1), ("large", len(large))]
    for name in ("map.json", "map.csv", "map.geojson"):
        client.export_map(tmp_path / name)
        loaded = client.import_map(tmp_path / name)
        assert (loaded.source, loaded.mode, loaded.landmarks) == (name, "import", len(large))
        assert [(m.x, m.y, m.var_x, m.count) for m in client.landmarks(session=loaded.id)] == [
            (m.x, m.y, m.var_x, m.count) for m in large
        ]
        client.clear(loaded.id)
        assert list(client.landmarks(session=loaded.id)) == []
        client.delete_session(loaded.id)
    assert client.sessions() == before
    client.export_map(tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ClientError, match="format"):
        client.export_map(tmp_path / "map.txt")
    with pytest.raises(MapFileError, match=r"missing\.json"):
        client.import_map(tmp_path / "missing.json")
    with pytest.raises(MapFileError):
        client.export_map(tmp_path / "no folder" / "map.json")
    assert {path.suffix for path in tmp_path.iterdir()} == {".json", ".csv", ".geojson", ".png"}
    bad = tmp_path / "bad.json"
    bad.write_text((tmp_path / "map.json").read_text().replace('"unit": "m"', '"unit": "mm"'))
    with pytest.raises(ClientError, match="mm"):
        client.import_map(bad)


def landmarks_so_far(client: Client) -> int:
    """None before the first scan of the map, which the server says as an error."""
    try:
        return len(list(client.landmarks()))
    except ClientError as error:
        if error.status != 404:
            raise
        return 0


def test_a_robot_drives_by_it(make_server: Callable[..., Server], folder: Path) -> None:
    """A sensor that stands still in a room of four corners."""
    server = make_server(recording=write_room(folder / "room.npz", scans=300))
    with Client(server.url) as client:
        with pytest.raises(ClientError, match="slam"):
            client.pose()
        assert client.trajectory() == []
        assert client.set(navigation={"mode": "slam", "method": "landmarks"})["navigation"]["mode"] == "slam"
        assert client.settings()["navigation"]["mode"] == "slam"
        wait_until(lambda: landmarks_so_far(client) == 4)
        found = np.array([m.xy for m in client.landmarks()])
        assert np.linalg.norm(found[:, None] - CORNERS, axis=2).min(0).max() < 0.05
        corners = client.corners()
        assert np.linalg.norm([one.xy - CORNERS for one in corners[:1]], axis=2).min() < 0.05
        assert {one.covariance.shape for one in corners} == {(2, 2)}
        wait_until(lambda: len(client.trajectory()) >= 5)
        pose = client.pose()
        assert (pose.mode, pose.pose.shape, pose.covariance.shape) == ("slam", (3,), (3, 3))
        np.testing.assert_allclose(pose.pose, 0, atol=0.05)
        past = client.trajectory(limit=5)
        assert len(past) == 5
        assert isinstance(past[0], PastPose)
        assert [one.stamp for one in past] == sorted(one.stamp for one in past)
        assert all(one.stamp > past[2].stamp for one in client.trajectory(since=past[2].stamp))
        client.set_pose(0.01, -0.01, 0.0, covariance=1e-4 * np.eye(3))
        client.send_odometry(100.0, 0.0, 0.0, 0.0)
        client.reset()
        frames = client.frames(points=True)
        first, second = next(frames), next(frames)
        assert second["sequence"] > first["sequence"]
        assert first["points"]
        frames.close()


@pytest.mark.parametrize(
    "ask",
    [
        lambda client: client.send_odometry(1.0, float("nan"), 0.0, 0.0),
        lambda client: client.set_pose(0.0, float("inf"), 0.0),
        lambda client: client.set_pose(0.0, 0.0, 0.0, covariance=[[1, 2], [2, 1]]),
        lambda client: client.set(extraction={"gap": -1}),
        lambda client: client.set(nonsense={}),
        lambda client: client.nearest(float("nan"), 0.0),
        lambda client: client.corners(fitter="nonsense"),
        lambda client: next(client.landmarks(session=999)),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_reason(client: Client, large: list, ask: Callable) -> None:
    with pytest.raises(ClientError) as refused:
        ask(client)
    assert refused.value.status in (404, 422)
    assert refused.value.detail


def test_no_server_is_said_to_be_none(free_port: Callable[[], int]) -> None:
    for url in (f"http://127.0.0.1:{free_port()}", "http://no.such.host.invalid:8000", "nonsense"):
        with Client(url, timeout=5) as client:
            for ask in (client.pose, lambda client=client: next(client.frames())):
                with pytest.raises(ServerUnreachableError, match="lidarcore serve"):
                    ask()


def test_another_server_is_told_from_ours(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-u",
        "-m",
        "http.server",
        "0",
        "--bind",
        "127.0.0.1",
        "--directory",
        str(tmp_path),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as other:
        port = other.stdout.readline().split("port ")[1].split()[0]
        with Client(f"http://127.0.0.1:{port}/") as client, pytest.raises(ClientError, match="check the URL"):
            client.pose()
        other.kill()


def test_a_token_opens_the_door(make_server: Callable[..., Server], room: Path) -> None:
    server = make_server(recording=room, token="secret")
    with Client(server.url) as stranger:
        for ask in (stranger.settings, lambda: next(stranger.frames())):
            with pytest.raises(ClientError, match="token") as refused:
                ask()
            assert refused.value.status == 401
    with Client(server.url, "secret") as client:
        assert client.settings()
        assert next(client.frames())["n_beams"] == 720


def test_the_client_is_there_without_being_paid_for_by_those_who_do_not_use_it() -> None:
    script = "import sys, lidarcore; print('httpx' in sys.modules, lidarcore.Client.__name__, 'httpx' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "Client", "True"]
    assert "Client" in lidarcore.__all__
    with pytest.raises(AttributeError, match="Clint"):
        lidarcore.Clint  # noqa: B018
