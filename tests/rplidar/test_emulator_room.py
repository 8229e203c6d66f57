"""What the emulated sensor measures is the room it stands in, and what it replays is what was captured."""

import time

import numpy as np
import pytest
from emulated_line import ASK_INFO, DENSE, LEGACY, SCAN, line_to, nodes, steps
from waiting import soonest

from lidarcore.rplidar.capture import CaptureWriter, Stream
from lidarcore.rplidar.emulation.device import EmulatedS1
from lidarcore.rplidar.emulation.options import EmulatorOptions
from lidarcore.rplidar.emulation.scan import furnished
from lidarcore.rplidar.emulator import main
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.simulation import furnished_room
from lidarcore.simulation.paths import ROUND, standing, wandering

EXACT = {"people": 0, "sigma_range": 1e-6, "sigma_bearing": 1e-6, "range_growth": 0, "unevenness": 0}
EXACT |= {"mixed": 0, "dropouts": 0, "jitter": 0}


def truth(angles, path=standing, time=0.0):
    """Distances (mm) in the room at clockwise angles (degrees), from where the path is at that time (s)."""
    return 1000 * furnished_room().cast(path(np.full(1, time))[0], np.radians(-angles))[0]


def test_distances_are_those_of_the_room_at_clockwise_angles():
    with EmulatorProcess(**EXACT, spin_up=0) as emulator, line_to(emulator) as line:
        line.scan()
        _, _, starts, dense = line.capsules(100)
        line.drain()
        line.scan(SCAN, LEGACY)
        *_, angles, legacy = nodes(line.read(5 * 800))
    between = (starts[:-1, None] + steps(starts)[:, None] / 40 * np.arange(40)).ravel()
    for distances, clockwise in ((dense[:-1].ravel(), between), (legacy, angles)):
        difference = np.abs(distances - truth(clockwise))
        assert np.median(difference) < 1.0  # whole millimetres
        assert np.mean(difference < 15) > 0.97  # angles are rounded: that moves points on slanted walls
        assert (
            np.mean(np.abs(distances - truth(-clockwise)) < 15) < 0.5
        )  # the mirror image, which is much like it


def test_the_same_seed_gives_the_same_measurements():
    seen = []
    for seed in (5, 5, 6):
        options = EmulatorOptions(seed=seed, streaming=True)
        room = furnished(options, np.random.default_rng(seed), 0.0)
        device = EmulatedS1(options, room, 0.0)
        seen.append([(device.due, device.take()) for _ in range(500)])
    assert seen[0] == seen[1]
    assert seen[0] != seen[2]


@pytest.mark.long
def test_a_sensor_that_moves_follows_its_path():
    with EmulatorProcess(**EXACT, moving=True, spin_up=0) as emulator, line_to(emulator) as line:
        line.scan()
        _, _, starts, distances = line.capsules(401)
    angles = starts[:-1, None] + steps(starts)[:, None] / 40 * np.arange(40)
    candidates = np.arange(0, ROUND, 0.025)  # in which it moves by 7 mm
    found = []
    for k in (10, 200, 390):  # one capsule of each: when was it measured, by where it fits the room
        misfit = [np.abs(truth(angles[k], wandering, time) - distances[k]).mean() for time in candidates]
        assert min(misfit) < 10
        found.append(candidates[np.argmin(misfit)])
    assert np.diff(found) == pytest.approx(190 * 40 * 108e-6, abs=0.25)


EXPRESS = bytes.fromhex("a582050100000000" + "23")
PIECES = [
    np.random.default_rng(k).bytes(300) for k in range(20)
]  # whatever it was: it is to come back as it is
APART = 0.02  # s


def capture(path, conversation, stream=None):
    with CaptureWriter(path, stream) as file:
        for k, (direction, data) in enumerate(conversation):
            file.write(direction, 1e9 + k * APART, data)


@pytest.mark.long
def test_a_capture_is_answered_and_sent_as_it_was_captured(tmp_path):
    info = bytes.fromhex("a55a1400000004" + "61090212" + 16 * "ab")
    asked = [("out", bytes.fromhex(ASK_INFO)), ("in", info[:9]), ("in", info[9:])]
    begun = [("out", EXPRESS), ("in", bytes.fromhex(DENSE) + PIECES[0])]
    speed_set = [("out", bytes.fromhex("a5a802580255"))]
    capture(tmp_path / "capture", [*asked, *begun, *speed_set, *(("in", piece) for piece in PIECES[1:])])
    with EmulatorProcess(replay=tmp_path / "capture") as emulator, line_to(emulator) as line:
        assert line.ask(ASK_INFO, 27) == info.hex()
        assert line.ask("a552", 10) == "a55a0300000006" "000000"  # fmt: skip # what was not asked then, as usual

        def duration():
            begin = time.monotonic()
            line.scan()
            assert line.read(300 * 20) == b"".join(PIECES)
            took = time.monotonic() - begin
            assert took >= 20 * APART
            assert line.is_silent(0.1)
            return took

        duration()
        assert soonest(duration, 20 * APART + 0.2) < 20 * APART + 0.2


@pytest.mark.long
def test_a_capture_that_began_in_the_middle_of_a_scan_is_announced(tmp_path):
    capture(tmp_path / "capture", [("in", piece) for piece in PIECES], Stream(0x85, 108.0))
    with EmulatorProcess(replay=tmp_path / "capture") as emulator, line_to(emulator) as line:
        assert line.ask(ASK_INFO, 27).startswith("a55a1400000004")
        line.scan(SCAN, DENSE)  # it sends what it has
        assert line.read(300 * 20) == b"".join(PIECES)


def test_what_is_no_capture_is_refused(tmp_path, capsys):
    (tmp_path / "text").write_text("room\n")
    with CaptureWriter(tmp_path / "strange", Stream(0x07)) as capture:
        capture.write("in", 0.0, b"?")
    faults = {"text": "not a capture", "nothing": "No such file", ".": "Is a directory", "strange": "type 7"}
    for name, cause in faults.items():
        with pytest.raises(SystemExit) as ended:
            main([f"--replay={tmp_path / name}"])
        assert ended.value.code == 2
        (sentence,) = capsys.readouterr().err.splitlines()
        assert sentence.startswith("lidarcore: ")
        assert cause in sentence
