"""Where the sensor is: extended Kalman filters on point landmarks, in a known map or with the map in the state."""

from lidarcore.localization.dead_reckoning import Velocity
from lidarcore.localization.deskewing import deskew
from lidarcore.localization.ekf.association import Association
from lidarcore.localization.ekf.estimate import Estimate, as_pose
from lidarcore.localization.ekf.localizer import Localizer
from lidarcore.localization.ekf.slam import Slam
from lidarcore.localization.landmarks import Landmarks, from_stored, to_stored
from lidarcore.localization.motion_noise import OdometryNoise, VelocityNoise
from lidarcore.localization.navigator import Navigator
from lidarcore.localization.points import Points
from lidarcore.localization.precompile import warm_up
from lidarcore.localization.relocation import Relocation, relocalize
from lidarcore.localization.settings import LocalizationSettings, NavigationSettings
from lidarcore.localization.tracking_result import TrackingResult

__all__ = [
    "Association",
    "Estimate",
    "Landmarks",
    "LocalizationSettings",
    "Localizer",
    "NavigationSettings",
    "Navigator",
    "OdometryNoise",
    "Points",
    "Relocation",
    "Slam",
    "TrackingResult",
    "Velocity",
    "VelocityNoise",
    "as_pose",
    "deskew",
    "from_stored",
    "relocalize",
    "to_stored",
    "warm_up",
]
