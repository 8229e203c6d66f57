"""The command `lidarcore calibrate`."""

import math
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import MOST, RecordingPath, Set, SettingsFile, Topic, check_folder, settings_from, to_file

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from lidarcore import SensorNoise
    from lidarcore.evaluation.calibration.result import Calibration
    from lidarcore.evaluation.intervals import Interval

    from ..jobs.calibration_report import BandsReport, CalibrationReport

WRITTEN = (
    ("sigma_range", 1e3, ", mm"),
    ("sigma_bearing", 1e3, ", mrad"),
    ("range_growth", 1e3, ", mm/m²"),
    ("unevenness", 1e3, ", mm"),
    ("unevenness_length", 1e3, ", mm"),
    ("tails", 1.0, ""),
    ("renewal", 1.0, ""),
    ("resampling", 1.0, ""),
)
"""What a calibration writes into the settings, with factor and unit."""
DEGREES = math.degrees(1)


def calibrate(
    recording: RecordingPath,
    output: Annotated[
        Path | None, to_file("FILE.json for the noise; other commands read it with --settings")
    ] = None,
    skip: Annotated[int, typer.Option(min=0, max=MOST, help="scans to skip at the beginning")] = 0,
    scans: Annotated[
        int | None, typer.Option(min=1, max=MOST, help="scans to take, 100 suffice; all if not given")
    ] = None,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
    json: Annotated[bool, typer.Option("--json", help="print JSON (m and rad) instead of a table")] = False,
) -> None:
    """Measure the noise of a sensor from a recording in which it stands still in a room.

    Where the noise of ranges or of bearings cannot be told, the file keeps that of --settings, or the default.
    """
    from pydantic import TypeAdapter
    from rich.console import Console

    from lidarcore import open_recording
    from lidarcore.errors import EvaluationError
    from lidarcore.evaluation.calibration.calibrate import calibrate as run
    from lidarcore.evaluation.consistency import tables as consistency_tables

    from ..jobs.calibration_report import CalibrationReport, report

    if output is not None:
        consistency_tables.check(output, (".json",))
        check_folder(output)
    chosen = settings_from(settings, set_)
    opened = open_recording(recording, topic, chosen.sensor.mask)
    taken = list(islice(opened, skip, None if scans is None else skip + scans))
    if moved := [number for number in opened.stations if number > skip]:
        raise EvaluationError(
            f"From scan {moved[0]} on the sensor stood elsewhere: choose scans from one place with --skip and --scans; "
            "`lidarcore evaluate stations` calibrates at each."
        )
    result = run(taken)
    found = report(result)
    if json:
        typer.echo(TypeAdapter(CalibrationReport).dump_json(found, indent=1))
    else:
        _show(Console(), found)
    if output is not None:
        _write(output, result, chosen.extraction.noise)


def _write(output: Path, result: "Calibration", usual: "SensorNoise") -> None:
    from lidarcore import files
    from lidarcore.errors import EvaluationError

    from ..jobs.profiles import Profile

    noise = result.noise_or(usual)
    kept = [name for name in ("sigma_range", "sigma_bearing") if result.told[name] is None]
    if len(kept) == 2:
        raise EvaluationError(f"Neither noise can be determined here, so {output} is not written.")
    files.write(output, Profile.of(noise).text)
    for name in kept:
        value = f"{name} {1e3 * getattr(noise, name):g} {'mm' if name == 'sigma_range' else 'mrad'}"
        typer.echo(f"{output} keeps {value} of the settings: it cannot be determined here.", err=True)


def _show(console: "Console", found: "CalibrationReport") -> None:
    console.print(_table(found))
    console.print(
        f"{found.beams:,} beams on {found.walls} walls; outliers {_text(found.outliers, 100)} %; the wall "
        f"that drifted most did so by {1e3 * found.drift:.1f} mm. Intervals are of 95 % confidence."
    )
    for remark in found.remarks:
        console.print(remark)


def _table(found: "CalibrationReport") -> "Table":
    from rich.table import Table

    table = Table("", "", "95 %")
    table.add_row("sigma_bearing, mrad", *_known(found.sigma_bearing))
    table.add_row("sigma_range, mm", *_known(found.sigma_range))
    _add_bands(table, "range", found.by_range, 1.0, "m")
    _add_bands(table, "incidence", found.by_incidence, DEGREES, "°")
    table.add_section()
    table.add_row("range_growth, mm/m²", *_cells(found.range_growth))
    table.add_row("unevenness, mm", *_cells(found.unevenness))
    table.add_row("unevenness_length, mm", *_cells(found.unevenness_length))
    table.add_section()
    table.add_row("in the settings:", "")
    for name, factor, unit in WRITTEN:
        value = getattr(found.noise, name)
        table.add_row(f"  {name}{unit}", "as set" if value is None else f"{factor * value:.2f}")
    table.add_section()
    table.add_row("range bias, mm", *_cells(found.range_bias))
    table.add_row("alignment, °", *_cells(found.alignment, DEGREES))
    return table


def _add_bands(table: "Table", title: str, bands: "BandsReport", factor: float, unit: str) -> None:
    table.add_section()
    verdict = "differs" if bands.differs else "the same"
    table.add_row(f"sigma_range by {title}, mm", verdict, f"p = {bands.p_value:.2g}")
    for low, high, sigma in zip(bands.edges[:-1], bands.edges[1:], bands.sigmas, strict=True):
        table.add_row(f"  {factor * low:.2f} to {factor * high:.2f} {unit}", *_known(sigma))


def _known(sigma: "Interval") -> tuple[str, str]:
    return _cells(sigma) if sigma.low > 0 else ("unknown", f"at most {1e3 * sigma.high:.2f}")


def _cells(figure: "Interval | None", factor: float = 1e3) -> tuple[str, str]:
    if figure is None:
        return "unknown", ""
    return f"{factor * figure.value:.2f}", f"{factor * figure.low:.2f} to {factor * figure.high:.2f}"


def _text(figure: "Interval", factor: float) -> str:
    return f"{factor * figure.value:.2f} ({factor * figure.low:.2f} to {factor * figure.high:.2f})"
