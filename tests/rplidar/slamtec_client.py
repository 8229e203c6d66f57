"""Slamtec's own SDK as a client, in a process of its own: prints what the device says, keeps every revolution.

Usage: slamtec_client.py PORT REVOLUTIONS FILE.npz
"""

import json
import sys

import numpy as np
from pyrplidarsdk import RplidarDriver


def main(port: str, count: int, file: str) -> None:
    driver = RplidarDriver(port=port, baudrate=256000)
    assert driver.connect()
    info, health = driver.get_device_info(), driver.get_health()
    assert driver.start_scan()
    scans = [driver.get_scan_data() for _ in range(count)]
    driver.stop_scan()
    driver.disconnect()
    print(json.dumps([info.model, info.firmware_version, info.hardware_version, health.status]))
    np.savez(file, *(np.array(scan, np.float64) for scan in scans))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
