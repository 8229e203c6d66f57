"""A port that cannot be used says why, and what to do about it."""

import grp
import itertools
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
import serial
from serial import Serial

from lidarcore.errors import NoDeviceError, PortBusyError, UnpluggedError
from lidarcore.rplidar.connection.port import Cancelled, Port

OPEN_IT = """
import grp, os, sys
from lidarcore.errors import DeviceError
from lidarcore.rplidar.connection.port import Port
if os.getuid() == 0:
    os.setuid(65534)  # nobody: for root there are no permissions
try:
    Port(sys.argv[1], 256000)
except DeviceError as error:
    print(type(error).__name__, error)
"""
PYSERIAL = os.path.dirname(serial.__file__)
HOLD_IT = "import os, sys; os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print('open', flush=True); sys.stdin.read()"


class Line:
    """A pseudo-terminal: `path` is a port, what is written to `far` arrives there."""

    def __init__(self) -> None:
        # New terminals get the lowest free numbers: some are left, lest another process gets this one once it is cut.
        lower = [os.openpty() for _ in range(8)]
        self.far, self._near = os.openpty()
        for end in itertools.chain(*lower):
            os.close(end)
        self.path = os.ttyname(self._near)
        self.is_cut = False

    def cut(self) -> None:
        self.is_cut = True
        for end in (self.far, self._near):
            os.close(end)


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.cut()


@contextmanager
def cut_before(moment: int, line: Line) -> Iterator[None]:
    """Cut the line before line number `moment` of pyserial's code is run."""
    lines = itertools.count(1)

    def trace(frame: FrameType, event: str, _: object) -> Callable[..., object] | None:
        if not frame.f_code.co_filename.startswith(PYSERIAL):
            return None
        if event == "line" and next(lines) == moment:
            line.cut()
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield
    finally:
        sys.settrace(before)


def test_a_port_that_is_not_there() -> None:
    with pytest.raises(NoDeviceError, match=r"no port /dev/ttyUSB99: .*serial port"):
        Port("/dev/ttyUSB99", 256_000)


@pytest.mark.parametrize("path", ["/dev/null", "/tmp", __file__])
def test_what_is_no_port(path: str) -> None:
    with pytest.raises(NoDeviceError, match="cannot be used as a serial port"):
        Port(path, 256_000)


@pytest.mark.parametrize("path", ["/dev/tty\0USB0", "tty\0", "/dev/\ud800"])
def test_what_is_no_text_is_no_port(path: str) -> None:
    with pytest.raises(NoDeviceError, match="cannot be the path of a port") as raised:
        Port(path, 256_000)
    str(raised.value).encode()  # whoever shows it can


def test_a_port_may_be_given_by_its_name(line: Line, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(NoDeviceError, match="/dev/null cannot be used"):
        Port("null", 256_000)
    with pytest.raises(NoDeviceError, match="no port /dev/ttyUSB99:"):
        Port("ttyUSB99", 256_000)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lidar").symlink_to(line.path)
    port = Port("lidar", 256_000)
    assert port.path == "lidar"
    port.close()


def test_without_permission_the_group_to_join_is_named(line: Line) -> None:
    if os.getuid() == 0:
        os.chown(line.path, -1, grp.getgrnam("tty").gr_gid)
    os.chmod(line.path, 0)
    child = subprocess.run(
        [sys.executable, "-c", OPEN_IT, line.path], capture_output=True, text=True, timeout=60, check=True
    )
    assert child.stdout.startswith(f"PortPermissionError You may not open {line.path}")
    assert f"`sudo usermod -aG {Path(line.path).group()} $USER`" in child.stdout


def test_a_port_is_opened_for_one_only(line: Line) -> None:
    first = Port(line.path, 256_000)
    with pytest.raises(PortBusyError, match="in use by"):
        Port(line.path, 256_000)
    first.close()
    Port(line.path, 256_000).close()


def test_a_port_locked_by_another_library_is_busy(line: Line) -> None:
    with Serial(line.path, 115_200, exclusive=True) as other:
        with pytest.raises(PortBusyError, match="in use by"):
            Port(line.path, 256_000)
        assert other.baudrate == 115_200


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells who has a file open")
def test_a_program_that_does_not_lock_is_found_and_named(line: Line) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD_IT, line.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "open\n"
        with pytest.raises(PortBusyError, match=rf"in use by python.* \(pid {holder.pid}\)"):
            Port(line.path, 256_000)
    Port(line.path, 256_000).close()


def test_every_byte_passes_unchanged_and_is_seen(line: Line) -> None:
    seen = []
    port = Port(line.path, 256_000, tap=lambda *seeing: seen.append(seeing))
    data = bytes(range(256))
    port.write(data)
    assert os.read(line.far, 1000) == data
    os.write(line.far, data)
    arrived = port.read()
    while len(arrived) < len(data):
        arrived += port.read()
    assert arrived == data
    assert b"".join(data for direction, _, data in seen if direction == "out") == data
    assert b"".join(data for direction, _, data in seen if direction == "in") == data
    port.close()


def test_draining_ends_when_it_is_quiet_and_when_it_never_is(line: Line) -> None:
    port = Port(line.path, 256_000)
    os.write(line.far, bytes(3000))
    assert port.drain()
    assert port.read() == b""

    talking = threading.Event()

    def talk() -> None:
        while not talking.wait(0.005):
            os.write(line.far, b"talk")

    talker = threading.Thread(target=talk)
    talker.start()
    quiet = all(port.drain(limit=0.2) for _ in range(50))  # a busy machine may hold up who talks
    talking.set()
    talker.join()
    port.close()
    assert not quiet


def test_a_cut_line_is_unplugged_to_reader_and_writer_and_can_be_closed() -> None:
    line = Line()
    port = Port(line.path, 256_000)
    line.cut()
    with pytest.raises(UnpluggedError, match=r"went away: check the sensor's cable"):
        port.read()
    with pytest.raises(UnpluggedError):
        port.write(b"x")
    port.close()
    port.close()


def test_a_port_that_goes_away_while_it_is_opened_is_missed_at_whatever_line() -> None:
    """Cut before the first, second, ... line that pyserial runs, until it has opened the port before it is cut."""
    for moment in itertools.count(1):
        line = Line()
        try:
            with cut_before(moment, line):
                port = Port(line.path, 256_000)
        except NoDeviceError:
            continue
        if not line.is_cut:
            break
        with pytest.raises(UnpluggedError):
            port.read()
    port.close()
    line.cut()
    assert moment > 50


def test_a_cancelled_port_is_not_read_any_more(line: Line) -> None:
    cancelled = threading.Event()
    port = Port(line.path, 256_000, cancelled=cancelled)
    os.write(line.far, b"x")
    cancelled.set()
    with pytest.raises(Cancelled):
        port.drain()
    port.close()
