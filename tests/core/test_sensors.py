"""Known kinds of sensor: their noise leads to walls and ellipses, in the library and wherever settings are read."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app.cli.options import settings_from
from real_recordings import SHARED

from lidarcore import SENSORS, ExtractionSettings, LidarError, extract, open_recording


@pytest.mark.parametrize("name", SENSORS)
def test_a_name_is_a_file_of_settings(name: str) -> None:
    kind = SENSORS[name]
    assert kind.title.isprintable()
    assert len(kind.rests_on) > 40
    assert settings_from(Path(name), None).extraction.noise == kind.noise


def test_a_name_that_is_none_is_refused_with_those_that_are() -> None:
    with pytest.raises(LidarError, match=r"no file rplidar_x9.*rplidar_s1, rplidar_a1_a2"):
        settings_from(Path("rplidar_x9"), None)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "recording", "topic"),
    [
        ("rplidar_a1_a2", "rplidar_csv_rooms/golf_room.csv.gz", None),
        ("rplidar_c1", "tau_rplidar_c1_rooms/lab446__scans.json", "dev1"),
        ("hokuyo_urg_04lx", "ccny_hokuyo_rosbag1/demo.bag", None),
    ],
)
def test_its_recordings_scatter_about_walls_as_it_says(name: str, recording: str, topic: str | None) -> None:
    """Within a factor of two about the median wall; whether ellipses hold is judged elsewhere."""
    noise = SENSORS[name].noise
    ratios: list[float] = []
    for scan in islice(open_recording(SHARED / recording, topic), 0, 300, 30):
        walls = extract(scan, ExtractionSettings(noise=noise)).segments
        middle = np.hypot(*((walls.start + walls.end) / 2).T)
        said = np.hypot(np.sqrt(noise.range_variances(middle)), noise.unevenness)
        ratios += (walls.rms / said)[walls.n_points >= 10].tolist()
    assert len(ratios) >= 10
    assert 0.5 < np.median(ratios) < 2
