"""The command `lidarcore localize`."""

from pathlib import Path
from typing import Annotated

import typer

from .options import RecordingPath, Set, SettingsFile, Topic, counting, settings_from


def localize(
    recording: RecordingPath,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="FILE.csv for the poses")] = None,
    known: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="FILE",
            help="to localize in: landmarks (.json, .csv, .geojson) or a grid (.yaml, as ROS and `lidarcore map` write "
            "it); without, SLAM builds one",
        ),
    ] = None,
    save_map: Annotated[
        Path | None,
        typer.Option(
            "--save-map", metavar="FILE", help="for the map that SLAM built, in one of these formats"
        ),
    ] = None,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Track the sensor through a recording, in a known map or in one of landmarks that is built on the way."""
    if known is not None and save_map is not None:
        raise typer.BadParameter("give --map or --save-map: a known map stays as it is.")
    from lidarcore import open_recording

    from .localization_run import format_of, track, tracker_in, write_map, write_poses

    chosen = settings_from(settings, set_)
    tracker = tracker_in(known, chosen)
    if save_map is not None:
        format_of(save_map)
    with counting("scans") as count:
        outcome = track(open_recording(recording, topic, chosen.sensor.mask), tracker, chosen, count)
    if output is not None:
        write_poses(output, outcome)
    if save_map is not None and outcome.landmarks is not None:
        write_map(save_map, outcome.landmarks, chosen.landmark_method)
    found = "" if outcome.landmarks is None else f"; {int(outcome.landmarks.confirmed.sum())} landmarks"
    typer.echo(f"{outcome.scans} scans, {outcome.tracked} of them tracked{found}.")
