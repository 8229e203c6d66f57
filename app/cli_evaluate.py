"""The command `lidarcore evaluate`: what each method claims, and what is so."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli_options import RecordingPath, Set, SettingsFile, Topic, check_folder, settings_from
from app.cli_progress import ForPrograms, progress

if TYPE_CHECKING:
    from lidarcore import SensorNoise

WIDTH = 180  # of the tables in a file or a pipe
MOVES = (
    "The sensor moves in this recording: no corner can be judged. It should stand still in a room; "
    "--skip and --scans choose a part in which it does."
)

evaluate = typer.Typer(help="What each method claims, and what is so.", no_args_is_help=True)


@evaluate.command()
def consistency(
    room: Annotated[
        list[str] | None,
        typer.Option(help="a simulated world, or a rectangle in m such as 4.5x2.5; may be repeated"),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(metavar="RANGE,BEARING", help="sigmas in m and rad, e.g. 0.02,0.0034; may be repeated"),
    ] = None,
    segments: Annotated[str, typer.Option(help="known, found (by the real segmentation), or both")] = "both",
    trials: Annotated[
        int,
        typer.Option(
            min=1,
            help="corner trials in all, each by every method; "
            "rounded up to whole blocks for each room, noise and segmentation",
        ),
    ] = 100_000,
    beams: Annotated[int, typer.Option(min=90, help="beams in a revolution")] = 920,
    seed: Annotated[int, typer.Option(min=0, help="of everything that is random")] = 0,
    workers: Annotated[
        int | None, typer.Option(min=1, help="processes; one for each core if not given")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="a Dask scheduler, e.g. tcp://host:8786, whose workers do the work"
        ),
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(help="keep finished parts in this file; the same command goes on from there"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="FILE.html for a report; FILE.json or FILE.csv with every figure"
        ),
    ] = None,
    by_room: Annotated[bool, typer.Option("--by-room", help="a table for each room, too")] = False,
    for_programs: ForPrograms = False,
) -> None:
    """Bias, RMS error, coverage, ANEES and ellipse areas of every fitter with both covariances."""
    from rich.console import Console

    from app.consistency_table import tables
    from lidarcore import FITTERS
    from lidarcore.evaluation import consistency as monte_carlo
    from lidarcore.evaluation import consistency_tables
    from lidarcore.evaluation.trials import SEGMENTATIONS

    if output is not None:  # told before minutes of work are lost
        consistency_tables.check(output, consistency_tables.STUDY_FORMATS)
        check_folder(output)
    if results is not None:
        check_folder(results, "--results")
    if segments not in (*SEGMENTATIONS, "both"):
        raise typer.BadParameter("--segments is known, found or both.")
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
    with progress(design.chunks, for_programs) as tell, _resumable(results):
        study = monte_carlo.study(
            design, workers or os.cpu_count() or 1, scheduler, results, lambda done, chunks: tell(done)
        )
    took = time.perf_counter() - started
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDTH)
    for table in tables(study, by_room):
        console.print(table)
    console.print(
        f"{study.trials:,} corner trials, each by {len(FITTERS)} fitters, in {took:.1f} s. "
        "± is half of a 95 % confidence interval; area: of the claimed ellipse over the actual one."
    )
    if output is not None:
        consistency_tables.write(study, output)


@evaluate.command()
def repeatability(
    recording: RecordingPath,
    scans: Annotated[int, typer.Option(min=10, help="in the window; as many are read")] = 100,
    skip: Annotated[int, typer.Option(min=0, help="scans to leave out at the beginning")] = 0,
    methods: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="fitters to compare; all if not given")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="FILE.json with every corner, or FILE.csv")
    ] = None,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """The scatter of corners against the ellipse each method claims, while the sensor stood still."""
    from rich.console import Console

    from app.repeatability_table import table
    from lidarcore import FITTERS, compare, open_recording
    from lidarcore.errors import EvaluationError
    from lidarcore.evaluation import consistency_tables, repeatability_tables
    from lidarcore.evaluation.repeatability import Repeatability

    if output is not None:
        consistency_tables.check(output)
        check_folder(output)
    extraction = settings_from(settings, set_).extraction
    study = Repeatability(scans, [name.strip() for name in methods.split(",")] if methods else FITTERS)
    for scan in islice(open_recording(recording, topic), skip, skip + scans):
        study.add(compare(scan, extraction, study.methods))
    summary = study.summary()
    if not any(method.corners for method in summary.methods):
        raise EvaluationError(MOVES if study.moved else f"No corner can be judged. {summary.message}")
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDTH)
    console.print(table(summary))
    if summary.message is not None:
        console.print(summary.message)
    if output is not None:
        repeatability_tables.write(summary, output)


def _noise(text: str) -> "SensorNoise":
    from lidarcore import SensorNoise

    try:
        sigma_range, sigma_bearing = map(float, text.split(","))
    except ValueError:
        raise typer.BadParameter(f"--noise {text!r} should be two numbers, m and rad: 0.02,0.0034.") from None
    return SensorNoise(sigma_range=sigma_range, sigma_bearing=sigma_bearing)


@contextmanager
def _resumable(results: Path | None) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        again = (
            "the same command goes on from there" if results else "with --results FILE it could be resumed"
        )
        typer.echo(f"Interrupted: {again}.", err=True)
        raise SystemExit(130) from None
