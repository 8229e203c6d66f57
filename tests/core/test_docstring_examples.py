"""The examples in docstrings of the public API run and print what they say."""

import doctest
from pathlib import Path
from types import ModuleType

import pytest

import lidarcore.extraction
import lidarcore.lines
import lidarcore.localization.navigator
import lidarcore.recordings


@pytest.mark.parametrize(
    ("module", "examples"),
    [
        (lidarcore.extraction, 2),
        (lidarcore.lines, 1),
        (lidarcore.localization.navigator, 1),
        (lidarcore.recordings, 1),
    ],
)
def test_examples_print_what_they_say(
    module: ModuleType, examples: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # some write files
    found = [test for test in doctest.DocTestFinder().find(module) if test.examples]
    assert len(found) == examples
    for test in found:
        assert doctest.DocTestRunner().run(test).failed == 0
