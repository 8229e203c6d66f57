import math

import numpy as np
import pytest
from lidarcore_app.sources.library import BUILTIN
from scipy.io import loadmat, savemat

from lidarcore.errors import RecordingError
from lidarcore.recordings import open_recording

BEARINGS = np.linspace(-2, 2, 5)
RANGES = np.arange(1.0, 16.0).reshape(3, 5)


@pytest.fixture(params=["npz", "packed npz", "mat", "packed mat"])
def saved(request, tmp_path):
    """A function that saves named arrays, in each format."""
    packed, kind = request.param.startswith("packed"), request.param.split()[-1]

    def save(**arrays):
        path = tmp_path / f"a.{kind}"
        if kind == "mat":
            savemat(path, arrays, do_compression=packed)
        else:
            (np.savez_compressed if packed else np.savez)(path, **arrays)
        return path

    return save


@pytest.mark.parametrize(("name", "scans", "zeros"), [("scans_a", 522, 0.165), ("scans_b", 393, 0.073)])
def test_matlab_scans_are_those_that_scipy_reads(shipped, name, scans, zeros):
    path = shipped / f"windsor_rplidar_mat/{name}.mat"
    truth = loadmat(path)
    assert truth["ranges"].shape == (scans, 420)
    assert np.mean(truth["ranges"] == 0) == pytest.approx(zeros, abs=0.001)
    for scan, ranges in zip(open_recording(path), truth["ranges"], strict=True):
        np.testing.assert_array_equal(scan.ranges, np.where(ranges == 0, np.nan, ranges))
        np.testing.assert_array_equal(scan.bearings, truth["angles"][0])


def test_the_demo_of_a_real_sensor_is_a_piece_of_its_recording(shipped):
    demo = next(path for path in BUILTIN if path.suffix == ".npz")
    piece = list(open_recording(shipped / "windsor_rplidar_mat/scans_a.mat"))[100:300]
    for scan, original in zip(open_recording(demo), piece, strict=True):
        np.testing.assert_allclose(scan.ranges, original.ranges, rtol=1e-7)
        np.testing.assert_array_equal(scan.bearings, original.bearings)
    assert "Sooraj Sunil" in (demo.parent / "LICENSE-windsor.txt").read_text()


def test_all_columns_arrive(saved):
    poses = np.array([[0, 0, 0], [1, 2, 0.1], [2, 3, 0.2]])
    path = saved(
        ranges=RANGES, bearings=BEARINGS, stamps=np.array([5.0, 5.5, 6.0]), quality=RANGES * 2,
        beam_times=BEARINGS + 2, odometry=poses, truth=poses + 1, comment=np.arange(3),
    )  # fmt: skip
    for index, scan in enumerate(open_recording(path)):
        np.testing.assert_array_equal(scan.ranges, RANGES[index])
        np.testing.assert_array_equal(scan.bearings, BEARINGS)
        np.testing.assert_array_equal(scan.quality, RANGES[index] * 2)
        np.testing.assert_array_equal(scan.beam_times, BEARINGS + 2)
        np.testing.assert_array_equal(scan.odometry, poses[index])
        np.testing.assert_array_equal(scan.truth, poses[index] + 1)
        assert scan.stamp == [5.0, 5.5, 6.0][index]


def test_scans_without_stamps_come_as_far_apart_as_a_robot_of_a_metre_a_second_needs(saved):
    poses = np.array([[0, 0, 0], [0.7, 0, 0], [1.4, 0, 0]])
    recording = open_recording(saved(ranges=RANGES, bearings=BEARINGS, odometry=poses))
    assert [scan.stamp for scan in recording] == pytest.approx([0.0, 0.7, 1.4])
    assert "There are no stamps: scans are taken to be 0.7 s apart." in recording.notes
    without = open_recording(saved(ranges=RANGES, bearings=BEARINGS))
    assert [scan.stamp for scan in without] == pytest.approx([0.0, 0.1, 0.2])


def test_one_scan_may_be_a_vector(saved):
    (scan,) = open_recording(saved(ranges=RANGES[0], angles=BEARINGS))
    np.testing.assert_array_equal(scan.ranges, RANGES[0])
    assert scan.stamp == 0


@pytest.mark.parametrize("dtype", ["f4", "i4", "u2", ">f8"])
def test_numbers_of_any_kind_will_do(saved, dtype):
    scans = list(open_recording(saved(ranges=np.asfortranarray(RANGES.astype(dtype)), bearings=BEARINGS)))
    np.testing.assert_array_equal([scan.ranges for scan in scans], RANGES)


def test_markers_for_no_return_are_missing(saved):
    ranges = np.array([[0.0, math.inf, math.nan, -1.0, 2.0]])
    (scan,) = open_recording(saved(ranges=ranges, bearings=BEARINGS))
    assert list(scan.valid) == [False, False, False, False, True]


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({"distances": RANGES, "bearings": BEARINGS}, "has no ranges: expected are ranges"),
        ({"ranges": RANGES}, "has no bearings: expected are ranges"),
        ({"ranges": RANGES[None], "bearings": BEARINGS}, r"ranges of shape \(1, 3, 5\): expected are ranges"),
        ({"ranges": RANGES.T, "bearings": BEARINGS}, r"bearings of shape .*5.* and ranges of \(5, 3\)"),
        ({"ranges": RANGES, "bearings": np.linspace(0, 359, 5)}, "from 0 to 359: expected are radians"),
        ({"ranges": RANGES * 1000, "bearings": BEARINGS}, "median range of 8000: expected are metres"),
        ({"ranges": RANGES, "bearings": BEARINGS * math.nan}, "expected are radians"),
        ({"ranges": RANGES, "bearings": BEARINGS, "stamps": np.arange(7)}, "stamps of shape"),
        ({"ranges": RANGES, "bearings": BEARINGS, "odometry": np.zeros((2, 3))}, "odometry of shape"),
        ({"ranges": RANGES + 1j, "bearings": BEARINGS}, "real numbers"),
        ({"ranges": np.array(["far", "near"]), "bearings": BEARINGS}, "real numbers"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_with_what_was_expected(saved, arrays, text):
    with pytest.raises(RecordingError, match=text):
        list(open_recording(saved(**arrays)))


def test_matlab_7_3_files_are_refused_with_advice(tmp_path):
    (tmp_path / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(400))
    with pytest.raises(RecordingError, match="save -v7"):
        open_recording(tmp_path / "new.mat")
