"""Finished chunks of a study in a file, so that it can be interrupted at any time and resumed."""

import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from types import TracebackType

import numpy as np

from lidarcore.errors import EvaluationError
from lidarcore.scan import Array

_TABLES = """
    pragma journal_mode = wal;
    pragma synchronous = normal;
    create table if not exists study (description text not null);
    create table if not exists chunk (number integer primary key, shape text not null, sums blob not null);
"""


class Results:
    """Arrays by the number of their chunk, in an SQLite file: a chunk is in it whole or not at all.

    Without a path they are kept in memory. Raises EvaluationError if the file is of another study (its description
    differs) or is no file of results.
    """

    def __init__(self, path: Path | None, description: str) -> None:
        self._path = path
        self._database = sqlite3.connect(path or ":memory:")
        try:
            self._begin(description)
        except sqlite3.DatabaseError as error:
            self._database.close()
            raise EvaluationError(f"{path} cannot hold the results of a study: {error}.") from error
        except EvaluationError:
            self._database.close()
            raise

    def _begin(self, description: str) -> None:
        self._database.executescript(_TABLES)
        with self._database:
            row = self._database.execute("select description from study").fetchone()
            if row is None:
                self._database.execute("insert into study values (?)", (description,))
            elif row[0] != description:
                raise EvaluationError(
                    f"{self._path} holds the results of another study, or of other code: give another file, or "
                    "remove it."
                )

    def put(self, number: int, sums: Array) -> None:
        """Keep one chunk."""
        with self._database:
            self._database.execute(
                "insert or replace into chunk values (?, ?, ?)",
                (number, ",".join(map(str, sums.shape)), sums.astype("<f8").tobytes()),
            )

    def all(self) -> Mapping[int, Array]:
        """Every chunk kept, by its number, in the order of numbers."""
        with closing(self._database.execute("select number, shape, sums from chunk order by number")) as rows:
            return {
                number: np.frombuffer(sums, "<f8").reshape([int(n) for n in shape.split(",")])
                for number, shape, sums in rows
            }

    def __enter__(self) -> "Results":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._database.close()
