"""Broken bytes of a sensor: to the decoders, and to the driver over a pseudo-terminal."""

import random
import time
import traceback
from itertools import islice

import numpy as np
from findings import Findings
from mutation import mutated
from recorded_scans import dense_stream

from lidarcore import DeviceError
from lidarcore.rplidar import Driver
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.rplidar.listener import Listener
from lidarcore.rplidar.protocol import StreamDecoder, encode_nodes

PATIENCE = 10.0  # s
FAULTS = ("flip {:.3f}", "lose {:.3f}", "lose-bytes {:.3f}", "stall {:.2f}", "garbage {:.0f}")


def fuzz(seconds: float, findings: Findings) -> None:
    """Half of the time each: decoders alone, and the driver with a sensor that fails."""
    sound = [b"".join(data for data, _ in dense_stream(5)), _nodes(5)]
    for name, rng in findings.rounds("decoders", seconds / 2):
        data = mutated(rng.choice([*sound, rng.randbytes(5000)]), rng)
        began = time.monotonic()
        try:
            _decode(data, rng)
        except Exception:
            findings.add(name, "bytes", traceback.format_exc(limit=-3), data)
        if time.monotonic() - began > PATIENCE:
            findings.add(name, "bytes", "took longer than 10 s", data)
    with EmulatorProcess(seed=findings.seed % 1000) as sensor:
        for name, rng in findings.rounds("driver", seconds / 2):
            _drive(name, rng, sensor, findings)


def _decode(data: bytes, rng: random.Random) -> None:
    """In fragments of any size, as a stream of every kind and as a capture."""
    decoders = [StreamDecoder(answer, rng.choice((1.0, 108.0, 500.0))) for answer in FORMATS]
    listener, at = Listener(rng.choice(list(FORMATS)), 108.0), 0
    while at < len(data):
        piece = data[at : at + rng.choice((1, 7, 84, 1000))]
        at += len(piece)
        for taker in (*(decoder.feed for decoder in decoders), listener.received):
            for revolution in taker(piece, 1e-4 * at):
                revolution.scan(0.0)


def _drive(name: str, rng: random.Random, sensor: EmulatorProcess, findings: Findings) -> None:
    """A connection that finds faults, or gets them."""
    scale = {"flip": 0.2, "lose": 0.5, "lose-bytes": 0.2, "stall": 2.0, "garbage": 5000}
    fault = rng.choice(FAULTS)
    word = fault.split()[0]
    is_first, began = rng.random() < 0.5, time.monotonic()
    command = fault.format(rng.random() * scale[word])
    try:
        if is_first:
            sensor.command(command)
        with Driver(sensor.port, reconnect=False) as driver:
            if not is_first:
                sensor.command(command)
            for _ in islice(driver, 5):
                pass
    except DeviceError:
        pass
    except Exception:
        findings.add(name, command, traceback.format_exc(limit=-3))
    if word in ("flip", "lose", "lose-bytes"):
        sensor.command(f"{word} 0")
    if time.monotonic() - began > 2 * PATIENCE:  # connecting tries all baud rates
        findings.add(name, command, f"took {time.monotonic() - began:.0f} s")


def _nodes(turns: int) -> bytes:
    angles = np.arange(360.0)
    return turns * encode_nodes(angles, np.full(360, 1000.0), np.full(360, 40), angles == 0)
