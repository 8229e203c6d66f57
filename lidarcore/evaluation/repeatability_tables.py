"""Repeatability as a file: JSON, with every corner, or CSV, a line for each method and kind of covariance."""

import csv
import io
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lidarcore import files
from lidarcore.evaluation.consistency_tables import check
from lidarcore.evaluation.repeatability_summary import Summary


def write(summary: Summary, path: Path) -> None:
    """Raises EvaluationError unless the file's name ends in .json or .csv."""
    check(path)
    files.write(path, to_json(summary) if path.suffix.lower() == ".json" else to_csv(summary))


def to_json(summary: Summary) -> str:
    """All of it, null for what cannot be told yet."""
    return json.dumps(_finite(asdict(summary)), indent=1, allow_nan=False) + "\n"


def to_csv(summary: Summary) -> str:
    """Areas in m²; ends of the 95 % intervals as figure_low and figure_high; empty for what cannot be told yet."""
    text = io.StringIO()
    lines = list(_lines(summary))
    writer = csv.DictWriter(text, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(_finite(lines))
    return text.getvalue()


def _lines(summary: Summary) -> Iterator[dict[str, Any]]:
    for method in summary.methods:
        for kind, claim in method.claims.items():
            box = claim.areas
            line: dict[str, Any] = {
                "fitter": method.name,
                "covariance": kind,
                "scans": summary.scans,
                "corners": len(method.corners),
                "actual_area": method.actual_area,
                "verdict": claim.verdict,
            }
            for name in ("low", "first_quartile", "median", "third_quartile", "high"):
                line["claimed_area_" + name] = None if box is None else getattr(box, name)
            for figure, interval in asdict(claim.judgement).items():
                line |= {figure: interval["value"]}
                line |= {f"{figure}_{end}": interval[end] for end in ("low", "high")}
            yield line


def _finite(document: Any) -> Any:
    """The same with None for every number that is not finite."""
    return json.loads(json.dumps(document), parse_constant=lambda _: None)
