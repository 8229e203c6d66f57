"""Messages of what is wrong with a file name the file and what to do, in plain words; not the insides of libraries."""

import gzip
import re
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lidarcore import Client, LidarError, open_recording
from lidarcore.evaluation.maps.accuracy import read_relations
from lidarcore.landmarks import Atlas, read_landmarks
from lidarcore.mapping.export import read_walls, write_map
from lidarcore.mapping.grid import OccupancyGrid, read_ros_map, write_ros_map
from lidarcore.mapping.walls import WallTable
from lidarcore.rplidar.connection.port import Port

INSIDES = re.compile(r"Errno|Error|zlib|gzip|codec|unicode|zip file|CRC|None|b'|ioctl|stream|\n")
GRID = OccupancyGrid(np.zeros((2, 2), np.int8), 0.05, np.zeros(3))
NO_WALLS = WallTable(
    *(np.empty(shape) for shape in (0, 0, 0, (0, 2, 2), (0, 2, 2), (0, 2), (0, 2), 0, 0, 0, 0, 0))
)
RELATIONS = b"1 2 0.1 0.2 0 0 0 0.3\n" * 500
YAML = "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def damaged(packed: bytes, at: int = 14) -> bytes:
    return packed[:at] + b"\xff" * 20 + packed[at + 20 :]


def npz(path: Path) -> Path:
    np.savez_compressed(path, ranges=np.arange(4000.0).reshape(40, 100), bearings=np.linspace(-3, 3, 100))
    return path


def relations(content: bytes) -> Callable[[Path], object]:
    return lambda folder: read_relations(written(folder / "hand.gz", content))


def written(path: Path, content: bytes | str) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def of_another_database(folder: Path) -> object:
    with sqlite3.connect(folder / "landmarks.db") as database:
        database.execute("CREATE TABLE other (id)")
    return open_recording(folder)


def of_damaged_npz(folder: Path) -> object:
    path = npz(folder / "room.npz")
    return list(open_recording(written(path, damaged(path.read_bytes(), 100))))


def of_half_an_npz(folder: Path) -> object:
    path = npz(folder / "room.npz")
    return open_recording(written(path, path.read_bytes()[:-100]))


def of_half_a_picture(folder: Path) -> object:
    path = folder / "map.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (90, 90)).astype(np.uint8)).save(path)
    written(path, path.read_bytes()[:4000])
    return read_ros_map(written(folder / "map.yaml", YAML.replace("pgm", "png")))


def of_text_in_latin_1(folder: Path) -> object:
    with written(folder / "hall.csv", "größe".encode("latin-1")).open(encoding="utf-8") as file:
        return list(read_landmarks(file, "csv"))


@pytest.mark.parametrize(
    ("use", "said"),
    [
        (
            lambda folder: open_recording(written(folder / "a.gz", damaged(gzip.compress(RELATIONS), 10))),
            "a.gz is damaged: nothing of it can be unpacked. Copy it anew.",
        ),
        (
            lambda folder: open_recording(folder / ("a" * 300)),
            "cannot be opened: File name too long.",
        ),
        (of_another_database, "landmarks.db is an SQLite database, but not a ROS 2 bag"),
        (lambda folder: Atlas(folder), "is a folder: give a file in it, such as /"),
        (lambda folder: Atlas(" "), "The name of the landmark map is empty: give a path"),
        (
            lambda folder: Atlas(written(folder / "a.db", b"no database" * 100)),
            "a.db cannot be used: it is no database, or damaged; give another file, or a copy that is whole.",
        ),
        *(
            (
                lambda folder, size=size: Atlas(written(folder / "a.db", b"x" * size)),
                "a.db cannot be used: it is no database, or damaged; give another file, or a copy that is whole.",
            )
            for size in (1, 2, 15, 100)
        ),
        (of_damaged_npz, "room.npz cannot be read as NumPy .npz: it is damaged or cut short, copy it anew."),
        (of_half_an_npz, "room.npz cannot be read as NumPy .npz: it is damaged or cut short, copy it anew."),
        (relations(damaged(gzip.compress(RELATIONS))), "hand.gz is not a file of relations: it is damaged"),
        (relations(gzip.compress(RELATIONS)[:-9]), "hand.gz is not a file of relations: it is damaged"),
        (relations(RELATIONS), "hand.gz is not a file of relations: it is damaged"),
        (
            relations(gzip.compress(b"\xff\xfe")),
            "hand.gz is not a file of relations: it is not text in UTF-8.",
        ),
        (
            lambda folder: read_ros_map(written(folder / "map.yaml", "image: [map.pgm\nnegate: {0\n")),
            "map.yaml is no valid YAML (line 2): mend it, or save the map anew.",
        ),
        (
            lambda folder: read_ros_map(written(folder / "map.yaml", b"\xff\xfe")),
            "map.yaml cannot be read: it is not text in UTF-8.",
        ),
        (
            lambda folder: read_ros_map(written(folder / "map.yaml", YAML)),
            "map.yaml names the image map.pgm, which is not there: put it beside it.",
        ),
        (of_half_a_picture, "map.png cannot be read: it is damaged or cut short, copy it anew."),
        (lambda folder: read_ros_map(folder), "is a folder: give the YAML file in it, such as /"),
        (
            lambda folder: read_walls(written(folder / "walls.csv", "id\n")),
            "walls.csv is a file: give the folder of the map, such as /",
        ),
        (
            lambda folder: write_map(written(folder / "hall", ""), GRID, NO_WALLS),
            "hall is a file: give the folder of the map, such as /",
        ),
        (
            lambda folder: write_ros_map(GRID, folder / "none" / "map.yaml"),
            "map.yaml cannot be written: No such file or directory.",
        ),
        (lambda folder: read_walls(folder), "walls.csv cannot be read: No such file or directory."),
        (of_text_in_latin_1, "it is not text in UTF-8"),
        (lambda folder: Port(str(folder), 256000), "cannot be used as a serial port (Is a directory)"),
        (lambda folder: Port("/dev/null", 256000), "/dev/null cannot be used as a serial port: "),
        (
            lambda folder: Client("http://127.0.0.1:9").corners(),
            "No server answers at http://127.0.0.1:9 (Connection refused): start",
        ),
    ],
)
def test_what_is_wrong_is_said_in_plain_words(
    use: Callable[[Path], object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(LidarError) as raised:
        use(tmp_path)
    message = str(raised.value)
    assert said in message
    assert not INSIDES.search(message), message
