"""Broken files of every format: read, or refused with a LidarError, in time and in little memory."""

import gzip
import random
import sqlite3
import time
import traceback
from collections.abc import Iterator
from contextlib import closing, suppress
from itertools import count
from pathlib import Path

import large_files
import numpy as np
from backports import zstd
from findings import Findings
from lidarcore_app.isolation import Isolated
from mcap.writer import CompressionType
from mutation import mutated
from PIL import Image
from reading import YAML, growth, read
from real_recordings import SHIPPED
from recorded_scans import demo
from ros_writers import drive, write_bag1, write_mcap
from scipy.io import savemat

from lidarcore import LidarError
from lidarcore.landmarks import Atlas, Landmark, export_map
from lidarcore.recordings import RecordingWriter

PATIENCE = 10.0  # s
MOST_MEMORY = 100_000_000  # bytes beside four times the size of the file
SMALL = 1 << 15  # bytes of a file that is made of repeated lines


def fuzz(folder: Path, seconds: float, findings: Findings) -> None:
    """Break files of all formats in turn for so long, all in one process as long as it lives."""
    sound = sorted(samples(folder / "sound"), key=lambda path: path.name)
    (folder / "broken").mkdir()
    for path in sound:  # compiled here, so that the time of nobody is taken for that
        read(path)
    end, number = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        with closing(Isolated("a file", LidarError, attempts, sound, findings.seed, number)) as reading:
            try:
                for number, problem in reading:
                    path = model(sound, number)
                    findings.tried["files"] += 1
                    if problem:
                        findings.add(
                            f"files {number}", path.name, problem, _broken(path, findings.seed, number)
                        )
                    if time.monotonic() > end:
                        return
            except LidarError as error:
                number += findings.tried["files"] > 0
                path = model(sound, number)
                findings.add(f"files {number}", path.name, error, _broken(path, findings.seed, number))
        number += 1


def attempts(sound: list[Path], seed: int, first: int) -> Iterator[tuple[int, str | None]]:
    """Numbers from the first on, and what was wrong with reading what that number makes."""
    for number in count(first):
        path = model(sound, number)
        broken = path.parents[1] / "broken" / path.name
        broken.write_bytes(_broken(path, seed, number))
        began = (
            time.process_time()
        )  # what a busy machine adds is not the file's doing; the process is killed later
        try:
            (grown,) = growth(broken)
        except Exception:  # a LidarError is none: growth takes it for what it is
            yield number, traceback.format_exc(limit=-3)
        else:
            took = time.process_time() - began
            is_much = grown > 4 * broken.stat().st_size + MOST_MEMORY or took > PATIENCE
            yield number, f"took {grown} bytes and {took:.0f} s" if is_much else None
        for left in broken.parent.iterdir():
            left.unlink()


def model(sound: list[Path], number: int) -> Path:
    """Which file is broken in that round."""
    return sound[number % len(sound)]


def _broken(path: Path, seed: int, number: int) -> bytes:
    return mutated(path.read_bytes(), random.Random(f"{seed} files {number}"))


def samples(folder: Path) -> list[Path]:
    """A sound file of each format."""
    folder.mkdir()
    for name in large_files.NAMES:
        large_files.make(folder, name, SMALL)
    drives = [(*message[:3], message[3] + 2 * lap) for lap in range(5) for message in drive()]
    for packing in ("bz2", "lz4", None):
        write_bag1(folder / f"{packing}.bag", drives, packing)
    for method in CompressionType:
        write_mcap(folder / f"{method.name}.mcap", drives, method)
    with RecordingWriter(folder / "own.mcap") as recording:
        for scan in demo(5):
            recording.write(scan)
    arrays = {"ranges": np.random.default_rng(0).uniform(1, 9, (20, 90)), "bearings": np.linspace(-3, 3, 90)}
    savemat(folder / "plain.mat", arrays)
    savemat(folder / "packed.mat", arrays, do_compression=True)
    np.savez_compressed(folder / "packed2.npz", **arrays)
    for real in SHIPPED.rglob("*.json"):
        (folder / real.name).write_bytes(real.read_bytes())
    carmen = (folder / "carmen.log").read_bytes()
    (folder / "carmen.log.gz").write_bytes(gzip.compress(carmen))
    (folder / "carmen.log.zstd").write_bytes(zstd.compress(carmen))
    _maps(folder)
    return [path for path in folder.iterdir() if path.is_file()]


def _maps(folder: Path) -> None:
    with Atlas(folder / "landmarks.db") as atlas:
        marks = (Landmark(x=i, y=2.0, var_x=1e-4, cov_xy=0.0, var_y=1e-4, kind="corner") for i in range(50))
        landmarks = atlas.begin("fuzz", 1e9, "slam", list(marks))
        for suffix in ("json", "geojson", "csv"):
            export_map(landmarks, folder / f"map_sound.{suffix}")
    with suppress(sqlite3.Error), closing(sqlite3.connect(folder / "landmarks.db")) as file:
        file.execute("PRAGMA journal_mode = DELETE")
    Image.new("L", (30, 20), 205).save(folder / "grid.png")
    Image.new("L", (30, 20), 205).save(folder / "grid.pgm", "ppm")
    (folder / "yaml_alone.yaml").write_text(YAML + "grid.pgm\n")
