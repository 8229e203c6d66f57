"""A server with an empty cache has the kernels of maps compiled beside it, and leaves nothing running."""

from pathlib import Path

import psutil
import pytest
from server_process import server
from waiting import wait_until

from lidarcore.mapping import precompile


def compiling(process: psutil.Process) -> list[psutil.Process]:
    return [child for child in process.children() if precompile.__name__ in child.cmdline()]


@pytest.mark.long
def test_kernels_are_compiled_in_a_process_that_ends_with_the_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The server ends long before they are."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    with server(tmp_path, "--emulator") as (process, _):
        wait_until(lambda: bool(compiling(process)))
        (child,) = compiling(process)
    wait_until(lambda: not child.is_running())
    assert "Traceback" not in (tmp_path / "log").read_text("utf-8")
