"""The command `lidarcore evaluate calibration`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import MOST, Seed, Workers, check_output, numbers, to_file
from ..progress import ForPrograms, counted

if TYPE_CHECKING:
    from lidarcore import SensorNoise

WIDTH = 150  # of the tables in a file or a pipe


def calibration(
    rooms: Annotated[
        int,
        typer.Option(
            min=1, max=MOST, help="simulated rooms, shared out among sizes and lengths of unevenness"
        ),
    ] = 200,
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="RANGE,BEARING,GROWTH",
            help="noise of the sensor in m, rad and 1/m; 0.002,0.001,0.0003 if not given",
        ),
    ] = None,
    scans: Annotated[int, typer.Option(min=10, max=MOST, help="scans of a calibration")] = 60,
    fewer: Annotated[
        int,
        typer.Option(
            min=10,
            max=MOST,
            help="scans of a second calibration, at most --scans; its errors are printed, too",
        ),
    ] = 40,
    seed: Seed = 0,
    workers: Workers = None,
    output: Annotated[Path | None, to_file("FILE.json with every figure")] = None,
    for_programs: ForPrograms = False,
) -> None:
    """Calibrate in simulated rooms with uneven walls: do intervals hold the truth, and ellipses afterwards?

    Takes about five seconds a room.
    """
    from lidarcore.evaluation.calibration import tables as calibration_tables
    from lidarcore.evaluation.calibration.design import Design
    from lidarcore.evaluation.calibration.study import study

    from ..tables import console
    from .calibration_table import cells_table, parts_table, remarks

    check_output(output, ".json")
    usual = Design()
    design = Design(
        rooms=rooms,
        noise=usual.noise if noise is None else _noise(noise),
        scans=scans,
        fewer=min(fewer, scans),
        seed=seed,
    )
    with counted(design.rooms, for_programs) as done:
        found = study(design, workers or os.cpu_count() or 1, done)
    terminal = console(WIDTH)
    for shown in (parts_table(found), cells_table(found), *remarks(found)):
        terminal.print(shown)
    if output is not None:
        calibration_tables.write(found, output)


def _noise(text: str) -> "SensorNoise":
    from lidarcore import SensorNoise

    meaning, example = "three numbers, m, rad and 1/m", "0.002,0.001,0.0003"
    sigma_range, sigma_bearing, growth = numbers("--noise", text, meaning, example)
    return SensorNoise(sigma_range, sigma_bearing, range_growth=growth)
