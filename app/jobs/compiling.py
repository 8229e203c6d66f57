"""The kernels of maps, compiled in a process of its own after an installation: the first map would wait a minute."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from lidarcore.mapping import ahead

_END_WITHIN = 5.0  # s


@contextmanager
def compiled_ahead() -> Iterator[None]:
    """Compile what the cache lacks while something else is done; what is not finished by then is left for next time."""
    if not ahead.is_missing():
        yield
        return
    process = subprocess.Popen([sys.executable, "-m", ahead.__name__], stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait(_END_WITHIN)
