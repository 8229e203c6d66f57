"""A recording that ends before its time: killed, or on a full disk. At most the last second is missing."""

import json
import random
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded_scans import demo, single
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from waiting import PATIENCE, wait_until

from lidarcore import open_recording

PROCESS = Path(__file__).with_name("recording_process.py")
NAMESPACE = ["unshare", "--map-root-user", "--mount", "sh", "-c"]
BUSY = 1.5  # s that a machine may be late by
SMALL_DISK = 'mount -t tmpfs -o size=1500k tmpfs "$1" && "$2" "$3" "$1/a.mcap" full; cp "$1/a.mcap" "$4"'


@contextmanager
def recording(path, how):
    """A process that records, and the stamps it has printed so far."""
    process = subprocess.Popen([sys.executable, PROCESS, path, how], stdout=subprocess.PIPE, text=True)
    stamps, begun = [], threading.Event()

    def listen():
        for line in process.stdout:
            stamps.append(float(line))
            begun.set()

    listener = threading.Thread(target=listen)
    listener.start()
    try:
        assert begun.wait(PATIENCE)
        yield process, stamps
    finally:
        process.kill()
        process.wait()
        listener.join()
        process.stdout.close()


def scans_for_others(path):
    """How many scans the mcap library and rosbags find."""
    with path.open("rb") as file:
        mcap = sum(channel.topic == "/scan" for _, channel, _ in make_reader(file).iter_messages())
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        topics = [connection for connection in bag.connections if connection.topic == "/scan"]
        return [mcap, sum(1 for _ in bag.messages(connections=topics))]


def assert_holds(path, stamps):
    """The file opens, and holds the scans of these stamps, each as it was."""
    assert len(stamps) >= 3
    read = {scan.stamp: scan for scan in open_recording(path)}
    assert set(stamps) <= set(read)
    known = demo(5)
    for number, stamp in enumerate(stamps):
        np.testing.assert_array_equal(read[stamp].ranges, single(known[number % 5].ranges))
    assert scans_for_others(path) == [len(read)] * 2


def kill_and_check(path, delay):
    with recording(path, "endless") as (process, stamps):
        time.sleep(delay)  # the moment is what is tried, nothing is awaited
        killed = time.time()
        process.kill()
        process.wait()
    assert_holds(path, [stamp for stamp in stamps if stamp < killed - 1 - BUSY])


@pytest.mark.long
def test_killed_at_any_moment_at_most_the_last_second_is_missing(tmp_path):
    moments = random.Random(3)
    for batch in range(2):
        delays = [moments.uniform(1.5, 3) + BUSY for _ in range(4)]
        failures = []

        def attempt(number, delay, batch=batch, failures=failures):
            try:
                kill_and_check(tmp_path / f"{batch}{number}.mcap", delay)
            except BaseException as error:
                failures.append(error)

        threads = [threading.Thread(target=attempt, args=item) for item in enumerate(delays)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not failures


@pytest.mark.long
def test_killed_while_the_sensor_is_silent_nothing_is_missing(tmp_path):
    with recording(tmp_path / "a.mcap", "stalling") as (process, stamps):
        wait_until(lambda: len(stamps) >= 3)
        time.sleep(max(0, stamps[-1] + 1 + BUSY - time.time()))  # the second that may be missing
        process.kill()
    assert_holds(tmp_path / "a.mcap", stamps)


def by_limit(tmp_path, limit=1_536_000):
    """A file that may not grow: works for everyone."""
    command = [sys.executable, PROCESS, tmp_path / "a.mcap", "full", str(limit)]
    return subprocess.run(command, capture_output=True, text=True, timeout=240)


def by_small_disk(tmp_path):
    """A real file system of 1.5 MB, in a mount namespace of its own."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = [*NAMESPACE, SMALL_DISK, "sh", disk, sys.executable, PROCESS, tmp_path / "a.mcap"]
    return subprocess.run(command, capture_output=True, text=True, timeout=240)


def may_mount():
    """Whether this user may mount a file system in a namespace; many containers do not allow it."""
    try:
        return subprocess.run([*NAMESPACE, "mount -t tmpfs tmpfs /mnt"], capture_output=True).returncode == 0
    except FileNotFoundError:
        return False


FULL = [(by_limit, "the file may not grow any further")]
if may_mount():
    FULL.append((by_small_disk, "the disk is full: free some space"))


@pytest.mark.long
@pytest.mark.parametrize(("fill", "cause"), FULL)
def test_a_full_disk_is_reported_and_what_was_before_can_be_read(tmp_path, fill, cause):
    done = fill(tmp_path)
    assert done.returncode == 0, done.stderr
    *lines, last = done.stdout.splitlines()
    status, stamps = json.loads(last), [float(line) for line in lines]
    assert status["state"] == "failed"
    assert cause in status["error"]
    assert "before can be read" in status["error"]
    assert 1_000_000 < status["size"] == (tmp_path / "a.mcap").stat().st_size <= 1_536_000
    assert_holds(tmp_path / "a.mcap", [stamp for stamp in stamps if stamp < stamps[-1] - 1])
    assert open_recording(tmp_path / "a.mcap").notes == ()  # cut back to whole records


def test_the_next_recording_begins_once_there_is_room_again(tmp_path):
    assert by_limit(tmp_path, 100_000).returncode == 0
    assert len(list(open_recording(tmp_path / "a.again"))) == 1
