"""Simulated worlds and sensors: known truth for tests and benchmarks, and the room of the emulated sensor."""

from lidarcore.simulation.rooms import furnished_room, random_pose
from lidarcore.simulation.sensor import SimulatedSensor
from lidarcore.simulation.world import World

__all__ = ["SimulatedSensor", "World", "furnished_room", "random_pose"]
