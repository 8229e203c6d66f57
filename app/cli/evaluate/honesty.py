"""The command `lidarcore evaluate honesty`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import Seed, Workers, check_output, plural, to_file
from ..progress import counted

if TYPE_CHECKING:
    from rich.table import Table

    from lidarcore.evaluation.maps.honesty import Honesty

_FIGURES = ("in 95 %", "ANEES", "its band", "steps in band", "median")
_ODOMETRY = {"wheels": "with odometry", "none": "without odometry"}
_WIDTH = 120  # of the tables in a file or a pipe


def honesty(
    world: Annotated[
        list[str] | None, typer.Option(help="a simulated world; may be repeated; all if not given")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, max=10_000, help="drives through each world")] = 100,
    seconds: Annotated[float, typer.Option(min=2, max=3600, help="length of each drive, in s")] = 40.0,
    seed: Seed = 0,
    workers: Workers = None,
    output: Annotated[Path | None, to_file("FILE.json with every figure and its interval")] = None,
) -> None:
    """Whether poses of maps from whole scans are as far off as their covariances say, in simulated worlds.

    Robots start anywhere on their way, mostly while they drive; each drive is mapped with what the wheels say and
    without. Poses are those of all scans against the first; relative poses are of keyframes, 1 and 10 apart.
    """
    from dataclasses import asdict

    from lidarcore import files
    from lidarcore.evaluation.maps.honesty import study_honesty
    from lidarcore.evaluation.repeatability.tables import json_text
    from lidarcore.simulation.worlds import WORLDS

    from ..tables import console

    check_output(output, ".json")
    worlds = list(dict.fromkeys(world or WORLDS))
    with counted(runs * len(worlds)) as done:
        found = study_honesty(worlds, runs, seconds, seed, workers or os.cpu_count() or 1, done)
    terminal = console(_WIDTH)
    for one in found:
        terminal.print(
            f"{one.world}, {_ODOMETRY[one.odometry]}: {plural(one.runs, 'run')}, {one.lost} of them lost; "
            f"{plural(one.loops, 'loop')}, {one.wrong} of them wrong"
        )
        terminal.print(_table(one))
    terminal.print(
        "Honest claims: 95 % of the truths in the 95 % ellipsoids, an ANEES of 1, its mean over the runs within "
        "its band in 95 % of the steps, a median of 2.37 (squared normalised errors, three degrees of freedom)."
    )
    if output is not None:
        told = {"runs": runs, "seconds": seconds, "seed": seed, "worlds": [asdict(one) for one in found]}
        files.write(output, json_text(told))


def _table(found: "Honesty") -> "Table":
    from lidarcore.evaluation.consistency.cells import cell
    from lidarcore.evaluation.consistency.verdicts import verdict

    from ..tables import table
    from .consistency_table import COLOURS

    result = table(None, ("",), _FIGURES)
    for name, judged in found.judged.items():
        result.add_row(
            f"[{COLOURS[verdict(judged.coverage)]}]{name}[/]",
            cell(judged.coverage, 1.0, 3),
            cell(judged.anees, 1.0, 2),
            "{:.2f} to {:.2f}".format(*judged.band),
            *((f"{100 * judged.steps:.0f} %", f"{judged.median:.2f}") if judged.median >= 0 else ("–", "–")),
        )
    return result
