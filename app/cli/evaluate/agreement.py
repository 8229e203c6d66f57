"""The command `lidarcore evaluate agreement`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import Given, Set, SettingsFile, TopicOfAll, check_output, settings_from, to_file
from ..progress import counting
from .stations import named_stations

if TYPE_CHECKING:
    from lidarcore.evaluation.stations.agreement_study import Agreement, AgreementStudy


def agreement(
    recordings: Annotated[
        list[Path], typer.Argument(help="recordings of a sensor that stood still at several places")
    ],
    given: Given = False,
    by_pair: Annotated[
        bool, typer.Option("--by-pair", help="also print a line for each pair of stations")
    ] = False,
    topic: TopicOfAll = None,
    output: Annotated[Path | None, to_file("FILE.json with the figures of every pair")] = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """The same walls and corners from neighbouring stations: do they differ by as much as is claimed?

    What a sensor does wrong in every scan from one place shows only here. It is told by one half of the pairs of
    stations, and judged on the other.
    """
    from dataclasses import asdict

    from lidarcore import files
    from lidarcore.evaluation.repeatability.tables import json_text
    from lidarcore.evaluation.stations.agreement_study import study

    check_output(output, ".json")
    chosen = settings_from(settings, set_)
    with counting("pairs of stations") as tell:
        stations = named_stations(recordings, topic, chosen.sensor.mask)
        found = study(stations, chosen.extraction, calibrated=not given, tell=tell)
    _print(found, by_pair)
    if output is not None:
        files.write(output, json_text(asdict(found)))


def _print(found: "AgreementStudy", by_pair: bool) -> None:
    """A row for each kind of claim, and with `by_pair` a line for each pair of stations."""
    from rich.console import Console

    from ..tables import table

    columns = ("claims", "systematic part, mm", "walls in 95 %", "lowest, highest pair", "corners in 95 %")
    shown = table("Differences between neighbouring stations", columns, ())
    shown.add_row("consistent", *_cells(found.consistent))
    shown.add_row("map", *_cells(found.map))
    shown.add_row("map, with a systematic part", *_cells(found.systematic))
    console = Console()
    console.print(shown)
    console.print(
        f"{found.map.differences:,} differences of walls between {len(found.map.pairs)} pairs of stations."
    )
    if by_pair:
        for name, held in found.systematic.pairs.items():
            console.print(f"{name:40} {found.map.pairs[name]:.3f} {held:.3f}")


def _cells(found: "Agreement") -> tuple[str, str, str, str]:
    parts = ", ".join(f"{1e3 * part:.1f}" for part in found.systematic)
    shares = found.pairs.values()
    walls, corners = found.walls, found.corners
    return (
        parts,
        walls.span(3),
        f"{min(shares):.2f}, {max(shares):.2f}",
        "too few" if corners.value != corners.value else f"{corners.value:.3f}",
    )
