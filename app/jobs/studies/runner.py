"""Studies run one at a time, each in a process of its own; their reports stay."""

import os
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from lidarcore import SensorNoise

from ...errors import ConflictError, NotFoundError
from ...records import record
from ..command_process import CommandProcess
from .kinds import KINDS, Options
from .reports import ReportEntry, Reports

State = Literal["running", "finished", "failed", "cancelled"]
MIN_SHARE = 0.05  # of the work done before what remains is estimated


@dataclass(frozen=True, slots=True)
class StudyStatus:
    """`done` of `total` parts; `remaining_s` is None until it can be told; `report` is the name of what came out."""

    kind: str
    options: dict[str, Any]
    state: State
    elapsed_s: float
    remaining_s: float | None
    done: int
    total: int
    error: str | None
    report: str | None


@dataclass(frozen=True, slots=True)
class ExpectedTime:
    """About how long it takes, s."""

    quick: float
    full: float


@dataclass(eq=False)
class _Study:
    """One study, from its start until another one is started."""

    kind: str
    options: dict[str, Any]
    path: Path
    state: State = "running"
    error: str | None = None
    started: float = field(default_factory=time.monotonic)
    ended: float | None = None
    process: CommandProcess | None = None

    @property
    def elapsed(self) -> float:
        """Seconds."""
        return (self.ended or time.monotonic()) - self.started

    def status(self) -> StudyStatus:
        done, total = (self.process.done, self.process.total) if self.process else (0, 0)
        share = done / total if total else 0.0
        is_known = self.state == "running" and share > MIN_SHARE
        return record(
            StudyStatus,
            self,
            elapsed_s=round(self.elapsed, 1),
            remaining_s=round(self.elapsed * (1 - share) / share, 1) if is_known else None,
            done=done,
            total=total,
            report=self.path.stem if self.state == "finished" else None,
        )


class Studies:
    """Studies, one at a time, and their reports. Every method may be called from any thread."""

    def __init__(self, folder: Path) -> None:
        self.reports = Reports(folder.absolute())
        self._run: _Study | None = None
        self._lock = threading.Lock()

    def finished(self) -> list[ReportEntry]:
        """The reports of all that is finished, the newest first."""
        unfinished = self._run.path.stem if self._run and self._run.state == "running" else None
        return [report for report in self.reports.all() if report.name != unfinished]

    @property
    def run(self) -> StudyStatus | None:
        """What runs, or ran last; None at first."""
        return self._run.status() if self._run else None

    def start(self, kind: str, options: Options, arguments: list[str], noise: SensorNoise) -> StudyStatus:
        """Run a study. Raises ConflictError if one is running, or what `Reports.new` raises."""
        with self._lock:
            if self._run and self._run.state == "running":
                raise ConflictError(
                    f"The study {self._run.kind} is running: wait for its end, or cancel it first."
                )
            chosen = _chosen(options, noise)
            run = _Study(kind, chosen, self.reports.new(kind))
            common = [f"--seed={options.seed}", f"--workers={_workers()}", f"--output={run.path}"]
            run.process = CommandProcess(
                [*KINDS[kind].command, *arguments, *common],
                lambda code, message: self._end(run, code, message),
            )
            self._run = run
            return run.status()

    def cancel(self) -> None:
        """End the study that runs, and all its processes. Raises NotFoundError if none does."""
        with self._lock:
            run = self._run
            if run is None or run.state != "running":
                raise NotFoundError("No study is running.")
            run.state = "cancelled"
        if run.process:
            run.process.kill()

    def close(self) -> None:
        """End what runs."""
        with suppress(NotFoundError):
            self.cancel()

    def _end(self, run: _Study, code: int, message: str) -> None:
        with self._lock:
            run.ended = time.monotonic()
            if run.state == "running" and code == 0 and run.path.is_file():
                run.state = "finished"
                with suppress(OSError):  # then it is not known how it was made
                    self.reports.describe(run.path, run.options, run.elapsed)
            else:
                self.reports.discard(run.path)
                if run.state == "running":
                    run.state, run.error = "failed", message


def _chosen(options: Options, noise: SensorNoise) -> dict[str, Any]:
    """The options that were chosen; the noise as it was set then."""
    chosen = options.model_dump(exclude_none=True)
    if chosen.get("noise") == "settings":
        chosen |= {"sigma_range": noise.sigma_range, "sigma_bearing": noise.sigma_bearing}
    return chosen


def expected(kind: str, reports: Sequence[ReportEntry]) -> ExpectedTime:
    """About how long a study of usual size takes: as long as the newest report of it took."""
    quick, full = KINDS[kind].seconds
    alike = [report for report in reports if report.kind == kind and _usual(report)]
    return ExpectedTime(_took(alike, True) or quick, _took(alike, False) or full)


def _took(reports: Sequence[ReportEntry], quick: bool) -> float | None:
    return next((r.took_s for r in reports if (r.options or {}).get("quick") is quick), None)


def _usual(report: ReportEntry) -> bool:
    return not {"scans", "recording", "runs", "trials"} & set(report.options or {})


def _workers() -> int:
    """Number of processes for a study: one core is left to the live view."""
    return max(1, (os.cpu_count() or 1) - 1)
