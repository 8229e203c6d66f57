"""A map from whole scans of a real sensor that was carried through rooms: no odometry, no corners needed."""

from pathlib import Path

import numpy as np

from lidarcore import open_recording
from lidarcore.mapping import Mapper

REAL = Path(__file__).parents[1] / "app" / "demo" / "real-rplidar-windsor.npz"

mapper = Mapper()
for scan in open_recording(REAL):
    mapper.step(scan)
mapper.finish()

stamps, poses = mapper.trajectory()  # (T,) s and (T, 3): x m, y m, heading rad in the frame of the first scan
sigma = 1000 * np.sqrt(np.diagonal(mapper.covariances(), axis1=1, axis2=2)[:, :2])
way = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).sum()
print(
    f"{len(stamps)} scans, {len(mapper.keyframes.scans)} of them keyframes; {len(mapper.loops)} loops closed"
)
print(
    f"{way:.1f} m of way; at the end x {poses[-1, 0]:.3f} m, y {poses[-1, 1]:.3f} m, sigma {sigma[-1].round(1)} mm"
)
