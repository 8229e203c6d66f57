"""A sensor that cannot be played: the problem names cause and cure, and what played goes on."""

import os
import stat
import subprocess
import sys
from collections.abc import Iterator

import pytest
from sensing import device, watch
from serving import Json, Server, assert_problem

from lidarcore.rplidar.emulator_process import EmulatorProcess

HOLD = """
import sys
from serial import Serial
port = Serial(sys.argv[1], exclusive=True)
print("open", flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def live(
    tmp_path_factory: pytest.TempPathFactory, sensor: EmulatorProcess, background: object
) -> Iterator[Server]:
    """A server that plays the sensor whatever else is tried."""
    server = Server(tmp_path_factory.mktemp("live"), recording=background)
    try:
        watch(server, sensor)
        yield server
    finally:
        server.stop()


def refused(live: Server, status: int, body: Json) -> str:
    """Why it cannot be played, once it is seen that what played was not disturbed."""
    before = live.next_frame()
    detail: str = assert_problem(live.http.put("/source", json=body), status)["detail"]
    with live.stream() as stream:
        stream.frame(lambda f: f["source"]["index"] > before["source"]["index"] + 1)
        told = device(stream, lambda d: d["completeness"] == 1)
    assert (told["state"], told["reconnects"], told["overruns"]) == ("streaming", 0, 0)
    return detail


@pytest.mark.long
def test_no_such_port(live: Server) -> None:
    assert "There is no port /dev/ttyUSB98" in refused(live, 404, {"kind": "device", "port": "/dev/ttyUSB98"})


@pytest.mark.long
def test_no_serial_port(live: Server) -> None:
    assert "cannot be used as a serial port" in refused(live, 404, {"kind": "device", "port": "/dev/null"})


@pytest.mark.long
def test_a_port_that_another_program_has(live: Server) -> None:
    with EmulatorProcess() as other:
        command = [sys.executable, "-c", HOLD, other.port]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
            assert holder.stdout.readline() == b"open\n"
            detail = refused(live, 409, {"kind": "device", "port": other.port})
            holder.stdin.close()
    assert f"{other.port} is in use by " in detail
    assert f"(pid {holder.pid})" in detail


@pytest.mark.long
def test_another_baud_rate_is_named(live: Server) -> None:
    with EmulatorProcess(baud=115_200) as other:
        assert "uses 115200 baud" in refused(live, 504, {"kind": "device", "port": other.port})
        body = {"kind": "device", "port": other.port, "baud": 115_200, "mode": "Turbo"}
        assert "Turbo" in refused(live, 422, body)


@pytest.mark.long
def test_a_sensor_that_protects_itself(live: Server) -> None:
    with EmulatorProcess(health=2, health_code=7, health_sticks=True, reset=0.1) as other:
        assert "7" in refused(live, 503, {"kind": "device", "port": other.port})


@pytest.mark.parametrize("body", [{"kind": "emulator", "mode": "Turbo"}, {"kind": "emulator", "rpm": 5000}])
def test_an_emulator_that_cannot_be(live: Server, body: Json) -> None:
    assert ("Turbo" if "mode" in body else "5000") in refused(live, 422, body)


def test_without_permission(live: Server) -> None:
    """Asked as a user who is not root, whom no permission would bind."""
    ends = os.openpty()
    path = os.ttyname(ends[1])
    os.chmod(path, 0)
    assert stat.S_IMODE(os.stat(path).st_mode) == 0
    user = os.geteuid()
    try:
        if user == 0:
            os.seteuid(65534)
        detail = refused(live, 403, {"kind": "device", "port": path})
    finally:
        os.seteuid(user)
        for end in ends:
            os.close(end)
    assert "usermod -aG" in detail or "chmod a+rw" in detail
