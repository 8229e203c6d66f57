"""The arrays that everything here is made of."""

from collections.abc import Iterable
from dataclasses import Field, fields
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]
Unsigned = NDArray[np.uint64]
Bools = NDArray[np.bool_]
Numbers = TypeVar("Numbers", Array, float)
"""Of functions on arrays that kernels compile for single numbers."""


class Columns:
    """Base of dataclasses whose fields are arrays (N, ...), all with the same N: one row for each of N things."""

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

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
