"""The command `lidarcore`. Heavy imports happen inside the commands, so that help is instant."""

import json
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from .calibrate import calibrate
from .devices import devices
from .evaluate import evaluate
from .experiment import experiment
from .localize import localize
from .map import map_recording
from .options import (
    RecordingPath,
    Set,
    SettingsFile,
    Topic,
    check_folder,
    plural,
    settings_from,
    tell_notes,
    to_file,
)
from .progress import counting
from .record import record
from .serve import serve

cli = typer.Typer(
    name="lidarcore",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"lidarcore {version('lidarcore')}")
        raise typer.Exit


@cli.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    """2D lidar scans to walls and corners with honest covariances: live in the browser, or into a file."""


@cli.command()
def process(
    recording: RecordingPath,
    output: Annotated[Path, to_file("FILE.csv, FILE.parquet or FILE.geojson")],
    topic: Topic = None,
    fitter: Annotated[list[str] | None, typer.Option(help="a method; may be repeated to compare")] = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Write every scan's segments and corners into a file."""
    from lidarcore import open_recording

    from .process import process as run

    check_folder(output)
    chosen = settings_from(settings, set_)
    fitters = [chosen.patched({"extraction": {"fitter": name}}).extraction.fitter for name in fitter or []]
    opened = open_recording(recording, topic, chosen.sensor.mask)
    with counting("scans") as count:
        counts = run(opened, output, chosen.extraction, fitters or [chosen.extraction.fitter], count)
    tell_notes(opened)
    found = f"{plural(counts.segments, 'segment')} and {plural(counts.corners, 'corner')}"
    typer.echo(f"{output}: {found} of {plural(counts.scans, 'scan')}")


@cli.command()
def info(recording: RecordingPath, topic: Topic = None) -> None:
    """Say what is in a recording."""
    from lidarcore import open_recording

    from .info import summarise

    for name, value in summarise(open_recording(recording, topic)):
        typer.echo(f"{name:20} {value}")


for command in (serve, calibrate, devices, record, localize):
    cli.command()(command)
cli.command("map")(map_recording)
cli.add_typer(experiment, name="experiment")
cli.add_typer(evaluate, name="evaluate")


# The emulator reads its options, and explains them, itself.
@cli.command(
    add_help_option=False, context_settings={"ignore_unknown_options": True, "allow_extra_args": True}
)
def emulate(context: typer.Context) -> None:
    """Emulate an RPLIDAR S1 on a pseudo-terminal; --help lists what can be set."""
    from lidarcore.rplidar.emulator import main

    main(context.args, program="lidarcore emulate")


@cli.command()
def bench() -> None:
    """Measure speed and accuracy on this machine."""
    from ..benchmarks.bench import run

    run()


def main() -> None:
    """Run the command; what the user can mend is one sentence and exit code 2."""
    # Matrices are small: a second thread of BLAS only waits for its turn, up to 20 ms, and takes a core meanwhile.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        cli()
    except Exception as error:
        message = _message(error)
        if message is None:
            raise
        print(f"lidarcore: {message}", file=sys.stderr)
        raise SystemExit(2) from None


def _message(error: Exception) -> str | None:
    """The sentence for an error of the user's; None for one of ours."""
    from pydantic import ValidationError

    from lidarcore import LidarError
    from lidarcore.files import reason

    from ..errors import explained

    if isinstance(error, ValidationError):
        return explained(error)
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {reason(error)}"
    if isinstance(error, OSError):
        return reason(error)
    if isinstance(error, LidarError | json.JSONDecodeError):
        return str(error)
    return None


if __name__ == "__main__":
    main()
