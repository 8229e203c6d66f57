"""The log of the server under attack: what is said again and again is said a few times, then counted."""

import logging
import time
from dataclasses import dataclass

OFTEN = 5  # times that the same thing is said
WITHIN = 60.0  # s; then it may be said again
SERVERS = ("uvicorn.error", "websockets.server", "asyncio")


@dataclass(slots=True)
class _Said:
    since: float
    times: int = 0


class Throttle(logging.Filter):
    """Lets a message, whatever its arguments, through OFTEN times in WITHIN seconds; then says how many it left out."""

    def __init__(self) -> None:
        super().__init__()
        self._said: dict[tuple[str, int, str], _Said] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record is to be logged. One that follows some left out says how many they were."""
        now, key = time.monotonic(), (record.name, record.lineno, record.pathname)
        said = self._said.setdefault(key, _Said(now))
        left_out = said.times - OFTEN
        if now - said.since > WITHIN:
            said.since, said.times = now, 0
            if left_out > 0:
                record.msg, record.args = f"{record.getMessage()} (and {left_out} more like it before)", None
        said.times += 1
        return said.times <= OFTEN


def throttle_servers() -> None:
    """Throttle what uvicorn, its WebSockets and asyncio say: a flood of connections is not to fill the disk."""
    for name in SERVERS:
        logging.getLogger(name).addFilter(Throttle())
