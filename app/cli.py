"""The command `lidarcore`. Heavy imports happen inside the commands, so that help is instant."""

import errno
import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from app.settings import Settings

cli = typer.Typer(
    name="lidarcore",
    help="2D lidar scans to walls and corners with honest covariances: live in the browser, or into a file.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

RecordingPath = Annotated[Path, typer.Argument(help="a recording of any known format; its content decides")]
Topic = Annotated[str | None, typer.Option(help="which lidar, if the recording has several")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="a setting, e.g. gap=0.2 or noise.sigma_range=0.01"),
]
SettingsFile = Annotated[
    Path | None,
    typer.Option("--settings", help="a JSON file of settings, as GET /api/v1/settings gives them"),
]


@cli.command()
def serve(
    recording: Annotated[Path | None, typer.Argument(help="play this; a simulated room if not given")] = None,
    topic: Topic = None,
    host: Annotated[
        str, typer.Option(help="address to listen on; a token is needed unless it is local")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes any free one")] = 8000,
    recordings: Annotated[Path, typer.Option(help="folder of recordings, and where uploads go")] = Path(
        "recordings"
    ),
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

    if recordings.exists() and not recordings.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is no folder, give one for --recordings", str(recordings))
    with listen(host, port) as listening:
        from app.server import ServerOptions

        options = ServerOptions(
            recordings=recordings,
            recording=recording,
            topic=topic,
            settings=_settings(settings, set_),
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
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from app.export import Counts
    from app.export import process as run
    from lidarcore import open_recording

    chosen = _settings(settings, set_)
    fitters = [chosen.patched({"extraction": {"fitter": name}}).extraction.fitter for name in fitter or []]
    columns = (BarColumn(), TextColumn("{task.completed} scans"), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def progress(counts: Counts) -> None:
            bar.update(task, completed=counts.scans)

        counts = run(
            open_recording(recording, topic),
            output,
            chosen.extraction,
            fitters or [chosen.extraction.fitter],
            progress,
        )
        bar.update(task, total=counts.scans)
    typer.echo(f"{output}: {counts.segments} segments and {counts.corners} corners of {counts.scans} scans")


@cli.command()
def info(recording: RecordingPath, topic: Topic = None) -> None:
    """Say what is in a recording."""
    from app.info import summarise
    from lidarcore import open_recording

    for name, value in summarise(open_recording(recording, topic)):
        typer.echo(f"{name:20} {value}")


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


def _settings(file: Path | None, assignments: list[str] | None) -> "Settings":
    """The defaults, changed by the file, changed by each NAME=VALUE."""
    from app.settings import Settings

    settings = Settings()
    if file is not None:
        settings = settings.patched(_read_settings(file))
    for assignment in assignments or []:
        settings = settings.patched(_patch(assignment))
    return settings


def _plain(token: str | None) -> str | None:
    """The token, if it can stand in an address, a header and a cookie as it is; none if it is empty."""
    if token and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise typer.BadParameter("a token has letters, digits and - . _ ~ only.")
    return token or None


def _read_settings(file: Path) -> dict[str, Any]:
    from lidarcore import LidarError

    try:
        settings = json.loads(file.read_text("utf-8"))
    except ValueError as error:  # not text, or not JSON
        raise LidarError(f"{file} is no JSON file: {error}.") from error
    if not isinstance(settings, dict):
        raise LidarError(f"{file} should hold an object, as GET /api/v1/settings gives it.")
    return settings


def _patch(assignment: str) -> dict[str, Any]:
    """'gap=0.2' or 'view.theme=light' as a merge patch; names without a section are of the extraction."""
    name, equals, text = assignment.partition("=")
    if not equals:
        raise typer.BadParameter(f"{assignment!r} should be NAME=VALUE, e.g. gap=0.2.")
    try:
        patch = json.loads(text)
    except json.JSONDecodeError:
        patch = text
    path = name.split(".")
    if path[0] not in ("extraction", "view"):
        path.insert(0, "extraction")
    for part in reversed(path):
        patch = {part: patch}
    return dict(patch)


if __name__ == "__main__":
    main()
