"""The command `lidarcore calibrate`."""

import json
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli_options import RecordingPath, Topic

if TYPE_CHECKING:
    from rich.table import Table

    from lidarcore.evaluation.calibration import Calibration
    from lidarcore.evaluation.intervals import Interval

DIFFERENT = 0.01  # p-value below which bands are said to differ


def calibrate(
    recording: RecordingPath,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="FILE.json for the noise, to be given to others as --settings"),
    ] = None,
    skip: Annotated[int, typer.Option(min=0, help="scans to leave out at the beginning")] = 0,
    scans: Annotated[
        int | None, typer.Option(min=1, help="scans to take, 100 suffice; all if not given")
    ] = None,
    topic: Topic = None,
) -> None:
    """The noise of a sensor from a recording made while it stood still in a room."""
    from rich.console import Console

    from lidarcore import files, open_recording
    from lidarcore.evaluation.calibration import calibrate as run

    taken = islice(open_recording(recording, topic), skip, None if scans is None else skip + scans)
    found = run(taken)
    console = Console()
    console.print(_table(found))
    console.print(
        f"{found.beams:,} beams on {found.walls} walls; outliers {_text(found.outliers, 100)} %; the wall that "
        f"drifted most did so by {1e3 * found.drift:.1f} mm. Intervals are of 95 % confidence."
    )
    if output is not None:
        noise = {"sigma_range": found.noise.sigma_range, "sigma_bearing": found.noise.sigma_bearing}
        files.write(output, json.dumps({"extraction": {"noise": noise}}, indent=1) + "\n")


def _table(found: "Calibration") -> "Table":
    import math

    from rich.table import Table

    table = Table("", "", "95 %")
    table.add_row("sigma_bearing, mrad", *_cells(found.sigma_bearing))
    table.add_row("sigma_range, mm", *_cells(found.sigma_range))
    for title, bands, factor, unit in (
        ("range", found.by_range, 1.0, "m"),
        ("incidence", found.by_incidence, math.degrees(1), "°"),
    ):
        verdict = "differs" if bands.p_value < DIFFERENT else "the same"
        table.add_section()
        table.add_row(f"sigma_range by {title}, mm", verdict, f"p = {bands.p_value:.2g}")
        for low, high, sigma in zip(bands.edges[:-1], bands.edges[1:], bands.sigmas, strict=True):
            table.add_row(f"  {factor * low:.2f} to {factor * high:.2f} {unit}", *_cells(sigma))
    return table


def _cells(figure: "Interval") -> tuple[str, str]:
    return f"{1e3 * figure.value:.2f}", f"{1e3 * figure.low:.2f} to {1e3 * figure.high:.2f}"


def _text(figure: "Interval", factor: float) -> str:
    return f"{factor * figure.value:.2f} ({factor * figure.low:.2f} to {factor * figure.high:.2f})"
