"""RPLIDAR S1: its serial protocol, a driver and an emulator.

from lidarcore.rplidar import Driver

with Driver() as driver:
    for scan in driver:
        ...
"""

from lidarcore.rplidar.devices import FoundDevice, find_devices
from lidarcore.rplidar.driver import Driver, State
from lidarcore.rplidar.protocol import DeviceInfo, Health, Revolution, ScanMode
from lidarcore.rplidar.statistics import Statistics

__all__ = [
    "DeviceInfo",
    "Driver",
    "FoundDevice",
    "Health",
    "Revolution",
    "ScanMode",
    "State",
    "Statistics",
    "find_devices",
]
