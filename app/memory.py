"""What a long-running process keeps of memory that it has freed."""

import ctypes
from contextlib import suppress

_M_ARENA_MAX = -8  # malloc.h of glibc
_MOST_ARENAS = 2


def share_arenas() -> None:
    """Have all threads share few of glibc's heaps: each keeps what its threads freed, and requests come in many."""
    with suppress(AttributeError, OSError, TypeError):  # another C library, which has none
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, _MOST_ARENAS)
