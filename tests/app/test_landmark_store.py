"""The map of a run on its way to the disk."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from lidarcore_app.jobs.maps.session_writer import MapChange
from lidarcore_app.jobs.maps.store import LandmarkStore
from processes import Serving
from serving import ROOT, wait_until, write_room
from waiting import PATIENCE

from lidarcore.errors import UnknownSessionError
from lidarcore.landmarks import Atlas
from lidarcore.localization import Landmarks, Points


def landmarks(n: int, **columns: object) -> Landmarks:
    """Landmarks 100, 101, ... at (0, 0), (1, 0), ..., confirmed, sigma 0.1 m, seen ten times until 5 s."""
    given = {
        "ids": 100 + np.arange(n), "xy": np.stack([np.arange(n), np.zeros(n)], -1), "variance": 0.01,
        "confirmed": np.ones(n, bool), "counts": np.full(n, 10), "last_seen": np.full(n, 5.0),
    } | columns  # fmt: skip
    points = Points(given.pop("xy"), given.pop("variance") * np.eye(2), "corner")
    return Landmarks(points=points, first_seen=np.zeros(n), **given)


class Told:
    """What the listeners of a store are told."""

    def __init__(self, store: LandmarkStore) -> None:
        self.changes: list[MapChange] = []
        store.listeners.append(self.changes.append)

    def next(self) -> MapChange:
        wait_until(lambda: self.changes)
        return self.changes.pop(0)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[LandmarkStore]:
    opened = LandmarkStore(tmp_path / "landmarks.db")
    yield opened
    opened.close()


def test_confirmed_landmarks_get_into_a_session_of_their_run(store: LandmarkStore) -> None:
    told, run = Told(store), store.begin("room.mcap")
    assert store.map() is None
    run.put(landmarks(3, confirmed=np.array([True, False, True])), "ml")
    change = told.next()
    assert [(m.x, m.y, m.kind, m.method, m.count) for m in change.landmarks] == [
        (0.0, 0.0, "corner", "ml", 10),
        (2.0, 0.0, "corner", "ml", 10),
    ]
    assert (run.session, store.session, change.session, change.removed) == (1, 1, 1, ())
    assert tuple(store.map()) == change.landmarks
    assert [run.ids.get(id) for id in (100, 101, 102)] == [
        change.landmarks[0].id,
        None,
        change.landmarks[1].id,
    ]
    session = store.atlas.session(1)
    assert (session.source, session.mode, session.ended, session.landmarks) == ("room.mcap", "slam", None, 2)
    assert abs(session.started - time.time()) < 60


def moved(by: float) -> np.ndarray:
    return np.array([[0, 0], [1 + by, 0], [2, 0]])


@pytest.mark.long
@pytest.mark.parametrize(
    ("columns", "is_written"),
    [
        ({}, False),
        ({"xy": moved(0.02)}, False),
        ({"xy": moved(0.03)}, True),
        ({"counts": np.array([10, 11, 10])}, True),
        ({"last_seen": np.array([5.0, 14.0, 5.0])}, False),
        ({"last_seen": np.array([5.0, 15.0, 5.0])}, True),
    ],
)
def test_a_known_landmark_is_written_again_when_it_changed_enough_and_at_the_end_in_any_case(
    store: LandmarkStore, columns: dict, is_written: bool
) -> None:
    told, run = Told(store), store.begin("room.mcap")
    run.put(landmarks(3))
    ids = [m.id for m in told.next().landmarks]
    run.put(landmarks(3, **columns))
    run.put(landmarks(4, **{name: np.concatenate([c, landmarks_of(name)]) for name, c in columns.items()}))
    written: list[int] = []
    while ids[2] + 1 not in written:
        written += [m.id for m in told.next().landmarks]
    assert written == ([ids[1], ids[2] + 1] if is_written else [ids[2] + 1])
    store.use(None)
    wait_until(lambda: store.atlas.session(1).ended)
    (second,) = [m for m in store.atlas[1] if m.id == ids[1]]
    end = landmarks(3, **columns)
    assert (second.x, second.count, second.last_seen) == (
        end.points.xy[1, 0],
        end.counts[1],
        end.last_seen[1],
    )
    assert len(store.atlas[1].history(ids[0])) == 1


def landmarks_of(name: str) -> np.ndarray:
    """That column of one more landmark."""
    return {"xy": np.array([[3, 0]]), "counts": np.array([10]), "last_seen": np.array([5.0])}[name]


def finish(store: LandmarkStore, replay: str | None, until: float = 5.0) -> int:
    """A run with a map, from the beginning of what is replayed to `until` s; the session."""
    run = store.begin("room.mcap", replay=replay)
    run.put(landmarks(2, last_seen=np.full(2, until)))
    wait_until(lambda: run.session)
    store.use(None)
    wait_until(lambda: store.atlas.session(run.session).ended)
    return run.session


def test_a_map_that_was_named_is_kept_when_what_is_replayed_begins_again(store: LandmarkStore) -> None:
    first = finish(store, "again and again")
    store.atlas.rename(first, "hall")
    finish(store, "again and again")
    third = finish(store, "again and again")
    wait_until(lambda: [session.id for session in store.atlas.sessions()] == [first, third])


@pytest.mark.parametrize(("replay", "is_replaced"), [("again and again", True), (None, False)])
def test_only_of_what_is_replayed_a_finished_map_takes_the_place_of_the_one_before(
    store: LandmarkStore, replay: str | None, is_replaced: bool
) -> None:
    first, other, second = finish(store, replay), finish(store, "another recording"), finish(store, replay)
    left = [other, second] if is_replaced else [first, other, second]
    wait_until(lambda: [session.id for session in store.atlas.sessions()] == left)
    run = store.begin("room.mcap", replay=replay)
    run.put(landmarks(2))
    wait_until(lambda: run.session)
    assert [session.id for session in store.atlas.sessions()] == [*left, run.session]


def test_a_map_that_saw_less_does_not_take_the_place_of_one_that_saw_all(store: LandmarkStore) -> None:
    """Both go when the recording was mapped to its end again, or nearly."""
    all_of_it = finish(store, "again and again")
    broken_off = finish(store, "again and again", until=2.0)
    assert [session.id for session in store.atlas.sessions()] == [all_of_it, broken_off]
    again = finish(store, "again and again", until=4.9)
    wait_until(lambda: [session.id for session in store.atlas.sessions()] == [again])


def test_a_map_in_use_stays_when_its_recording_is_mapped_again(store: LandmarkStore) -> None:
    told, first = Told(store), finish(store, "again and again")
    run = store.begin("room.mcap", replay="again and again")
    run.put(landmarks(2))
    while told.next().session == first:
        pass
    store.use(first)
    wait_until(lambda: store.atlas.session(run.session).ended)
    time.sleep(0.1)
    assert [session.id for session in store.atlas.sessions()] == [first, run.session]


def test_small_steps_add_up(store: LandmarkStore) -> None:
    """What was written counts, not what was seen last."""
    told, run = Told(store), store.begin("room.mcap")
    run.put(landmarks(3))
    told.next()
    for i in range(1, 5):
        run.put(landmarks(3, xy=moved(0.01 * i)))
        time.sleep(0.05)
    (written,) = told.next().landmarks
    assert written.x == pytest.approx(1.03, abs=0.011)


def test_what_the_filter_gave_up_is_taken_out_and_its_history_stays(store: LandmarkStore) -> None:
    told, run = Told(store), store.begin("room.mcap")
    run.put(landmarks(3))
    first, second, third = told.next().landmarks
    run.put(landmarks(2, ids=np.array([100, 102])))
    change = told.next()
    assert change.removed == (second.id,)
    assert [m.id for m in store.map()] == [first.id, third.id]
    assert store.map().history(second.id) == [second]
    assert run.ids.get(101) is None


def test_runs_do_not_touch_each_other(store: LandmarkStore) -> None:
    told = Told(store)
    runs = []
    for i in range(3):
        runs.append(store.begin(f"run {i}"))
        runs[-1].put(landmarks(i + 1))
        told.next()
    assert [one.landmarks for one in store.atlas.sessions()] == [1, 2, 3]
    wait_until(lambda: [one.ended is None for one in store.atlas.sessions()] == [False, False, True])
    assert store.map().session == runs[2].session
    store.use(runs[0].session)
    assert store.map().session == runs[0].session
    with pytest.raises(UnknownSessionError):
        store.map(99)


def test_a_session_can_be_localized_in(store: LandmarkStore) -> None:
    told, run, truth = Told(store), store.begin("room.mcap"), landmarks(5)
    run.put(truth)
    change = told.next()
    known = store.landmarks(run.session)
    assert known.ids.tolist() == [m.id for m in change.landmarks]
    assert known.confirmed.all()
    np.testing.assert_array_equal(known.points.xy, truth.points.xy)
    np.testing.assert_array_equal(known.points.covariance, truth.points.covariance)
    assert known.points.kinds.tolist() == truth.points.kinds.tolist()
    assert store.newest() == run.session
    assert len(store.landmarks(store.atlas.begin("empty", 0.0).session)) == 0


def test_a_running_map_that_was_cleared_or_deleted_is_written_again_but_not_when_its_run_has_ended(
    store: LandmarkStore,
) -> None:
    told, run = Told(store), store.begin("room.mcap")
    run.put(landmarks(3))
    told.next()
    for i, give_up in enumerate((store.map().clear, lambda: store.atlas.delete(run.session)), 1):
        session = run.session
        give_up()
        run.put(landmarks(3, counts=np.full(3, 10 * 2**i)))
        assert len(told.next().landmarks) == 3
        assert len(store.map()) == 3
        assert run.session == (session if i == 1 else session + 1)
    run.put(landmarks(3, last_seen=np.full(3, 6.0)))
    store.atlas.delete(run.session)
    store.use(None)
    store.begin("next").put(landmarks(1))
    assert told.next().landmarks
    assert [one.source for one in store.atlas.sessions()] == ["next"]
    assert store.status.error is None


def test_a_map_is_written_later_where_writing_it_fails_for_a_reason_nobody_foresaw(
    store: LandmarkStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, begin = Told(store), store.atlas.begin

    def fail_once(*_: object) -> None:
        monkeypatch.setattr(store.atlas, "begin", begin)
        raise MemoryError

    monkeypatch.setattr(store.atlas, "begin", fail_once)
    store.begin("room.mcap").put(landmarks(2))
    wait_until(lambda: store.status.error)
    assert len(told.next().landmarks) == 2
    assert len(store.map()) == 2
    assert store.status.error is None


@pytest.mark.long
def test_a_locked_file_is_reported_holds_up_nobody_and_catches_up(store: LandmarkStore) -> None:
    told, run = Told(store), store.begin("room.mcap")
    run.put(landmarks(1))
    told.next()
    blocker = sqlite3.connect(store.atlas.path, isolation_level=None)
    blocker.execute("BEGIN IMMEDIATE")
    begin = time.monotonic()
    run.put(landmarks(2))
    first = time.monotonic()
    for n in range(3, 102):
        run.put(landmarks(n))
    assert time.monotonic() - begin < PATIENCE / 2  # else it waits as long as the file is locked
    wait_until(lambda: store.status.error)
    assert "locked" in store.status.error
    run.put(landmarks(101))
    behind = time.monotonic() - first
    assert store.status.behind_s >= behind  # what waits longest counts, however often a newer map comes
    assert len(store.map()) == 1  # whoever reads goes on
    blocker.execute("ROLLBACK")
    assert len(told.next().landmarks) == 100
    assert len(store.map()) == 101
    assert store.status.error is None
    assert not told.changes


@pytest.mark.long
def test_a_full_disk_is_reported_and_the_map_is_written_when_there_is_room(tmp_path: Path) -> None:
    script = """
import resource, signal, sys, time
from pathlib import Path
import numpy as np
from test_landmark_store import landmarks
from lidarcore_app.jobs.maps.store import LandmarkStore
store = LandmarkStore(sys.argv[1])
run = store.begin("full")
limit = resource.getrlimit(resource.RLIMIT_FSIZE)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, limit[1]))
n = 0
while store.status.error is None:
    n += 100
    run.put(landmarks(n))
    time.sleep(0.05)
print(store.status.error)
resource.setrlimit(resource.RLIMIT_FSIZE, limit)
store.close()
print(n, store.status.error)
"""
    path = tmp_path / "landmarks.db"
    command = [sys.executable, "-c", script, str(path)]
    done = subprocess.run(
        command, cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=240, check=True
    )
    error, end = done.stdout.splitlines()
    assert "cannot be used" in error
    n, error_at_end = end.split()
    assert error_at_end == "None"
    with Atlas(path) as atlas:
        assert len(atlas.newest()) == int(n)
        assert atlas.session(1).ended


RUN = """
import sys, time
from test_landmark_store import landmarks
from lidarcore_app.jobs.maps.store import LandmarkStore
store = LandmarkStore(sys.argv[1])
def say(*words):  # in one piece, as two threads do
    sys.stdout.write(" ".join(map(str, words)) + "\\n")
    sys.stdout.flush()
store.listeners.append(lambda change: say("stored", *(m.id for m in change.landmarks)))
run, n = store.begin("run"), 0
while True:
    n += 1
    run.put(landmarks(n))
    say("confirmed", n, time.time())
    time.sleep(0.02)
"""


def environment() -> dict[str, str]:
    here = Path(__file__).parent
    return os.environ | {"PYTHONPATH": f"{ROOT}:{here}:{here.parent}"}


BUSY = 2.0  # s that a machine may be late by


@pytest.mark.long
def test_no_landmark_confirmed_a_second_ago_is_lost_when_the_process_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "landmarks.db"
    command = [sys.executable, "-c", RUN, str(path)]
    with subprocess.Popen(command, cwd=ROOT, env=environment(), stdout=subprocess.PIPE, text=True) as process:
        lines = [process.stdout.readline().split() for _ in range(300)]
        os.kill(process.pid, signal.SIGKILL)
        killed = time.time()
        lines += [line.split() for line in process.stdout.read().splitlines()]
    confirmed = [int(n) for kind, n, *at in lines if kind == "confirmed" and float(at[0]) < killed - 1 - BUSY]
    stored = {int(id) for kind, *ids in lines if kind == "stored" for id in ids}
    with Atlas(path) as atlas:
        kept = list(atlas.newest())
        assert [m.x for m in kept] == list(range(len(kept)))
        assert stored <= {m.id for m in kept}
        assert len(kept) >= max(confirmed) > 20
        assert atlas.session(1).ended is None


@pytest.mark.long
def test_what_a_server_told_of_its_map_is_there_after_it_was_killed(
    serving: Callable[..., Serving], tmp_path: Path
) -> None:
    room, path = write_room(tmp_path / "room.npz", scans=300), tmp_path / "maps.db"
    server = serving(
        room, "--map", path, "--set", "navigation.mode=slam", "--set", "navigation.method=landmarks"
    )
    told: list[int] = []

    def has_four() -> bool:
        answer = httpx.get(f"{server.url}api/v1/landmarks", timeout=30)
        told[:] = [one["id"] for one in answer.json()["landmarks"]] if answer.is_success else []
        return len(told) == 4

    wait_until(has_four, seconds=60)
    server.process.kill()
    server.process.wait()
    with Atlas(path) as atlas:
        assert set(told) <= {m.id for m in atlas.newest()}
        (session,) = atlas.sessions()
        assert (session.source, session.ended) == ("room.npz", None)
