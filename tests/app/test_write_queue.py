"""Maps that wait to be written."""

import threading

from lidarcore_app.jobs.maps.session_writer import SessionWriter, Waiting
from lidarcore_app.jobs.maps.write_queue import MOST_RUNS, WriteQueue
from waiting import PATIENCE


class _Slow(SessionWriter):
    """Writes once the disk is free."""

    def write(self, disk: threading.Event, *, final: bool) -> None:
        disk.wait(PATIENCE)


def test_that_the_oldest_map_is_lost_where_too_many_wait_is_told(caplog) -> None:
    disk, queue = threading.Event(), WriteQueue(lambda _: None, lambda _: None)
    for _ in range(MOST_RUNS + 2):  # one is being written
        waiting = Waiting((disk,), ended=False, since=0.0)
        queue.schedule(_Slow(None, "a run", queue.schedule, None), waiting)
    assert queue.error == "More than 8 maps waited to be written: the oldest is lost."
    assert queue.error in caplog.messages
    disk.set()
    assert queue.close()
    assert queue.error is None
