"""The folder of finished reports: each an HTML file, and beside it a JSON file that says how it was made."""

import json
import re
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from lidarcore.files import partials, write

from ...errors import ConflictError, NotFoundError, storing
from .kinds import KINDS

MOST = 100  # reports kept; the user deletes what is not needed any more
NAME = re.compile(rf"({'|'.join(KINDS)})_\d{{4}}-\d\d-\d\d_\d\d-\d\d-\d\d(_\d+)?")


@dataclass(frozen=True, slots=True)
class ReportEntry:
    """`options` and `took_s` are None where the file that says so is missing."""

    name: str
    kind: str
    created: str
    size: int
    took_s: float | None
    options: dict[str, Any] | None


class Reports:
    """Reports by their names, which are kind, date and time. Nothing else in the folder is touched."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for left in partials(folder, "*.html"):  # by a study that was killed while it wrote
            left.unlink(missing_ok=True)

    def all(self) -> list[ReportEntry]:
        """The newest first."""
        paths = [path for path in self.folder.glob("*.html") if NAME.fullmatch(path.stem)]
        return sorted(map(_entry, paths), key=lambda report: report.created, reverse=True)

    def path(self, name: str) -> Path:
        """Where the report is. Raises NotFoundError if there is none of that name."""
        path = self.folder / f"{name}.html"
        if not NAME.fullmatch(name) or not path.is_file():
            raise NotFoundError(f"There is no report {name!r}.")
        return path

    def new(self, kind: str) -> Path:
        """Where a new report goes. Raises ConflictError if there are too many, StorageError."""
        if len(self.all()) >= MOST:
            raise ConflictError(f"There are {MOST} reports already: delete some of them first.")
        with storing(f"The folder {self.folder} cannot be created"):
            self.folder.mkdir(parents=True, exist_ok=True)
        stem = f"{kind}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
        names = [stem, *(f"{stem}_{n}" for n in range(2, MOST + 2))]
        return next(path for name in names if not (path := self.folder / f"{name}.html").exists())

    def describe(self, path: Path, options: dict[str, Any], took_s: float) -> None:
        """Keep how a report was made. Raises OSError."""
        write(
            path.with_suffix(".json"), json.dumps({"options": options, "took_s": round(took_s, 1)}, indent=1)
        )

    def delete(self, name: str) -> None:
        """Delete a report. Raises NotFoundError if there is none of that name."""
        path = self.path(name)
        path.unlink(missing_ok=True)
        path.with_suffix(".json").unlink(missing_ok=True)

    def discard(self, path: Path) -> None:
        """Remove what a study that came to nothing may have left."""
        for left in (path, path.with_suffix(".json"), *partials(self.folder, path.name)):
            left.unlink(missing_ok=True)


def _entry(path: Path) -> ReportEntry:
    status, about = path.stat(), _about(path.with_suffix(".json"))
    return ReportEntry(
        name=path.stem,
        kind=path.stem.partition("_")[0],
        created=datetime.fromtimestamp(status.st_mtime, UTC).isoformat(timespec="seconds"),
        size=status.st_size,
        took_s=about.get("took_s"),
        options=about.get("options"),
    )


def _about(path: Path) -> dict[str, Any]:
    try:
        about = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):  # not there, or not ours
        return {}
    return about if isinstance(about, dict) else {}
