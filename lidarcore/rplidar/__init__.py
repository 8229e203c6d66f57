"""RPLIDAR S1: its serial protocol, a driver and an emulator.

from lidarcore.rplidar import Driver

with Driver() as driver:
    for scan in driver:
        ...
"""

from lidarcore.rplidar.connection.devices import FoundDevice, find_devices
from lidarcore.rplidar.connection.statistics import Statistics
from lidarcore.rplidar.driver import Driver, State
from lidarcore.rplidar.protocol import DeviceInfo, Health, Revolution, ScanMode

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
