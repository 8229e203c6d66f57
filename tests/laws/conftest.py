import pytest

from lidarcore import FITTERS


@pytest.fixture(params=FITTERS)
def name(request) -> str:
    return request.param


@pytest.fixture
def fit(name):
    """(ranges, bearings, noise) -> Line, by each fitter in turn."""
    return FITTERS[name].fit
