"""The command `lidarcore`. Heavy imports happen inside the commands, so that help is instant."""

import errno
import json
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli_calibrate import calibrate
from app.cli_devices import devices
from app.cli_emulate import PASS_ON, emulate
from app.cli_evaluate import evaluate
from app.cli_experiment import experiment
from app.cli_localize import localize
from app.cli_options import RecordingPath, Set, SettingsFile, Topic, counting, settings_from
from app.cli_record import record

cli = typer.Typer(
    name="lidarcore",
    help="2D lidar scans to walls and corners with honest covariances: live in the browser, or into a file.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@cli.command()
def serve(
    recording: Annotated[
        Path | None,
        typer.Argument(help="play this; if not given, the sensor connected, else an emulated one"),
    ] = None,
    topic: Topic = None,
    host: Annotated[
        str, typer.Option(help="address to listen on; a token is needed unless it is local")
    ] = "127.0.0.1",
    http_port: Annotated[
        int, typer.Option(min=0, max=65535, help="port of the dashboard; 0 takes any free one")
    ] = 8000,
    port: Annotated[
        str | None,
        typer.Option(
            help="serial port of the sensor, such as /dev/ttyUSB0; a mere number is taken as --http-port"
        ),
    ] = None,
    baud: Annotated[int | None, typer.Option(min=1200, help="of the sensor; 256000 if not given")] = None,
    mode: Annotated[str | None, typer.Option(help="DenseBoost or Standard; what the sensor prefers")] = None,
    rpm: Annotated[int | None, typer.Option(help="speed of the motor; 600 if not given")] = None,
    emulator: Annotated[
        bool, typer.Option("--emulator", help="an emulated sensor, whatever is connected")
    ] = False,
    recordings: Annotated[Path, typer.Option(help="folder of recordings, and where uploads go")] = Path(
        "recordings"
    ),
    map: Annotated[
        str | None,
        typer.Option(
            "--map", metavar="URL", help="file of landmark maps; landmarks.db beside the folder of recordings"
        ),
    ] = None,
    max_upload: Annotated[int, typer.Option(min=1, help="largest upload, MB")] = 1024,
    token: Annotated[
        str | None, typer.Option(envvar="LIDARCORE_TOKEN", help="token to demand; random if needed")
    ] = None,
    allow_host: Annotated[
        list[str] | None, typer.Option(help="a further name this server is reached by")
    ] = None,
    settings: SettingsFile = None,
    set_: Set = None,
    open_browser: Annotated[bool, typer.Option("--open-browser", help="open the page")] = False,
) -> None:
    """Serve the dashboard."""
    from app.serve import listen, secured
    from app.serve import serve as run

    if port is not None and port.isdecimal():
        http_port, port = int(port), None
    if sum(given not in (None, False) for given in (recording, port, emulator)) > 1:
        raise typer.BadParameter("give one of RECORDING, --port and --emulator.")

    if recordings.exists() and not recordings.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is no folder, give one for --recordings", str(recordings))
    with listen(host, http_port) as listening:
        from app.live import DeviceOptions
        from app.server import ServerOptions

        options = ServerOptions(
            recordings=recordings,
            recording=recording,
            topic=topic,
            map=map,
            device=DeviceOptions(port, baud, mode, rpm, emulator),
            say=lambda sentence: print(sentence, flush=True),
            settings=settings_from(settings, set_),
            max_bytes=max_upload << 20,
            hosts=tuple(allow_host or ()),
            token=_plain(token),
        )
        run(secured(options, host), listening, host, open_browser=open_browser)


@cli.command()
def process(
    recording: RecordingPath,
    output: Annotated[Path, typer.Option("-o", "--output", help="FILE.csv, FILE.parquet or FILE.geojson")],
    topic: Topic = None,
    fitter: Annotated[list[str] | None, typer.Option(help="a method; may be repeated to compare")] = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Write every scan's segments and corners into a file."""
    from app.export import process as run
    from lidarcore import open_recording

    chosen = settings_from(settings, set_)
    fitters = [chosen.patched({"extraction": {"fitter": name}}).extraction.fitter for name in fitter or []]
    with counting("scans") as count:
        counts = run(
            open_recording(recording, topic),
            output,
            chosen.extraction,
            fitters or [chosen.extraction.fitter],
            lambda so_far: count(so_far.scans),
        )
    typer.echo(f"{output}: {counts.segments} segments and {counts.corners} corners of {counts.scans} scans")


@cli.command()
def info(recording: RecordingPath, topic: Topic = None) -> None:
    """Say what is in a recording."""
    from app.info import summarise
    from lidarcore import open_recording

    for name, value in summarise(open_recording(recording, topic)):
        typer.echo(f"{name:20} {value}")


cli.command()(calibrate)
cli.command()(devices)
cli.command()(record)
cli.command()(localize)
cli.add_typer(experiment, name="experiment")
cli.add_typer(evaluate, name="evaluate")
cli.command(add_help_option=False, context_settings=PASS_ON)(emulate)


@cli.command()
def bench() -> None:
    """Measure speed and accuracy on this machine."""
    from app.bench import run

    run()


def main() -> None:
    """Run the command; what the user can mend is one sentence and exit code 2."""
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

    if isinstance(error, ValidationError):
        return "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, LidarError | OSError | json.JSONDecodeError):
        return str(error)
    return None


def _plain(token: str | None) -> str | None:
    """The token, if it can stand in an address, a header and a cookie as it is; none if it is empty."""
    if token and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise typer.BadParameter("a token has letters, digits and - . _ ~ only.")
    return token or None


if __name__ == "__main__":
    main()
