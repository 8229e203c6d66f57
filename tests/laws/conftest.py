import pytest
from hypothesis import settings

from lidarcore import FITTERS, Scan, extract, warm_up

# The same examples on every run, so that a failure is a change of the code and not of the dice.
settings.register_profile("laws", deadline=None, derandomize=True, max_examples=100)
settings.load_profile("laws")


@pytest.fixture(scope="session", autouse=True)
def _compiled():
    warm_up()
    extract(Scan([1.0], [0.0]))


@pytest.fixture(params=FITTERS)
def name(request) -> str:
    return request.param


@pytest.fixture
def fit(name):
    """(ranges, bearings, noise) -> Line, by each fitter in turn."""
    return FITTERS[name].fit
