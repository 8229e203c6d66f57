"""Files of every format that make the most of each byte: many small things, each of which costs a reader memory."""

import io
import sqlite3
import struct
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import cache
from pathlib import Path

import numpy as np
from backports import zstd
from PIL import Image

from lidarcore import Scan
from lidarcore.recordings import RecordingWriter

MEBIBYTE = 1 << 20


def repeated(head: bytes, line: bytes, tail: bytes = b"") -> Callable[[int], Iterator[bytes]]:
    """Pieces of a file of about `size` bytes."""

    def pieces(size: int) -> Iterator[bytes]:
        yield head
        block = line * (MEBIBYTE // len(line))
        for _ in range(max(size // len(block), 1)):
            yield block
        yield tail

    return pieces


def counted(head: bytes, line: str) -> Callable[[int], Iterator[bytes]]:
    """The same of lines that all differ: {0} is their number."""

    def pieces(size: int) -> Iterator[bytes]:
        yield head
        number = 0
        while size > 0:
            block = "".join(line.format(number + i) for i in range(20_000)).encode()
            number, size = number + 20_000, size - len(block)
            yield block

    return pieces


CARMEN = b"# message formats defined: PARAM ODOM FLASER\n"
FLASER = b"FLASER 1 1 0 0 0 0 0 0 1 h 1\n"
GMAPPING = b"LASER_READING 1 1 0 0 0 1\n"
LEGO = b"S 1 101" + 101 * b" 9" + b"\n"
SLAMBOT = b"1 1 1" + 360 * b" 9" + b"\n"
CORESLAM = b"1 1 1 1" + 21 * b" 0" + b" " + 682 * b" 99" + b"\n"


@cache
def capture() -> bytes:
    """A second of an S1, as the driver writes it."""
    from recorded_scans import dense_stream

    head = b'{"rplidar_capture": 1, "answer_type": 133, "us_per_sample": 108.0, "baud": 256000}\n'
    records = (struct.pack("<cdI", b"<", 1e9 + t, len(data)) + data for data, t in dense_stream(10))
    return head + b"".join(records)


def capture_pieces(size: int) -> Iterator[bytes]:
    head, _, records = capture().partition(b"\n")
    yield from repeated(head + b"\n", records)(size)


def npz(dtype: str, compression: int) -> Callable[[int], Iterator[bytes]]:
    def pieces(size: int) -> Iterator[bytes]:
        ranges = (np.arange(size // np.dtype(dtype).itemsize) % 90 + 1).astype(dtype).reshape(-1, 64)
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", compression) as archive:
            for name, array in {"ranges": ranges, "bearings": np.linspace(0, 6, 64)}.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, array)
        yield stream.getvalue()

    return pieces


def mat(size: int) -> Iterator[bytes]:
    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    def matrix(name: bytes, kind: int, array: np.ndarray) -> bytes:
        shape = struct.pack("<ii", *array.shape)
        parts = ((6, struct.pack("<II", 6, 0)), (5, shape), (1, name), (kind, array.tobytes(order="F")))
        return element(14, b"".join(element(*part) for part in parts))

    yield b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    yield matrix(b"bearings", 9, np.linspace(0, 6, 64)[None])
    yield matrix(b"ranges", 2, (np.arange(size) % 90 + 1).astype(np.uint8).reshape(-1, 64))


def messages(path: Path, scans: int, beams: int) -> Path:
    with RecordingWriter(path) as recording:
        bearings = np.linspace(-3, 3, beams)
        for i in range(scans):
            recording.write(Scan(np.full(beams, 1.0 + i % 7), bearings, 1e9 + 0.1 * i, odometry=[i, 0, 0]))
    return path


def bag1(size: int) -> Iterator[bytes]:
    """Connections that nothing uses, each of another topic, and then zeros."""

    def record(op: bytes, data: bytes, **fields: bytes) -> bytes:
        parts = (name.encode() + b"=" + value for name, value in {"op": op, **fields}.items())
        head = b"".join(struct.pack("<I", len(part)) + part for part in parts)
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    yield b"#ROSBAG V2.0\n"
    number = 0
    kind = b"type=a/B"
    data = struct.pack("<I", len(kind)) + kind
    while size > 0:
        block = b"".join(
            record(b"\x07", data, topic=b"%d" % i, conn=struct.pack("<I", i))
            for i in range(number, number + 10_000)
        )
        number, size = number + 10_000, size - len(block)
        yield block


def mcap(size: int) -> Iterator[bytes]:
    """Channels that nothing uses."""

    def channel(i: int) -> bytes:
        topic = b"%d" % i
        body = struct.pack("<HHI", i % 65536, 1, len(topic)) + topic + struct.pack("<II", 0, 0)
        return struct.pack("<BQ", 4, len(body)) + body

    yield b"\x89MCAP0\r\n"
    number = 0
    while size > 0:
        block = b"".join(map(channel, range(number, number + 10_000)))
        number, size = number + 10_000, size - len(block)
        yield block


def mcap_chunks(size: int) -> Iterator[bytes]:
    """Chunks that unpack to nineteen times what they take."""
    yield b"\x89MCAP0\r\n"
    noise = np.random.default_rng(0).bytes(size // 2)
    packed = zstd.compress(noise + bytes(10 * size))
    body = struct.pack("<QQQI", 0, 0, len(noise) + 10 * size, 0) + struct.pack("<I", 4) + b"zstd"
    body += struct.pack("<Q", len(packed)) + packed
    yield struct.pack("<BQ", 6, len(body)) + body


def database(path: Path, size: int) -> Path:
    """A bag whose topics fill it."""
    with closing(sqlite3.connect(path)) as file, file:
        file.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        file.execute("CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        file.executemany("INSERT INTO topics VALUES (?, ?, 'a')", ((i, str(i)) for i in range(size // 18)))
    return path


LANDMARK = b'{"x":1,"y":1,"var_x":1,"cov_xy":0,"var_y":1,"kind":"c"}'
FEATURE = b'{"geometry":{"type":"Point","coordinates":[1,1]},"properties":{"var_x":1,"cov_xy":0,"var_y":1,"kind":"c"}}'
MAP_HEAD = b'{"format": "lidarcore landmarks", "version": 1, "unit": "m", "%s": ['


def ros_map(suffix: str, mode: str, pixels_per_byte: int) -> Callable[[int], Iterator[bytes]]:
    """An image of a map, as large as its file may be."""

    def pieces(size: int) -> Iterator[bytes]:
        side = int((size * pixels_per_byte) ** 0.5)
        stream = io.BytesIO()
        Image.new(mode, (side, side)).save(stream, suffix)
        yield stream.getvalue()

    return pieces


FILES: dict[str, Callable[[int], Iterator[bytes]]] = {
    "carmen.log": repeated(CARMEN, FLASER),
    "carmen_beams.log": repeated(CARMEN + FLASER, b"FLASER 100000" + 100_000 * b" 1" + b" 0 0 0 0 0 0 1 h 1\n"),
    "carmen_odometry.log": repeated(CARMEN + FLASER, b"ODOM 1 1 1 0 0 0 1\n"),
    "carmen_parameters.log": counted(CARMEN + FLASER, "PARAM {0} 1\n"),
    "carmen_topics.log": counted(CARMEN + FLASER, "RAWLASER{0} 0 0 1 1 1 0 0 0 0 1 h 1\n"),
    "gmapping.gfs": repeated(b"", GMAPPING),
    "lego.txt": repeated(LEGO, b"S 1 1 9\n"),
    "lego_encoders.txt": repeated(LEGO, b"M 1 1 0 0 0 1\n"),
    "lego_reference.txt": repeated(LEGO, b"P 1 1 1\n"),
    "slambot.log": repeated(b"", SLAMBOT),
    "coreslam.dat": repeated(b"", CORESLAM),
    "table.csv": repeated(b"t,r0,r1,r2\n", b"1,1,1,1\n"),
    "points.json": repeated(b'{"a": [[1,2],', b"[1,2],", b"[1,2]]}"),
    "many_sets.json": counted(b'{"a": [[1,2]]', ',"{0}":[[1,2]]'),
    "nested.json": repeated(b'{"a": [[1,2],', b"[],", b"[]]}"),
    "samples.csv": repeated(b"newscan,angle,distance\n", b"0,1,1\n"),
    "turns.csv": repeated(b"newscan,angle,distance\n", b"1,1,1\n"),
    "stations.csv": counted(b"station,rev,angle_deg,distance_mm\n", "{0},1,1,1\n"),
    "dump.txt": repeated(b"#RPLIDAR SCAN DATA\n", b"1 1 1\n"),
    "hex.txt": repeated(b"a5 5a 05 00 00 40 81 ", b"3e 02 01 10 02 "),
    "capture.rplidar": capture_pieces,
    "bytes.npz": npz("u1", zipfile.ZIP_STORED),
    "packed.npz": npz("f8", zipfile.ZIP_DEFLATED),
    "matrix.mat": mat,
    "connections.bag": bag1,
    "channels.mcap": mcap,
    "chunks.mcap": mcap_chunks,
    "map.json": repeated(MAP_HEAD % b"landmarks", LANDMARK + b",", LANDMARK + b"]}"),
    "map_nested.json": repeated(MAP_HEAD % b"landmarks" + b"[", b"[],", b"[]]]}"),
    "map.geojson": repeated(MAP_HEAD % b"features", FEATURE + b",", FEATURE + b"]}"),
    "map.csv": repeated(b"x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind\n", b"1,1,1,0,1,c\n"),
    "map.pgm": ros_map("ppm", "L", 1),
    "map.bmp": ros_map("bmp", "RGB", 1),
    "map.png": ros_map("png", "L", 1),
}  # fmt: skip


def make(folder: Path, name: str, size: int) -> Path:
    """The file of that name, of about `size` bytes."""
    path = folder / name
    if name == "topics.db3":
        return database(path, size)
    if name == "scans.mcap":
        return messages(path, size // 15_000, 1000)
    with path.open("wb") as file:
        file.writelines(FILES[name](size))
    return path


NAMES = (*FILES, "topics.db3", "scans.mcap")
