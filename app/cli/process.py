"""A whole recording's segments and corners into one table: CSV, Parquet or GeoJSON by the file's suffix."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from lidarcore import ExtractionSettings, Features, RecordingError, Scan, compare
from lidarcore.files import replacing
from lidarcore.recordings import Recording

from ..pipeline.tables import CORNER_COLUMNS, INTEGERS, SEGMENT_COLUMNS, values

BATCH = 200  # scans written at once

SCHEMA = pa.schema(
    [
        ("scan", pa.int64()),
        ("stamp", pa.float64()),
        ("fitter", pa.string()),
        ("covariance", pa.string()),
        ("kind", pa.string()),
        ("id", pa.int64()),
        *(
            (name, pa.int64() if name in INTEGERS else pa.float64())
            for name in (*SEGMENT_COLUMNS, *CORNER_COLUMNS)
        ),
    ]
)


class GeoJsonWriter:
    """A FeatureCollection of LineStrings and Points, in metres in the sensor frame of each scan."""

    def __init__(self, path: str, schema: pa.Schema) -> None:
        self._file = open(path, "w", encoding="utf-8")  # noqa: SIM115
        self._file.write('{"type": "FeatureCollection", "features": [')
        self._separator = "\n"

    def __enter__(self) -> "GeoJsonWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.write("\n]}\n")
        self._file.close()

    def write(self, batch: pa.RecordBatch) -> None:
        for row in batch.to_pylist():
            self._file.write(self._separator + json.dumps(_feature(row), allow_nan=False))
            self._separator = ",\n"


WRITERS: dict[str, Callable[[str, pa.Schema], Any]] = {
    ".csv": pyarrow.csv.CSVWriter,
    ".parquet": pyarrow.parquet.ParquetWriter,
    ".geojson": GeoJsonWriter,
}


@dataclass
class Counts:
    """What was written."""

    scans: int = 0
    segments: int = 0
    corners: int = 0


@dataclass
class _Batch:
    """Columns that grow scan by scan; what a row has not got is null."""

    columns: dict[str, list[Any]] = field(default_factory=lambda: {name: [] for name in SCHEMA.names})

    def add(self, index: int, scan: Scan, fitter: str, features: Features) -> None:
        for kind, columns, n in (
            ("segment", SEGMENT_COLUMNS, len(features.segments)),
            ("corner", CORNER_COLUMNS, len(features.corners)),
        ):
            known: dict[str, list[Any]] = {
                "scan": [index] * n,
                "stamp": [scan.stamp] * n,
                "fitter": [fitter] * n,
                "covariance": [features.settings.covariance] * n,
                "kind": [kind] * n,
                "id": list(range(n)),
                **values(columns, features),
            }
            for name, column in self.columns.items():
                column.extend(known.get(name, [None] * n))

    def table(self) -> pa.RecordBatch:
        return pa.RecordBatch.from_pydict(self.columns, SCHEMA)


def process(
    recording: Recording,
    output: Path,
    settings: ExtractionSettings,
    fitters: Sequence[str],
    progress: Callable[[int], None],
) -> Counts:
    """Extract every scan by every fitter and write the table; the file appears when complete, or not at all.

    `progress` is told the number of scans. Raises RecordingError for a bad recording or an unknown suffix.
    """
    suffix = output.suffix.lower()
    if suffix not in WRITERS:
        raise RecordingError(
            f"{output.name} should end in one of {', '.join(WRITERS)}, which says the format."
        )
    if output.exists() and any(output.samefile(path) for path in (recording.path, *recording.path.glob("*"))):
        raise RecordingError(f"{output} is the recording itself: write into another file.")
    counts, batch = Counts(), _Batch()
    with replacing(output) as partial, WRITERS[suffix](str(partial), SCHEMA) as writer:
        for index, scan in enumerate(recording):
            for fitter, features in compare(scan, settings, fitters).items():
                batch.add(index, scan, fitter, features)
                counts.segments += len(features.segments)
                counts.corners += len(features.corners)
            counts.scans += 1
            progress(counts.scans)
            if counts.scans % BATCH == 0:
                writer.write(batch.table())
                batch = _Batch()
        writer.write(batch.table())
    return counts


def _feature(row: dict[str, Any]) -> dict[str, Any]:
    present = {name: value for name, value in row.items() if value is not None}
    if row["kind"] == "segment":
        ends = [
            [present.pop("x_start"), present.pop("y_start")],
            [present.pop("x_end"), present.pop("y_end")],
        ]
        geometry: dict[str, Any] = {"type": "LineString", "coordinates": ends}
    else:
        geometry = {"type": "Point", "coordinates": [present.pop("x"), present.pop("y")]}
    return {"type": "Feature", "geometry": geometry, "properties": present}
