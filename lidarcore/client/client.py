"""A client of a running `lidarcore serve`, for scripts and robots. `with Client() as client: client.pose()`."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Unpack
from urllib.parse import quote

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.client.answers import PastPose, Pose, SeenCorner, Which
from lidarcore.client.connection import Connection, given
from lidarcore.closing import Closing
from lidarcore.errors import MapFileError, UnknownLandmarkError
from lidarcore.files import replacing
from lidarcore.landmarks import Box, Circle, Landmark, Metric, Neighbour, Session

_PAGE = 1000  # landmarks and states asked for at a time
_MEDIA_TYPES = {"json": "application/json", "csv": "text/csv", "geojson": "application/geo+json"}


class Client(Closing):
    """Speaks to the REST API and the WebSocket of one server.

    Every method raises ServerUnreachableError if nothing answers, and ClientError if the server refuses, with its
    reason. The server's own documentation is at /docs.
    """

    def __init__(
        self, url: str = "http://127.0.0.1:8000", token: str | None = None, timeout: float = 10.0
    ) -> None:
        """`url` and `token` as the server printed them when it started; `timeout` in s."""
        self._connection = Connection(url, token, timeout)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def landmarks(
        self,
        *,
        box: Box | Sequence[float] | None = None,
        circle: Circle | Sequence[float] | None = None,
        session: int | None = None,
        **which: Unpack[Which],
    ) -> Iterator[Landmark]:
        """Landmarks in a box (x_min, y_min, x_max, y_max) or a circle (x, y, radius), m, or all, page by page.

        Of a session; by default of the one that is written or used, else of the newest. Raises LandmarkError for a box
        or a circle that makes no sense.
        """
        asked: dict[str, Any] = {**which, "session": session, "limit": _PAGE}
        if box is not None:
            b = box if isinstance(box, Box) else Box(*box)
            asked["bbox"] = ",".join(str(float(bound)) for bound in (b.x_min, b.y_min, b.x_max, b.y_max))
        if circle is not None:
            c = circle if isinstance(circle, Circle) else Circle(*circle)
            asked |= {"x": c.x, "y": c.y, "radius": c.radius}
        while True:
            page = self._connection.get("/landmarks", **asked)
            yield from (Landmark(**row) for row in page["landmarks"])
            if page["next"] is None:
                return
            asked |= {"after": page["next"], "session": page["session"]}

    def nearest(
        self,
        x: float,
        y: float,
        k: int = 1,
        metric: Metric = "euclidean",
        *,
        within: float | None = None,
        sigma: float | None = None,
        session: int | None = None,
        **which: Unpack[Which],
    ) -> list[Neighbour]:
        """The k landmarks nearest to a point (m), nearest first; sigma (m) is of the point, for mahalanobis."""
        asked = {
            "x": x,
            "y": y,
            "k": k,
            "metric": metric,
            "within": within,
            "sigma": sigma,
            "session": session,
        }
        found = self._connection.get("/landmarks/nearest", **which, **asked)["neighbours"]
        return [Neighbour(Landmark(**one["landmark"]), one["distance"]) for one in found]

    def landmark(self, id: int) -> Landmark:
        """One landmark; raises UnknownLandmarkError if it was removed."""
        row = self._connection.get(f"/landmarks/{id}", limit=1)["landmark"]
        if row is None:
            raise UnknownLandmarkError(f"Landmark {id} was removed: its history tells what it was.")
        return Landmark(**row)

    def history(self, id: int) -> list[Landmark]:
        """What a landmark was in each second in which it was seen, the oldest first; also of one that was removed."""
        states: list[Landmark] = []
        page: dict[str, Any] = {"next": None}
        while not states or page["next"] is not None:
            page = self._connection.get(f"/landmarks/{id}", after=page["next"], limit=_PAGE)
            states += [Landmark(**row) for row in page["history"]]
        return states

    def sessions(self) -> list[Session]:
        """All sessions, the oldest first."""
        return [Session(**row) for row in self._connection.get("/sessions")["sessions"]]

    def delete_session(self, id: int) -> None:
        """Delete a session with its landmarks and their history."""
        self._connection.ask("DELETE", f"/sessions/{id}")

    def clear(self, session: int | None = None) -> None:
        """Give up all landmarks of a session."""
        self._connection.ask("DELETE", "/landmarks", params=given(session=session))

    def export_map(self, path: str | Path, session: int | None = None) -> None:
        """Write the map of a session; the suffix (.json, .csv, .geojson, .png, .zip) says what.

        Raises MapFileError if the file cannot be written; it appears when complete.
        """
        path = Path(path)
        asked = given(session=session, format=path.suffix.lower().removeprefix("."))
        content = self._connection.ask("GET", "/map", params=asked).content
        with _explained(path), replacing(path) as partial:
            partial.write_bytes(content)

    def import_map(self, path: str | Path) -> Session:
        """Load a file that `export_map` wrote (.json, .csv, .geojson) as a new session.

        Raises MapFileError if the file cannot be read.
        """
        path = Path(path)
        name = path.suffix.lower().removeprefix(".")
        headers = {"Content-Type": _MEDIA_TYPES.get(name, "application/octet-stream")}
        with _explained(path):
            content = path.read_bytes()
        asked = {"format": name, "name": path.name}
        return Session(
            **self._connection.ask("POST", "/map", params=asked, content=content, headers=headers).json()
        )

    def pose(self) -> Pose:
        """Where the sensor is."""
        row = self._connection.get("/pose")
        pose = np.array([row.pop("x"), row.pop("y"), row.pop("heading")])
        covariance = np.array(row.pop("covariance"))
        return Pose(pose=pose, covariance=covariance, **row)

    def trajectory(self, since: float | None = None, limit: int | None = None) -> list[PastPose]:
        """Where the sensor has been in this run, the oldest first: since a stamp (s), the newest `limit` poses."""
        return [
            PastPose(**row) for row in self._connection.get("/trajectory", since=since, limit=limit)["poses"]
        ]

    def set_pose(self, x: float, y: float, heading: float, covariance: ArrayLike | None = None) -> None:
        """Say where the sensor is: m, m, rad, with a covariance (3, 3) or some guess of it."""
        matrix = None if covariance is None else np.asarray(covariance, np.float64).tolist()
        self._connection.send("POST", "/pose", given(x=x, y=y, heading=heading, covariance=matrix))

    def send_odometry(self, stamp: float, x: float, y: float, heading: float) -> None:
        """Feed T_odom_sensor (m, m, rad) at a time (s, by the clock of the scans)."""
        self._connection.send("POST", "/odometry", {"stamp": stamp, "x": x, "y": y, "heading": heading})

    def reset(self) -> None:
        """Begin localization, or SLAM with an empty map, again."""
        self._connection.ask("POST", "/localization/reset")

    def corners(self, fitter: str | None = None) -> list[SeenCorner]:
        """The corners of the newest scan by one method; the main one if none is given."""
        rows = self._connection.get("/corners", fitter=fitter)
        seen = [(row["id"], *row["by_method"].values()) for row in rows]
        return [
            SeenCorner(id, np.array([one["x"], one["y"]]), np.array(one["covariance"]), one["angle"])
            for id, one in seen
        ]

    def repeatability(self) -> dict[str, Any]:
        """What each method claims of the corners, and how they scatter: as GET /api/v1/repeatability describes.

        Switched on by `client.set(repeatability={"running": True})` while the sensor stands still.
        """
        return self._connection.get("/repeatability")

    def calibrate(self, scans: int = 100) -> dict[str, Any]:
        """Begin to measure the noise of a sensor that stands still, from its next scans; see `calibration`."""
        return self._connection.send("POST", "/calibration", {"scans": scans})

    def calibration(self) -> dict[str, Any]:
        """The calibration under way, or the last one: as GET /api/v1/calibration describes."""
        return self._connection.get("/calibration")

    def profiles(self) -> list[dict[str, Any]]:
        """The noise profiles that were saved: name, noise, or the problem with the file."""
        return self._connection.get("/profiles")["profiles"]

    def save_profile(
        self,
        name: str,
        sigma_range: float,
        sigma_bearing: float,
        *,
        overwrite: bool = False,
        **parts: float,
    ) -> None:
        """Save a noise (m, rad) as a profile of the server; parts: others of `SensorNoise`, such as unevenness."""
        noise = {"sigma_range": sigma_range, "sigma_bearing": sigma_bearing, **parts}
        query = "?overwrite=true" if overwrite else ""
        self._connection.send(
            "PUT", f"/profiles/{quote(name, safe='')}{query}", {"extraction": {"noise": noise}}
        )

    def use_profile(self, name: str) -> dict[str, Any]:
        """Let extraction take the noise of a profile. All settings then."""
        return self.set(**self._connection.get(f"/profiles/{quote(name, safe='')}"))

    def delete_profile(self, name: str) -> None:
        """Delete a profile."""
        self._connection.ask("DELETE", f"/profiles/{quote(name, safe='')}")

    def settings(self) -> dict[str, Any]:
        """All settings, section by section."""
        return self._connection.get("/settings")

    def set(self, **sections: Mapping[str, Any]) -> dict[str, Any]:
        """Change settings: `client.set(navigation={"mode": "slam"})`; None puts a default back. All settings then."""
        return self._connection.send("PATCH", "/settings", sections)

    def frames(self, points: bool = False) -> Iterator[dict[str, Any]]:
        """Frames as they are made, each as GET /api/v1/frame describes; a slow client gets fewer, never old ones."""
        for message in self._connection.stream(f"/stream?points={str(points).lower()}"):
            if message.pop("type") == "frame":
                yield message


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise MapFileError(f"{path} cannot be read or written: {error.strerror}.") from error
