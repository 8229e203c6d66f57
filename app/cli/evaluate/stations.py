"""The command `lidarcore evaluate stations`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import MOST, Given, Set, SettingsFile, TopicOfAll, check_output, settings_from, to_file
from ..progress import counting

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from lidarcore import Scan
    from lidarcore.body_mask import Sector

WIDTH = 150  # of the tables in a file or a pipe


def stations(
    recordings: Annotated[list[Path], typer.Argument(help="recordings of sensors that stood still")],
    methods: Annotated[str, typer.Option(metavar="NAME,...", help="fitters to judge")] = "ml,utls",
    window: Annotated[int, typer.Option(min=10, max=MOST, help="scans that are judged together")] = 100,
    given: Given = False,
    by_station: Annotated[
        bool, typer.Option("--by-station", help="also print a table for each station")
    ] = False,
    topic: TopicOfAll = None,
    output: Annotated[Path | None, to_file("FILE.json with the figures of every station")] = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Calibrate on the first half of every station where a sensor stood still, and judge the ellipses on the second.

    A recording has several stations if its file says so, or if the sensor was seen to move between them.
    """
    from lidarcore.evaluation.stations import tables as station_tables
    from lidarcore.evaluation.stations.study import study

    from ..tables import console
    from .stations_table import limits_table, methods_table, station_table

    check_output(output, ".json")
    names = [name.strip() for name in methods.split(",")]
    chosen = settings_from(settings, set_)
    with counting("stations") as tell:
        found = study(
            named_stations(recordings, topic, chosen.sensor.mask),
            names,
            chosen.extraction,
            window=window,
            calibrated=not given,
            tell=tell,
        )
    terminal = console(WIDTH)
    terminal.print(methods_table(found))
    terminal.print(limits_table(found))
    if by_station:
        terminal.print(station_table(found))
    for station in found.stations:
        if station.remark is not None:
            terminal.print(f"{station.name}: {station.remark}")
    if output is not None:
        station_tables.write(found, output)


def named_stations(
    recordings: list[Path], topic: str | None, mask: "Sequence[Sector] | None"
) -> "Iterator[tuple[str, list[Scan]]]":
    """Each station that is long enough, with a name: that of its file, and a number if there are several."""
    from lidarcore import open_recording
    from lidarcore.evaluation.stations.recording import stations as split
    from lidarcore.evaluation.stations.study import SHORTEST

    for path in recordings:
        opened = open_recording(path, topic, mask)
        found = [scans for scans in split(opened) if len(scans) >= SHORTEST]
        name = path.name.split(".", 1)[0]
        for number, scans in enumerate(found, 1):
            yield (f"{name} {number}" if len(found) > 1 else name), scans
