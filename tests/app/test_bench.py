"""`lidarcore bench` from beginning to end, with a fraction of the work: every part is measured and judged."""

import re

import pytest
from lidarcore_app.benchmarks import bench, map_load, repeatability_load, server_load

from lidarcore.evaluation.speed import extraction

LESS = {
    bench: {
        "SCANS": 3,
        "LOAD_SECONDS": 1.0,
        "TAB_SECONDS": 1.0,
        "TAB_ROUNDS": 2,
        "LANDMARKS": 2000,
        "QUESTIONS": 4,
        "MAPPED": 20,
    },
    extraction: {"REPEATS": 1},
    map_load: {"SETTLE": 0.1},
    repeatability_load: {"SETTLE": 0.1, "WINDOW": 5},
    server_load: {"SETTLE": 0.1},
}
PARTS = (
    "Extraction: 920 beams",
    "One line through 100 points",
    "RPLIDAR S1: 40 samples",
    "More beams",
    "known map: 3 states",
    "SLAM: a whole step",
    "the front end",
    "A finished map of 20 scans",
    "Walls and corners of the room",
    "SLAM and all layers on",
    "the furnished room, 100 scans",
    "one browser; in turn",
    "asked over HTTP",
)
"""Of each table's title."""


def test_every_part_is_measured_and_judged(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module, constants in LESS.items():
        for name, value in constants.items():
            monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(bench, "SLAM_MS", {100: 0.3, 150: None})
    monkeypatch.setenv("COLUMNS", "200")
    bench.run()
    told = capsys.readouterr().out
    for title in PARTS:
        table = told.partition(title)[2].partition("└")[0]
        measured = [line for line in table.splitlines() if line.startswith("│")]
        assert len(measured) >= 2, told
        assert all(re.search(r"│ +[+-]?\d[\d.]* ", line) for line in measured), table
    assert len(re.findall(r"\b(?:ok|missed)\b", told)) > 40
