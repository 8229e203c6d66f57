"""A Hokuyo carried through a lab, without odometry: the map it makes is one in which it finds itself again."""

from pathlib import Path

import numpy as np
import pytest

from lidarcore import extract, open_recording
from lidarcore.geometry import wrap
from lidarcore.localization import Landmarks, NavigationSettings, Navigator, TrackingResult


def run(data: Path, navigator: Navigator) -> list[TrackingResult]:
    recording = open_recording(data / "ccny_hokuyo_rosbag1" / "demo.bag")
    return [navigator.step(scan, extract(navigator.deskewed(scan))) for scan in recording]


@pytest.fixture(scope="module")
def mapped(data: Path) -> list[TrackingResult]:
    return run(data, Navigator(NavigationSettings(mode="slam")))


def test_every_corner_is_in_the_map_once(mapped: list[TrackingResult]) -> None:
    landmarks = mapped[-1].landmarks
    xy = landmarks.points.xy[landmarks.confirmed]
    apart = np.linalg.norm(xy[:, None] - xy, axis=-1) + 9 * np.eye(len(xy))
    assert len(xy) >= 8
    assert apart.min() > 0.1


def test_it_tracks_all_the_way(mapped: list[TrackingResult]) -> None:
    states = [where.state for where in mapped]
    begun = states.index("tracking")
    assert begun < 20
    assert set(states[begun:]) == {"tracking"}


def test_in_its_own_map_it_finds_itself_from_nothing_and_goes_the_same_way(
    data: Path, mapped: list[TrackingResult]
) -> None:
    final = mapped[-1].landmarks
    known: Landmarks = final.subset(final.confirmed)
    found = run(data, Navigator(NavigationSettings(mode="localize"), known))
    differences = np.array(
        [
            where.estimate.pose - before.estimate.pose
            for where, before in zip(found, mapped, strict=True)
            if where.state == "tracking"
        ]
    )
    assert len(differences) > 0.9 * len(mapped)
    assert np.hypot(*differences[:, :2].T).max() < 0.1
    assert np.abs(wrap(differences[:, 2])).max() < 0.05
