"""A robot that asks and tells a running server: `make run` first, or give the address of another one."""

import sys
import time

from lidarcore import Client
from lidarcore.errors import ServerUnreachableError

URL = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8000"


def main() -> None:
    """Ask for corners, tell where the wheels are, ask for the pose and what is near."""
    with Client(URL) as robot:
        robot.set(extraction={"fitter": "ml"}, navigation={"mode": "slam", "method": "landmarks"})
        for corner in robot.corners():
            print(f"corner {corner.id} at {corner.xy.round(3)} m")

        robot.send_odometry(time.time(), 0.0, 0.0, 0.0)  # stamp, x, y (m), heading (rad) of the sensor
        time.sleep(3)  # landmarks are confirmed once they were seen often enough
        pose = robot.pose()
        print(f"{pose.state}: {pose.pose.round(3)}")
        for neighbour in robot.nearest(1.0, 2.0, k=3):
            landmark = neighbour.landmark
            print(
                f"landmark {landmark.id} at {landmark.x:.2f} {landmark.y:.2f} m, {neighbour.distance:.2f} m away"
            )


try:
    main()
except ServerUnreachableError as error:
    sys.exit(str(error))
