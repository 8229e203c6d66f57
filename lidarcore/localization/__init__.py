"""Where the sensor is: extended Kalman filters on point landmarks, in a known map or with the map in the state."""

from lidarcore.localization.association import Association
from lidarcore.localization.deskew import deskew
from lidarcore.localization.estimate import Estimate
from lidarcore.localization.localizer import Localizer
from lidarcore.localization.points import Points
from lidarcore.localization.posts import find_posts
from lidarcore.localization.relocalization import Relocation, relocalize
from lidarcore.localization.settings import LocalizationSettings, OdometryNoise, VelocityNoise
from lidarcore.localization.slam import Slam

__all__ = [
    "Association",
    "Estimate",
    "LocalizationSettings",
    "Localizer",
    "OdometryNoise",
    "Points",
    "Relocation",
    "Slam",
    "VelocityNoise",
    "deskew",
    "find_posts",
    "relocalize",
]
