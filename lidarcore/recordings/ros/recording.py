"""What ROS 1 and ROS 2 bags share: LaserScan topics, odometry, and where the sensor sits."""

from abc import abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import PoseTrack, compose
from lidarcore.recordings.base import Recording
from lidarcore.recordings.beams import BEAMS, fits
from lidarcore.recordings.ros.frames import FrameTree, planar, rotation
from lidarcore.recordings.ros.messages import LASER, ODOMETRY, Message, decode, frame, scan_of, seconds
from lidarcore.scan import Scan

UPRIGHT = np.cos(np.radians(10))


class RosRecording(Recording):
    """Scans of sensor_msgs/LaserScan messages, with T_odom_sensor from nav_msgs/Odometry and tf.

    Opening reads the file once, for the topics, the odometry and the transforms.
    """

    @abstractmethod
    def _messages(self, connections: dict[str, str]) -> Iterator[Message]:
        """Yield the messages of the WANTED types as recorded, and fill in every topic's type on the way."""

    def _open(self, topic: str | None) -> None:
        connections: dict[str, str] = {}
        frames, laser_frames = FrameTree(), dict[str, str]()
        tracks: defaultdict[str, list[tuple[str, Array]]] = defaultdict(list)
        for message in self._messages(connections):
            if message.topic in laser_frames or message.type == BEAMS:
                continue
            if (content := decode(message)) is None:
                self._remark("Damaged messages are left out.")
            elif message.type == LASER:
                laser_frames[message.topic] = frame(content.header.frame_id)
            elif message.type == ODOMETRY:
                tracks[message.topic].append((frame(content.child_frame_id), _stamped_pose(content, message)))
            else:
                frames.add(content, static=message.topic.endswith("tf_static"))
        if not laser_frames:
            found = ", ".join(f"{name} ({type_})" for name, type_ in sorted(connections.items())) or "nothing"
            raise self._error(f"holds no readable {LASER}. It holds: {found}.")
        self._choose(laser_frames, topic)
        base = self._take_odometry(tracks)
        self._mount(frames, base, laser_frames[str(self.topic)])

    def _take_odometry(self, tracks: dict[str, list[tuple[str, Array]]]) -> str | None:
        """Keep the poses of one odometry topic; return the frame that they are of."""
        self._odometry = PoseTrack(np.empty(0), np.empty((0, 3)))
        if not tracks:
            return None
        name = min(tracks, key=lambda name: (not name.endswith("/odom"), name))
        if len(tracks) > 1:
            others = ", ".join(sorted(set(tracks) - {name}))
            self._remark(f"Odometry is taken from {name}; the file also holds {others}.")
        table = np.array([pose for _, pose in tracks[name]])
        self._odometry = PoseTrack(table[:, 0], table[:, 1:])
        return tracks[name][0][0] or None

    def _mount(self, frames: FrameTree, base: str | None, sensor: str) -> None:
        """Find T_base_sensor, seen from above."""
        self._mirrored = False
        T_base_sensor = frames.mounting(base, sensor)
        if T_base_sensor is None:
            if len(self._odometry):
                self._remark(
                    f"No transform leads from {base or 'a base'} to {sensor!r}: for the odometry, "
                    "the sensor is taken to sit at the base's origin and to face forward."
                )
            return
        self.T_base_sensor, level = planar(T_base_sensor)
        self._mirrored = level < 0
        if self._mirrored:
            self._remark("The sensor hangs upside down: bearings are mirrored, counter-clockwise from above.")
        if abs(level) < UPRIGHT:
            tilt = np.degrees(np.arccos(abs(level)))
            self._remark(f"The sensor is tilted by {tilt:.0f} degrees: taken as level.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        beams, has_beams = None, False
        for message in self._messages({}):
            if message.type == BEAMS and message.topic == f"{self.topic}/beams":
                beams, has_beams = decode(message), True
            elif message.type == LASER and message.topic == self.topic:
                if (laser := decode(message)) is None:
                    self._count("damaged scans left out", 1)
                    continue
                exact = beams if beams is not None and fits(beams, laser) else None
                self._count(
                    "scans whose exact bearings are lost: even steps taken", int(has_beams and not exact)
                )
                yield partial(self._scan, laser, exact, message)

    def _scan(self, laser: Any, beams: Any | None, message: Message) -> Scan:
        stamp = _stamp(laser, message)
        self._count("scans without a stamp: the time of recording is taken", int(not seconds(laser.header)))
        T_odom_sensor = self._odometry.at(stamp)
        if T_odom_sensor is None:
            self._count("scans outside the time of the odometry", int(len(self._odometry) > 0))
        elif self.T_base_sensor is not None:
            T_odom_sensor = compose(T_odom_sensor, self.T_base_sensor)
        return scan_of(
            laser, beams, stamp, mirrored=self._mirrored, odometry=T_odom_sensor, count=self._count
        )


def _stamp(content: Any, message: Message) -> float:
    """Stamp of the header in s, or the time of recording if that is zero."""
    return seconds(content.header) or message.time


def _stamped_pose(odometry: Any, message: Message) -> Array:
    """Stamp and pose (4,) of a nav_msgs/Odometry."""
    pose = odometry.pose.pose
    R = rotation(pose.orientation)
    return np.array(
        [_stamp(odometry, message), pose.position.x, pose.position.y, np.arctan2(R[1, 0], R[0, 0])]
    )
