"""The map of one session on disk: what is in it, and what it can be asked."""

import math
import sqlite3
from collections.abc import Iterable, Iterator
from typing import get_args

from numpy.typing import ArrayLike

from lidarcore.errors import LandmarkError, UnknownSessionError, UnknownWallError
from lidarcore.landmarks.database import Database
from lidarcore.landmarks.landmark import Landmark, as_covariance, as_position
from lidarcore.landmarks.landmark_store import (
    forget_landmarks,
    landmark_history,
    remove_landmark,
    store_landmarks,
    unknown_landmark,
)
from lidarcore.landmarks.nearest import Metric, Neighbour, Neighbourhood
from lidarcore.landmarks.queries import (
    SELECTED,
    Box,
    Circle,
    Filter,
    Page,
    check_finite,
    check_limit,
    check_order,
    find,
)
from lidarcore.landmarks.stored_grid import StoredGrid, grid_of, replace_grid
from lidarcore.landmarks.stored_wall import (
    StoredWall,
    covariance_of,
    replace_walls,
    wall_history,
    walls_of,
)

_ALL = Filter()
_IN_SESSION = f"SELECT {SELECTED} FROM landmarks WHERE session = :session"


class LandmarkMap:
    """The landmarks, and the walls, of one session, in metres in its world frame. An Atlas makes it.

    What `put` was given is on the disk when it returns. History keeps the last state of a landmark or wall within
    each second of its last_seen.
    """

    def __init__(self, database: Database, session: int) -> None:
        self._database = database
        self.session = session

    def __len__(self) -> int:
        with self._database.reading() as connection:
            query = "SELECT count(*) FROM landmarks WHERE session = ?"
            return int(connection.execute(query, (self.session,)).fetchone()[0])

    def __iter__(self) -> Iterator[Landmark]:
        """All landmarks in the order of their ids, as they were when the iteration began."""
        with self._database.reading() as connection:
            for row in connection.execute(f"{_IN_SESSION} ORDER BY id", {"session": self.session}):
                yield Landmark(*row)

    def __getitem__(self, id: int) -> Landmark:
        """Raises UnknownLandmarkError."""
        with self._database.reading() as connection:
            query, parameters = f"{_IN_SESSION} AND id = :id", {"session": self.session, "id": id}
            if row := connection.execute(query, parameters).fetchone():
                return Landmark(*row)
        raise unknown_landmark(self.session, id)

    def put(self, landmarks: Iterable[Landmark], without: Iterable[int] = ()) -> list[int]:
        """Store new landmarks (id None) and new states of known ones, and take out those `without`; the ids stored.

        All or none. The history of what is taken out stays. Raises UnknownLandmarkError for an id that is not in the
        map, UnknownSessionError if the session was deleted.
        """
        with self._database.writing() as connection:
            self._check(connection)
            for id in without:
                remove_landmark(connection, self.session, id)
            return store_landmarks(connection, self.session, landmarks)

    def put_walls(
        self,
        walls: Iterable[StoredWall],
        grid: StoredGrid | None = None,
        covariance: bytes | None = None,
    ) -> None:
        """Store walls, and the grid of the same moment, in place of those that the map has: all or nothing.

        covariance  how the walls err together, as `pack_covariance` gives it; that of earlier walls goes with them

        Raises UnknownSessionError if it was deleted.
        """
        with self._database.writing() as connection:
            self._check(connection)
            replace_walls(connection, self.session, walls, covariance)
            if grid is not None:
                replace_grid(connection, self.session, grid)

    def walls(self) -> list[StoredWall]:
        """All walls in the order of their ids."""
        with self._database.reading() as connection:
            return walls_of(connection, self.session)

    def walls_together(self) -> tuple[list[StoredWall], bytes | None]:
        """All walls in the order of their ids, and how they err together, if that is kept."""
        with self._database.reading() as connection:
            return walls_of(connection, self.session), covariance_of(connection, self.session)

    def wall_history(self, id: int, after: float = -math.inf, limit: int = 1000) -> list[StoredWall]:
        """States of one wall with last_seen > after (s), oldest first, also of one that is no longer in the map.

        Raises UnknownWallError.
        """
        check_limit("limit", limit)
        check_order("-inf", -math.inf, "after", after)
        with self._database.reading() as connection:
            found = wall_history(connection, self.session, id, after, limit)
        if found is None:
            raise UnknownWallError(f"Session {self.session} has no history of a wall {id}.")
        return found

    def grid(self) -> StoredGrid | None:
        """The occupancy grid, if there is one."""
        with self._database.reading() as connection:
            return grid_of(connection, self.session)

    def _check(self, connection: sqlite3.Connection) -> None:
        if not connection.execute("SELECT 1 FROM sessions WHERE id = ?", (self.session,)).fetchone():
            raise UnknownSessionError(f"Session {self.session} was deleted: begin another one.")

    def remove(self, ids: Iterable[int]) -> None:
        """Take landmarks out, all or none; their history stays. Raises UnknownLandmarkError."""
        self.put((), without=ids)

    def clear(self) -> None:
        """Give up all landmarks and their history, bit by bit, so that others who write need not wait."""
        forget_landmarks(self._database, self.session)

    def find(
        self, region: Box | Circle | None = None, which: Filter = _ALL, after: int = 0, limit: int = 1000
    ) -> Page:
        """A page of at most `limit` landmarks in the region (None: anywhere), in the order of their ids.

        `after` is 0 for the first page, then the `next` of the page before. Raises LandmarkError.
        """
        with self._database.reading() as connection:
            return find(connection, self.session, region, which, after, limit)

    def nearest(
        self,
        xy: ArrayLike,
        k: int = 1,
        which: Filter = _ALL,
        within: float = math.inf,
        metric: Metric = "euclidean",
        covariance: ArrayLike | None = None,
    ) -> list[Neighbour]:
        """The k landmarks nearest to a point (2,) m, nearest first; those of equal distance by id.

        within      largest distance: m, or for Mahalanobis without unit, such as the root of a chi-square gate
        covariance  (2, 2) m² of the point, for Mahalanobis: the distance is sqrt(d^T (C + covariance)^-1 d) with
                    the landmark's C; None for an exact point

        Looks at every landmark of the map where few pass the filter, or far off the map; there `within` helps.
        Raises LandmarkError.
        """
        x, y = as_position(xy)
        check_finite(x=x, y=y)
        check_limit("k", k)
        check_order("0", 0.0, "within", within)
        if metric not in get_args(Metric) or (metric == "euclidean" and covariance is not None):
            raise LandmarkError(
                f"metric is {metric!r}: choose mahalanobis, or euclidean, which takes no covariance of the point."
            )
        point = (0.0, 0.0, 0.0) if covariance is None else as_covariance(covariance)
        with self._database.reading() as connection:
            return Neighbourhood(connection, self.session, (x, y), point, which).nearest(k, within, metric)

    def history(self, id: int, after: float = -math.inf, limit: int = 1000) -> list[Landmark]:
        """States of one landmark with last_seen > after (s), oldest first, also of one that was removed.

        Raises UnknownLandmarkError.
        """
        check_limit("limit", limit)
        check_order("-inf", -math.inf, "after", after)
        with self._database.reading() as connection:
            return landmark_history(connection, self.session, id, after, limit)

    def extent(self) -> Box | None:
        """The smallest box around all landmarks, m; None for an empty map. Reads the whole map."""
        query = "SELECT min(x), min(y), max(x), max(y) FROM landmarks WHERE session = ?"
        with self._database.reading() as connection:
            bounds = connection.execute(query, (self.session,)).fetchone()
        return None if bounds[0] is None else Box(*bounds)
