"""What `lidarcore bench` says of maps: every scan that is asked for is timed, and a table tells both and the limits."""

import numpy as np
import pytest
from lidarcore_app.benchmarks import bench
from rich.console import Console

from lidarcore.evaluation.speed import mapping


def test_as_many_scans_are_timed_as_are_asked_for() -> None:
    took, yardstick = mapping.time_front_end(scans=12)
    assert took.shape == yardstick.shape == (12,)
    assert (np.concatenate([took, yardstick]) > 0).all()


def test_a_limit_is_held_by_the_figure_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    times = np.r_[np.full(95, 1.5), np.full(5, 7.0)], np.full(100, 0.25)
    monkeypatch.setattr(bench, "time_front_end", lambda: times)
    console = Console(width=200)
    with console.capture() as shown:
        console.print(bench._front_end())
    rows = [line for line in shown.get().splitlines() if "ms" not in line]
    assert any("yardstick" in row and row.count("0.25") == 2 for row in rows)
    assert any("1.50 (at most 2) ok" in row and "7.00 (at most 5) missed" in row for row in rows)
