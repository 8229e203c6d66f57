import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, consumes, initialize, multiple, rule
from landmark_maps import RandomLandmarks, corner

from lidarcore.errors import LandmarkError, LandmarkMapError, UnknownLandmarkError, UnknownSessionError
from lidarcore.landmarks import MAX_NAME, Atlas, Box, Session

WRITER = """
import sys
from lidarcore.landmarks import Atlas, Landmark
landmark_map = Atlas(sys.argv[1]).begin("writer", 0.0, "slam")
for i in range(10**9):
    new = [Landmark(float(i), float(j), 1e-4, 0.0, 1e-4, "corner", last_seen=float(i)) for j in range(3)]
    print(*landmark_map.put(new), flush=True)
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
    with Atlas(path) as atlas:
        landmark_map = atlas.newest()
        kept = {landmark.id: landmark for landmark in landmark_map}
        assert set(ids) <= set(kept)
        assert len(kept) % 3 == 0  # a transaction is there as a whole or not at all
        assert all(kept[id].xy.tolist() == [(id - 1) // 3, (id - 1) % 3] for id in ids)
        assert len(landmark_map.find(Box(-1, -1, 1e6, 1e6), limit=10_000).landmarks) == len(kept)
        assert landmark_map.history(ids[-1])[-1] == kept[ids[-1]]
        assert atlas.sessions() == [Session(1, "writer", "slam", 0.0, None, len(kept))]
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
        self.atlas = Atlas(f"{self.folder.name}/map.db")
        self.other = self.atlas.begin("other", 0.0)
        self.map = self.atlas.begin("test", 1.0)

    @rule(target=ids, new=st.lists(landmarks, max_size=5))
    def put(self, new):
        found = self.map.put(new)
        for id, landmark in zip(found, new, strict=True):
            assert id not in self.states
            self.model[id] = replace(landmark, id=id)
            self.states[id] = {int(landmark.last_seen): self.model[id]}
        return multiple(*found)

    @rule(id=ids, landmark=landmarks)
    def update(self, id, landmark):
        self.model[id] = replace(landmark, id=id)
        self.states[id][int(landmark.last_seen)] = self.model[id]
        self.map.put([self.model[id]])

    @rule(id=consumes(ids))
    def remove(self, id):
        self.map.remove([id])
        del self.model[id]
        with pytest.raises(UnknownLandmarkError):
            self.map[id]

    @rule(landmark=landmarks)
    def fail(self, landmark):
        with pytest.raises(UnknownLandmarkError):
            self.map.put([landmark, replace(landmark, id=10**6)])

    @rule(landmark=landmarks)
    def use_another_session(self, landmark):
        (id,) = self.other.put([landmark])
        assert self.atlas.holding(id).session == self.other.session
        for refused in (lambda: self.map[id], lambda: self.map.remove([id]), lambda: self.map.history(id)):
            with pytest.raises(UnknownLandmarkError):
                refused()
        with pytest.raises(UnknownLandmarkError):
            self.map.put([replace(landmark, id=id)])

    @rule()
    def delete_another_session(self):
        self.atlas.delete(self.other.session)
        with pytest.raises(UnknownSessionError):
            self.other.put([corner()])
        self.other = self.atlas.begin("other", 0.0)

    @rule()
    def reopen(self):
        self.atlas.close()
        self.atlas = Atlas(f"sqlite:///{self.atlas.path}")
        self.map, self.other = self.atlas[self.map.session], self.atlas[self.other.session]

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
        assert history == [self.states[id][s] for s in sorted(self.states[id])]
        assert self.atlas.holding(id).session == self.map.session

    def teardown(self):
        self.atlas.close()
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

    with Atlas(path) as atlas:
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            process.stdout.readline()
            landmark_map, written = atlas.newest(), threading.Event()
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
    states = landmark_map.history(id)
    assert [landmark.count for landmark in states] == [9, 19, 29, 39, 49, 59, 69, 79, 89, 99]
    first = landmark_map.history(id, limit=4)
    rest = landmark_map.history(id, after=first[-1].last_seen)
    assert first + rest == states
    landmark_map.remove([id])
    assert landmark_map.history(id) == states
    with pytest.raises(UnknownLandmarkError):
        landmark_map.history(id + 1)


def test_sessions_are_told_apart(atlas):
    first, second = atlas.begin("a.mcap", 5.0, "slam"), atlas.begin("device", 9.0)
    first.put([corner(), corner(5)])
    atlas.end(first.session, 7.0)
    assert atlas.sessions() == [
        Session(1, "a.mcap", "slam", 5.0, 7.0, 2),
        Session(2, "device", "", 9.0, None, 0),
    ]
    atlas.end(second.session, 8.0)  # the clock was set back
    assert atlas.session(2).ended == 9.0
    assert (len(atlas[1]), len(atlas[2]), atlas.newest().session) == (2, 0, 1)
    for refused in (
        lambda: atlas[3],
        lambda: atlas.session(3),
        lambda: atlas.end(3, 9.0),
        lambda: atlas.delete(3),
    ):
        with pytest.raises(UnknownSessionError, match="no session 3"):
            refused()
    for refused in (lambda: atlas.begin("clock", float("nan")), lambda: atlas.end(1, float("inf"))):
        with pytest.raises(LandmarkError):
            refused()
    with pytest.raises(UnknownLandmarkError):
        atlas.holding(3)


def test_the_newest_map_is_one_that_has_landmarks(atlas):
    assert atlas.newest() is None
    assert atlas.sessions() == []
    first, second, _ = (atlas.begin("run", 0.0) for _ in range(3))
    assert atlas.newest() is None
    for landmark_map in (first, second):
        landmark_map.put([corner()])
        assert atlas.newest().session == landmark_map.session
    second.clear()
    assert atlas.newest().session == first.session


def test_a_deleted_session_is_gone_with_all_it_had_and_its_ids_are_not_given_again(atlas):
    kept, gone = atlas.begin("kept", 1.0), atlas.begin("gone", 2.0)
    (stays,), ids = kept.put([corner()]), gone.put(RandomLandmarks(2500).landmarks())
    gone.remove(ids[:1])
    atlas.delete(gone.session)
    assert [one.id for one in atlas.sessions()] == [kept.session]
    assert atlas.newest().session == kept.session
    assert [m.id for m in kept] == [stays]
    for id in (ids[0], ids[-1]):
        with pytest.raises(UnknownLandmarkError):
            atlas.holding(id)
    with sqlite3.connect(atlas.path) as connection:
        for table in ("landmarks", "places", "history", "extents"):
            assert connection.execute(f"SELECT count(*) FROM {table}").fetchone() == (1,), table
    connection.close()
    new = atlas.begin("new", 3.0)
    assert new.session == gone.session + 1
    assert new.put([corner()]) == [ids[-1] + 1]


DELETER = """
import sys
from lidarcore.landmarks import Atlas
print("deleting", flush=True)
Atlas(sys.argv[1]).delete(1)
"""


@pytest.mark.long
def test_a_deletion_that_is_killed_is_whole_and_the_next_one_frees_the_rest(tmp_path):
    path = tmp_path / "map.db"
    with Atlas(path) as atlas:
        atlas.begin("first", 1.0).put(RandomLandmarks(20_000).landmarks())
        (id,) = atlas.begin("second", 2.0).put([corner()])
        atlas.begin("third", 3.0)
        with subprocess.Popen([sys.executable, "-c", DELETER, str(path)], stdout=subprocess.PIPE) as process:
            process.stdout.readline()
            while len(atlas.sessions()) == 3:
                pass
            process.kill()
        with pytest.raises(UnknownSessionError):
            atlas[1]
        assert [m.id for m in atlas[2]] == [id]
        atlas.delete(3)
        with sqlite3.connect(path) as connection:
            for table in ("landmarks", "places", "history", "extents"):
                assert connection.execute(f"SELECT count(*) FROM {table}").fetchone() == (1,), table


def test_what_fails_half_way_changes_nothing(landmark_map):
    ids = landmark_map.put(RandomLandmarks(20).landmarks())
    before = list(landmark_map)

    def breaking():
        yield corner()
        raise RuntimeError("source gone")

    for attempt in (
        lambda: landmark_map.put(breaking()),
        lambda: landmark_map.put([corner(id=ids[3]), corner(id=10**6)]),
        lambda: landmark_map.remove([*ids, 10**6]),
    ):
        with pytest.raises((RuntimeError, LandmarkMapError)):
            attempt()
        assert list(landmark_map) == before
        assert len(landmark_map.find(Box(-1e6, -1e6, 1e6, 1e6)).landmarks) == 20


def assert_same(found, expected):
    """Landmarks that differ by rounding at most."""
    for one, other in zip(found, expected, strict=True):
        values, others = asdict(one), asdict(other)
        numbers = {name for name, value in values.items() if isinstance(value, float)}
        assert {name: values[name] for name in numbers} == pytest.approx(
            {name: others[name] for name in numbers}, rel=1e-12
        )
        assert all(values[name] == others[name] for name in values.keys() - numbers)


def test_a_file_of_version_1_opens_with_all_it_had_as_one_session(tmp_path):
    """Written by the first version: 40 random landmarks, the seventh moved, the fifth and sixth removed again.

    The processor that wrote them multiplied matrices in another order: last digits may differ.
    """
    path = shutil.copy(Path(__file__).with_name("version_1.db"), tmp_path / "old.db")
    truth = [replace(m, id=i) for i, m in enumerate(RandomLandmarks(40).landmarks(), 1)]
    moved = corner(3, 4, id=7, count=9, last_seen=2e5)
    for _ in range(2):
        with Atlas(path) as atlas:
            landmark_map = atlas.newest()
            assert_same(landmark_map, [*truth[:4], moved, *truth[7:]])
            assert_same(landmark_map.history(7), [truth[6], moved])
            assert_same(landmark_map.history(5), [truth[4]])
            first, last = min(m.first_seen for m in (*truth, moved)), 2e5
            assert atlas.sessions() == [
                Session(1, "room.mcap", "", 5.0, None, 0),
                Session(2, "before sessions", "", first, last, 38),
            ]
            assert landmark_map.nearest((3, 4))[0].landmark == moved
            inside = [m for m in landmark_map if 20 <= m.x <= 40 and 30 <= m.y <= 50]
            assert landmark_map.find(Box(20, 30, 40, 50)).landmarks == inside != []


def test_walls_of_a_file_of_version_3_begin_their_history_with_what_they_are(tmp_path):
    """Written by the third version, which kept no history of walls: two of them, one seen before the clock began."""
    path = shutil.copy(Path(__file__).with_name("version_3.db"), tmp_path / "old.db")
    for _ in range(2):
        with Atlas(path) as atlas:
            (session,) = atlas.sessions()
            walls = atlas[session.id].walls()
            assert [(wall.id, wall.last_seen, wall.count) for wall in walls] == [(0, 20.5, 5), (7, -3.25, 8)]
            assert [atlas[session.id].wall_history(wall.id) for wall in walls] == [[wall] for wall in walls]
    grown = [
        replace(wall, length=3.0, last_seen=wall.last_seen + shift)
        for wall, shift in zip(walls, (0.4, 1.0), strict=True)
    ]
    with Atlas(path) as atlas:
        atlas[session.id].put_walls(grown)
        assert atlas[session.id].wall_history(0) == grown[:1]  # in the same second
        assert atlas[session.id].wall_history(7) == [walls[1], grown[1]]


def test_sessions_of_a_file_of_version_5_have_no_names_until_they_get_one(tmp_path):
    """Written by the fifth version, which knew no names: a session with a corner."""
    path = shutil.copy(Path(__file__).with_name("version_5.db"), tmp_path / "old.db")
    before = Session(1, "hall.mcap", "slam", 1000.0, 1060.0, 1)
    with Atlas(path) as atlas:
        assert atlas.sessions() == [before]
        assert_same(atlas[1], [corner(id=1)])
        atlas.rename(1, " hall ")
    with Atlas(path) as atlas:
        assert atlas.session(1) == replace(before, name="hall")
        atlas.rename(1, "")
        assert atlas.session(1) == before


def test_of_walls_of_a_file_of_version_6_it_is_not_known_how_they_err_together_until_it_is_put(tmp_path):
    """Written by the sixth version, which did not keep that: a session with a name and two walls."""
    path = shutil.copy(Path(__file__).with_name("version_6.db"), tmp_path / "old.db")
    with Atlas(path) as atlas:
        assert atlas.session(1) == Session(1, "hall.mcap", "slam", 1000.0, 1060.0, 0, walls=2, name="Hall")
        walls, covariance = atlas[1].walls_together()
        assert [(wall.id, wall.x1) for wall in walls] == [(0, 1.0), (7, 3.0)]
        assert covariance is None
        atlas[1].put_walls(walls, covariance=b"together")
    with Atlas(path) as atlas:
        assert atlas[1].walls_together() == (walls, b"together")
        atlas[1].put_walls(walls)
        assert atlas[1].walls_together() == (walls, None)
        atlas[1].put_walls(walls, covariance=b"again")
        atlas.delete(1)
    with sqlite3.connect(path) as connection:
        assert connection.execute("SELECT count(*) FROM wall_covariances").fetchone() == (0,)
    connection.close()


def test_a_name_that_cannot_be_shown_or_is_too_long_names_nothing(atlas):
    for name in ("a\tb", "x" * (MAX_NAME + 1)):
        with pytest.raises(LandmarkError, match="The name"):
            atlas.begin("x", 0.0, name=name)
    assert atlas.sessions() == []
    session = atlas.begin("x", 0.0, name="x" * MAX_NAME).session
    with pytest.raises(LandmarkError, match="The name"):
        atlas.rename(session, "\ud800")
    assert atlas.session(session).name == "x" * MAX_NAME
    for name in ("\u202eback", "a\u200d\nb"):
        with pytest.raises(LandmarkError, match="The name"):
            atlas.rename(session, name)
    atlas.rename(session, " \u200c ")
    assert atlas.session(session).name == ""
    atlas.rename(session, "\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645")  # Persian joins within a word
    with pytest.raises(UnknownSessionError):
        atlas.rename(session + 1, "y")


def test_an_empty_file_of_version_1_has_no_session(tmp_path):
    path = shutil.copy(Path(__file__).with_name("version_1.db"), tmp_path / "old.db")
    with sqlite3.connect(path) as connection:
        for table in ("landmarks", "places", "history", "sessions"):
            connection.execute(f"DELETE FROM {table}")
    connection.close()
    with Atlas(path) as atlas:
        assert atlas.newest() is None
        assert atlas.begin("new", 0.0).put([corner()]) == [41]


def spoil(path, *statements):
    Atlas(path).close()
    with sqlite3.connect(path) as connection:
        for statement in statements:
            connection.execute(statement)
    connection.close()


@pytest.mark.parametrize(
    ("statement", "text"),
    [
        ("PRAGMA user_version = 99", "update lidarcore"),
        ("UPDATE about SET unit = 'mm'", "'mm', not in metres"),
        ("PRAGMA application_id = 5", "not a landmark map"),
        ("DROP TABLE about", "are not those of a landmark map"),
    ],
)
def test_a_map_of_another_version_or_unit_is_refused_and_left_alone(tmp_path, statement, text):
    path = tmp_path / "map.db"
    spoil(path, statement)
    before = path.read_bytes()
    with pytest.raises(LandmarkMapError, match=text):
        Atlas(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", [b"not a database at all" * 100, b"SQLite format 3\0" + bytes(4000)])
def test_a_file_that_is_no_database_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "map.db"
    path.write_bytes(content)
    with pytest.raises(LandmarkMapError):
        Atlas(path)
    assert path.read_bytes() == content


def test_a_damaged_landmark_does_not_come_out(tmp_path):
    path = tmp_path / "map.db"
    with Atlas(path) as atlas:
        (id,) = atlas.begin("test", 0.0).put([corner()])
    spoil(path, "UPDATE landmarks SET var_x = -1")
    with Atlas(path) as atlas, pytest.raises(LandmarkError, match="positive definite"):
        atlas.newest()[id]


@pytest.mark.parametrize(
    "url", ["postgresql://host/map", ":memory:", "", "missing/folder/map.db", ".", "a\0b"]
)
def test_what_is_no_file_for_a_map_is_refused(url):
    with pytest.raises(LandmarkMapError):
        Atlas(url)


def test_a_closed_map_says_so(tmp_path):
    atlas = Atlas(tmp_path / "map.db")
    landmark_map = atlas.begin("test", 0.0)
    atlas.close()
    for use in (lambda: landmark_map.put([corner()]), lambda: landmark_map.find(), lambda: atlas.sessions()):
        with pytest.raises(LandmarkMapError, match="closed"):
            use()


def test_a_map_whose_tables_compute_is_refused(tmp_path):
    path = tmp_path / "map.db"
    with Atlas(path) as atlas:
        atlas.begin("room", 0.0).put([corner()])
    with sqlite3.connect(path) as database:
        database.execute("ALTER TABLE landmarks ADD COLUMN extra BLOB AS (zeroblob(990000000))")
    with pytest.raises(LandmarkMapError, match="not those of a landmark map"):
        Atlas(path)


def test_a_damaged_file_is_an_error_of_the_map_wherever_the_damage_is(tmp_path):
    """A byte that is no UTF-8, swept over the texts of the tables and over the whole file."""
    path = tmp_path / "map.db"
    with Atlas(path) as atlas:
        atlas.begin("room", 0.0).put([corner()])
    content = path.read_bytes()
    text = content.index(b"CREATE TABLE")
    for place in (*range(text, text + 4000, 41), *range(0, len(content), 1009)):
        damaged = tmp_path / f"damaged_{place}.db"
        damaged.write_bytes(content[:place] + b"\xff" + content[place + 1 :])
        with suppress(LandmarkMapError), Atlas(damaged) as atlas:
            atlas.sessions()
