"""SLAMTEC RPLIDAR S1: its serial protocol, a driver, captures of its bytes, and an emulator.

from lidarcore.rplidar import Driver

with Driver() as driver:
    for scan in driver:
        ...
"""

from lidarcore.rplidar.capture import CaptureWriter, Direction, Piece, Stream
from lidarcore.rplidar.connection.devices import FoundDevice, find_devices
from lidarcore.rplidar.connection.port import Tap, path_of
from lidarcore.rplidar.connection.scan_options import BAUD, check_scan_options
from lidarcore.rplidar.connection.statistics import Statistics
from lidarcore.rplidar.driver import Driver, State
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.rplidar.protocol import DeviceInfo, Health, Revolution, ScanMode

__all__ = [
    "BAUD",
    "CaptureWriter",
    "DeviceInfo",
    "Direction",
    "Driver",
    "EmulatorProcess",
    "FoundDevice",
    "Health",
    "Piece",
    "Revolution",
    "ScanMode",
    "State",
    "Statistics",
    "Stream",
    "Tap",
    "check_scan_options",
    "emulator",
    "find_devices",
    "path_of",
]
