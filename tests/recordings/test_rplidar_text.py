import gzip
import math

import numpy as np
import pytest

from lidarcore.errors import RecordingError
from lidarcore.recordings import open_recording

ROOMS = "rplidar_csv_rooms"


def table(path):
    """Rows of a CSV, read by numpy."""
    return np.genfromtxt(gzip.decompress(path.read_bytes()).decode().splitlines(), delimiter=",", names=True)


def assert_is_turned(scan, angles, distances, quality=None):
    """The scan has exactly these samples, clockwise degrees and mm, as counter-clockwise radians and m."""
    found = sorted(zip(-np.degrees(scan.bearings) % 360, np.nan_to_num(scan.ranges) * 1000, strict=True))
    expected = sorted(zip(angles % 360, distances, strict=True))
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert (np.abs(scan.bearings) <= math.pi).all()
    if quality is not None:
        np.testing.assert_array_equal(sorted(scan.quality), sorted(quality))


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "revolutions"), [("nut_room", 1498), ("nut_behind_obj", 361), ("golf_room", 947)]
)
def test_csv_revolutions_are_those_of_the_flags(data, name, revolutions):
    """The first one of each file was cut by the start of the recording: its sweep is below 200 degrees."""
    rows = table(data / ROOMS / f"{name}.csv.gz")
    starts = np.flatnonzero(rows["newscan"] == 1)
    parts = np.split(rows, starts[1:])
    assert len(parts) == revolutions
    recording = open_recording(data / ROOMS / f"{name}.csv.gz")
    scans = list(recording)
    assert len(scans) == revolutions - 1
    assert "1 partial revolution at the start or end left out." in recording.notes
    for scan, part in zip(scans, parts[1:], strict=True):
        quality = part["quality"] if "quality" in part.dtype.names else None
        assert (scan.quality is None) == (quality is None)
        assert_is_turned(scan, part["angle"], part["distance"], quality)


@pytest.mark.long
def test_revolutions_at_stations_are_told_apart(data):
    rows = table(data / ROOMS / "mapping_keng.csv.gz")
    keys = rows["station"] * 1000 + rows["rev"]
    parts = np.split(rows, np.flatnonzero(np.diff(keys)) + 1)
    scans = list(open_recording(data / ROOMS / "mapping_keng.csv.gz"))
    assert len(scans) == len(parts) == 12 * 401
    for scan, part in list(zip(scans, parts, strict=True))[::50]:
        assert_is_turned(scan, part["angle_deg"], part["distance_mm"])


def test_a_static_room_repeats_itself(data):
    """Median spread of a range per 2 degrees over nut_room is 11 mm; a wrong revolution would tear it."""
    bins = [[] for _ in range(180)]
    for scan in open_recording(data / ROOMS / "nut_room.csv.gz"):
        for index, range_ in zip(
            (np.degrees(scan.bearings) % 360 // 2).astype(int), scan.ranges, strict=True
        ):
            bins[index].append(range_)
    spreads = [np.nanstd(ranges) for ranges in bins if len(ranges) > 1000]
    assert len(spreads) > 100
    assert np.median(spreads) == pytest.approx(0.011, abs=0.003)


def csv(tmp_path, *rows, header="newscan,angle,distance"):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([header, *rows, ""]))
    return path


def test_clockwise_is_turned_to_counter_clockwise(tmp_path):
    """A wall on the right: at 90 degrees clockwise. In the sensor frame, y left, it lies at negative y."""
    (scan,) = open_recording(csv(tmp_path, "1,0,1000", "0,90,2000", "0,180,3000", "0,270,4000"))
    points = {tuple(np.round(xy, 9) + 0.0) for xy in scan.xy}
    assert points == {(1, 0), (0, -2), (-3, 0), (0, 4)}
    assert (np.diff(np.unwrap(scan.bearings)) > 0).all()


def test_a_revolution_may_wrap_inside(tmp_path):
    angles = (np.arange(350, 350 + 360, 5)) % 360
    rows = [f"{int(index == 0)},{angle},{1000 + angle}" for index, angle in enumerate(angles)]
    first, second = open_recording(csv(tmp_path, *rows, *rows))
    for scan in (first, second):
        assert_is_turned(scan, angles.astype(float), 1000.0 + angles)
        assert np.sum(np.diff(scan.bearings) < 0) <= 1


def test_partial_revolutions_at_both_ends_are_left_out(tmp_path):
    whole = [f"{int(angle == 0)},{angle},1000" for angle in range(0, 360, 5)]
    before = [f"0,{angle},2000" for angle in range(200, 360, 5)]
    after = [f"{int(angle == 0)},{angle},3000" for angle in range(0, 90, 5)]
    recording = open_recording(csv(tmp_path, *before, *whole, *whole, *after))
    assert [set(scan.ranges) for scan in recording] == [{1.0}, {1.0}]
    assert "2 partial revolutions at the start or end left out." in recording.notes


def test_damaged_rows_and_angles_are_left_out_and_counted(tmp_path):
    rows = [
        "1,0,1000",
        "0,1",
        "0,ten,1000",
        "0,nan,1000",
        "0,500,1000",
        "",
        "0,90,inf",
        "0,100,0",
        "0,101,-3",
    ]
    recording = open_recording(csv(tmp_path, *rows))
    (scan,) = recording
    assert len(scan) == 4
    assert list(scan.ranges[scan.valid]) == [1.0]
    assert "2 damaged lines left out." in recording.notes
    assert "2 samples with an angle outside 0..360 degrees left out." in recording.notes


def test_a_header_alone_is_no_recording(tmp_path):
    with pytest.raises(RecordingError, match="no readable scan"):
        list(open_recording(csv(tmp_path)))


def test_a_saved_scan_of_frame_grabber_is_read(data):
    path = data / "rplidar_raw_serial_hex/frame_grabber_Data.txt"
    rows = np.loadtxt(path, comments="#")
    recording = open_recording(path)
    (scan,) = recording
    assert_is_turned(scan, rows[:, 0], rows[:, 1], rows[:, 2])
    assert "The headers announce 201 samples, 193 are there." in recording.notes


def test_saved_scans_in_a_row_are_told_apart(data, tmp_path):
    text = (data / "rplidar_raw_serial_hex/frame_grabber_Data.txt").read_text()
    (tmp_path / "three.txt").write_text(text.replace("201", "193") * 3)
    recording = open_recording(tmp_path / "three.txt")
    assert [len(scan) for scan in recording] == [193] * 3
    assert not any("announce" in note for note in recording.notes)


def test_the_print_out_of_ultra_simple_is_read(tmp_path):
    """Sorted by angle as the tool does, the mark S of a revolution may stand at its end."""
    rows = [
        f"   theta: {angle:03.2f} Dist: {1000 + angle:08.2f} Q: 47 " for angle in np.arange(0.3, 359, 0.9)
    ]
    begun_after, begun_before = (
        ["S  theta: 0.02 Dist: 01500.00 Q: 47 "],
        ["S  theta: 359.80 Dist: 01500.00 Q: 0 "],
    )
    text = [
        "Ultra simple LIDAR data grabber for SLAMTEC LIDAR.",
        "Version: 2.1.0",
        "SLAMTEC LIDAR S/N: DCAA9AF2",
    ]
    text += [*begun_after, *rows, *rows, *begun_before, *begun_after, *rows]
    (tmp_path / "out.txt").write_text("\n".join([*text, ""]))
    scans = list(open_recording(tmp_path / "out.txt"))
    assert [len(scan) for scan in scans] == [len(rows) + 1] * 3
    assert_is_turned(scans[1], np.append(np.arange(0.3, 359, 0.9), 359.8).round(2), scans_mm(scans[1]))


def scans_mm(scan):
    """Distances in the order of clockwise angles."""
    return scan.ranges[np.argsort(-scan.bearings % (2 * math.pi))] * 1000
