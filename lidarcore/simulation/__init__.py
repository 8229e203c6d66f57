"""Simulated worlds and sensors: known truth for tests, benchmarks and the demo."""

from lidarcore.simulation.rooms import furnished_room, random_pose
from lidarcore.simulation.sensor import SimulatedSensor, demo_scans
from lidarcore.simulation.world import World

__all__ = ["SimulatedSensor", "World", "demo_scans", "furnished_room", "random_pose"]
