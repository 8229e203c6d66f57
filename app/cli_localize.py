"""The command `lidarcore localize`."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli_options import RecordingPath, Set, SettingsFile, Topic, counting, settings_from


def localize(
    recording: RecordingPath,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="FILE.csv for the poses")] = None,
    known: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="FILE", help="to localize in: .json, .csv, .geojson; without, SLAM builds one"
        ),
    ] = None,
    save_map: Annotated[
        Path | None,
        typer.Option(
            "--save-map", metavar="FILE", help="for the map that SLAM built, in one of these formats"
        ),
    ] = None,
    scans: Annotated[
        bool,
        typer.Option("--scans", help="match whole scans instead of landmarks: where corners are few; no map"),
    ] = False,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Where the sensor was in a recording: poses with covariances, and the map of landmarks."""
    if known is not None and save_map is not None:
        raise typer.BadParameter("give --map or --save-map: a known map stays as it is.")
    if scans and (known or save_map):
        raise typer.BadParameter("--scans knows no landmarks: leave --map and --save-map out.")
    from app.localizing import format_of, match_scans, read_map, write_map, write_poses
    from app.localizing import localize as run
    from lidarcore import open_recording

    chosen = settings_from(settings, set_)
    landmarks = None if known is None else read_map(known)
    if save_map is not None:
        format_of(save_map)
    with counting("scans") as count:
        opened = open_recording(recording, topic)
        outcome = match_scans(opened, chosen, count) if scans else run(opened, landmarks, chosen, count)
    if output is not None:
        write_poses(output, outcome)
    if save_map is not None:
        write_map(save_map, outcome.landmarks, chosen.landmark_method)
    found = "" if scans else f"; {int(outcome.landmarks.confirmed.sum())} landmarks"
    typer.echo(f"{outcome.scans} scans, {outcome.tracked} of them tracked{found}.")
