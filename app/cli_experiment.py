"""The command `lidarcore experiment`: experiments of papers, run again, and a report of each."""

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

QUICK_RUNS = 2

experiment = typer.Typer(
    help="Run an experiment of a paper again, and write a report of it.", no_args_is_help=True
)


@experiment.callback()
def _experiments() -> None:
    """Keeps the name of the experiment a part of the command while there is only one."""


@experiment.command("clustering-ekf")
def clustering_ekf(
    output: Annotated[
        Path, typer.Option("-o", "--output", help="FILE.html for the report; replaced if it exists")
    ] = Path("clustering-ekf.html"),
    seed: Annotated[int, typer.Option(min=0, help="of everything that is random")] = 0,
    runs: Annotated[
        int | None, typer.Option(min=1, help="drives along each trajectory; 20 if not given, 2 with --quick")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="one scan a second only, to try it out")] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="processes; one for each core if not given")
    ] = None,
) -> None:
    """Four ways to cluster lidar points, with and without a Kalman filter, on three trajectories."""
    if output.is_dir() or not output.absolute().parent.is_dir():  # told before minutes of work are lost
        raise FileNotFoundError(
            errno.ENOENT, "is no file in a folder that exists, give one for --output", str(output)
        )
    from lidarcore.experiments import clustering_ekf as paper
    from lidarcore.experiments.clustering_ekf_report import html

    design = paper.Design(seed=seed, runs=runs or (QUICK_RUNS if quick else paper.Design().runs))
    if quick:
        design = design.quick()
    with _progress(design.runs * len(paper.TRAJECTORIES)) as done:
        result = paper.run(design, workers or os.cpu_count() or 1, done)
    output.write_text(html(result), "utf-8")
    typer.echo(f"{output}: {len(result.outcomes)} drives, runs x trajectories x methods")


@contextmanager
def _progress(total: int) -> Iterator[Callable[[], None]]:
    """A bar on the terminal, if there is one; call what it gives after each of the parts."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=total)
        yield lambda: bar.advance(task)
