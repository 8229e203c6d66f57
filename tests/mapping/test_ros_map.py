"""ROS maps: written as Nav2 reads them, read as Nav2 does, and refused where they make no sense."""

import errno
import gzip
import os
import resource
import shutil
from pathlib import Path

import numpy as np
import pytest
from nav2_reader import read_nav2
from PIL import Image

from lidarcore.errors import GridError, MapFileError
from lidarcore.mapping.grid import OccupancyGrid, read_ros_map, write_ros_map

HEADER = "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def small_grid() -> OccupancyGrid:
    cells = np.random.default_rng(1).choice([-1, 0, 100], (7, 11))
    return OccupancyGrid(cells, 0.05, np.array([-1.25, 3.4, 0.3]))


def written(folder: Path, pixels: np.ndarray, yaml: str = HEADER) -> Path:
    (folder / "map.yaml").write_text(yaml)
    height, width = pixels.shape
    (folder / "map.pgm").write_bytes(
        b"P5\n%d %d\n255\n" % (width, height) + pixels.astype(np.uint8).tobytes()
    )
    return folder / "map.yaml"


def test_an_independent_reader_finds_what_was_written(tmp_path):
    grid = small_grid()
    write_ros_map(grid, tmp_path / "floor.yaml")
    cells, resolution, origin = read_nav2(tmp_path / "floor.yaml")
    np.testing.assert_array_equal(cells, grid.cells)
    assert resolution == grid.resolution
    assert origin == pytest.approx(grid.origin.tolist())


def test_reading_gives_back_what_was_written(tmp_path):
    grid = small_grid()
    write_ros_map(grid, tmp_path / "floor.yaml")
    read = read_ros_map(tmp_path / "floor.yaml")
    np.testing.assert_array_equal(read.cells, grid.cells)
    np.testing.assert_allclose(read.origin, grid.origin)


@pytest.mark.real_data
def test_a_map_that_slam_toolbox_saved(tmp_path, data):
    folder = data / "turtlebot4_rplidar_rosbag2"
    image = gzip.decompress((folder / "mac_1st_floor_final.pgm.gz").read_bytes())
    (tmp_path / "mac_1st_floor_final.pgm").write_bytes(image)
    shutil.copyfile(folder / "mac_1st_floor_final.yaml", tmp_path / "floor.yaml")
    grid = read_ros_map(tmp_path / "floor.yaml")
    pixels = np.frombuffer(image[-903 * 1706 :], np.uint8)
    assert grid.cells.shape == (1706, 903)
    assert (grid.cells == 100).sum() == (pixels == 0).sum()
    assert (grid.cells == 0).sum() == (pixels == 254).sum()
    assert (grid.cells == -1).sum() == (pixels == 205).sum()  # which its own free_thresh would call free
    write_ros_map(grid, tmp_path / "again.yaml")
    assert (tmp_path / "again.pgm").read_bytes() == image


def test_thresholds_and_negate_are_followed(tmp_path):
    pixels = np.array([[0, 60, 100, 150, 210, 255]])
    assert read_ros_map(written(tmp_path, pixels)).cells.tolist() == [[100, 100, -1, -1, 0, 0]]
    negated = written(tmp_path, pixels, HEADER.replace("negate: 0", "negate: true"))
    assert read_ros_map(negated).cells.tolist() == [[0, -1, -1, -1, 100, 100]]


def test_the_first_row_of_an_image_is_the_top(tmp_path):
    grid = read_ros_map(written(tmp_path, np.array([[0, 254], [254, 254]])))
    assert grid.at(np.array([[0.02, 0.07], [0.02, 0.02], [0.07, 0.07], [5, 5]])).tolist() == [100, 0, 0, -1]


def test_scale_mode_keeps_percentages_and_what_is_transparent_is_unknown(tmp_path):
    text = HEADER.replace("map.pgm", "map.png") + "mode: scale\n"
    (tmp_path / "map.yaml").write_text(text)
    occupancy = np.array([0.0, 0.3, 0.5, 0.9])
    grey = np.rint((1 - occupancy) * 255).astype(np.uint8)
    pixels = np.stack([grey, grey, grey, np.array([255, 255, 255, 255], np.uint8)], -1)
    pixels = np.concatenate([pixels, [[10, 10, 10, 254]]]).astype(np.uint8)[None]
    Image.fromarray(pixels, "RGBA").save(tmp_path / "map.png")
    actual = 1 - grey / 255.0
    between = np.rint((actual - 0.196) / (0.65 - 0.196) * 100)
    assert read_ros_map(tmp_path / "map.yaml").cells.tolist() == [[0, between[1], between[2], 100, -1]]


def test_raw_mode_keeps_the_values(tmp_path):
    path = written(tmp_path, np.array([[0, 37, 100, 101, 255]]), HEADER + "mode: raw\n")
    assert read_ros_map(path).cells.tolist() == [[0, 37, 100, -1, -1]]


def test_plain_and_deep_images(tmp_path):
    path = written(tmp_path, np.array([[0, 254]]))
    (tmp_path / "map.pgm").write_text("P2\n# by hand\n2 1\n255\n0 254\n")
    assert read_ros_map(path).cells.tolist() == [[100, 0]]
    (tmp_path / "map.pgm").write_bytes(b"P5\n#deep\n2 1\n65535\n\x00\x00\xff\xff")
    assert read_ros_map(path).cells.tolist() == [[100, 0]]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t: t.replace("map.pgm", "../outside.pgm"), "outside"),
        (lambda t: t.replace("map.pgm", "/etc/passwd"), "outside"),
        (lambda t: t.replace("map.pgm", "missing.pgm"), "missing"),
        (lambda t: t.replace("resolution: 0.05", "resolution: -1"), "resolution"),
        (lambda t: t.replace("resolution: 0.05", "resolution: .nan"), "resolution"),
        (lambda t: t.replace("[0, 0, 0]", "[0, 0]"), "origin"),
        (lambda t: t.replace("negate: 0\n", ""), "negate"),
        (lambda t: t.replace("0.196", "0.7"), "free_thresh"),
        (lambda t: t + "mode: fancy\n", "mode"),
        (lambda t: "[", "YAML"),
        (lambda t: "just words", "entries"),
        (lambda t: t + "x: " + "y" * 200_000, "too long"),
        (lambda t: "a: &a [x,x]\nb: &b [*a,*a]\n" + t.replace("image: map.pgm", "image: *b"), "image"),
    ],
)
def test_yaml_that_makes_no_sense_is_refused(tmp_path, change, word):
    (tmp_path / "outside.pgm").write_bytes(b"P5\n1 1\n255\n0")
    folder = tmp_path / "maps"
    folder.mkdir()
    path = written(folder, np.zeros((2, 3)), change(HEADER))
    with pytest.raises(MapFileError, match=word):
        read_ros_map(path)


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    path = written(folder, np.zeros((2, 3)))
    (folder / "map.pgm").rename(tmp_path / "map.pgm")
    (folder / "map.pgm").symlink_to(tmp_path / "map.pgm")
    with pytest.raises(MapFileError, match="outside"):
        read_ros_map(path)


@pytest.mark.parametrize(
    "image",
    [
        b"P5\n3 2\n255\n12345",  # too short
        b"P5\n3 2\n255\n1234567",  # too long
        b"P5\n40000 40000\n255\n1",  # 1.6 x 10^9 pixels
        b"P5\n0 2\n255\n",
        b"P5\n3",
        b"P2\n3 2\n255\n1 2 3",
        b"GIF89a",
        b"",
    ],
)
def test_images_that_are_not_what_they_say_are_refused(tmp_path, image):
    path = written(tmp_path, np.zeros((2, 3)))
    (tmp_path / "map.pgm").write_bytes(image)
    with pytest.raises(MapFileError):
        read_ros_map(path)


def test_a_grid_of_a_thousand_million_cells_is_refused_before_memory_is_taken():
    with pytest.raises(GridError, match="cells"):
        OccupancyGrid(np.broadcast_to(np.int8(0), (40_000, 40_000)), 0.05, np.zeros(3))


def test_a_full_disk_leaves_what_was_there(tmp_path):
    path = tmp_path / "floor.yaml"
    write_ros_map(small_grid(), path)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    large = OccupancyGrid(np.zeros((1000, 1000)), 0.05, np.zeros(3))
    child = os.fork()
    if child == 0:  # a limit of the size of files is what a full disk looks like, and cannot be taken back
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
        try:
            write_ros_map(large, path)
        except MapFileError as error:
            os._exit(0 if os.strerror(errno.EFBIG) in str(error) else 2)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_the_suffix_says_what_it_is(tmp_path):
    with pytest.raises(MapFileError, match="yaml"):
        write_ros_map(small_grid(), tmp_path / "floor.png")
