"""Tables whose columns are arrays."""

from collections.abc import Iterable
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance as Dataclass
else:
    Dataclass = object


class Columns(Dataclass):
    """Base of dataclasses whose fields are arrays (N, ...), all with the same N: one row for each of N things."""

    __slots__ = ()

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, which: Any) -> Self:
        """The rows that a mask (N,), indices or a slice choose."""
        return type(self)(*(getattr(self, column.name)[which] for column in fields(self)))

    @classmethod
    def joined(cls, tables: Iterable[Self]) -> Self:
        """The rows of several tables, one table after the other."""
        several = list(tables)
        return cls(
            *(np.concatenate([getattr(table, column.name) for table in several]) for column in fields(cls))
        )
