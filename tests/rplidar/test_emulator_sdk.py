"""Software nobody here wrote reads the emulator, and our decoder reads the same bytes: they have to agree.

Slamtec's SDK (as pyrplidarsdk) for dense capsules, rplidar-roboticia for legacy nodes.
"""

import json
import os
import select
import subprocess
import sys
import threading
import tty
from contextlib import contextmanager
from pathlib import Path

import capsule_streams as cs
import numpy as np
import pytest
import rplidar
import serial

from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.rplidar.protocol import Answer, StreamDecoder

REVOLUTIONS = 42
DENSE, LEGACY = bytes.fromhex("a55a5400004085"), bytes.fromhex("a55a0500004081")


@contextmanager
def overheard(port):
    """A port that leads to the one given, and all bytes that came through it from the sensor."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    heard, ended = bytearray(), threading.Event()
    with serial.Serial(port, 256000, timeout=0, exclusive=True) as sensor:

        def carry():
            while not ended.is_set():
                ready, _, _ = select.select([ours, sensor], [], [], 0.1)
                if ours in ready:
                    sensor.write(os.read(ours, 4096))
                if sensor in ready:
                    data = sensor.read(65536)
                    heard.extend(data)
                    os.write(ours, data)

        thread = threading.Thread(target=carry)
        thread.start()
        try:
            yield os.ttyname(theirs), heard
        finally:
            ended.set()
            thread.join()
            os.close(ours)
            os.close(theirs)


def decoded(heard, descriptor, answer, us_per_sample):
    """Our revolutions of the last scan in what was heard."""
    stream = bytes(heard).rpartition(descriptor)[2]
    return StreamDecoder(answer, us_per_sample).feed(stream, 0.0)


def returns(revolutions):
    """Angles (1/16384 of a right angle) and distances (1/4 mm) of all samples that returned, one after the other."""
    z = np.concatenate([cs.z_q14(revolution) for revolution in revolutions])
    distances = np.concatenate([revolution.distances for revolution in revolutions])
    return np.stack([z, distances], -1)[distances > 0]


def find(rows, there, begin):
    """Where these rows are in others, one after the other, from `begin` on."""
    for at in np.flatnonzero((there[begin:] == rows[0]).all(axis=1)) + begin:
        if np.array_equal(there[at : at + len(rows)], rows):
            return at
    return None


@pytest.mark.long
def test_slamtecs_sdk_and_our_decoder_agree_node_for_node(tmp_path):
    with EmulatorProcess(moving=True, people=3) as emulator, overheard(emulator.port) as (port, heard):
        client = [sys.executable, Path(__file__).with_name("slamtec_client.py"), port]
        said = subprocess.run(
            [*client, str(REVOLUTIONS), tmp_path / "sdk.npz"], capture_output=True, text=True, timeout=60
        )
        assert said.returncode == 0, said.stderr
    assert json.loads(said.stdout.splitlines()[-1]) == [0x61, 1 << 8 | 28, 18, 0]
    ours = returns(decoded(heard, DENSE, Answer.DENSE, 108.0))
    with np.load(tmp_path / "sdk.npz") as file:
        scans = list(file.values())
    assert len(scans) == REVOLUTIONS
    # It begins a revolution with the last sample before the front, we with the first one behind it: its very first
    # one belongs to a turn that we leave out.
    scans[0] = scans[0][:, 1:]
    end, nodes = 0, 0
    for angles, ranges, quality in scans:
        theirs = np.stack([np.degrees(angles) / 90 * 16384, ranges * 4000], -1)
        assert np.abs(theirs - np.rint(theirs)).max() < 0.01  # they are whole numbers, as sent
        at = find(np.rint(theirs).astype(int), ours, end)
        assert at is not None
        assert (quality == 188).all()  # the SDK makes it up: dense capsules carry none
        end, nodes = at + len(theirs), nodes + len(theirs)
    assert nodes > 0.95 * REVOLUTIONS * 926


@pytest.mark.long
def test_roboticias_driver_and_our_decoder_agree_in_legacy_mode(monkeypatch):
    for name in ("setDTR", "dtr"):  # no pseudo-terminal has this line
        monkeypatch.setattr(serial.Serial, name, lambda self, on: None, raising=True)
    with EmulatorProcess(legacy_only=True, people=3) as emulator, overheard(emulator.port) as (port, heard):
        driver = rplidar.RPLidar(port, 256000, timeout=3)
        info = driver.get_info()
        assert (info["model"], info["firmware"], info["hardware"]) == (0x61, (1, 28), 18)
        assert driver.get_health() == ("Good", 0)
        measures = driver.iter_measures(max_buf_meas=False)
        theirs = np.array([next(measures) for _ in range(410 * 12)])
        driver.stop()
        driver.disconnect()
    starts = np.flatnonzero(theirs[:, 0])
    revolutions = decoded(heard, LEGACY, Answer.NODES, 244.0)
    for begin, end, ours in zip(starts, starts[1:], revolutions, strict=False):
        _, quality, angle, distance = theirs[begin:end].T
        assert np.array_equal(ours.angles, angle * 65536)
        assert np.array_equal(ours.distances, distance * 4)
        assert np.array_equal(ours.quality, quality)
    assert len(starts) > 10
