"""The emulator as a process: how it starts, how it ends, and that it never outlives its purpose."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import psutil
import pytest
from emulated_line import ASK_INFO, line_to
from pydantic import ValidationError
from waiting import PATIENCE

from lidarcore import DeviceError
from lidarcore.rplidar.emulation.options import EmulatorOptions, parse
from lidarcore.rplidar.emulation.pseudo_terminal import PseudoTerminal
from lidarcore.rplidar.emulator_process import EmulatorProcess

EMULATOR = [sys.executable, "-m", "lidarcore.rplidar.emulator"]
PARENT = """
from lidarcore.rplidar.emulator_process import EmulatorProcess
emulator = EmulatorProcess()
print(emulator.pid, emulator.port, flush=True)
input()
"""


def start(arguments, **streams):
    process = subprocess.Popen([*EMULATOR, *arguments], stdout=subprocess.PIPE, text=True, **streams)
    return process, process.stdout.readline().removeprefix("RPLIDAR S1 emulated on ").strip()


def test_it_takes_options_and_gives_the_port_at_the_path_asked_for(tmp_path):
    link = tmp_path / "lidar"
    with EmulatorProcess(link=link, people=0) as emulator:
        assert emulator.port == str(link)
        assert link.is_char_device()
        # What interrupts us from a terminal must not reach it: we stop the sensor first.
        assert os.getpgid(emulator.pid) != os.getpgid(0)
        with line_to(emulator) as line:
            assert line.ask(ASK_INFO, 27).startswith("a55a1400000004")
        emulator.close()
        emulator.close()
        assert not os.path.lexists(link)
        assert not psutil.pid_exists(emulator.pid)
        with pytest.raises(DeviceError, match="no longer running"):
            emulator.command("unplug")


@pytest.mark.long
@pytest.mark.parametrize("options", [{}, {"link": "lidar"}], ids=["own folder", "link"])
def test_killed_it_leaves_no_port_no_folder_and_no_zombie(tmp_path, options):
    link = {name: tmp_path / path for name, path in options.items()}
    ended = threading.Event()
    with EmulatorProcess(on_end=ended.set, **link) as emulator:
        os.kill(emulator.pid, signal.SIGKILL)
        assert ended.wait(PATIENCE)
        assert not os.path.lexists(emulator.port)
        assert Path(emulator.port).parent.exists() == bool(options)
        assert not psutil.pid_exists(emulator.pid)
        with pytest.raises(DeviceError, match="no longer running"):
            emulator.command("unplug")


@pytest.mark.long
def test_its_end_is_told_once_and_only_if_it_was_not_asked_for():
    ends, ended = [], threading.Event()

    def end():
        emulator.close()  # which is allowed
        ends.append(emulator.port)
        ended.set()

    with EmulatorProcess(on_end=end) as emulator:
        emulator.command("quit")
        assert ended.wait(PATIENCE)
    assert ends == [emulator.port]
    with EmulatorProcess(on_end=lambda: ends.append("closed")):
        pass
    with pytest.raises(DeviceError, match="has ended"):
        EmulatorProcess(on_end=lambda: ends.append("not begun"), replay="/nope")
    assert ends == [emulator.port]


def test_the_link_of_an_emulator_that_was_killed_is_taken_over(tmp_path):
    link = tmp_path / "lidar"
    link.symlink_to("/dev/pts/none")
    terminal = PseudoTerminal(link)
    assert link.is_char_device()
    terminal.unplug()
    assert os.listdir(tmp_path) == []


def test_a_path_that_cannot_be_a_port_is_named_and_left_alone(tmp_path):
    (tmp_path / "file").write_text("precious")
    with pytest.raises(DeviceError, match="file cannot be made a link: something else is there"):
        EmulatorProcess(link=tmp_path / "file")
    with pytest.raises(DeviceError, match="none/port cannot be made a link: No such file or directory"):
        PseudoTerminal(tmp_path / "none" / "port")
    assert (tmp_path / "file").read_text() == "precious"
    assert os.listdir(tmp_path) == ["file"]


def test_options_that_cannot_be_are_refused_before_anything_starts():
    with pytest.raises(ValidationError):
        EmulatorProcess(flip=2)
    with pytest.raises(ValidationError):
        EmulatorProcess(colour="red")


def test_every_option_survives_the_command_line():
    options = EmulatorOptions(
        link=Path("/a b/c"), people=0, moving=True, rpm=700, flip=0.25, baud=115200, health=1, streaming=True
    )
    assert parse(options.arguments(), "program") == options
    assert parse([], "program") == EmulatorOptions()


def test_a_wrong_option_is_explained_on_the_command_line(capsys):
    with pytest.raises(SystemExit) as stopped:
        parse(["--flip=2", "--rpm=fast"], "program")
    assert stopped.value.code == 2
    complaint = capsys.readouterr().err
    assert "--flip 2: Input should be less than or equal to 1" in complaint
    assert "--rpm fast: Input should be a valid integer" in complaint


@pytest.mark.long
def test_it_ends_when_its_parent_is_killed():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    pid, port = parent.stdout.readline().decode().split()
    emulator = psutil.Process(int(pid))
    parent.kill()
    parent.communicate()
    emulator.wait(PATIENCE)
    assert not Path(port).parent.exists()


@pytest.mark.long
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_and_leaves_nothing_behind(end):
    process, port = start([], stdin=subprocess.PIPE)
    process.send_signal(end)
    with process:
        assert process.wait(PATIENCE) == 0
    assert not Path(port).parent.exists()


@pytest.mark.long
def test_without_anyone_to_give_commands_it_goes_on():
    process, port = start(["--streaming"], stdin=subprocess.DEVNULL)
    with process:
        with open(port, "rb") as stream:
            assert len(stream.read(84 * 100)) == 84 * 100
        assert process.poll() is None
        process.terminate()


@pytest.mark.long
def test_it_obeys_lines_in_pieces_and_quits_when_told():
    process, _ = start([], stdin=subprocess.PIPE)
    with process:
        for piece in ("unp", "lug\nreplug\nqu", "it\n"):
            process.stdin.write(piece)
            process.stdin.flush()
        assert process.wait(PATIENCE) == 0
        assert process.stdout.read() == "ok unplug\nok replug\nok quit\n"
