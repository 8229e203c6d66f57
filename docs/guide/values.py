"""What the guide's words can name: figures that came out, and what was set up."""

from collections.abc import Mapping
from dataclasses import fields

from lidarcore.evaluation.consistency.figures import HONEST
from lidarcore.evaluation.intervals import LEVEL, Interval

from . import real_wall
from .filters import SETTINGS
from .measurement import MIXED_NOISE, Figures, Measurement
from .numbers import Told
from .views import SITUATIONS


def values(m: Measurement) -> Mapping[str, object]:
    """By name; figures of methods by a second name such as 'cwlf published coverage_95'."""
    alone = {name: Told(value) for name, value in (_set_up(m) | _measured(m)).items()}
    tables: dict[str, Mapping[str, Interval | float]] = {
        **_of_studies(m),
        "fed": _of_filter(m),
        "real": real_wall.values(),
    }
    return {
        **alone,
        **{name: {key: Told(value) for key, value in table.items()} for name, table in tables.items()},
    }


def _of_studies(m: Measurement) -> dict[str, Figures]:
    """Of each situation, and of the largest noise of the table: 'worst' with segments known, else 'found'."""
    worst = m.design.table.noises[-1]
    tables: dict[str, Figures] = {name: {} for name in (*SITUATIONS, "worst", "found")}
    for (case, fitter, kind), figures in m.by_method.items():
        tables[case] |= {f"{fitter} {kind} {name}": figure for name, figure in figures.items()}
    for (noise, segments, fitter, kind), figures in m.by_noise.items():
        if noise == worst:
            case = "worst" if segments == "known" else "found"
            tables[case] |= {f"{fitter} {kind} {name}": figure for name, figure in figures.items()}
    return tables


def _of_filter(m: Measurement) -> Figures:
    return {
        f"{fitter} {kind} {figure.name}": getattr(fed, figure.name)
        for (fitter, kind), fed in m.filtered.items()
        for figure in fields(fed)
    }


def _set_up(m: Measurement) -> dict[str, Interval | float]:
    """What no chance is in; standard units."""
    kind, distance, design = SITUATIONS["kind"], m.views["kind"].distance, m.design
    return {
        "level": LEVEL,
        "honest": HONEST[0],
        "gate": SETTINGS.gate,
        "scans": float(design.scans),
        "sightings": float(design.sightings),
        "drives": float(design.drives),
        "trials": float(design.trials),
        "table_trials": float(design.table_trials),
        "seed": float(design.seed),
        "worst_range": design.table.noises[-1].sigma_range,
        "table_bearing": design.table.noises[-1].sigma_bearing,
        "mixed_range": MIXED_NOISE.sigma_range,
        "kind_distance": distance,
        "kind_sideways": distance * kind.noise.sigma_bearing,
        "kind_range": kind.noise.sigma_range,
        "wall_distance": m.wall.distance,
        "wall_incidence": m.wall.incidence,
        "shadow": m.wall.shadow,
        "slice": m.wall.slice,
    }


def _measured(m: Measurement) -> dict[str, Interval | float]:
    return {"spread": m.wall.spread, "mixed_none": m.mixed[0], "mixed_all": m.mixed[1]}
