"""Scans of a live source, kept as they come."""

import numpy as np
from lidarcore_app.sources.history import HistorySource

from lidarcore import Scan


class Given(HistorySource):
    """Scans at given stamps, which have come."""

    name = "given"

    def __init__(self, stamps: list[float]) -> None:
        super().__init__(lambda scan: None)
        for stamp in stamps:
            self._take(Scan(np.ones(3), np.arange(3.0), stamp), arrival=stamp)

    def _follow(self) -> None:
        pass


def test_times_are_from_the_first_stamp_though_it_be_zero() -> None:
    assert [Given([0.0, 0.5, 1.0]).time(index) for index in range(3)] == [0.0, 0.5, 1.0]
    assert [Given([7.0, 7.5]).time(index) for index in range(2)] == [0.0, 0.5]
