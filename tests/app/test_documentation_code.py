"""README, documentation and examples: their code runs, their command lines and requests are what the program takes."""

import contextlib
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import typer.main
from lidarcore_app.cli.main import cli
from sensing import watch
from serving import ROOT, Server
from waiting import wait_until

from lidarcore import open_recording
from lidarcore.mapping.grid import build_grid, write_ros_map
from lidarcore.rplidar.emulation.options import parse as parse_emulator_options
from lidarcore.rplidar.emulator_process import EmulatorProcess

PAGES = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts)]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
HALL = "hall/map.yaml"
DEMO = "app/demo/emulated-s1.mcap"
BLOCK = re.compile(r"^( *)```(\w+)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


def blocks(language: str) -> list[Any]:
    """Each block of that language, in the order of its page, named by where it stands."""
    found = []
    for page in PAGES:
        text = page.read_text("utf-8")
        for match in BLOCK.finditer(text):
            if match[2] == language:
                line = text.count("\n", 0, match.start()) + 1
                code = "\n".join(row.removeprefix(match[1]) for row in match[3].splitlines())
                found.append(pytest.param(code, id=f"{page.relative_to(ROOT)}:{line}"))
    return found


def console_lines(program: str) -> list[str]:
    """Each command line of that program once."""
    rows = (row for block in blocks("console") for row in block.values[0].splitlines())
    return list(dict.fromkeys(row[2:] for row in rows if row.startswith(f"$ {program} ")))


@pytest.fixture(scope="module")
def port() -> Iterator[str]:
    with EmulatorProcess() as emulator:
        yield emulator.port


@pytest.fixture(scope="module")
def running(shared_server: Server, sensor: EmulatorProcess) -> Server:
    """A server as a reader has started one: of the emulated room, with a map. Nobody is about who hides a corner."""
    watch(shared_server, sensor)
    shared_server.change("PATCH", "/settings", {"navigation": {"mode": "slam", "method": "landmarks"}})
    wait_until(lambda: shared_server.get("/localization")["session"], "there is a map")
    return shared_server


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that has the demo where the source tree has it, and takes what is written."""
    (tmp_path / "app" / "demo").mkdir(parents=True)
    (tmp_path / DEMO).symlink_to(ROOT / DEMO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("code", blocks("python"))
def test_python_runs(code: str, workplace: Path, running: Server, request: pytest.FixtureRequest) -> None:
    if HALL in code:
        map_hall()
    if "/dev/ttyUSB0" in code:
        code = code.replace("/dev/ttyUSB0", request.getfixturevalue("port"))
    exec(compile(code.replace("http://127.0.0.1:8000", running.url), "documentation", "exec"), {})


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_an_example_runs(
    path: Path,
    workplace: Path,
    running: Server,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", [path.name, *([running.url] if path.name == "09_rest.py" else [])])
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out.strip()


def test_the_example_that_needs_a_server_says_so_in_a_line() -> None:
    command = [sys.executable, str(ROOT / "examples" / "09_rest.py"), "http://127.0.0.1:9"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("No server answers at http://127.0.0.1:9")
    assert len(done.stderr.splitlines()) == 1


def test_every_example_is_listed() -> None:
    listed = re.findall(r"\((\d\d_\w+\.py)\)", (ROOT / "examples" / "README.md").read_text("utf-8"))
    assert listed == [path.name for path in EXAMPLES]


def command_of(arguments: list[str]) -> tuple[Any, list[str]]:
    """The command of a command line, and what is left for it."""
    command: Any = typer.main.get_command(cli)
    while hasattr(command, "commands"):
        command, arguments = command.commands[arguments[0]], arguments[1:]
    return command, arguments


@pytest.mark.parametrize("line", console_lines("lidarcore"))
def test_a_command_line_is_understood(line: str) -> None:
    command, arguments = command_of(shlex.split(line, comments=True)[1:])
    if command.name == "emulate":
        parse_emulator_options(arguments, "lidarcore emulate")
    else:
        command.make_context(command.name, list(arguments))


# Laying whole scans on each other takes long, and has tests of its own.
ON_THE_DEMO = [line for line in console_lines("lidarcore") if DEMO in line and "--scans" not in line]


@pytest.mark.parametrize("line", ON_THE_DEMO)
def test_a_command_on_the_demo_runs(line: str, workplace: Path) -> None:
    if "--map hall.json" in line:
        run(f"lidarcore localize {DEMO} --save-map hall.json -o first.csv")
    if HALL in line:
        map_hall()
    run(line)
    for written in re.findall(r"(?:-o|--save-map) (\S+)", line):
        assert (workplace / written).stat().st_size


def map_hall() -> None:
    """What an earlier page has the reader make: here of one scan alone, which is enough to find others by."""
    Path(HALL).parent.mkdir(exist_ok=True)
    write_ros_map(build_grid([next(iter(open_recording(DEMO)))], np.zeros((1, 3))), HALL)


def run(line: str) -> None:
    with contextlib.suppress(SystemExit):
        assert not cli(shlex.split(line, comments=True)[1:], standalone_mode=False)


@pytest.mark.parametrize("line", console_lines("make"))
def test_a_target_of_make_exists(line: str) -> None:
    target = line.split()[1]
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE), target


@pytest.mark.parametrize("line", console_lines("curl"))
def test_a_request_is_answered(line: str, running: Server) -> None:
    words = iter(shlex.split(line.replace("http://127.0.0.1:8000", running.url))[1:])
    method, url, headers, body = "GET", "", {}, None
    for word in words:
        if word == "-X":
            method = next(words)
        elif word == "-H":
            name, _, value = next(words).partition(": ")
            headers[name] = value
        elif word == "-d":
            body = next(words)
        else:
            url = word
    answer = httpx.request(method, url, headers=headers, content=body)
    assert answer.is_success, answer.text


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 120
