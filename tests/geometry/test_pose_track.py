"""Poses over time against numpy's interpolation of headings that were unwrapped before."""

import numpy as np
import pytest

from lidarcore.geometry import PoseTrack, wrap


@pytest.mark.parametrize("seed", range(5))
def test_poses_are_interpolated_along_the_shorter_turn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    stamps = np.repeat(rng.permutation(20), 2).astype(float)
    poses = np.column_stack([rng.normal(size=(40, 2)), rng.uniform(-np.pi, np.pi, 40)])
    poses[7, 1] = stamps[11] = np.nan
    track, kept = PoseTrack(stamps, poses), np.isfinite(stamps) & np.isfinite(poses).all(axis=1)
    order = np.argsort(stamps[kept], kind="stable")
    stamps, poses = stamps[kept][order], poses[kept][order]
    for at in [*stamps, *rng.uniform(stamps[0], stamps[-1], 50)]:
        columns = (poses[:, 0], poses[:, 1], np.unwrap(poses[:, 2]))
        x, y, heading = (np.interp(at, stamps, column) for column in columns)
        found = track.at(at)
        np.testing.assert_allclose(found[:2], [x, y], atol=1e-12)
        assert abs(wrap(found[2] - heading)) < 1e-12
    assert track.at(stamps[0] - 0.1) is None
    assert track.at(stamps[-1] + 0.1) is None
    assert (len(track), PoseTrack(np.empty(0), np.empty((0, 3))).at(0.0)) == (len(stamps), None)
