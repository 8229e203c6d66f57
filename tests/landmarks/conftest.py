import pytest
from landmark_maps import corner

from lidarcore.landmarks import Atlas


@pytest.fixture
def atlas(tmp_path):
    with Atlas(tmp_path / "map.db") as opened:
        yield opened


@pytest.fixture
def landmark_map(atlas):
    """The map of one session among others, which lie in the same place."""
    others = [atlas.begin("before", 1.0), atlas.begin("other", 2.0)]
    opened = atlas.begin("test", 3.0)
    for other in (*others, atlas.begin("after", 4.0)):
        other.put([corner(x, y) for x in range(-5, 5) for y in range(-5, 5)])
    return opened
