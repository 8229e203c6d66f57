import os
import signal
import sqlite3
import subprocess
import sys
import threading
from dataclasses import replace
from tempfile import TemporaryDirectory

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, consumes, initialize, multiple, rule
from landmark_maps import RandomLandmarks, corner

from lidarcore.errors import LandmarkError, LandmarkMapError, UnknownLandmarkError
from lidarcore.landmarks import Box, LandmarkMap, Session

WRITER = """
import sys
from lidarcore.landmarks import Landmark, LandmarkMap
landmark_map = LandmarkMap(sys.argv[1])
session = landmark_map.begin_session("writer", 0.0)
for i in range(10**9):
    new = [Landmark(float(i), float(j), 1e-4, 0.0, 1e-4, "corner", last_seen=float(i)) for j in range(3)]
    print(*landmark_map.put(new, session), flush=True)
"""


@pytest.mark.parametrize("lines", [1, 40, 200])
def test_no_confirmed_landmark_is_lost_when_the_process_is_killed(tmp_path, lines):
    path = tmp_path / "map.db"
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        confirmed = [process.stdout.readline() for _ in range(lines)]
        os.kill(process.pid, signal.SIGKILL)
        confirmed += process.stdout.read().splitlines()
    ids = [int(word) for line in confirmed for word in line.split()]
    with LandmarkMap(path) as landmark_map:
        kept = {landmark.id: landmark for landmark in landmark_map}
        assert set(ids) <= set(kept)
        assert len(kept) % 3 == 0  # a transaction is there as a whole or not at all
        assert all(kept[id].xy.tolist() == [(id - 1) // 3, (id - 1) % 3] for id in ids)
        assert len(landmark_map.find(Box(-1, -1, 1e6, 1e6), limit=10_000).landmarks) == len(kept)
        assert landmark_map.history(ids[-1])[-1].landmark == kept[ids[-1]]
        assert landmark_map.sessions() == [Session(1, "writer", 0.0, None)]
        assert landmark_map.put([corner()]) == [max(kept) + 1]
    assert sqlite3.connect(path).execute("PRAGMA integrity_check").fetchall() == [("ok",)]


class AgainstDictionary(RuleBasedStateMachine):
    """A map does what a dictionary of landmarks does, and forgets nothing when it is closed."""

    ids = Bundle("ids")
    landmarks = st.builds(
        corner, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), var_x=st.floats(1e-3, 1), var_y=st.floats(1e-3, 1),
        kind=st.sampled_from(["corner", "cluster"]), count=st.integers(1, 9), last_seen=st.floats(0, 9),
    )  # fmt: skip

    @initialize()
    def open(self):
        self.folder, self.model, self.states = TemporaryDirectory(), {}, {}
        self.map = LandmarkMap(f"{self.folder.name}/map.db")
        self.session = self.map.begin_session("test", 1.0)

    @rule(target=ids, new=st.lists(landmarks, max_size=5))
    def put(self, new):
        found = self.map.put(new, self.session)
        for id, landmark in zip(found, new, strict=True):
            assert id not in self.states
            self.model[id] = replace(landmark, id=id)
            self.states[id] = {int(landmark.last_seen): self.model[id]}
        return multiple(*found)

    @rule(id=ids, landmark=landmarks)
    def update(self, id, landmark):
        self.model[id] = replace(landmark, id=id)
        self.states[id][int(landmark.last_seen)] = self.model[id]
        self.map.put([self.model[id]], self.session)

    @rule(id=consumes(ids))
    def remove(self, id):
        self.map.remove([id])
        del self.model[id]
        with pytest.raises(UnknownLandmarkError):
            self.map[id]

    @rule(landmark=landmarks)
    def fail(self, landmark):
        with pytest.raises(UnknownLandmarkError):
            self.map.put([landmark, replace(landmark, id=10**6)], self.session)

    @rule()
    def reopen(self):
        self.map.close()
        self.map = LandmarkMap(f"sqlite:///{self.map.path}")

    @rule(low=st.integers(-1000, 0), high=st.integers(0, 1000))
    def compare(self, low, high):
        assert list(self.map) == [self.model[id] for id in sorted(self.model)]
        assert len(self.map) == len(self.model)
        inside = [m for m in self.map if low <= m.x <= high and low <= m.y <= high]
        assert self.map.find(Box(low, low, high, high)).landmarks == inside

    @rule(id=ids)
    def compare_one(self, id):
        assert self.map[id] == self.model[id]
        history = self.map.history(id)
        assert [state.landmark for state in history] == [self.states[id][s] for s in sorted(self.states[id])]
        assert {state.session for state in history} == {self.session}

    def teardown(self):
        self.map.close()
        self.folder.cleanup()


TestAgainstDictionary = AgainstDictionary.TestCase
TestAgainstDictionary.settings = settings(max_examples=15, stateful_step_count=25)


def test_readers_see_whole_transactions_while_another_process_writes(tmp_path):
    path, wrong = tmp_path / "map.db", []

    def read(landmark_map, written):
        while not written.is_set():
            found = landmark_map.find(Box(-1e6, -1e6, 1e6, 1e6), limit=9_999).landmarks
            near = landmark_map.nearest((0, 0), 9_999)
            wrong.extend(n for n in (len(found), len(near), len(list(landmark_map))) if n % 3)

    with LandmarkMap(path) as landmark_map:
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            process.stdout.readline()
            written = threading.Event()
            threads = [threading.Thread(target=read, args=(landmark_map, written)) for _ in range(3)]
            for thread in threads:
                thread.start()
            ours = [landmark_map.put([corner()] * 3) for _ in range(5)]
            theirs = [process.stdout.readline() for _ in range(5)]
            written.set()
            for thread in threads:
                thread.join()
            process.kill()
        assert all(theirs)
        assert not wrong
        assert {id for ids in ours for id in ids} <= {landmark.id for landmark in landmark_map}


def test_history_keeps_the_last_state_of_each_second_and_pages(landmark_map):
    (id,) = landmark_map.put([corner(0.0)])
    for i in range(1, 100):
        landmark_map.put([corner(i, count=i, last_seen=i / 10, id=id)])
    states = [state.landmark for state in landmark_map.history(id)]
    assert [landmark.count for landmark in states] == [9, 19, 29, 39, 49, 59, 69, 79, 89, 99]
    first = landmark_map.history(id, limit=4)
    rest = landmark_map.history(id, after=first[-1].landmark.last_seen)
    assert [state.landmark for state in first + rest] == states
    landmark_map.remove([id])
    assert [state.landmark for state in landmark_map.history(id)] == states
    with pytest.raises(UnknownLandmarkError):
        landmark_map.history(id + 1)


def test_sessions_are_told_apart(landmark_map):
    first, second = (landmark_map.begin_session(name, at) for name, at in (("a.mcap", 5.0), ("device", 9.0)))
    (id,) = landmark_map.put([corner(last_seen=1.0)], first)
    landmark_map.put([corner(last_seen=2.0, id=id)], second)
    landmark_map.end_session(first, 7.0)
    assert [state.session for state in landmark_map.history(id)] == [first, second]
    assert landmark_map.sessions() == [Session(1, "a.mcap", 5.0, 7.0), Session(2, "device", 9.0, None)]
    for refused in (
        lambda: landmark_map.put([corner()], 3),
        lambda: landmark_map.end_session(3, 10.0),
        lambda: landmark_map.end_session(second, 8.0),
    ):
        with pytest.raises(LandmarkMapError, match=r"no session [23]"):
            refused()
    with pytest.raises(LandmarkError):
        landmark_map.begin_session("clock", float("nan"))
    assert len(landmark_map) == 1


def test_what_fails_half_way_changes_nothing(landmark_map):
    landmark_map.put(RandomLandmarks(20).landmarks())
    before = list(landmark_map)

    def breaking():
        yield corner()
        raise RuntimeError("source gone")

    for attempt in (
        lambda: landmark_map.put(breaking()),
        lambda: landmark_map.replace(breaking()),
        lambda: landmark_map.replace([corner(id=7), corner(id=7)]),
        lambda: landmark_map.remove([1, 2, 99]),
    ):
        with pytest.raises((RuntimeError, LandmarkMapError)):
            attempt()
        assert list(landmark_map) == before
        assert len(landmark_map.find(Box(-1e6, -1e6, 1e6, 1e6)).landmarks) == 20


def spoil(path, *statements):
    LandmarkMap(path).close()
    with sqlite3.connect(path) as connection:
        for statement in statements:
            connection.execute(statement)
    connection.close()


@pytest.mark.parametrize(
    ("statement", "text"),
    [
        ("PRAGMA user_version = 99", "update lidarcore"),
        ("UPDATE about SET unit = 'mm'", "'mm', not in metres"),
        ("PRAGMA application_id = 5", "no map of landmarks"),
        ("DROP TABLE about", "no such table"),
    ],
)
def test_a_map_of_another_version_or_unit_is_refused_and_left_alone(tmp_path, statement, text):
    path = tmp_path / "map.db"
    spoil(path, statement)
    before = path.read_bytes()
    with pytest.raises(LandmarkMapError, match=text):
        LandmarkMap(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", [b"not a database at all" * 100, b"SQLite format 3\0" + bytes(4000)])
def test_a_file_that_is_no_database_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "map.db"
    path.write_bytes(content)
    with pytest.raises(LandmarkMapError):
        LandmarkMap(path)
    assert path.read_bytes() == content


def test_a_damaged_landmark_does_not_come_out(tmp_path):
    path = tmp_path / "map.db"
    with LandmarkMap(path) as landmark_map:
        landmark_map.put([corner()])
    spoil(path, "UPDATE landmarks SET var_x = -1")
    with LandmarkMap(path) as landmark_map, pytest.raises(LandmarkError, match="positive definite"):
        landmark_map[1]


@pytest.mark.parametrize(
    "url", ["postgresql://host/map", ":memory:", "", "missing/folder/map.db", ".", "a\0b"]
)
def test_what_is_no_file_for_a_map_is_refused(url):
    with pytest.raises(LandmarkMapError):
        LandmarkMap(url)


def test_a_closed_map_says_so(tmp_path):
    landmark_map = LandmarkMap(tmp_path / "map.db")
    landmark_map.close()
    for use in (lambda: landmark_map.put([corner()]), lambda: landmark_map.find()):
        with pytest.raises(LandmarkMapError, match="closed"):
            use()
