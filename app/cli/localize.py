"""The command `lidarcore localize`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import (
    RecordingPath,
    Set,
    SettingsFile,
    Topic,
    check_folder,
    check_output,
    named,
    numbers,
    plural,
    settings_from,
    tell_notes,
    to_file,
)
from .progress import counting

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .localization_run import Outcome

_MAP = " Landmarks alone do not tell the way here: `lidarcore map` finds it from whole scans."
_HINT = " If you know where the first scan was taken, give it by --pose."


def localize(
    recording: RecordingPath,
    output: Annotated[Path | None, to_file("FILE.csv for the poses")] = None,
    known: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="FILE",
            parser=named("map", "its path, or . for the one in the working folder"),
            help="to localize in: landmarks (.json, .csv, .geojson) or a grid (.yaml, as ROS and `lidarcore map` write "
            "it), or the folder of the latter; without, SLAM builds one",
        ),
    ] = None,
    save_map: Annotated[
        Path | None,
        typer.Option(
            "--save-map", metavar="FILE", help="for the map that SLAM built, in one of these formats"
        ),
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,HEADING",
            help="where the first scan was taken in the map of --map, in m, m, rad; without, it is looked for",
        ),
    ] = None,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Track the sensor through a recording, in a known map or in one of landmarks that is built on the way."""
    _check(output, known, save_map, pose)
    from lidarcore import files, open_recording

    from ..pipeline.tables import csv_text
    from .localization_run import place, track, tracker_in, write_map

    told = None if pose is None else numbers("--pose", pose, "a pose in m, m, rad", "1.2,-0.5,1.57")
    chosen = settings_from(settings, set_)
    tracker = tracker_in(known, chosen)
    if told is not None:
        place(tracker, told)
    opened = open_recording(recording, topic, chosen.sensor.mask)
    with counting("scans") as count:
        outcome = track(opened, tracker, chosen, count)
    tell_notes(opened)
    if output is not None:
        files.write(output, csv_text(outcome.columns))
    if save_map is not None and outcome.landmarks is not None:
        write_map(save_map, outcome.landmarks, chosen.landmark_method)
    for sentence in _told(outcome, by_slam=known is None, from_pose=told is not None):
        typer.echo(sentence)


def _check(output: Path | None, known: Path | None, save_map: Path | None, pose: str | None) -> None:
    """Raises BadParameter, LidarError or OSError if options do not go together, or a file could not be written."""
    from .localization_run import format_of

    if known is not None and save_map is not None:
        raise typer.BadParameter("give --map or --save-map: a known map stays as it is.")
    if pose is not None and known is None:
        raise typer.BadParameter("give --pose with --map: SLAM begins where the first scan was taken.")
    check_output(output, ".csv")
    if save_map is not None:
        format_of(save_map)
        check_folder(save_map, "--save-map")


def _told(outcome: "Outcome", *, by_slam: bool, from_pose: bool) -> "Iterator[str]":
    """What came of it, and what would help where that is little."""
    if not outcome.tracked and outcome.message is not None:
        hint = "" if by_slam or from_pose else _HINT
        yield f"No pose was found. {outcome.message}{hint}"
    found = outcome.landmarks
    landmarks = "" if found is None else "; " + plural(int(found.confirmed.sum()), "landmark")
    other = _MAP if by_slam and outcome.tracked < outcome.scans / 2 else ""
    yield f"{plural(outcome.scans, 'scan')}, {outcome.tracked} of them tracked{landmarks}.{other}"
