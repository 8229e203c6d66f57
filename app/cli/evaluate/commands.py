"""Judging ellipses and maps: the commands below `lidarcore evaluate`, gathered."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import (
    MOST,
    RecordingPath,
    Seed,
    Set,
    SettingsFile,
    Topic,
    Workers,
    check_output,
    numbers,
    settings_from,
    to_file,
)
from ..progress import ForPrograms, progress
from .agreement import agreement
from .calibration import calibration
from .endurance import endurance
from .honesty import honesty
from .map import evaluate_map
from .map_studies import relocation, walls
from .stations import stations

if TYPE_CHECKING:
    from lidarcore import SensorNoise
    from lidarcore.evaluation.consistency.study import Consistency

WIDTH = 180  # of the tables in a file or a pipe
MOVES = (
    "The sensor moves in this recording: nothing can be judged. It should stand still in a room; "
    "--skip and --scans choose a part in which it does."
)

evaluate = typer.Typer(
    help="Judge ellipses and maps: what is claimed against what is measured.", no_args_is_help=True
)
evaluate.command("map")(evaluate_map)


Rooms = Annotated[
    list[str] | None,
    typer.Option(help="a simulated world, or a rectangle in m such as 4.5x2.5; may be repeated"),
]
Noises = Annotated[
    list[str] | None,
    typer.Option(
        metavar="RANGE,BEARING",
        help="noise of the sensor: sigmas in m and rad, e.g. 0.02,0.0034; may be repeated",
    ),
]
WhichSegments = Annotated[
    str, typer.Option(help="segments to use: known, found (by the real segmentation), or both")
]
Trials = Annotated[
    int,
    typer.Option(
        min=1,
        max=MOST,
        help="corner trials in all, each by every method; "
        "rounded up to whole blocks for each room, noise and segmentation",
    ),
]
Beams = Annotated[int, typer.Option(min=90, max=100_000, help="beams in a revolution")]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="a Dask scheduler, e.g. tcp://host:8786, whose workers do the work"),
]
Report = Annotated[Path | None, to_file("FILE.html for a report; FILE.json or FILE.csv with every figure")]
ByRoom = Annotated[bool, typer.Option("--by-room", help="also print a table for each room")]


@evaluate.command()
def consistency(
    room: Rooms = None,
    noise: Noises = None,
    segments: WhichSegments = "both",
    trials: Trials = 100_000,
    beams: Beams = 920,
    seed: Seed = 0,
    workers: Workers = None,
    scheduler: Scheduler = None,
    output: Report = None,
    by_room: ByRoom = False,
    for_programs: ForPrograms = False,
) -> None:
    """Bias, RMS error, coverage, ANEES and ellipse areas of every fitter with both covariances."""
    from lidarcore.evaluation.consistency import study as monte_carlo
    from lidarcore.evaluation.consistency import tables as consistency_tables
    from lidarcore.evaluation.consistency.trials import SEGMENTATIONS

    check_output(output, *consistency_tables.STUDY_FORMATS)
    if segments not in (*SEGMENTATIONS, "both"):
        raise typer.BadParameter(f"--segments {segments} is unknown: give known, found or both.")
    usual = monte_carlo.Design()
    design = monte_carlo.Design(
        rooms=tuple(room or usual.rooms),
        noises=tuple(map(_noise, noise)) if noise else usual.noises,
        segmentations=tuple(s for s in SEGMENTATIONS if segments in (s, "both")),
        trials=trials,
        beams=beams,
        seed=seed,
    )
    started = time.perf_counter()
    with progress(design.chunks, for_programs) as tell, _interruptible():
        study = monte_carlo.study(
            design, workers or os.cpu_count() or 1, scheduler, lambda done, chunks: tell(done)
        )
    _show(study, by_room, time.perf_counter() - started)
    if output is not None:
        consistency_tables.write(study, output)


def _show(study: "Consistency", by_room: bool, seconds: float) -> None:
    from lidarcore import FITTERS

    from ..tables import console
    from .consistency_table import tables

    terminal = console(WIDTH)
    for table in tables(study, by_room):
        terminal.print(table)
    terminal.print(
        f"{study.trials:,} corner trials, each by {len(FITTERS)} fitters, in {seconds:.1f} s. "
        "± is half of a 95 % confidence interval; area: of the claimed ellipse over the actual one."
    )


@evaluate.command()
def repeatability(
    recording: RecordingPath,
    scans: Annotated[int, typer.Option(min=10, max=MOST, help="scans to read and judge together")] = 100,
    skip: Annotated[int, typer.Option(min=0, max=MOST, help="scans to skip at the beginning")] = 0,
    methods: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="fitters to compare; all if not given")
    ] = None,
    output: Annotated[Path | None, to_file("FILE.json with every corner and wall, or FILE.csv")] = None,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """The scatter of walls and corners against the ellipse each method claims, while the sensor stood still."""
    from lidarcore import FITTERS, compare, open_recording
    from lidarcore.errors import EvaluationError
    from lidarcore.evaluation.consistency import tables as consistency_tables
    from lidarcore.evaluation.repeatability import tables as repeatability_tables
    from lidarcore.evaluation.repeatability.statistics import Repeatability

    from ..tables import console
    from .repeatability_table import remarks, tables

    check_output(output, *consistency_tables.FORMATS)
    chosen = settings_from(settings, set_)
    study = Repeatability(scans, [name.strip() for name in methods.split(",")] if methods else FITTERS)
    for scan in islice(open_recording(recording, topic, chosen.sensor.mask), skip, skip + scans):
        study.add(compare(scan, chosen.extraction, study.methods))
    summary = study.summary()
    if not any(found.scatter().is_judged for found in (study.corners, study.walls)):
        raise EvaluationError(MOVES if study.moved else f"Nothing can be judged. {summary.message}")
    terminal = console(WIDTH)
    for shown in tables(summary):
        terminal.print(shown)
    for remark in remarks(summary):
        terminal.print(remark)
    if output is not None:
        repeatability_tables.write(summary, output)


for command in (calibration, stations, agreement, honesty, endurance, relocation, walls):
    evaluate.command()(command)


def _noise(text: str) -> "SensorNoise":
    from lidarcore import SensorNoise

    sigma_range, sigma_bearing = numbers("--noise", text, "two numbers, m and rad", "0.02,0.0034")
    return SensorNoise(sigma_range=sigma_range, sigma_bearing=sigma_bearing)


@contextmanager
def _interruptible() -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("Interrupted: nothing was written.", err=True)
        raise SystemExit(130) from None
