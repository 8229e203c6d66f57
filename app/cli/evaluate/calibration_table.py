"""A study of calibrations on the terminal."""

from collections.abc import Iterator

from rich.table import Table

from lidarcore.evaluation.calibration.design import PARTS, WITHOUT
from lidarcore.evaluation.calibration.result import PRECISE
from lidarcore.evaluation.calibration.study import CalibrationStudy, Cell, Part
from lidarcore.evaluation.consistency.figures import HONEST
from lidarcore.evaluation.intervals import Interval

from ..tables import table


def parts_table(study: CalibrationStudy) -> Table:
    """Every part of the noise over all rooms, and the unevenness by its size and length."""
    low, high = HONEST
    design = study.design
    result = table(
        f"{design.rooms} simulated rooms: 95 % intervals from {design.scans} scans "
        f"(asked: {low:g} to {high:g} of them hold the truth), errors from {design.fewer}",
        ("part",),
        ("rooms", "hold the truth", "mean error", f"from {design.fewer}: median", "90 % within"),
    )
    for part in study.parts():
        result.add_row(part.name, *_cells(part))
    for cell in study.cells:
        result.add_section()
        for part in study.parts(cell):
            if part.name.startswith("unevenness"):
                result.add_row(f"{part.name}: {_named(cell)}", *_cells(part))
    return result


def cells_table(study: CalibrationStudy) -> Table:
    """The ellipses after the calibration, by unevenness."""
    low, high = HONEST
    scatter_of = ("walls: scatter, standing", "claimed / scatter", "corners", "claimed / scatter")
    result = table(
        f"95 % ellipses after the calibration (asked: {low:g} to {high:g})",
        ("walls uneven by",),
        ("walls: truth, other places", "corners", *scatter_of),
    )
    for cell in study.cells:
        row = [cell.held(of).text(3) for of in (0, 1)]
        for corners in (False, True):
            scatter = cell.scatter(corners)
            row += (
                ["", ""] if scatter is None else [scatter.coverage(0).text(3), scatter.area_ratio(0).text(2)]
            )
        result.add_row(_named(cell), *row)
    return result


def remarks(study: CalibrationStudy) -> Iterator[str]:
    """What the tables mean, what they leave out and why, and whether the fewer scans suffice."""
    yield (
        "± is half of a 95 % confidence interval over rooms. Truth: ellipses for maps against the straight lines that "
        "walls are about, from other places in the room; scatter: ellipses of one place against what repeats there."
    )
    for name, reason in WITHOUT.items():
        yield f"Not judged: {name} ({reason})."
    for failure in sorted(set(study.failures)):
        yield f"Not calibrated: {study.failures.count(failure)} of {study.design.rooms} rooms. {failure}"
    sizes = [part.error for part in study.parts() if part.name == "unevenness" and part.error is not None]
    for median, most in sizes:
        yield (
            f"From {study.design.fewer} scans the unevenness is known to {100 * median:.0f} % in half of the rooms "
            f"and to {100 * most:.0f} % in nine of ten (asked: {100 * PRECISE:.0f} %)."
        )


def _named(cell: Cell) -> str:
    size, length = 1e3 * cell.noise.unevenness, 1e2 * cell.noise.unevenness_length
    return f"{size:g} mm over {length:g} cm" if size else "straight"


def _cells(part: Part) -> list[str]:
    factor, unit = PARTS[part.name] if part.error is None else (100.0, "%")
    error = ["", ""] if part.error is None else [f"{100 * one:.1f} %" for one in part.error]
    return [str(part.told), part.held.text(3), _off(part.bias, factor, unit), *error]


def _off(bias: Interval, factor: float, unit: str) -> str:
    return "" if bias.value != bias.value else f"{bias.text(2, factor)} {unit}"
