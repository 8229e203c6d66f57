"""The command `lidarcore map`."""

import errno
from pathlib import Path
from typing import Annotated, Literal

import typer

from .options import (
    RecordingPath,
    Set,
    SettingsFile,
    Topic,
    check_new_folder,
    named_folder,
    plural,
    settings_from,
    tell_notes,
)
from .progress import ForPrograms, counting


def map_recording(
    recording: RecordingPath,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FOLDER",
            parser=named_folder,
            help="folder to write the files of the map into",
        ),
    ],
    odometry: Annotated[
        Literal["recorded", "none"],
        typer.Option(help="none leaves out what the recording says of the sensor's motion"),
    ] = "recorded",
    replace: Annotated[
        bool, typer.Option("--replace", help="replace the files of a map that is in the folder")
    ] = False,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
    for_programs: ForPrograms = False,
) -> None:
    """A map of where a recording was taken, from whole scans: grid, walls, floor plans, and poses with covariances.

    The folder gets map.pgm and map.yaml (ROS), walls.csv, walls.geojson and walls_covariance.bin, plan.svg and
    plan.dxf, map.png, poses.csv.
    """
    from lidarcore import open_recording

    from .map_run import build, without_odometry, write_files

    check_new_folder(output)
    _check_free(output, replace)
    chosen = settings_from(settings, set_)
    opened = open_recording(recording, topic, chosen.sensor.mask)
    with counting("scans", for_programs) as count:
        built = build(opened if odometry == "recorded" else without_odometry(opened), chosen, count)
    tell_notes(opened)
    walls = write_files(output, built, chosen)
    typer.echo(
        f"{output}: {plural(len(built.states), 'scan')}, {built.states.count('tracking')} of them tracked; "
        f"{plural(len(built.mapper.keyframes.scans), 'keyframe')}, {plural(len(built.mapper.loops), 'loop')}; "
        f"{plural(len(walls), 'wall')}, {walls.length.sum():.0f} m."
    )
    if built.left_out:
        typer.echo(f"Left out: {plural(len(built.left_out), 'scan')}, the first of them {built.left_out[0]}.")


def _check_free(folder: Path, replace: bool) -> None:
    """A map may be hours of work, and what people drew on its plan.

    Raises FileExistsError if the folder has one that is not to be replaced, IsADirectoryError if it cannot be.
    """
    from .map_run import files_of_a_map

    there = files_of_a_map(folder)
    if folders := [name for name in there if (folder / name).is_dir()]:
        raise IsADirectoryError(
            errno.EISDIR,
            f"holds a folder {folders[0]}, where a file of the map belongs; give another folder for --output",
            str(folder),
        )
    if there and not replace:
        raise FileExistsError(
            errno.EEXIST,
            f"holds {there[0]} already; give another folder for --output, or replace the map there by --replace",
            str(folder),
        )
