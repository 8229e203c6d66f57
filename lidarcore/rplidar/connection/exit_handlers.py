"""Closing what is open when the program ends: at its regular end, and when it is asked to end by a signal.

SIGINT already raises KeyboardInterrupt. SIGTERM and SIGHUP would end the program on the spot, with the motor turning;
here they raise SystemExit, so that every `with` is left as it should be. A handler of the program's own is respected.
"""

import atexit
import signal
import threading
from collections.abc import Callable
from types import FrameType

Handler = Callable[[int, FrameType | None], None] | signal.Handlers

_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
_open: list[Callable[[], None]] = []


def close_at_exit(close: Callable[[], None]) -> None:
    """Call `close` when the program ends, unless `forget_at_exit` comes first."""
    _open.append(close)
    atexit.register(close)
    _replace_handlers(signal.SIG_DFL, _leave)


def forget_at_exit(close: Callable[[], None]) -> None:
    """Do not call `close` when the program ends: what it closes is closed already."""
    if close in _open:
        _open.remove(close)
    atexit.unregister(close)
    if not _open:
        _replace_handlers(_leave, signal.SIG_DFL)


def _replace_handlers(old: Handler, new: Handler) -> None:
    if threading.current_thread() is not threading.main_thread():  # only that one may
        return
    for number in _SIGNALS:
        if signal.getsignal(number) == old:
            signal.signal(number, new)


def _leave(number: int, frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
