"""Studies run by a real server: in a process of their own, one at a time, with reports that stay."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import psutil
import pytest
from lidarcore_app.jobs.command_process import parts_done
from lidarcore_app.jobs.studies.reports import MOST
from processes import ENVIRONMENT, Serving
from serving import ROOT, Json, Server, assert_problem, write_room
from waiting import wait_until

SHORT = {"trials": 1000, "noise": "settings"}
LONG = {"trials": 20_000_000}
CORNERS = {"scans": 10, "recording": "room.npz"}


def running(of: int = os.getpid()) -> list[psutil.Process]:
    """The processes of studies that one has started, and theirs."""
    return [
        process
        for child in psutil.Process(of).children()
        if "--progress" in child.cmdline()
        for process in (child, *child.children(recursive=True))
    ]


def finished(server: Server) -> Json:
    wait_until(lambda: server.get("/studies")["run"]["state"] != "running", "the study has ended", 240)
    return server.get("/studies")["run"]


def started(server: Server, kind: str, options: Json) -> list[psutil.Process]:
    """Start a study and wait until it has said how much there is to do."""
    server.change("POST", f"/studies/{kind}", options)
    wait_until(lambda: server.get("/studies")["run"]["total"], "it has begun")
    return running()


def test_a_study_runs_and_its_report_stays_when_the_server_is_started_anew(
    make_server: Callable[..., Server],
) -> None:
    server = make_server()
    server.change("PATCH", "/settings", {"extraction": {"noise": {"sigma_range": 0.013}}})
    answer = server.change("POST", "/studies/consistency", SHORT)
    assert (answer["kind"], answer["state"], answer["report"]) == ("consistency", "running", None)
    told = {"quick": True, "seed": 0, **SHORT, "sigma_range": 0.013, "sigma_bearing": 0.0034}
    assert answer["options"] == told
    run = finished(server)
    assert (run["state"], run["error"]) == ("finished", None)
    assert run["done"] == run["total"] == 120
    assert run["remaining_s"] is None
    assert not running()
    (report,) = server.get("/studies")["reports"]
    assert report.items() >= {"name": run["report"], "kind": "consistency", "options": told}.items()
    assert report["took_s"] == pytest.approx(run["elapsed_s"], abs=0.2)
    again = make_server()
    assert again.get("/studies")["run"] is None
    assert again.get("/studies")["reports"] == [report]
    page = again.http.get(f"/studies/reports/{report['name']}")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert len(page.content) == report["size"]
    assert "Noise 1.3 cm, 3.4 mrad" in page.text
    again.http.delete(f"/studies/reports/{report['name']}").raise_for_status()
    assert again.get("/studies")["reports"] == []
    assert list((again.folder.parent / "studies").iterdir()) == []


def test_a_paper_is_run_on_a_recording_of_the_library(server: Server, room: Path) -> None:
    """Four corners of a rectangle, of which the recording has thirty scans."""
    server.change("POST", "/studies/wctls", CORNERS)
    run = finished(server)
    assert (run["state"], run["error"]) == ("finished", None)
    page = server.http.get(f"/studies/reports/{run['report']}").text
    assert "10 scans of a recording, the sensor at rest; corners: 4." in page


def test_nothing_in_a_report_can_run(server: Server) -> None:
    folder = server.folder.parent / "studies"
    folder.mkdir()
    (folder / "cwlf_2026-01-02_03-04-05.html").write_text("<script>alert(1)</script>")
    policy = server.http.get("/studies/reports/cwlf_2026-01-02_03-04-05").headers["content-security-policy"]
    directives = dict(part.split(" ", 1) for part in policy.split("; "))
    assert directives["default-src"] == "'none'"
    assert "script-src" not in directives
    assert directives["frame-ancestors"] == "'self'"
    (report,) = server.get("/studies")["reports"]
    assert (report["options"], report["took_s"]) == (None, None)


def test_a_cancelled_study_is_gone_with_its_process_and_leaves_nothing(server: Server) -> None:
    (process, *_) = started(server, "consistency", LONG)
    assert process.nice() == 10
    workers = [a.removeprefix("--workers=") for a in process.cmdline() if a.startswith("--workers=")]
    assert workers == [str(max(1, os.cpu_count() - 1))]
    server.http.delete("/studies/running").raise_for_status()
    assert not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    assert not running()
    assert server.get("/studies")["run"]["state"] == "cancelled"
    assert list((server.folder.parent / "studies").iterdir()) == []
    assert_problem(server.http.delete("/studies/running"), 404)


@pytest.mark.long
def test_one_at_a_time(server: Server) -> None:
    started(server, "consistency", LONG)
    problem = assert_problem(server.http.post("/studies/cwlf", json={}), 409)
    assert "consistency is running" in problem["detail"]
    assert len({p.pid for p in running() if "--progress" in p.cmdline()}) == 1
    server.http.delete("/studies/running").raise_for_status()
    assert started(server, "cwlf", {})
    server.http.delete("/studies/running").raise_for_status()


def test_a_study_that_fails_says_why_in_the_words_of_the_command(server: Server, folder: Path) -> None:
    write_room(folder / "short.npz", scans=9)
    server.change("POST", "/studies/cwlf", {"recording": "short.npz"})
    run = finished(server)
    assert run["state"] == "failed"
    assert run["error"].startswith("9 scans are too few")
    assert server.get("/studies")["reports"] == []


@pytest.mark.parametrize(
    ("kind", "options", "pointer"),
    [
        ("cwlf", {"scans": 9}, "/scans"),
        ("cwlf", {"scans": 1_000_000}, "/scans"),
        ("wctls", {"seed": -1}, "/seed"),
        ("wctls", {"noise": "none"}, "/noise"),
        ("wctls", {"quick": "yes"}, "/quick"),
        ("clustering-ekf", {"runs": 0}, "/runs"),
        ("clustering-ekf", {"recording": "room.npz"}, "/recording"),
        ("consistency", {"trials": 10**12}, "/trials"),
        ("consistency", {"output": "/etc/passwd"}, "/output"),
    ],
)
def test_options_that_cannot_be_are_refused(
    shared_server: Server, kind: str, options: Json, pointer: str
) -> None:
    problem = assert_problem(shared_server.http.post(f"/studies/{kind}", json=options), 422)
    assert pointer in [error["pointer"] for error in problem["errors"]]
    assert shared_server.get("/studies")["run"] is None


@pytest.mark.parametrize("name", ["../room.npz", "/etc/passwd", "..", ".hidden", "a/b", "-o"])
def test_names_of_recordings_never_become_paths(shared_server: Server, name: str) -> None:
    response = shared_server.http.post("/studies/cwlf", json={"recording": name})
    assert response.status_code in (404, 422)
    assert shared_server.get("/studies")["run"] is None


@pytest.mark.parametrize(
    "name",
    [
        "cwlf_2026-01-01_00-00-00",
        "..%2Frecordings%2Froom",
        "../landmarks",
        "cwlf",
        "",
        "cwlf_2026-01-01_00-00-00%00",
    ],
)
def test_names_of_reports_never_become_paths(shared_server: Server, name: str) -> None:
    for method in ("GET", "DELETE"):
        assert shared_server.http.request(method, f"/studies/reports/{name}").status_code in (404, 405)
    assert (shared_server.folder / "room.npz").exists()


def test_what_else_lies_beside_the_reports_is_neither_shown_nor_deleted(server: Server) -> None:
    folder = server.folder.parent / "studies"
    folder.mkdir()
    (folder / "notes.html").write_text("mine")
    for method in ("GET", "DELETE"):
        assert_problem(server.http.request(method, "/studies/reports/notes"), 404)
    assert server.get("/studies")["reports"] == []
    assert (folder / "notes.html").read_text() == "mine"


def test_reports_are_not_without_number(server: Server) -> None:
    folder = server.folder.parent / "studies"
    folder.mkdir()
    for n in range(MOST):
        (folder / f"cwlf_2026-01-01_00-00-00_{n}.html").touch()
    problem = assert_problem(server.http.post("/studies/cwlf", json={}), 409)
    assert "delete some" in problem["detail"]


def test_the_schema_says_what_can_be_chosen(shared_server: Server) -> None:
    kinds = {kind["name"]: kind for kind in shared_server.get("/studies")["kinds"]}
    assert list(kinds) == ["consistency", "cwlf", "wctls", "clustering-ekf"]
    for kind in kinds.values():
        assert kind["question"].endswith("?")
        assert 0 < kind["expected_s"]["quick"] < kind["expected_s"]["full"]
        assert {"quick", "seed"} < set(kind["schema"]["properties"])


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_study_ends_with_the_server(serving: Callable[..., Serving], room: Path, number: int) -> None:
    """However that ends."""
    one = serving(room)
    with httpx.Client(base_url=f"{one.url}api/v1", timeout=30) as http:
        http.post("/studies/consistency", json=LONG).raise_for_status()
        wait_until(lambda: http.get("/studies").json()["run"]["total"], "it has begun")
    processes = running(one.process.pid)
    assert processes
    one.process.send_signal(number)
    one.process.wait(30)
    wait_until(lambda: not any(alive(process) for process in processes), "all of it is gone")


def alive(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.fixture
def command(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A long study on two workers, as the server runs it, once it has begun."""
    arguments = [
        "evaluate",
        "consistency",
        "--trials=20000000",
        "--workers=2",
        f"--output={tmp_path / 'out.html'}",
    ]
    with subprocess.Popen(
        [sys.executable, "-m", "lidarcore_app.cli.main", *arguments, "--progress"],
        cwd=ROOT, env=ENVIRONMENT, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        assert parts_done(process.stderr.readline()) == (0, 480)
        wait_until(lambda: len(workers_of(process.pid)) == 2, "its workers run")
        yield process
        process.kill()


def workers_of(pid: int) -> list[psutil.Process]:
    children = psutil.Process(pid).children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def test_a_command_for_programs_ends_with_its_input_and_so_do_its_workers(
    command: subprocess.Popen[str],
) -> None:
    workers = workers_of(command.pid)
    assert command.stdin is not None
    command.stdin.close()
    command.wait(30)
    wait_until(lambda: not any(map(alive, workers)), "its workers are gone")


def test_workers_end_when_their_parent_is_killed(command: subprocess.Popen[str]) -> None:
    workers = workers_of(command.pid)
    command.kill()
    wait_until(lambda: not any(map(alive, workers)), "its workers are gone")


@pytest.mark.parametrize(
    ("line", "parts"),
    [
        ("progress 3 5\n", (3, 5)),
        ("progress 3\n", None),
        ("progress -1 5", None),
        ("progress x y", None),
        ("lidarcore: progress 3 5", None),
        ("", None),
        ("\n", None),
    ],
)
def test_only_lines_of_progress_are_taken_for_it(line: str, parts: tuple[int, int] | None) -> None:
    assert parts_done(line) == parts


@pytest.mark.long
@pytest.mark.parametrize("study", ["cwlf", "wctls"])
def test_the_parts_told_go_up_to_all(study: str, tmp_path: Path, room: Path) -> None:
    """The input stays open until the end, as a program keeps it."""
    arguments = [
        "experiment",
        study,
        f"--recording={room}",
        f"--output={tmp_path / 'out.html'}",
        "--workers=1",
    ]
    with subprocess.Popen(
        [sys.executable, "-m", "lidarcore_app.cli.main", *arguments, "--progress"],
        cwd=ROOT, env=ENVIRONMENT, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        said = process.stderr.read()
        assert process.wait(60) == 0
    assert re.fullmatch(r"(progress \d+ \d+\n)+", said)
    done, total = parts_done(said.splitlines()[-1])
    assert done == total
