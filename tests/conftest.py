"""For all tests: parallel processes, compiled kernels, the same examples on every run, and the real recordings.

Most recordings lie beside the checkout, because their licences do not allow shipping them; what tests/data holds comes
along.
"""

import os

# Before numpy is loaded, here and in what tests start: there are as many processes as cores already, and threads of
# linear algebra that wait for each other take several times the processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import fcntl
import importlib
import pkgutil
import signal
from pathlib import Path

import hypothesis
import numba
import pytest
from real_recordings import SHARED, SHIPPED

import lidarcore
from lidarcore import localization, warm_up

COMPILING = Path(lidarcore.__file__).parent / "__pycache__" / "compiling"
# Longest first: with whole files handed out to the processes, a long one that comes last leaves the others idle.
ORDER = ("browser", "evaluation", "experiments", "guide", "mapping", "localization", "laws", "app")

# The same examples on every run of the same code; a busy machine is no reason to fail. Hypothesis also tries the
# numbers in those of our modules that are loaded: all are, so that nothing depends on the tests before.
for package in ("lidarcore", "lidarcore_app", "docs.guide"):
    for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
        importlib.import_module(module.name)
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


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before anything is timed or waited for, in one process while the others wait for what it keeps."""
    if os.environ.get("CI") and not SHARED.is_dir():
        pytest.exit(f"CI needs the real recordings in {SHARED}: put them there, or unset CI.", returncode=1)
    hands_out = session.config.getoption("numprocesses", None) and not hasattr(session.config, "workerinput")
    if hands_out or session.config.option.collectonly or numba.config.DISABLE_JIT:
        return
    COMPILING.parent.mkdir(exist_ok=True)
    with COMPILING.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        warm_up()
        localization.warm_up()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """As many processes as there are cores; at least two, because much of a test's time is waiting."""
    return max(2, len(os.sched_getaffinity(0)))


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of the real recordings beside the checkout."""
    return SHARED


@pytest.fixture(scope="session")
def shipped() -> Path:
    """The folder of the real recordings that come along."""
    return SHIPPED


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Longest first. Without the recordings, leave out the tests that read them."""
    places = {name: place for place, name in enumerate(ORDER)}
    items.sort(key=lambda item: places.get(item.path.parent.name, len(ORDER)))
    if SHARED.is_dir():
        return
    kept = [item for item in items if not _reads_recordings(item)]
    config.hook.pytest_deselected(items=[item for item in items if _reads_recordings(item)])
    items[:] = kept


def pytest_report_header() -> str:
    there = "read from" if SHARED.is_dir() else "not found, their tests are left out:"
    return f"real recordings: {there} {SHARED}"


def _reads_recordings(item: pytest.Item) -> bool:
    return item.get_closest_marker("real_data") is not None or "data" in getattr(item, "fixturenames", ())
