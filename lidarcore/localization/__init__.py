"""Where the sensor is: extended Kalman filters on point landmarks, in a known map or with the map in the state."""

from lidarcore.localization.association import Association
from lidarcore.localization.deskew import deskew
from lidarcore.localization.estimate import Estimate
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.localizer import Localizer
from lidarcore.localization.navigator import Navigator
from lidarcore.localization.points import Points
from lidarcore.localization.posts import find_posts
from lidarcore.localization.relocalization import Relocation, relocalize
from lidarcore.localization.settings import (
    LocalizationSettings,
    NavigationSettings,
    OdometryNoise,
    VelocityNoise,
)
from lidarcore.localization.slam import Slam
from lidarcore.localization.stored import from_stored, to_stored
from lidarcore.localization.warming import warm_up
from lidarcore.localization.whereabouts import Whereabouts

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
    "VelocityNoise",
    "Whereabouts",
    "deskew",
    "find_posts",
    "from_stored",
    "relocalize",
    "to_stored",
    "warm_up",
]
