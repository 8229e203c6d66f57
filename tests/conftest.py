"""For all tests: compiled kernels, the same examples on every run, and the real recordings.

The recordings lie beside the checkout: their licences do not allow shipping most of them.
"""

import os
import signal
from pathlib import Path

import hypothesis
import pytest
from hypothesis.internal.conjecture import providers

from lidarcore import warm_up

DATA = Path(__file__).parents[2] / "shared" / "data"


# The same examples on every run, so that a failure is a change of the code and not of the dice. Numbers that happen to
# stand in the modules loaded would be examples, too, and others with every edit and every choice of tests.
assert callable(providers._get_local_constants), "hypothesis draws constants of the code in another way now"
providers._get_local_constants = providers.Constants
# A machine that is busy is no reason to fail either.
hypothesis.settings.register_profile(
    "repeatable",
    deadline=None,
    derandomize=True,
    max_examples=100,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("repeatable")

# What nohup, or a shell in the background, has us ignore is passed on to every program that we start; what we catch
# is not.
for ignored in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(ignored) == signal.SIG_IGN:
        signal.signal(ignored, lambda *_: None)


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    """Compile once, before anything is timed or waited for."""
    warm_up()


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real recordings."""
    return DATA


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Without the recordings, leave out the tests that read them; CI must have them."""
    if DATA.is_dir():
        return
    if os.environ.get("CI"):
        pytest.exit(f"CI needs the real recordings in {DATA}.", returncode=1)
    kept = [item for item in items if not _reads_recordings(item)]
    config.hook.pytest_deselected(items=[item for item in items if _reads_recordings(item)])
    items[:] = kept


def pytest_report_header() -> str:
    there = "read from" if DATA.is_dir() else "not found, their tests are left out:"
    return f"real recordings: {there} {DATA}"


def _reads_recordings(item: pytest.Item) -> bool:
    return item.get_closest_marker("real_data") is not None or "data" in getattr(item, "fixturenames", ())
