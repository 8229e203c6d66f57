"""Files made to harm: a RecordingError, soon, and in little memory."""

import bz2
import gzip
import io
import pickle
import re
import sqlite3
import struct
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from backports import zstd

from lidarcore.errors import RecordingError
from lidarcore.files.foreign_database import bound
from lidarcore.recordings import open_recording

MEBIBYTE = 1 << 20


class Flag:
    """Unpickling it would call print; nothing must."""

    def __reduce__(self):
        return (exec, ("raise SystemExit('a pickle ran')",))


def npy_header(shape, dtype="<f8", order=False):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": order, "shape": shape})
    return stream.getvalue()


def zipped(*members, compression=zipfile.ZIP_DEFLATED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return stream.getvalue()


def pickled_npz():
    header = npy_header((1,), "|O")
    return zipped(
        ("ranges.npy", header + pickle.dumps(Flag())), ("bearings.npy", npy_header((1,)) + bytes(8))
    )


def claiming_npz():
    return zipped(
        ("ranges.npy", npy_header((10**5, 10**5)) + bytes(80)), ("bearings.npy", npy_header((1,)) + bytes(8))
    )


def bomb_npz():
    numbers = 80 * MEBIBYTE
    return zipped(("ranges.npy", npy_header((numbers,), "|u1") + bytes(numbers)))


def claiming_zip():
    """The directory of the archive claims 3 GB for a member."""
    content = bytearray(zipped(("ranges.npy", npy_header((2,)) + bytes(16)), compression=zipfile.ZIP_STORED))
    directory = content.rfind(b"PK\x01\x02")
    content[directory + 20 : directory + 28] = struct.pack("<II", 3 << 30, 3 << 30)
    return bytes(content)


def mat_header():
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def mat_matrix(rows, columns, size):
    """The start of a double matrix `ranges`, its numbers missing."""
    flags = struct.pack("<IIII", 6, 8, 6, 0)
    dimensions = struct.pack("<IIii", 5, 8, rows, columns)
    name = struct.pack("<II8s", 1, 6, b"ranges")
    body = flags + dimensions + name + struct.pack("<II", 9, size)
    return struct.pack("<II", 14, len(body) + size) + body


def claiming_mat():
    return mat_header() + mat_matrix(40000, 12500, 4 * 10**9)


def lying_mat():
    """Few numbers by its shape, 4 GB by its length."""
    return mat_header() + mat_matrix(10, 10, 4 * 10**9)


def bomb_mat():
    compressor = zlib.compressobj()
    packed = compressor.compress(mat_matrix(1000, 80000, 640_000_000))
    packed += b"".join(compressor.compress(bytes(10_000_000)) for _ in range(64)) + compressor.flush()
    return mat_header() + struct.pack("<II", 15, len(packed)) + packed


def record(op, data, claim=None, **fields):
    header = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in {"op": op, **fields}.items()
    )
    return (
        struct.pack("<I", len(header))
        + header
        + struct.pack("<I", len(data) if claim is None else claim)
        + data
    )


BAG = b"#ROSBAG V2.0\n"


def claiming_bag_header():
    return BAG + struct.pack("<I", 0xFFFFFFF0) + bytes(1000)


def claiming_bag_record():
    return BAG + record(
        b"\x05", bytes(1000), 0xFFFFFFF0, compression=b"none", size=struct.pack("<I", 0xFFFFFFF0)
    )


def bomb_bag():
    chunk = bz2.compress(bytes(100 * MEBIBYTE))
    return BAG + 5 * record(b"\x05", chunk, compression=b"bz2", size=struct.pack("<I", 100 * MEBIBYTE))


MCAP = b"\x89MCAP0\r\n"


def mcap_chunk(packed, claim):
    body = (
        struct.pack("<QQQI", 0, 0, claim, 0)
        + struct.pack("<I", 4)
        + b"zstd"
        + struct.pack("<Q", len(packed))
        + packed
    )
    return struct.pack("<BQ", 6, len(body)) + body


def claiming_mcap():
    return MCAP + struct.pack("<BQ", 6, 10 * 10**9) + bytes(1000)


def bomb_mcap():
    return MCAP + 5 * mcap_chunk(zstd.compress(bytes(100 * MEBIBYTE)), 100 * MEBIBYTE)


CARMEN_HEAD = b"# message formats defined: PARAM ODOM FLASER\n"

HOSTILE = {
    "pickled.npz": (pickled_npz, "pickled objects"),
    "claiming.npz": (claiming_npz, "too large for the size of the file"),
    "bomb.npz": (bomb_npz, "too many for its own size"),
    "claiming.zip": (claiming_zip, "too many for its own size"),
    "claiming.mat": (claiming_mat, "cannot be read as MATLAB"),
    "lying.mat": (lying_mat, "cannot be read as MATLAB"),
    "bomb.mat": (bomb_mat, "too large for the size of the file"),
    "claiming_header.bag": (claiming_bag_header, "holds no readable sensor_msgs/LaserScan"),
    "claiming_record.bag": (claiming_bag_record, "holds no readable sensor_msgs/LaserScan"),
    "bomb.bag": (bomb_bag, "unpacks to more than"),
    "claiming.mcap": (claiming_mcap, "holds no readable sensor_msgs/LaserScan"),
    "bomb.mcap": (bomb_mcap, "unpacks to more than"),
    "zeros.gz": (lambda: gzip.compress(bytes(200 * MEBIBYTE)), "none of the known formats"),
    "zeros.zstd": (lambda: zstd.compress(bytes(200 * MEBIBYTE)), "none of the known formats"),
    "endless_line.log.gz": (
        lambda: gzip.compress(CARMEN_HEAD + bytes(200 * MEBIBYTE)),
        "line is longer than",
    ),
    "long_lines.log.gz": (
        lambda: gzip.compress(CARMEN_HEAD + (b" " * (MEBIBYTE // 2) + b"\n") * 400),
        "unpacks to more than",
    ),
    "deep.json": (lambda: b'{"dev1": [[1, ' + b"[" * 10**6, "cannot be read as JSON"),
    "many_beams.log": (lambda: CARMEN_HEAD + b"FLASER 4000000000 1 2 3\n", "1 damaged line left out"),
}


@pytest.mark.long
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_fast_and_in_little_memory(tmp_path, name):
    make, text = HOSTILE[name]
    path = tmp_path / name
    path.write_bytes(make())
    assert path.stat().st_size < 2 * MEBIBYTE
    before, begin = peak_memory(reset=True), time.process_time()
    with pytest.raises(RecordingError, match=text):
        list(open_recording(path))
    assert time.process_time() - begin < 10
    assert peak_memory() - before < 100 * MEBIBYTE


def peak_memory(reset=False):
    """Largest resident memory of this process in bytes, since the last reset (proc(5): clear_refs, VmHWM)."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])


COMPUTING = {
    "view": (
        "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
        "SELECT id, 1 AS topic_id, 0 AS timestamp, x'00' AS data FROM n",
    ),
    "virtual column": (
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data BLOB AS (zeroblob(990000000)))",
        "INSERT INTO messages (topic_id, timestamp) VALUES (1, 1), (1, 2), (1, 3), (1, 4), (1, 5)",
    ),
    "stored column": (
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp AS (topic_id) STORED, data)",
        "INSERT INTO messages (topic_id, data) VALUES (1, x'00')",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", COMPUTING)
def test_a_database_that_computes_what_it_should_hold_is_not_run(tmp_path, what):
    path = tmp_path / "computing.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        database.execute("INSERT INTO topics VALUES (1, '/scan', 'sensor_msgs/msg/LaserScan')")
        for statement in COMPUTING[what]:
            database.execute(statement)
    before, begin = peak_memory(reset=True), time.process_time()
    with pytest.raises(RecordingError, match="lacks the tables"):
        open_recording(path)
    assert time.process_time() - begin < 2
    assert peak_memory() - before < 100 * MEBIBYTE


def test_a_query_that_computes_instead_of_reading_is_ended():
    """The second line of defence, for what a schema may do that is not known yet."""
    with sqlite3.connect(":memory:") as database:
        bound(database, size=1000)
        endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT count(*) FROM n"
        with pytest.raises(sqlite3.OperationalError, match="interrupted"):
            database.execute(endless)
        with pytest.raises(sqlite3.DataError, match="too big"):
            database.execute("SELECT zeroblob(990000000)")
