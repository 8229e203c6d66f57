"""Hex dumps of real RPLIDARs, against a decoder of legacy nodes that was written for this test alone."""

import gzip
import re
from itertools import pairwise

import numpy as np
import pytest

from lidarcore import open_recording
from lidarcore.errors import RecordingError

FOLDER = "rplidar_raw_serial_hex"
DUMPS = {  # revolutions that are whole
    "realterm_capture_1.txt": 1,
    "sample_data_2.txt": 1,
    "sample_data_motorctrl_1st_try.txt": 6,
    "sample_data_pyserial_1.txt.gz": 32,
    "sample_data_pyserial_3.txt": 6,
}


def nodes_of(path):
    """(N, 4) start flag, angle deg, distance mm, quality of every node from the first of 20 that look like nodes."""
    content = path.read_bytes()
    text = (gzip.decompress(content) if path.suffix == ".gz" else content).decode()
    text = re.sub("->.*", "", text).replace("0x", "")
    data = bytes.fromhex("".join(text.split()))

    def is_node(at):
        return len(data) >= at + 5 and (data[at] ^ data[at] >> 1) & 1 and data[at + 1] & 1

    at = next(i for i in range(len(data)) if all(is_node(i + 5 * k) for k in range(20)))
    nodes = []
    while at + 5 <= len(data):
        if is_node(at):
            a, b, c, d, e = data[at : at + 5]
            nodes.append((a & 1, ((b >> 1) + (c << 7)) / 64, (d + (e << 8)) / 4, a >> 2))
            at += 5
        else:
            at += 1
    return np.array(nodes)


def whole_turns(nodes):
    """Nodes from one start flag to the next, where no byte was lost: the angle turns once, by small steps."""
    for begin, end in pairwise(np.flatnonzero(nodes[:, 0])):
        steps = (np.diff(nodes[begin:end, 1]) + 180) % 360 - 180
        if np.abs(steps).max(initial=0) < 10 and abs(steps.sum() - 360) < 10:
            yield nodes[begin:end]


@pytest.mark.parametrize("name", DUMPS)
def test_a_dump_holds_the_revolutions_between_its_start_flags(data, name):
    scans = list(open_recording(data / FOLDER / name))
    assert len(scans) == DUMPS[name]
    turns = list(whole_turns(nodes_of(data / FOLDER / name)))
    assert len(turns) >= max(DUMPS[name] - 1, 1)
    decoded = {table(np.degrees(-scan.bearings), 1000 * scan.ranges, scan.quality) for scan in scans}
    assert {table(*turn[:, 1:].T) for turn in turns} <= decoded


def table(angles, distances, qualities):
    """Samples in units of the protocol, 1/64 degree and 1/4 mm, in an order that does not depend on ties."""
    rows = np.stack([64 * (angles % 360), 4 * np.nan_to_num(distances), qualities], -1)
    return tuple(sorted(map(tuple, np.rint(rows).astype(int).tolist())))


def test_a_dump_has_no_times(data):
    scans = list(open_recording(data / FOLDER / "sample_data_pyserial_1.txt.gz"))
    assert [scan.stamp for scan in scans] == pytest.approx(0.1 * np.arange(len(scans)))
    assert all(scan.beam_times is None for scan in scans)


def test_a_dump_without_measurements_is_refused(tmp_path):
    (tmp_path / "health.txt").write_text("A5 52\nA5 5A 03 00 00 00 06 00 00 00\n")
    with pytest.raises(RecordingError, match="no readable scan"):
        list(open_recording(tmp_path / "health.txt"))


def test_other_text_with_numbers_is_no_dump(tmp_path):
    (tmp_path / "numbers.txt").write_text("12 34 56 78\n" * 20)
    with pytest.raises(RecordingError, match="none of the known formats"):
        open_recording(tmp_path / "numbers.txt")
