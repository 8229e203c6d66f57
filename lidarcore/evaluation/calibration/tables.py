"""A study of calibrations as JSON."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from lidarcore import files
from lidarcore.evaluation.calibration.study import CalibrationStudy, Cell
from lidarcore.files.texts import json_text


def write(study: CalibrationStudy, path: Path) -> None:
    """Design, every part of all rooms and by unevenness, and the ellipses; null for what is not known."""
    document = {
        "design": asdict(study.design),
        "failures": study.failures,
        "parts": [asdict(part) for part in study.parts()],
        "cells": [
            {
                "unevenness": cell.noise.unevenness,
                "unevenness_length": cell.noise.unevenness_length,
                "parts": [asdict(part) for part in study.parts(cell)],
                "walls": _ellipses(cell, 0),
                "corners": _ellipses(cell, 1),
            }
            for cell in study.cells
        ],
    }
    files.write(path, json_text(document))


def _ellipses(cell: Cell, of: int) -> dict[str, Any]:
    scatter = cell.scatter(bool(of))
    return {
        "truth_95": asdict(cell.held(of)),
        "scatter_95": None if scatter is None else asdict(scatter.coverage(0)),
        "claimed_over_scatter": None if scatter is None else asdict(scatter.area_ratio(0)),
    }
