import pytest

from lidarcore.landmarks import LandmarkMap


@pytest.fixture
def landmark_map(tmp_path):
    with LandmarkMap(tmp_path / "map.db") as opened:
        yield opened
