"""How many heaps the C library keeps for many threads, counted by itself (malloc_info(3))."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import ctypes, sys, threading
from lidarcore_app.web.serving import share_arenas
if sys.argv[1:]:
    share_arenas()
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
together = threading.Barrier(12)
def allocate():
    together.wait()
    libc.malloc(5000)
    together.wait()
threads = [threading.Thread(target=allocate) for _ in range(12)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
libc.malloc_info(0, ctypes.c_void_p.in_dll(libc, "stdout"))
libc.fflush(None)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_threads_share_few_heaps() -> None:
    def heaps(*arguments: str) -> int:
        run = subprocess.run(
            [sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=True
        )
        return run.stdout.count("<heap nr")

    assert heaps() > 2
    assert heaps("shared") <= 2
