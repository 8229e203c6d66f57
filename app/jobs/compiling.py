"""The kernels of maps, compiled in a process of its own after an installation: the first map would wait a minute."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from lidarcore.mapping import precompile


@contextmanager
def compiled_ahead() -> Iterator[None]:
    """Compile what the cache lacks while something else is done; what is not finished by then is left for next time.

    It says nothing: without it everything works, later.
    """
    if not precompile.is_missing():
        yield
        return
    # A session of its own: Ctrl-C ends the server, which then ends this process without a traceback in between.
    process = subprocess.Popen(
        [sys.executable, "-m", precompile.__name__],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield
    finally:
        process.kill()  # a kernel that is half written is written to a name of its own first
        process.wait()
