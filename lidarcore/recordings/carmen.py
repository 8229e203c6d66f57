"""CARMEN logs: FLASER, RLASER, ROBOTLASERn and RAWLASERn lines, with ODOM for the lasers that have no pose.

Format: readlog.c and writelog.c of CARMEN's logger.
"""

import re
from array import array
from dataclasses import replace

import numpy as np

from lidarcore.geometry import PoseTrack
from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.laser_survey import SICK_RANGE, Survey
from lidarcore.scan import Array, Scan

_OF_GRAPH = (
    "The log holds a pose graph (VERTEX lines): the poses of its scans may be those of the graph, not wheel odometry. "
    "lidarcore map --odometry none leaves them out."
)
_NEW = re.compile(r"(ROBOT|RAW)LASER\d")
_FRONT, _REAR = ("robot_frontlaser_offset", 0.0), ("robot_rearlaser_offset", np.pi)
OFFSETS = {"FLASER": _FRONT, "RLASER": _REAR} | {
    f"{kind}LASER{number}": place for kind in ("ROBOT", "RAW") for number, place in ((1, _FRONT), (2, _REAR))
}
"""Parameter with the distance of the laser ahead of the robot's centre in m, and its yaw in rad."""


class CarmenLog(LaserLog):
    """A CARMEN log. T_odom_sensor is what the log says: wheel odometry, or poses somebody corrected.

    Poses that the log declares corrected, as NEFF lines do, are the truth of its scans, too.
    """

    name = "CARMEN log"
    signature = re.compile(
        rb"^([FR]LASER \d+ |(ROBOT|RAW)LASER\d \d+ |ODOM( [-+.\de]+){7} |# message formats defined)",
        re.MULTILINE,
    )

    def _open(self, topic: str | None) -> None:
        self._parameters: dict[str, str] = {}
        self._wheel_poses = array("d")
        self._track: PoseTrack | None = None
        super()._open(topic)

    def _distinct(self, topics: set[str]) -> set[str]:
        """One laser's readings may be there as RAWLASERn and, with a pose, as ROBOTLASERn."""
        return topics - {topic.replace("ROBOT", "RAW") for topic in topics if topic.startswith("ROBOT")}

    def _learn(self, survey: Survey) -> None:
        super()._learn(survey)
        table = np.frombuffer(self._wheel_poses).reshape(-1, 4)
        self._track, self._wheel_poses = PoseTrack(table[:, 0], table[:, 1:]), array("d")
        mounting = survey.mounting.first
        if mounting is not None and survey.mounting.is_rigid():
            self.T_base_sensor = mounting.round(6) + 0.0  # no -0
            return
        if mounting is not None:
            self._remark(
                "One of the two poses in each line was corrected: odometry is the robot's, the second."
            )
        parameter, yaw = OFFSETS.get(str(self.topic), ("", 0.0))
        if parameter in self._parameters:
            self.T_base_sensor = np.array([float(self._parameters[parameter]), 0.0, yaw])
        else:
            self._remark(
                "The log does not say where the laser sits: taken at the robot's centre, facing forward."
            )

    def _base_pose(self, reading: Reading, stamp: float) -> Array | None:
        if reading.base_pose is None and self._track is not None:
            return self._track.at(stamp)
        return reading.base_pose

    def _scan(self, reading: Reading, stamp: float) -> Scan:
        scan = super()._scan(reading, stamp)
        return replace(scan, truth=scan.odometry) if self.is_corrected else scan

    def _parse(self, words: list[bytes]) -> Reading | None:
        kind = words[0].decode("ascii", "replace") if words else ""
        if kind in ("FLASER", "RLASER"):
            return _old_laser(kind, words)
        if _NEW.fullmatch(kind):
            return _new_laser(kind, words)
        if kind == "ODOM" and self._track is None:
            self._wheel_poses.extend((float(words[7]), *numbers(words[1:], 3)))
        elif kind == "PARAM" and words[1].decode(errors="replace") in (_FRONT[0], _REAR[0]):
            self._parameters[words[1].decode(errors="replace")] = words[2].decode(errors="replace")
        elif kind == "NEFF":
            self.is_corrected = True
            self._remark("GMapping wrote the log (NEFF lines): its poses are corrected, not wheel odometry.")
        elif kind.startswith("VERTEX"):
            self._remark(_OF_GRAPH)
        return None


def _old_laser(kind: str, words: list[bytes]) -> Reading:
    """Read FLASER n ranges, sensor x y th, robot x y th, ipc_time host logger_time; the sensor is a SICK."""
    number = int(words[1])
    rest = words[2 + number :]
    poses, stamps = numbers(rest, 6), (float(rest[6]), float(rest[8]))
    ranges = numbers(words[2:], number)
    return Reading(kind, ranges, None, SICK_RANGE, stamps, poses[:3], poses[3:])


def _new_laser(kind: str, words: list[bytes]) -> Reading:
    """Read ROBOTLASERn type start fov step max_range accuracy mode, n ranges, n remissions, ...

    ... sensor and robot pose, 2 speeds, 3 safety margins (not in RAWLASERn), ipc_time host logger_time.
    """
    _, start, _, step, max_range = numbers(words[1:], 5)
    number = int(words[8])
    ranges, rest = numbers(words[9:], number), words[9 + number :]
    remissions, rest = numbers(rest[1:], int(rest[0])), rest[1 + int(rest[0]) :]
    pose = base_pose = None
    if kind.startswith("ROBOT"):
        pose, base_pose, rest = numbers(rest, 3), numbers(rest[3:], 3), rest[11:]
    return Reading(
        kind,
        ranges,
        start + step * np.arange(number),
        max_range if max_range > 0 else SICK_RANGE,
        (float(rest[0]), float(rest[2])),
        pose,
        base_pose,
        remissions if len(remissions) == number else None,
    )
