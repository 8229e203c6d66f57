"""Repeatability as a file: JSON with every corner and wall, or CSV with a line for each method and covariance."""

from collections.abc import Iterator, Sized
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lidarcore import files
from lidarcore.evaluation.consistency.tables import check
from lidarcore.evaluation.repeatability.summary import Method, Summary
from lidarcore.files.texts import csv_text, finite, json_text

__all__ = ["finite", "json_text", "to_csv", "to_json", "write"]


def write(summary: Summary, path: Path) -> None:
    """Raises EvaluationError unless the file's name ends in .json or .csv."""
    check(path)
    files.write(path, to_json(summary) if path.suffix.lower() == ".json" else to_csv(summary))


def to_json(summary: Summary) -> str:
    """A summary as JSON, null for what cannot be told yet."""
    return json_text(asdict(summary))


def to_csv(summary: Summary) -> str:
    """Corners, areas in m²; then walls, areas of (alpha, r) in rad m; empty for what cannot be told yet.

    Ends of the 95 % intervals are figure_low and figure_high.
    """
    return csv_text(finite(list(_lines(summary))))


def _lines(summary: Summary) -> Iterator[dict[str, Any]]:
    judged: list[tuple[str, Method, Sized]] = [("corners", m, m.corners) for m in summary.methods]
    judged += [("walls", method, method.walls) for method in summary.walls.methods]
    for what, method, features in judged:
        for kind, claim in method.claims.items():
            box = claim.areas
            line: dict[str, Any] = {
                "of": what,
                "fitter": method.name,
                "covariance": kind,
                "scans": summary.scans,
                "judged": len(features),
                "actual_area": method.actual_area,
                "verdict": claim.verdict,
            }
            for name in ("low", "first_quartile", "median", "third_quartile", "high"):
                line["claimed_area_" + name] = None if box is None else getattr(box, name)
            for figure, interval in asdict(claim.judgement).items():
                line |= {figure: interval["value"]}
                line |= {f"{figure}_{end}": interval[end] for end in ("low", "high")}
            yield line
