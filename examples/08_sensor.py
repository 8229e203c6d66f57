"""A sensor at a port: `python 08_sensor.py /dev/ttyUSB0`; without a port, an emulated one."""

import sys
from contextlib import nullcontext
from itertools import islice

from lidarcore import extract
from lidarcore.rplidar import Driver
from lidarcore.rplidar.emulator_process import EmulatorProcess

emulator = nullcontext() if len(sys.argv) > 1 else EmulatorProcess()
with emulator as emulated, Driver(emulated.port if emulated else sys.argv[1]) as driver:
    for scan in islice(driver, 10):  # endless without islice
        features = extract(scan)
        print(f"{scan}: {scan.completeness:.0%} complete, {len(features.corners)} corners")
