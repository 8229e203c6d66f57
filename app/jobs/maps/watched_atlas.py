"""The file of maps, which tells that the list of its sessions is another one: who shows it asks for it again."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lidarcore.landmarks import Atlas, LandmarkMap


class WatchedAtlas(Atlas):
    """An atlas that counts how often its sessions were changed through it: begun, ended, named or deleted.

    revision   another number after each change
    listeners  called after each, in the thread that made it
    """

    def __init__(self, url: str | Path, patience: float) -> None:
        super().__init__(url, patience)
        self.revision = 0
        self.listeners: list[Callable[[], None]] = []

    def begin(self, *given: Any, **named: Any) -> LandmarkMap:
        """As that of Atlas, and so are the others."""
        begun = super().begin(*given, **named)
        self._changed()
        return begun

    def end(self, session: int, ended: float) -> None:
        super().end(session, ended)
        self._changed()

    def rename(self, session: int, name: str) -> None:
        super().rename(session, name)
        self._changed()

    def delete(self, session: int) -> None:
        super().delete(session)
        self._changed()

    def _changed(self) -> None:
        self.revision += 1
        for listener in self.listeners:
            listener()
