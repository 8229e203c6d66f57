"""Simulated worlds and sensors: known truth for tests and benchmarks, and the room of the emulated sensor.

A robot that drives is in `simulation.robot`, its settings in `simulation.settings`, the worlds in `simulation.worlds`;
they are not imported here, for the emulated sensor needs neither them nor the filters whose noise they name.
"""

from lidarcore.simulation.rooms import furnished_room, random_pose
from lidarcore.simulation.sensor import SimulatedSensor
from lidarcore.simulation.world import World

__all__ = [
    "SimulatedSensor",
    "World",
    "furnished_room",
    "random_pose",
    "robot",
    "settings",
    "worlds",
]
