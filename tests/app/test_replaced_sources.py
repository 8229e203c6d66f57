"""What played before is freed at once with its scans and its map.

The collector of reference cycles counts objects, not their bytes: what waits for it may be hundreds of megabytes.
"""

import gc
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest
from serving import Json, Server, wait_until

from lidarcore.rplidar.emulator_process import EmulatorProcess

KINDS = ("device", "emulator", "simulation", "recording")


@pytest.fixture
def _no_collector() -> Iterator[None]:
    gc.disable()
    yield
    gc.enable()


@pytest.mark.long
@pytest.mark.usefixtures("_no_collector")
@pytest.mark.parametrize("kind", KINDS)
def test_what_was_replaced_is_freed(server: Server, sensor: EmulatorProcess, room: Path, kind: str) -> None:
    choice: Json = {"device": {"port": sensor.port}, "recording": {"name": room.name}}.get(kind, {})
    server.change("PATCH", "/settings", {"navigation": {"mode": "slam", "method": "scans"}})
    replaced = map_of(server, {"kind": kind, **choice})
    map_of(server, {"kind": "simulation"})
    wait_until(lambda: all(thing() is None for thing in replaced), "they are freed")


def map_of(server: Server, choice: Json) -> list["weakref.ref[object]"]:
    """The source that is chosen, and the grid of its map once there is one."""
    runtime = server.runtime
    before = runtime.frame.timed.source if runtime.frame else 0
    server.change("PUT", "/source", choice)

    def has_map() -> bool:
        frame = runtime.frame
        return bool(frame and frame.timed.source > before and frame.picture)

    wait_until(has_map, "there is a map")
    assert runtime.frame is not None
    assert runtime.frame.picture is not None
    return [weakref.ref(runtime.player.source), weakref.ref(runtime.frame.picture.grid.cells)]
