"""A reader of ROS maps that shares nothing with ours: plain text and bytes, the rules of Nav2's map_io."""

from pathlib import Path

import numpy as np


def entries(path: Path) -> dict[str, str]:
    """What a YAML of one line for each entry says."""
    lines = (line.split(":", 1) for line in path.read_text().splitlines() if line.strip())
    return {key.strip(): value.strip() for key, value in lines}


def read_nav2(path: Path) -> tuple[np.ndarray, float, list[float]]:
    """Cells as nav_msgs/OccupancyGrid has them (-1, 0, 100; the first row at the bottom), resolution and origin."""
    said = entries(path)
    assert said["mode"] == "trinary"
    raw = (path.parent / said["image"]).read_bytes()
    magic, width, height, most = raw.split(maxsplit=4)[:4]
    assert magic == b"P5"
    assert most == b"255"
    header = len(raw) - int(width) * int(height)
    grey = np.frombuffer(raw[header:], np.uint8).reshape(int(height), int(width)).astype(float)
    brightness = grey / 255
    occupancy = brightness if int(said["negate"]) else 1 - brightness
    cells = np.full(grey.shape, -1)
    cells[occupancy < float(said["free_thresh"])] = 0
    cells[occupancy > float(said["occupied_thresh"])] = 100
    origin = [float(number) for number in said["origin"].strip("[]").split(",")]
    return cells[::-1], float(said["resolution"]), origin
