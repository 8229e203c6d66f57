"""Foreign files in a process of their own: what it yields, what it raises, and what it may not do."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app import isolation
from lidarcore_app.isolation import Isolated
from lidarcore_app.sources.recorded import RecordingSource
from serving import Server, assert_problem, wait_until, write_room

from lidarcore import LidarError, RecordingError, TopicError, open_recording


def test_a_recording_read_in_a_process_of_its_own_is_the_recording(tmp_path: Path) -> None:
    path = write_room(tmp_path / "room.npz")
    source = RecordingSource(path)
    source.start(lambda: None, lambda: None)
    wait_until(lambda: source.complete)
    expected = list(open_recording(path))
    assert (source.count, source.error, source.format) == (len(expected), None, open_recording(path).name)
    for i, scan in enumerate(expected):
        np.testing.assert_array_equal(source.scan(i).ranges, scan.ranges)
        assert source.scan(i).stamp == scan.stamp
    source.close()


def yields(*items: object) -> Iterator[object]:
    yield from items


def raises(error: Exception) -> Iterator[object]:
    yield 1
    raise error


def hoards() -> Iterator[object]:
    yield bytearray(isolation.MEMORY)


def sleeps() -> Iterator[object]:
    time.sleep(1000)
    yield 1


def dies() -> Iterator[object]:
    os.kill(os.getpid(), signal.SIGSEGV)
    yield 1


def test_what_a_function_yields_and_raises_arrives() -> None:
    assert list(Isolated("x", RecordingError, yields, 1, None, "two")) == [1, None, "two"]
    with pytest.raises(TopicError, match="two lidars") as caught:
        list(Isolated("x", RecordingError, raises, TopicError("two lidars", ("a", "b"))))
    assert caught.value.topics == ("a", "b")


@pytest.mark.parametrize(
    ("function", "text"), [(hoards, "more than 1024 MiB"), (sleeps, "nothing could be read"), (dies, "died")]
)
def test_what_hoards_hangs_or_dies_is_an_error_that_says_so(monkeypatch, function, text) -> None:
    monkeypatch.setattr(isolation, "QUIET", 20.0 if function is not sleeps else 0.5)
    reading = Isolated("odd.json", LidarError, function)
    with pytest.raises(LidarError, match=rf"Reading odd\.json was stopped: .*{text}"):
        list(reading)


def test_a_source_that_is_closed_ends_its_process(tmp_path: Path) -> None:
    source = RecordingSource(write_room(tmp_path / "room.npz", scans=3000))
    process = source._reading._process
    assert process.is_alive()
    source.start(lambda: None, lambda: None)
    source.close()
    assert not process.is_alive()
    assert source.error is None


@pytest.mark.long
def test_an_upload_too_large_to_be_read_is_refused_while_frames_go_on(server: Server) -> None:
    """100 MB of points in one scan: more than 1 GB as Python objects, were they read."""
    body = b'{"dev1": [' + b"[1.0, 2.0]," * 9_000_000 + b"[1.0, 2.0]]}"
    with server.stream() as stream:
        first = stream.frame()["sequence"]
        problem = assert_problem(server.http.put("/recordings/nested.json", content=body), 422)
        assert "more than 262144 beams" in problem["detail"]
        stream.frame(lambda frame: frame["sequence"] > first + 5)
    assert not (server.folder / "nested.json").exists()
