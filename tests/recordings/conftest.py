"""Where the real recordings are."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data() -> Path:
    return Path(__file__).parents[3] / "shared" / "data"
