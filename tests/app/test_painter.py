"""Pictures in a thread of their own."""

import threading

import pytest
from lidarcore_app.scene.painter import Painter


def test_of_what_waits_only_the_newest_is_painted() -> None:
    painter, painted, begun, free = Painter(), [], threading.Event(), threading.Event()

    def slow() -> None:
        begun.set()
        free.wait(60)
        painted.append("slow")

    painter.paint(slow)
    assert begun.wait(60)
    for name in ("overtaken", "overtaken, too", "newest"):
        painter.paint(lambda name=name: painted.append(name))
    assert painted == []  # nobody waited
    last = threading.Event()
    free.set()
    painter.paint(lambda: (painted.append("last"), last.set()))
    assert last.wait(60)
    painter.close()
    assert painted[0] == "slow"
    assert painted[-1] == "last"
    assert set(painted[1:-1]) <= {"newest"}


def test_a_picture_that_fails_is_logged_and_the_next_is_painted(caplog: pytest.LogCaptureFixture) -> None:
    painter, done = Painter(), threading.Event()

    def broken() -> None:
        done.set()
        raise ValueError("no such colour")

    painter.paint(broken)
    assert done.wait(60)
    painted = threading.Event()
    painter.paint(painted.set)
    assert painted.wait(60)
    painter.close()
    assert "a picture could not be painted" in caplog.text
    assert "no such colour" in caplog.text
