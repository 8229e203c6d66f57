"""Servers and recordings for the tests of the app."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from processes import Serving
from sensing import watch
from serving import ROBOT, SINCE, Server, write_room
from waiting import free_port

from lidarcore.rplidar.emulator_process import EmulatorProcess


@pytest.fixture(name="free_port")
def find_port() -> Callable[[], int]:
    return free_port


@pytest.fixture
def hokuyo(data: Path) -> Path:
    """A ROS 1 bag of a Hokuyo in a room."""
    return data / "ccny_hokuyo_rosbag1" / "demo.bag"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "recordings"
    path.mkdir()
    return path


@pytest.fixture
def room(folder: Path) -> Path:
    return write_room(folder / "room.npz")


@pytest.fixture(scope="session")
def background(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a server plays until it is told what to play: a recording outside of its folder."""
    return write_room(tmp_path_factory.mktemp("background") / "background.npz", scans=100, since=SINCE)


@pytest.fixture
def make_server(folder: Path, background: Path) -> Iterator[Callable[..., Server]]:
    with ExitStack() as stack:

        def make(**options: Any) -> Server:
            server = Server(folder, **{"recording": background} | options)
            stack.callback(server.stop)
            return server

        yield make


@pytest.fixture
def server(make_server: Callable[..., Server]) -> Server:
    return make_server()


@pytest.fixture
def driving(make_server: Callable[..., Server]) -> Server:
    """Plays a simulated robot that drives through two rooms."""
    server = make_server()
    server.change("PUT", "/source", ROBOT)
    return server


@pytest.fixture(scope="module")
def shared_server(tmp_path_factory: pytest.TempPathFactory, background: Path) -> Iterator[Server]:
    """One for all tests of a module that change nothing in it."""
    folder = tmp_path_factory.mktemp("shared") / "recordings"
    folder.mkdir()
    write_room(folder / "room.npz")
    server = Server(folder, recording=background)
    yield server
    server.stop()


@pytest.fixture
def serving(tmp_path: Path) -> Iterator[Callable[..., Serving]]:
    """`lidarcore serve` with these arguments and a folder of recordings of its own."""
    started: list[Serving] = []

    def start(*arguments: object, **options: Any) -> Serving:
        started.append(
            Serving("--http-port", 0, *arguments, "--recordings", tmp_path / "recordings", **options)
        )
        return started[-1]

    yield start
    for one in started:
        one.process.kill()
        one.process.communicate()


@pytest.fixture(scope="module")
def sensor() -> Iterator[EmulatorProcess]:
    """A sensor at a port, with nobody about who would hide a wall."""
    with EmulatorProcess(people=0) as emulator:
        yield emulator


@pytest.fixture
def watching(server: Server, sensor: EmulatorProcess) -> Server:
    """A server that plays the sensor."""
    watch(server, sensor)
    return server
