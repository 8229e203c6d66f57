"""Where the real recordings lie: some come along with the tests, the others beside the checkout."""

from collections.abc import Iterable
from pathlib import Path

import pytest

SHIPPED = Path(__file__).parent / "data"
SHARED = Path(__file__).parents[2] / "shared" / "data"


def where(name: str) -> Path:
    """The recording of this name."""
    return SHIPPED / name if (SHIPPED / name).exists() else SHARED / name


def each(names: Iterable[str]) -> list[object]:
    """The names as parameters of a test, which is left out for those that are missing."""
    return [
        pytest.param(name, marks=() if where(name).is_relative_to(SHIPPED) else pytest.mark.real_data)
        for name in names
    ]
