"""Recorded scans: `open_recording` recognises the format by content; FORMATS lists what it knows.

A format is one module of this package with one subclass of Recording; it is found by being there.
"""

import inspect
import os
import pkgutil
import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from lidarcore.body_mask import Sector
from lidarcore.errors import RecordingError
from lidarcore.files import reason
from lidarcore.files.streams import read_head
from lidarcore.recordings.base import Recording
from lidarcore.recordings.writer import ELLIPSE_SCALE, RecordingWriter

__all__ = [
    "ELLIPSE_SCALE",
    "FORMATS",
    "Recording",
    "RecordingWriter",
    "open_recording",
]


_MAP = re.compile(rb"\AP[25]\s|^(image|occupied_thresh):", re.MULTILINE)
"""In the beginning of a map's image, or of the YAML beside it."""


def _formats() -> tuple[type[Recording], ...]:
    """Every concrete Recording in this package, by name."""
    modules = [import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    found = {
        value
        for module in modules
        for _, value in inspect.getmembers(module, inspect.isclass)
        if issubclass(value, Recording) and not inspect.isabstract(value)
    }
    return tuple(sorted(found, key=lambda format_: format_.name))


FORMATS: tuple[type[Recording], ...] = _formats()


def open_recording(
    path: str | os.PathLike[str], topic: str | None = None, mask: Sequence[Sector] | None = None
) -> Recording:
    """Open a recording of any known format, also packed with gzip or zstd. Content decides, not the name.

    path   a file, or the folder of a ROS 2 bag
    topic  one of several lidars in the file; needed only if there are several
    mask   sectors of the robot's own body to leave out, () for none; if None, those kept in the recording

    Returns a `Recording`: iterate over it for its scans, as often as you like; `notes` says what was left out.

    >>> from lidarcore import Scan, open_recording
    >>> from lidarcore.recordings import RecordingWriter
    >>> with RecordingWriter("two_scans.mcap") as recording:
    ...     for stamp in (10.0, 10.1):
    ...         recording.write(Scan([1.0, 2.0, 3.0], [-0.1, 0.0, 0.1], stamp=stamp))
    >>> [scan.stamp for scan in open_recording("two_scans.mcap")]
    [10.0, 10.1]

    Raises RecordingError if the path is no readable recording of a known format, and its subclass TopicError
    (with `topics`) if the file holds several lidars and none was chosen, or not the one asked for.
    """
    path = Path(path)
    try:
        head = _head(path)
        recognised = [format_ for format_ in FORMATS if format_.recognises(path, head)]
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
        raise RecordingError(f"{path} cannot be opened: {reason(error)}.") from error
    if recognised:
        recording = recognised[0](path, topic)
        if mask is not None:
            recording.mask = tuple(mask)
        return recording
    if path.is_dir():
        raise RecordingError(f"The directory {path} is not a ROS 2 bag: it holds no .db3 or .mcap file.")
    if _MAP.search(head):
        raise RecordingError(
            f"{path.name} looks like a map, not like a recording: {_map_of(path, head)} in the page by "
            "Map › Load a file, or localize a recording in it by `lidarcore localize --map`."
        )
    known = ", ".join(format_.name for format_ in FORMATS)
    raise RecordingError(
        f"{path.name} is in none of the known formats: {known}. Anything else can be saved "
        "with numpy.savez as a .npz: ranges (N, B) m and bearings (B,) rad."
    )


def _map_of(path: Path, head: bytes) -> str:
    """What of a map is to be loaded: an image by the YAML that belongs to it, and nothing that is packed."""
    unpacked = "unpack it, and load" if path.suffix == ".gz" else "load"
    return f"{unpacked} {'the .yaml that belongs to it' if head.startswith(b'P') else 'it'}"


def _head(path: Path) -> bytes:
    if path.is_dir():
        return b""
    if not path.exists():
        raise RecordingError(f"There is no file {path}: give the path of a recording.")
    if not path.is_file():
        raise RecordingError(
            f"There is no file at {path} but a device or a pipe: save the recording, and give its path."
        )
    damage: list[str] = []
    head = read_head(path, damage.append)
    if not head and damage:
        raise RecordingError(f"{path.name} is damaged: nothing of it can be unpacked. Copy it anew.")
    if not head:
        raise RecordingError(f"{path.name} is empty.")
    return head
