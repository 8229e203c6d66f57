"""What the emulator answers, byte by byte, to a client that knows nothing of our code."""

import numpy as np
import pytest
from emulated_line import (
    ASK_HEALTH,
    ASK_INFO,
    DENSE_BOOST,
    DENSE_BOOST_OF_OLD_SDKS,
    FORCE_SCAN,
    LEGACY,
    RESET,
    SCAN,
    STOP,
    capsules,
    conf,
    line_to,
    nodes,
    speed,
    steps,
    with_checksum,
)

from lidarcore.rplidar.emulation.device import EmulatedS1
from lidarcore.rplidar.emulation.options import EmulatorOptions
from lidarcore.rplidar.emulation.scan import furnished
from lidarcore.rplidar.emulator_process import EmulatorProcess

QUIET = 0.15  # s without a byte: an answer would have come in a few ms


@pytest.fixture(scope="module")
def emulator():
    with EmulatorProcess(spin_up=0.05, reset=0.4, people=0) as emulator:
        yield emulator


@pytest.fixture
def line(emulator):
    """To an S1 that has just been plugged in."""
    emulator.command("replug")
    with line_to(emulator) as line:
        yield line


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (ASK_HEALTH, "a55a0300000006" "000000"),
        ("a559", "a55a0400000015" "f4006c00"),
        (conf(0x70), "a55a0600000020" "70000000" "0200"),
        (conf(0x71, 0), "a55a0800000020" "71000000" "00f40000"),
        (conf(0x71, 1), "a55a0800000020" "71000000" "006c0000"),
        (conf(0x74, 1), "a55a0800000020" "74000000" "00280000"),
        (conf(0x75, 0), "a55a0500000020" "75000000" "81"),
        (conf(0x75, 1), "a55a0500000020" "75000000" "85"),
        (conf(0x79), "a55a0400000020" "79000000"),
        (conf(0x7C), "a55a0600000020" "7c000000" "0100"),
        (conf(0x7F, 0), "a55a0d00000020" "7f000000" + b"Standard\0".hex()),
        (conf(0x7F, 1), "a55a0f00000020" "7f000000" + b"DenseBoost\0".hex()),
        (conf(0x01), "a55a0800000020" "01000000" "58020000"),
        (conf(0x04), "a55a0600000020" "04000000" "e001"),
        (conf(0x05), "a55a0600000020" "05000000" "8403"),
        ("a5ff0400000000" "5e", "a55a04000000ff" "00000000"),
        (with_checksum("a58408" "7100000001000000"), "a55a0800000020" "71000000" "006c0000"),
    ],
)  # fmt: skip
def test_each_question_has_the_answer_of_an_s1(line, request_, answer):
    assert line.ask(request_, len(answer) // 2) == answer
    assert line.is_silent(0.02)


def test_examples_of_the_protocol_are_what_this_client_sends():
    assert conf(0x70) == "a584047000000055"
    assert conf(0x7F, 1) == "a584067f000000010059"
    assert (speed(600), speed(0)) == ("a5a802580255", "a5a80200000f")


def test_a_request_that_is_never_finished_is_forgotten():
    options = EmulatorOptions(people=0)
    device = EmulatedS1(options, furnished(options, np.random.default_rng(0), 0.0), 0.0)
    info = bytes.fromhex(ASK_INFO)
    assert device.receive(info[:1], 1.0) == b""
    assert len(device.receive(info[1:], 5.9)) == 27
    assert device.receive(info[:1], 10.0) == b""
    assert len(device.receive(info, 15.1)) == 27  # all of a request has to come within 5 s


def test_it_says_that_it_is_an_s1(line):
    answer = bytes.fromhex(line.ask(ASK_INFO, 27))
    assert answer[:7].hex() == "a55a1400000004"
    assert tuple(answer[7:11]) == (0x61, 28, 1, 18)
    assert any(answer[11:])


@pytest.mark.parametrize(
    "request_",
    [
        STOP,
        conf(0x70)[:-2] + "54",  # wrong checksum
        conf(0x999),  # no such entry
        conf(0x71, 2),  # no such mode
        with_checksum("a58402" "7100"),  # no whole entry
        with_checksum("a58205" "0200000000"),  # a scan in a mode that does not exist
        with_checksum("a58201" "01"),
        speed(600),
        with_checksum("a5f002" "9402"),
        "ffffffff" "5a5a",
    ],
)  # fmt: skip
def test_what_has_no_answer_gets_none_and_does_no_harm(line, request_):
    line.send(request_)
    assert line.is_silent(QUIET)
    assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "000000"  # fmt: skip


@pytest.mark.parametrize("request_", [DENSE_BOOST, DENSE_BOOST_OF_OLD_SDKS])
def test_dense_capsules_are_whole_and_follow_each_other(line, request_):
    line.scan(request_)
    whole, flags, starts, distances = line.capsules(100)
    assert whole.all()
    assert flags.tolist() == [True] + [False] * 99
    assert np.abs(steps(starts)[20:] - 15.552).max() < 0.3  # 40 samples of 108 us at 10 Hz
    assert 700 < np.median(distances) < 8000


def test_legacy_nodes_are_sound_and_flagged_where_the_angle_wraps(line):
    line.scan(SCAN, LEGACY)
    start, not_start, quality, check, angle, distance = nodes(line.read(5 * 1600))
    assert ((start ^ not_start) & check).all()
    wraps = np.flatnonzero(np.diff(angle) < 0) + 1
    assert np.flatnonzero(start).tolist() == wraps.tolist()
    assert len(wraps) in (3, 4)  # in 1600 x 244 us
    assert np.abs(np.diff(wraps) - 0.1 / 244e-6).max() < 10
    assert (quality[distance == 0] == 0).all()
    assert (quality[distance > 0] > 0).all()


def test_a_scan_asked_for_again_starts_again(line):
    line.scan()
    line.capsules(3)
    line.drain()
    line.scan()
    assert line.capsules(2)[1].tolist() == [True, False]


@pytest.mark.parametrize("request_", [STOP, ASK_INFO, conf(0x70), "a559", speed(0)])
def test_a_request_ends_the_scan(line, request_):
    line.scan()
    line.capsules(3)
    line.send(request_)
    line.until_silent(QUIET)  # a capsule comes every 4 ms


def test_a_new_speed_does_not_end_the_scan(line):
    line.scan()
    line.capsules(30)
    for rpm, step in ((900, 15.552 * 1.5), (480, 15.552 * 0.8), (5000, 15.552 * 1.5), (1, 15.552 * 0.8)):
        line.send(speed(rpm))  # held within what the motor can do
        for _ in range(20):  # 0.1 s until it is heard, 0.05 s to get there
            whole, flags, starts, _ = line.capsules(20)
            assert whole.all()
            assert not flags.any()
            if np.median(steps(starts)) == pytest.approx(step, rel=0.02):
                break
        else:
            pytest.fail(f"{np.median(steps(starts))} degrees instead of {step}")


def test_the_pwm_of_another_model_is_swallowed(line):
    line.scan()
    line.send(with_checksum("a5f002" "9402"))  # fmt: skip
    assert line.capsules(30)[0].all()


@pytest.mark.long
def test_samples_wait_for_a_stable_motor_but_a_forced_scan_does_not():
    with EmulatorProcess(spin_up=2, people=0) as emulator:
        with line_to(emulator) as line:
            line.scan()
            assert line.is_silent(0.25)
            assert np.abs(steps(line.capsules(40)[2])[-10:] - 15.552).max() < 0.3
        emulator.command("replug")
        with line_to(emulator) as line:
            line.scan(FORCE_SCAN, LEGACY)
            angle = nodes(line.read(5 * 2000))[4]
        growing = np.diff(np.unwrap(angle, period=360))
        assert growing[:50].mean() < 0.3 * growing[-50:].mean()


def test_after_a_reset_it_is_deaf_for_a_while(line):
    line.scan()
    line.send(RESET)
    line.send(ASK_INFO)
    rest = line.until_silent(0.2)
    assert bytes.fromhex("a55a1400000004") not in rest
    assert line.ask_until_answered(ASK_INFO, 27).startswith("a55a1400000004")


def test_in_protection_stop_nothing_scans_until_a_reset(emulator, line):
    line.scan()
    emulator.command("health 2 4660")
    line.drain()
    assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "023412"  # fmt: skip
    for request in (SCAN, FORCE_SCAN, DENSE_BOOST):
        line.send(request)
    assert line.is_silent(QUIET)
    line.send(RESET)
    assert line.is_silent(QUIET)
    assert line.ask_until_answered(ASK_HEALTH, 10) == "a55a0300000006" "000000"  # fmt: skip
    line.drain()
    line.scan()


def test_a_warning_is_only_a_warning(emulator, line):
    emulator.command("health 1 7")
    assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "010700"  # fmt: skip
    line.scan()
    assert line.capsules(5)[0].all()


def test_health_that_sticks_survives_reset_and_replug():
    with EmulatorProcess(health=2, health_code=9, health_sticks=True, reset=0.1) as emulator:
        with line_to(emulator) as line:
            line.send(RESET)
            assert line.ask_until_answered(ASK_HEALTH, 10) == "a55a0300000006" "020900"  # fmt: skip
        emulator.command("replug")
        with line_to(emulator) as line:
            assert line.ask(ASK_HEALTH, 10) == "a55a0300000006" "020900"  # fmt: skip


def test_an_old_model_knows_the_legacy_scan_only():
    with EmulatorProcess(legacy_only=True, spin_up=0.05) as emulator, line_to(emulator) as line:
        for request in (conf(0x70), DENSE_BOOST):
            line.send(request)
            assert line.is_silent(QUIET)
        line.scan(SCAN, LEGACY)
        assert nodes(line.read(500))[3].all()


@pytest.mark.long
def test_configuration_may_stay_unanswered():
    with EmulatorProcess(silent_conf=True, spin_up=0.05) as emulator, line_to(emulator) as line:
        line.send(conf(0x7C))
        assert line.is_silent(QUIET)
        line.scan()
        assert line.capsules(5)[0].all()


@pytest.mark.long
def test_another_baud_rate_hears_garbage_and_is_not_heard():
    with EmulatorProcess(streaming=True, spin_up=0.05) as emulator:
        with line_to(emulator, 115200) as line:
            line.send(STOP)
            data = line.read(84 * 200)
            found = [capsules(data[at : at + 84])[0][0] for at in range(len(data) - 84)]
            assert sum(found) < 8  # 16,716 windows of random bytes, 1 in 65,536 of them by chance
        with line_to(emulator) as line:
            data = line.read(84 * 24)[
                -84 * 19 :
            ]  # before them what had waited since the other line was closed
            assert max(capsules(data[at : at + 84 * 18])[0].sum() for at in range(84)) == 18
            line.drain()
            assert line.ask(ASK_INFO, 27).startswith("a55a1400000004")
        emulator.command("replug")  # it does not scan again by itself
        with line_to(emulator, 115200) as line:
            line.send(ASK_INFO)
            assert line.is_silent(QUIET)
    with EmulatorProcess(baud=115200) as emulator, line_to(emulator, 115200) as line:  # which may be its own
        assert line.ask(ASK_INFO, 27).startswith("a55a1400000004")
