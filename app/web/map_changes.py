"""Changes of the map that a client of the stream has still to be sent: the newest of each landmark."""

from pydantic_core import to_json

from lidarcore.landmarks import Landmark

from ..jobs.session_writer import MapChange


class MapChanges:
    """Changes of one session, one by one; those of a session before it no longer matter."""

    def __init__(self) -> None:
        self._session: int | None = None
        self._landmarks: dict[int | None, Landmark] = {}
        self._removed: set[int] = set()

    def __bool__(self) -> bool:
        return self._session is not None

    def add(self, change: MapChange) -> None:
        if change.session != self._session:
            self._session = change.session
            self._landmarks.clear()
            self._removed.clear()
        for id_ in change.removed:
            self._landmarks.pop(id_, None)
        self._removed.update(change.removed)
        self._landmarks.update((landmark.id, landmark) for landmark in change.landmarks)

    def text(self) -> str:
        """The changes as JSON."""
        rows = list(self._landmarks.values())
        return to_json({"session": self._session, "changed": rows, "removed": sorted(self._removed)}).decode()
