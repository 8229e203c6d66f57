"""A study of stations as JSON."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from lidarcore import files
from lidarcore.evaluation.stations.study import Figures, StationStudy
from lidarcore.files.texts import json_text


def write(study: StationStudy, path: Path) -> None:
    """Every method's figures, pooled and by station, and the noise of each station; null for what is not known."""
    document = {
        "stations": [asdict(station) for station in study.stations],
        "methods": [
            {
                "name": name,
                "walls": _figures(study.walls, m, study),
                "corners": _figures(study.corners, m, study),
            }
            for m, name in enumerate(study.methods)
        ],
    }
    files.write(path, json_text(document))


def _figures(figures: Figures, m: int, study: StationStudy) -> dict[str, Any]:
    by_station = {
        study.stations[number].name: {"coverage_95": held, "sightings": seen}
        for number, (held, seen) in figures.by_station(m).items()
    }
    return {
        "coverage_95": asdict(figures.coverage(m)),
        "area_ratio": asdict(figures.area_ratio(m)),
        "scatter_against": {
            other: asdict(figures.scatter_against(m, o)) for o, other in enumerate(study.methods) if o != m
        },
        "sightings": figures.sightings(m),
        "by_station": by_station,
    }
