import pytest
from hypothesis import settings

from lidarcore import warm_up

# The same examples on every run, so that a failure is a change of the code and not of the dice.
settings.register_profile("core", deadline=None, derandomize=True, max_examples=100)
settings.load_profile("core")


@pytest.fixture(scope="session", autouse=True)
def _compiled():
    warm_up()
