"""Options that several commands share, and the settings they make."""

import errno
import json
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from lidarcore.recordings import Recording

    from ..pipeline.settings import Settings


def named(what: str, advice: str) -> Callable[[str | Path], Path]:
    """What reads a path that may not be empty, as of a variable that is not set: it would mean the working folder."""

    def path(name: str | Path) -> Path:  # a default is a path already
        if not str(name).strip():
            raise typer.BadParameter(f"the name of the {what} is empty: give {advice}.")
        return Path(name)

    return path


named_folder = named("folder", "one, or . for the working folder")
RecordingPath = Annotated[
    Path,
    typer.Argument(
        parser=named("recording", "its path"), help="a recording of any known format; its content decides"
    ),
]
Topic = Annotated[str | None, typer.Option(help="which lidar, if the recording has several")]
TopicOfAll = Annotated[str | None, typer.Option(help="which lidar, if the recordings have several")]
MOST = 1_000_000_000  # of whatever is counted: more than any recording holds

Seed = Annotated[int, typer.Option(min=0, max=MOST, help="seed of the random numbers")]
Workers = Annotated[
    int | None, typer.Option(min=1, max=1024, help="processes; one for each core if not given")
]
Mode = Annotated[
    str | None, typer.Option(help="DenseBoost or Standard; what the sensor prefers if not given")
]
Rpm = Annotated[int | None, typer.Option(help="speed of the motor; 600 if not given")]
Given = Annotated[
    bool, typer.Option("--given", help="judge the noise of the settings instead of a calibrated one")
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="a setting, e.g. gap=0.2 or noise.sigma_range=0.01"),
]
SettingsFile = Annotated[
    Path | None,
    typer.Option(
        "--settings",
        parser=named("file of settings", "its path, or the name of a kind of sensor"),
        help="a JSON file of settings, as GET /api/v1/settings gives them, or the name of a kind of sensor, such as "
        "rplidar_a1_a2, for its noise",
    ),
]


def to_file(help: str) -> Any:
    """The option -o, --output of a command that writes a file; `help` says which."""
    return typer.Option("-o", "--output", help=help)


def end_like_ctrl_c() -> None:
    """SIGTERM, and SIGHUP unless `nohup` has it ignored, end the command as Ctrl-C does, and what it has started."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)


def check_folder(file: Path, option: str = "--output") -> None:
    """Told before minutes of work are lost. Raises OSError unless a file of that name can be written."""
    if file.is_dir() or not file.absolute().parent.is_dir():
        raise FileNotFoundError(
            errno.ENOENT, f"is not a file in a folder that exists; give one for {option}", str(file)
        )
    _check_writable(file.absolute().parent, file, option)


def check_new_folder(folder: Path) -> None:
    """As `check_folder`, for a folder that may have to be made."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise NotADirectoryError(
            errno.ENOTDIR,
            f"cannot be a folder, since {there} is a file; give another one for --output",
            str(folder),
        )
    _check_writable(there, folder, "--output")


def _check_writable(folder: Path, path: Path, option: str) -> None:
    try:
        TemporaryFile(dir=folder).close()
    except OSError as error:
        raise PermissionError(
            errno.EACCES, f"cannot be written there; give another place for {option}", str(path)
        ) from error


def plural(number: int, noun: str) -> str:
    """'1 scan', '2 scans'."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def tell_notes(recording: "Recording") -> None:
    """What was found and handled in a recording that was read, on stderr."""
    for note in recording.notes:
        typer.echo(f"{recording.path.name}: {note}", err=True)


def check_output(file: Path | None, *formats: str) -> None:
    """As `check_folder`, if there is to be one. Raises EvaluationError unless its name ends in one of the formats."""
    if file is not None:
        from lidarcore.evaluation.consistency.tables import check

        check(file, formats)
        check_folder(file)


def numbers(option: str, text: str, meaning: str, example: str) -> list[float]:
    """As many numbers as the example has, separated by commas. Raises BadParameter."""
    with suppress(ValueError):
        found = [float(part) for part in text.split(",")]
        if len(found) == len(example.split(",")):
            return found
    raise typer.BadParameter(f"{option} {text!r} should be {meaning}: {example}.")


def settings_from(file: Path | None, assignments: list[str] | None) -> "Settings":
    """The defaults, changed by the file or the noise of the sensor named, changed by each NAME=VALUE."""
    from lidarcore import SENSORS

    from ..pipeline.settings import Settings

    settings = Settings()
    if str(file) in SENSORS:
        settings = settings.with_noise(SENSORS[str(file)].noise)
    elif file is not None:
        settings = settings.patched(_read_settings(file))
    for assignment in assignments or []:
        settings = settings.patched(_patch(assignment))
    return settings


def _read_settings(file: Path) -> dict[str, Any]:
    from lidarcore import SENSORS, LidarError
    from lidarcore.files import reason

    try:
        settings = json.loads(file.read_text("utf-8"))
    except FileNotFoundError as error:
        sensors = ", ".join(SENSORS)
        raise LidarError(
            f"There is no file {file}, and no sensor of that name; known are {sensors}."
        ) from error
    except ValueError as error:  # not text, or not JSON
        raise LidarError(f"{file} is not a JSON file: {reason(error)}.") from error
    if not isinstance(settings, dict):
        raise LidarError(f"{file} should hold an object, as GET /api/v1/settings gives it.")
    return settings


def _patch(assignment: str) -> dict[str, Any]:
    """'gap=0.2' or 'view.theme=light' as a merge patch; names without a section are of the extraction."""
    from ..pipeline.settings import Settings

    name, equals, text = assignment.partition("=")
    if not equals:
        raise typer.BadParameter(f"{assignment!r} should be NAME=VALUE, e.g. gap=0.2.")
    patch = _value(text)
    path = name.split(".")
    if path[0] not in Settings.model_fields:
        path.insert(0, "extraction")
    for part in reversed(path):
        patch = {part: patch}
    return dict(patch)


def _value(text: str) -> Any:
    """JSON, or a number as people write it (.01), or else the text itself."""
    for read in (json.loads, float):
        with suppress(ValueError):
            return read(text)
    return text
