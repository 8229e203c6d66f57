"""The driver at a port where nobody answers."""

import os
import select
import signal
import threading
import time
from pathlib import Path

import pytest
from driving import PATIENCE, Program

from lidarcore.errors import DeviceError, NoAnswerError
from lidarcore.rplidar import Driver
from lidarcore.rplidar.protocol import Command, RequestReader


@pytest.mark.long
def test_silence_is_told_in_bounded_time() -> None:
    ends = os.openpty()
    start = time.monotonic()
    with pytest.raises(NoAnswerError, match=r"Nothing answers.*power"):
        Driver(os.ttyname(ends[1])).__enter__()
    assert time.monotonic() - start < PATIENCE / 2
    for end in ends:
        os.close(end)


@pytest.mark.long
@pytest.mark.parametrize("stops", [1, 8], ids=["asking", "trying other baud rates"])
def test_closing_ends_connecting_to_silence(stops: int) -> None:
    far, near = os.openpty()
    driver = Driver(os.ttyname(near))

    def close() -> None:
        requests, seen = RequestReader(), 0
        while seen < stops and select.select([far], [], [], PATIENCE)[0]:
            seen += sum(request.command == Command.STOP for request in requests.feed(os.read(far, 4096)))
        closed.append(time.monotonic())
        driver.close()

    closed: list[float] = []
    closer = threading.Thread(target=close)
    closer.start()
    with pytest.raises(DeviceError, match="was closed"):
        driver.__enter__()
    assert time.monotonic() - closed[0] < 5  # by itself it ends after as long
    closer.join()
    for end in (far, near):
        os.close(end)


def test_a_signal_ends_connecting_to_silence_without_a_word(tmp_path: Path) -> None:
    far, near = os.openpty()
    with Program(os.ttyname(near), tmp_path / "sent", "with driver: pass") as program:
        assert select.select([far], [], [], PATIENCE)[0]  # it asks
        start = time.monotonic()
        program.terminate()
        assert program.communicate(timeout=PATIENCE) == ("", "")
    assert time.monotonic() - start < PATIENCE / 2
    assert program.returncode == 128 + signal.SIGTERM
    assert program.stopped_the_motor()
    for end in (far, near):
        os.close(end)
