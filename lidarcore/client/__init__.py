"""A client of a running `lidarcore serve`, for scripts and robots."""

from lidarcore.client.answers import PastPose, Pose, SeenCorner
from lidarcore.client.client import Client
from lidarcore.errors import ClientError, ServerUnreachableError

__all__ = ["Client", "ClientError", "PastPose", "Pose", "SeenCorner", "ServerUnreachableError"]
