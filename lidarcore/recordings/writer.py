"""Writes recordings: standard ROS 2 MCAP files, which Foxglove, Rerun and `ros2 bag` open."""

import struct
import time
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

from lidarcore.body_mask import Sector, as_text
from lidarcore.closing import Closing
from lidarcore.features import Features
from lidarcore.files.growing_file import GrowingFile
from lidarcore.recordings.pace import NOMINAL_PERIOD
from lidarcore.recordings.ros.mcap import MAGIC, MASK, METADATA, SENSOR
from lidarcore.recordings.ros.messages import typestore
from lidarcore.scan import Scan

FLUSH_EVERY = 0.5
"""s that a scan waits at most before it is in the file, as long as someone calls `write` or `flush`."""

CHUNK = 1 << 18
"""bytes of messages after which they are written in any case."""

ELLIPSE_SCALE = 10.0  # sigma

END = struct.pack("<BQI BQQQI", 15, 4, 0, 2, 20, 0, 0, 0) + MAGIC
"""of an MCAP file without an index (DataEnd, Footer): makes it whole after every flush, for any reader."""


class RecordingWriter(Closing):
    """A recording that grows scan by scan: `with RecordingWriter("room.mcap") as recording: recording.write(scan)`.

    Topics, all in the frame "laser" and with the stamp of the scan:
    /scan        sensor_msgs/LaserScan on evenly spaced bearings: no return is inf, data lost are NaN
    /scan/beams  lidarcore_msgs/Beams (see beams.py): exact bearings, times and gaps, for `open_recording`
    /odom, /tf   nav_msgs/Odometry and its transform, if scans have odometry
    /features    visualization_msgs/MarkerArray: walls, corners and their ellipses, if features are given
    The sensor's model and the mask of the robot's body are kept as metadata, and the ranges as they were measured.

    Times of recording follow the stamps, and go on by 0.1 s where the stamps do not grow. Whole scans are written
    together, twice a second: after `kill -9` or on a full disk the file is whole up to there, without an index.

    `scans` is the number of scans written.
    Raises RecordingError, here and in every method, if the file exists already or cannot be written; see GrowingFile.
    """

    def __init__(
        self, path: str | PathLike[str], *, sensor: str = "RPLIDAR S1", ellipse_scale: float = ELLIPSE_SCALE
    ) -> None:
        from mcap.writer import Writer  # here: takes as long to import as all the rest

        self.scans = 0
        self._file = GrowingFile(Path(path), END)
        self._mcap = Writer(self._file, chunk_size=1 << 30)  # type: ignore[arg-type]  # chunks end with a flush only
        self._mcap.start("ros2", f"lidarcore {version('lidarcore')}")
        self._mcap.add_metadata(METADATA, {SENSOR: sensor})
        self._ellipse_scale = ellipse_scale
        self._channels: dict[str, int] = {}
        self._mask: tuple[Sector, ...] = ()
        self._stamp = self._begin = self._now = 0.0
        self._pending, self._flushed = 0, time.monotonic()

    @property
    def size(self) -> int:
        """Bytes that are in the file."""
        return self._file.size

    @property
    def duration(self) -> float:
        """Seconds from the first scan to the last."""
        return self._now - self._begin

    def write(self, scan: Scan, features: Features | None = None, mask: tuple[Sector, ...] = ()) -> None:
        """Add a scan, and what was found in it. Raises RecordingError, also for a stamp beyond ROS 2.

        mask  of the robot's body; the one of the last scan is that of the recording
        """
        from lidarcore.recordings.ros.encoding import encoded

        self._file.check_open()
        made = encoded(scan, features, self._ellipse_scale)
        self._keep(mask)
        self._advance(scan.stamp)
        for topic, (type_, message) in made.items():
            self._add(topic, type_.replace("/", "/msg/"), message)
        self.scans += 1
        if self._pending >= CHUNK or time.monotonic() - self._flushed >= FLUSH_EVERY:
            self.flush()

    def flush(self) -> None:
        """Write what is pending. To be called at least once a second while no scans come."""
        if self._pending:
            self._mcap.flush()
        self._pending, self._flushed = 0, time.monotonic()

    def close(self) -> None:
        """Write the rest and the index. A recording without a scan is removed."""
        if self._file.closed:
            return
        try:
            if self.scans:
                self._mcap.finish()
                self._file.complete()
        finally:
            self._file.close()

    def _keep(self, mask: tuple[Sector, ...]) -> None:
        if mask != self._mask:
            self._mcap.add_metadata(METADATA, {MASK: as_text(mask)})
            self._mask = mask

    def _advance(self, stamp: float) -> None:
        """Set the time of recording: it steps with the stamps, and it always grows."""
        if not self.scans:
            self._begin = self._now = max(stamp, 0.0)
        else:
            step = stamp - self._stamp
            self._now += step if step > 0 else NOMINAL_PERIOD
        self._stamp = stamp

    def _add(self, topic: str, type_: str, message: Any) -> None:
        data = bytes(typestore("cdr").serialize_cdr(message, type_))
        now = round(self._now * 1e9)
        self._mcap.add_message(self._channel(topic, type_), now, data, now, self.scans)
        self._pending += len(data)

    def _channel(self, topic: str, type_: str) -> int:
        if topic not in self._channels:
            definition = typestore("cdr").generate_msgdef(type_, ros_version=2)[0]
            schema = self._mcap.register_schema(type_, "ros2msg", definition.encode())
            qos = {"offered_qos_profiles": ""}  # the profile asks for it; empty is the default
            self._channels[topic] = self._mcap.register_channel(topic, "cdr", schema, qos)
        return self._channels[topic]
