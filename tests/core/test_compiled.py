"""Compiled kernels: kept on disk while they and all that they use stay the same, wherever there is room for them."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import numba
import numpy as np
import pytest

import lidarcore  # noqa: F401
from lidarcore import compiled

CALLEE = "from lidarcore.compiled import inlined\n@inlined\ndef part(x):\n    return x {}\nFACTOR = {}\n"
CALLER = """
import callee
from callee import part
from lidarcore.compiled import kernel
FACTOR = callee.FACTOR
@kernel
def whole(x):
    return FACTOR * part(x)
print(whole(3.0), sum(whole.stats.cache_hits.values()))
"""


@compiled.kernel
def floor(x: float) -> float:
    return np.floor(x)


def run(folder: Path, source: str, name: str = "callee") -> tuple[float, int]:
    """What the caller gives with this callee in a process of its own, and whether its code was read from disk."""
    (folder / f"{name}.py").write_text(source)
    (folder / "caller.py").write_text(CALLER.replace("callee", name))
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kept"), "PYTHONDONTWRITEBYTECODE": "1"}
    made = subprocess.run(
        [sys.executable, "caller.py"], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    value, hits = made.stdout.split()
    return float(value), int(hits)


@pytest.mark.long
def test_kept_code_is_used_until_a_kernel_that_it_calls_or_a_constant_changes(tmp_path: Path) -> None:
    assert run(tmp_path, CALLEE.format("+ 1", 10)) == (40.0, 0)
    assert run(tmp_path, CALLEE.format("+ 1", 10)) == (40.0, 1)
    assert run(tmp_path, CALLEE.format("+ 1  # a remark", 10)) == (40.0, 1)
    assert run(tmp_path, CALLEE.format("* 2", 10)) == (60.0, 0)
    assert run(tmp_path, CALLEE.format("* 2", 100)) == (600.0, 0)


@pytest.mark.long
def test_kept_code_is_made_anew_where_a_module_that_it_used_has_another_name(tmp_path: Path) -> None:
    assert run(tmp_path, CALLEE.format("+ 1", 10)) == (40.0, 0)
    (tmp_path / "callee.py").unlink()
    assert run(tmp_path, CALLEE.format("+ 1", 10), "renamed") == (40.0, 0)
    assert run(tmp_path, CALLEE.format("+ 1", 10), "renamed") == (40.0, 1)


def test_a_kernel_may_have_the_name_of_what_it_calls_in_another_module() -> None:
    assert floor(2.5) == 2.0


def test_numbas_settings_are_left_alone() -> None:
    assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR


def test_where_nothing_can_be_kept_it_says_so_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "a file"
    blocked.touch()
    monkeypatch.setattr(compiled, "_candidates", lambda: iter([blocked / "first", blocked / "second"]))
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    compiled.folder.cache_clear()
    try:
        with pytest.warns(RuntimeWarning, match="Set NUMBA_CACHE_DIR") as warned:
            folder = compiled.folder()
        with warnings.catch_warnings(action="error"):
            assert compiled.folder() == folder
        assert len(warned) == 1
        assert folder.is_dir()
    finally:
        compiled.folder.cache_clear()


def test_the_second_choice_is_taken_where_the_first_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a file").touch()
    monkeypatch.setattr(
        compiled, "_candidates", lambda: iter([tmp_path / "a file" / "kernels", tmp_path / "home"])
    )
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    compiled.folder.cache_clear()
    try:
        assert compiled.folder() == tmp_path / "home"
    finally:
        compiled.folder.cache_clear()
