"""The command `lidarcore calibrate`."""

import math
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli_options import RecordingPath, SettingsFile, Topic, check_folder, settings_from

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from app.calibration_wire import BandsJson, CalibrationJson, IntervalJson
    from lidarcore import SensorNoise
    from lidarcore.evaluation.calibration import Calibration

DEGREES = math.degrees(1)


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
    settings: SettingsFile = None,
    json: Annotated[
        bool, typer.Option("--json", help="all of it as JSON instead of a table, m and rad")
    ] = False,
) -> None:
    """The noise of a sensor from a recording made while it stood still in a room.

    Where one of its two numbers cannot be told, the file keeps that of --settings, or the default.
    """
    from pydantic_core import to_json
    from rich.console import Console

    from app.calibration_wire import calibration_json
    from lidarcore import open_recording
    from lidarcore.evaluation import consistency_tables
    from lidarcore.evaluation.calibration import calibrate as run

    if output is not None:
        consistency_tables.check(output, (".json",))
        check_folder(output)
    usual = settings_from(settings, None).extraction.noise
    result = run(islice(open_recording(recording, topic), skip, None if scans is None else skip + scans))
    found = calibration_json(result)
    if json:
        typer.echo(to_json(found, indent=1))
    else:
        _show(Console(), found)
    if output is not None:
        _write(output, result, usual)


def _write(output: Path, result: "Calibration", usual: "SensorNoise") -> None:
    from app.profiles import Profile
    from lidarcore import files
    from lidarcore.errors import EvaluationError

    kept = [
        f"{name} {1e3 * getattr(usual, name):g} {unit}"
        for name, unit, told in zip(
            ("sigma_range", "sigma_bearing"), ("mm", "mrad"), result.told, strict=True
        )
        if told is None
    ]
    if len(kept) == len(result.told):
        raise EvaluationError(f"Neither noise can be told here, so {output} is not written.")
    files.write(output, Profile.of(result.noise_or(usual)).text)
    if kept:
        typer.echo(f"{output} keeps {kept[0]} of the settings: it cannot be told here.", err=True)


def _show(console: "Console", found: "CalibrationJson") -> None:
    console.print(_table(found))
    console.print(
        f"{found['beams']:,} beams on {found['walls']} walls; outliers {_text(found['outliers'], 100)} %; the wall "
        f"that drifted most did so by {1e3 * found['drift']:.1f} mm. Intervals are of 95 % confidence."
    )
    for remark in found["remarks"]:
        console.print(remark)


def _table(found: "CalibrationJson") -> "Table":
    from rich.table import Table

    table = Table("", "", "95 %")
    table.add_row("sigma_bearing, mrad", *_told(found["sigma_bearing"]))
    table.add_row("sigma_range, mm", *_told(found["sigma_range"]))
    _add_bands(table, "range", found["by_range"], 1.0, "m")
    _add_bands(table, "incidence", found["by_incidence"], DEGREES, "°")
    table.add_section()
    table.add_row("range bias, mm", *_cells(found["range_bias"]))
    table.add_row("alignment, °", *_cells(found["alignment"], DEGREES))
    return table


def _add_bands(table: "Table", title: str, bands: "BandsJson", factor: float, unit: str) -> None:
    table.add_section()
    verdict = "differs" if bands["differs"] else "the same"
    table.add_row(f"sigma_range by {title}, mm", verdict, f"p = {bands['p_value']:.2g}")
    for low, high, sigma in zip(bands["edges"][:-1], bands["edges"][1:], bands["sigmas"], strict=True):
        table.add_row(f"  {factor * low:.2f} to {factor * high:.2f} {unit}", *_told(sigma))


def _told(sigma: "IntervalJson") -> tuple[str, str]:
    return _cells(sigma) if sigma["low"] > 0 else ("cannot be told", f"at most {1e3 * sigma['high']:.2f}")


def _cells(figure: "IntervalJson | None", factor: float = 1e3) -> tuple[str, str]:
    if figure is None:
        return "cannot be told", ""
    return f"{factor * figure['value']:.2f}", f"{factor * figure['low']:.2f} to {factor * figure['high']:.2f}"


def _text(figure: "IntervalJson", factor: float) -> str:
    return f"{factor * figure['value']:.2f} ({factor * figure['low']:.2f} to {factor * figure['high']:.2f})"
