"""What is in a recording, in a few lines."""

from array import array
from collections.abc import Iterator

import numpy as np

from lidarcore import Array
from lidarcore.recordings import Recording


def summarise(recording: Recording) -> Iterator[tuple[str, str]]:
    """Names and values, after reading all of it. Raises RecordingError if it cannot be read."""
    beams, stamps = array("l"), array("d")  # lists would take more than a file of tiny scans
    valid, shortest, longest, odometry = 0, np.inf, 0.0, 0
    first, last = np.inf, -np.inf
    for scan in recording:
        beams.append(len(scan))
        valid += int(scan.valid.sum())
        found = scan.ranges[scan.valid]
        shortest, longest = found.min(initial=shortest), found.max(initial=longest)
        first, last = scan.bearings.min(initial=first), scan.bearings.max(initial=last)
        stamps.append(scan.stamp)
        odometry += scan.odometry is not None
    yield "format", recording.name
    yield from (
        ("topic", topic + (" (read)" if topic == recording.topic else "")) for topic in recording.topics
    )
    yield "scans", str(len(beams))
    yield "duration", _duration(np.frombuffer(stamps))
    yield "beams per scan", f"{min(beams)} to {max(beams)}, median {np.median(beams):.0f}"
    yield "bearings", _sector(first, last)
    yield "returns", f"{100 * valid / sum(beams):.1f} %"
    yield "ranges", f"{shortest:.3f} to {longest:.3f} m" if valid else "none"
    yield "odometry", f"in {odometry} scans" if odometry else "none"
    if recording.mask:
        yield "robot's own body", f"masked in {len(recording.mask)} sectors"
    if recording.T_base_sensor is not None:
        x, y, yaw = recording.T_base_sensor
        yield "sensor on the robot", f"x {x:.3f} m, y {y:.3f} m, yaw {np.degrees(yaw):.1f} degrees"
    yield from (("note", note) for note in recording.notes)


def _sector(first: float, last: float) -> str:
    """From where to where, rad; from 0 on if all of it is below, as a sensor that turns clockwise has it."""
    turned = 360 if first < -np.pi and last <= 0 else 0
    return f"{np.degrees(first) + turned:z.1f} to {np.degrees(last) + turned:z.1f} degrees"


def _duration(stamps: Array) -> str:
    duration = float(stamps[-1] - stamps[0])
    if duration <= 0:
        return "unknown: the stamps do not grow"
    return f"{duration:.1f} s, {(len(stamps) - 1) / duration:.1f} scans per second"
