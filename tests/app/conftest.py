"""Servers and recordings for the tests of the app."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from serving import Server, write_room

from app.serve import listen


@pytest.fixture
def free_port() -> Callable[[], int]:
    def find() -> int:
        with listen("127.0.0.1", 0) as listening:
            port: int = listening.getsockname()[1]
            return port

    return find


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


@pytest.fixture
def make_server(folder: Path) -> Iterator[Callable[..., Server]]:
    with ExitStack() as stack:

        def make(**options: Any) -> Server:
            server = Server(folder, **options)
            stack.callback(server.stop)
            return server

        yield make


@pytest.fixture
def server(make_server: Callable[..., Server]) -> Server:
    return make_server()


@pytest.fixture(scope="module")
def shared_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One for all tests of a module that change nothing in it."""
    folder = tmp_path_factory.mktemp("shared") / "recordings"
    folder.mkdir()
    write_room(folder / "room.npz")
    server = Server(folder)
    yield server
    server.stop()
