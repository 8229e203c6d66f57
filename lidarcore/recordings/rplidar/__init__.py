"""What is kept of an RPLIDAR without a robot around it: its bytes, or the samples that its tools write."""

from lidarcore.recordings.rplidar.capture import RplidarCapture
from lidarcore.recordings.rplidar.csv_samples import RplidarCsv
from lidarcore.recordings.rplidar.hex_text import RplidarHex
from lidarcore.recordings.rplidar.slamtec import SlamtecDump

__all__ = ["RplidarCapture", "RplidarCsv", "RplidarHex", "SlamtecDump"]
