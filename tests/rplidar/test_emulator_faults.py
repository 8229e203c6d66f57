"""Pacing, and every fault the emulator can be told to have, seen from the other end of the line."""

import os
import time

import numpy as np
import psutil
import pytest
import serial
from emulated_line import ASK_HEALTH, ASK_INFO, LEGACY, SCAN, capsules, line_to, nodes, steps
from waiting import PATIENCE

from lidarcore import DeviceError
from lidarcore.rplidar.emulation.faults import Faults
from lidarcore.rplidar.emulator_process import EmulatorProcess

CAPSULE = 40 * 108e-6  # s
STEP = 15.552  # degrees at 10 Hz


@pytest.fixture(scope="module")
def emulator():
    with EmulatorProcess(spin_up=0.05) as emulator:
        yield emulator


@pytest.fixture
def line(emulator):
    for command in ("replug", "flip 0", "lose 0", "lose-bytes 0", "stall 0"):
        emulator.command(command)
    with line_to(emulator) as line:
        yield line


def lateness(line, size, count, period):
    """By how much each of so many packets comes later than at that pace (s), but for a constant."""
    at = []
    for _ in range(count):
        line.read(size)
        at.append(time.monotonic())
    return np.array(at) - np.arange(count) * period


def pace(late, period):
    """Time from one to the next (s), by those at either end that are held up least: a busy machine makes late only."""
    tenth = len(late) // 10
    first, last = np.argmin(late[:tenth]), np.argmin(late[-tenth:]) + len(late) - tenth
    return period + (late[last] - late[first]) / (last - first)


@pytest.mark.long
def test_capsules_come_at_the_pace_of_an_s1_and_cost_little(emulator, line):
    line.scan()
    line.capsules(20)
    process = psutil.Process(emulator.pid)
    used = process.cpu_times()
    late = lateness(line, 84, 450, CAPSULE)
    now = process.cpu_times()
    assert pace(late, CAPSULE) == pytest.approx(CAPSULE, rel=0.01)
    assert (
        np.quantile(late, 0.1) - late.min() < 0.02
    )  # they do not come in the blocks of 0.1 s that are simulated
    assert now.user + now.system - used.user - used.system < 0.2 * 450 * CAPSULE


@pytest.mark.long
def test_legacy_nodes_come_at_the_pace_of_an_s1(line):
    line.scan(SCAN, LEGACY)
    line.read(5 * 160)
    period = 16 * 244e-6  # as many are sent at once
    assert pace(lateness(line, 5 * 16, 400, period), period) == pytest.approx(period, rel=0.02)


def test_flipped_bits_break_that_share_of_the_capsules(emulator, line):
    emulator.command("flip 0.3")
    line.scan()
    whole = line.capsules(300)[0]
    assert 0.14 < 1 - whole.mean() < 0.46  # six standard deviations of 300 draws
    emulator.command("flip 0")
    line.until_whole(60)


def test_lost_capsules_leave_twice_the_angle(emulator, line):
    emulator.command("lose 0.2")
    line.scan()
    whole, _, starts, _ = line.capsules(300)
    assert whole.all()
    lost = np.rint(steps(starts)[30:] / STEP) - 1
    assert 0.1 < lost.sum() / (lost + 1).sum() < 0.3


def test_after_a_lost_byte_nothing_is_where_it_was(emulator, line):
    emulator.command("lose-bytes 0.01")
    line.scan()
    data = line.read(84 * 200)
    whole = [capsules(data[at : at + 84])[0][0] for at in range(len(data) - 84)]
    assert sum(whole[::84][20:]) < 18  # of 180; 84 lost bytes on, a few are back in their places
    assert 0.25 < sum(whole) / 200 < 0.6  # 0.99 to the power of 84 is 0.43


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_shares_are_shares(share):
    packets, rng = np.arange(84 * 20000).astype(np.uint8), np.random.default_rng(1)
    tolerance = 5 * np.sqrt(share * (1 - share) / 20000)
    damaged = np.frombuffer(Faults(flip=share, rng=rng).damage(packets.tobytes(), 84), np.uint8)
    bits = np.unpackbits((damaged ^ packets).reshape(-1, 84), axis=1).sum(axis=1)
    assert set(bits) <= {0, 1}
    assert bits.mean() == pytest.approx(share, abs=tolerance)
    kept = len(Faults(lose=share, rng=rng).damage(packets.tobytes(), 84))
    assert kept % 84 == 0
    assert kept / len(packets) == pytest.approx(1 - share, abs=tolerance)
    kept = len(Faults(lose_bytes=share, rng=rng).damage(packets.tobytes(), 0))
    assert kept / len(packets) == pytest.approx(1 - share, abs=tolerance)


def test_faults_of_legacy_nodes_are_those_of_single_nodes(emulator, line):
    emulator.command("lose 0.5")
    line.scan(SCAN, LEGACY)
    start, not_start, _, check, angle, _ = nodes(line.read(5 * 800))
    assert ((start ^ not_start) & check).all()
    lost = np.rint(steps(angle)[400:] / (360 * 10 * 244e-6)) - 1
    assert 0.4 < lost.sum() / (lost + 1).sum() < 0.6


def test_garbage_comes_between_whole_capsules(emulator, line):
    line.scan()
    line.capsules(10)
    emulator.command("garbage 1000")
    assert not all(line.capsules(1)[0][0] for _ in range(300))
    line.read(1000 - 84)
    assert line.capsules(60)[0].all()


def test_a_stall_is_a_silence_in_which_the_head_turns_on(emulator, line):
    line.scan()
    line.capsules(50)
    begin = time.monotonic()
    emulator.command("stall 1.5")
    at, whole, flags = [], [], []
    while not at or at[-1] < begin + 1.6:
        is_whole, flag, *_ = line.capsules(1)
        at.append(time.monotonic())
        whole += is_whole.tolist()
        flags += flag.tolist()
    assert max(np.diff([begin, *at])) > 0.75
    assert all(whole)
    assert not any(flags)  # the scan goes on, it does not begin again


def test_a_client_that_does_not_read_stops_nothing(emulator, line):
    line.scan()
    line.capsules(10)
    begin = time.monotonic()
    while time.monotonic() - begin < 1.5:  # more than the line holds
        emulator.command("stall 0")
    backlog = 0
    line.serial.timeout = 0
    while data := line.serial.read(1 << 16):
        backlog += len(data)
    assert 84 * 100 < backlog < 84 * 300  # 347 capsules in 1.5 s
    line.serial.timeout = PATIENCE
    line.drain()
    assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "000000"  # fmt: skip


def test_unplugged_the_port_is_gone_and_who_had_it_open_gets_errors(emulator, line):
    line.scan()
    emulator.command("unplug")
    assert not os.path.lexists(emulator.port)
    with pytest.raises(serial.SerialException):
        line.serial.read(1 << 20)
    with pytest.raises(serial.SerialException):
        serial.Serial(emulator.port)
    emulator.command("unplug")  # again does nothing
    emulator.command("garbage 100")
    emulator.command("health 2")


def test_replugged_it_answers_at_the_same_path_as_just_switched_on(emulator, line):
    line.scan()
    for _ in range(3):
        emulator.command("unplug")
        emulator.command("replug")
        with line_to(emulator) as again:
            assert again.is_silent(0.05)
            assert again.ask(ASK_INFO, 27).startswith("a55a1400000004")
            again.scan()
            assert again.capsules(3)[1].tolist() == [True, False, False]


@pytest.mark.long
def test_plugged_in_again_it_may_have_to_boot():
    with EmulatorProcess(boot=0.5) as emulator:
        begin = time.monotonic()
        emulator.command("replug")
        with line_to(emulator) as line:
            line.ask_until_answered(ASK_INFO, 27)
        assert time.monotonic() - begin > 0.4


def test_faults_combine(emulator, line):
    for command in ("lose 0.1", "flip 0.1", "lose-bytes 0.002", "stall 0.2"):
        emulator.command(command)
    line.scan()
    emulator.command("garbage 5000")
    data = line.read(84 * 200)
    whole = [capsules(data[at : at + 84])[0][0] for at in range(len(data) - 84)]
    # Of 140 that are no garbage, 0.9 * 0.998 to the power of 84 = 0.76; of up to 200 where there is no room for it.
    assert 60 < sum(whole) < 180
    emulator.command("health 2 3")
    line.drain()
    assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "020300"  # fmt: skip


@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        ("explode", "no command 'explode'; there are unplug"),
        ("flip 1.5", "a share is from 0 to 1"),
        ("lose -0.1", "a share is from 0 to 1"),
        ("lose-bytes nan", "a share is from 0 to 1"),
        ("garbage -1", "give 0 to 65536 bytes"),
        ("stall", "usage: stall"),
        ("stall soon", "usage: stall"),
        ("unplug 3", "usage: unplug"),
        ("health 3", "the status is 0, 1 or 2"),
        ("", "no command ''"),
    ],
)
def test_a_wrong_command_is_answered_and_changes_nothing(emulator, line, command, complaint):
    with pytest.raises(DeviceError, match=complaint):
        emulator.command(command)
    assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "000000"  # fmt: skip
