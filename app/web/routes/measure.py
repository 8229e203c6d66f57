"""Distances and angles between walls and corners, of a scan or of the map, with their standard deviations."""

from typing import Annotated

from fastapi import APIRouter, Query
from typing_extensions import TypedDict

from lidarcore.mapping import measure as of_map
from lidarcore.mapping import scan_measure as of_scan
from lidarcore.mapping.export import COVARIANCE_FILE
from lidarcore.mapping.walls import MOST_WALLS, JointWalls

from ...errors import NotFoundError
from ...jobs.maps.names import called
from ..dependencies import Server
from ..problems import ProblemError, documented
from ..requests.places import MeasuredFeatureJson, Place, found_at
from ..state import State
from .grid import asked_session

router = APIRouter(prefix="/measure", tags=["frame"], responses=documented(404, 422, 503))

MIXED = "One place is of the scan, the other of the map: give two of the scan, or two of the map."
OF_SCAN = "Both places are of the scan: leave out session, or give places of the map, such as map-wall:7."
NO_WALLS = (
    "No map is shown whose walls can be measured: give the session of one that is kept, or set navigation.mode to slam "
    "and navigation.method to scans, and wait."
)
BEING_MADE = "{} is still being made: leave out session to measure it as it is now."
BARE = "{} has no walls that can be measured: give the session of a map of whole scans."
TOO_MANY = "{} has more than {} walls: of so many it is not kept how they err together."
NOT_JOINT = (
    "A map that is kept can be measured if it is known how its walls err together. {} lacks that: its making was not "
    "finished, an older version kept it, or it was loaded without {}, which files of more than {} walls lack. {}"
)
FROM_RECORDING = "Make it once more from its recording, {}."
AGAIN = "It has no recording here: build another one by SLAM and end it, or load it with that file."


class MeasureJson(TypedDict):
    """A measurement by the main method: m and rad, one sigma; `angle` is null unless both are walls."""

    first: MeasuredFeatureJson
    second: MeasuredFeatureJson
    distance: float
    sigma: float
    angle: float | None
    angle_sigma: float | None


@router.get("", response_description="The distance, and the angle between walls")
def measure(
    server: Server,
    first: Place,
    second: Place,
    session: Annotated[
        int | None,
        Query(
            description="a map that is kept; if not given, places of the map are of the one that is made, or localized "
            "in, now"
        ),
    ] = None,
) -> MeasureJson:
    """How far two corners or walls of the current frame, or of a map, are from each other, and how sure that is.

    From a corner to a wall: across its line; between walls: across, on the average, which says nothing of walls that
    are not about parallel: their `angle` tells. 404 if nothing is near a place, no wall has the id, or both
    places name the same thing; 422 if one is of the scan and the other of the map, which err together in ways that
    nobody knows. Maps that are kept can be measured once they are finished, if they have at most 1,000 walls;
    404 says why another one cannot.
    """
    if first.startswith("map-") != second.startswith("map-"):
        raise ProblemError(422, MIXED)
    if session is not None and not first.startswith("map-"):
        raise ProblemError(422, OF_SCAN)
    where = _map(server, session) if first.startswith("map-") else server.runtime.newest()
    a, b = (found_at(where, place) for place in (first, second))
    if a.feature == b.feature:
        raise NotFoundError("Both places are on the same wall or corner: give places on two different ones.")
    walls = a.feature.kind == b.feature.kind == "wall"
    if isinstance(where, JointWalls):
        found = of_map.distance(where, a.feature, b.feature)
        turn = of_map.angle(where, a.feature, b.feature) if walls else None
    else:
        found = of_scan.distance(where.main, a.feature, b.feature)
        turn = of_scan.angle(where.main, a.feature, b.feature) if walls else None
    return {
        "first": a.said,
        "second": b.said,
        "distance": found.value,
        "sigma": found.sigma,
        "angle": turn.value if turn else None,
        "angle_sigma": turn.sigma if turn else None,
    }


def _map(server: State, session: int | None) -> JointWalls:
    """The walls of a map that is kept, or else of that which the page shows. Raises NotFoundError."""
    kept = asked_session(server, session)
    if kept is not None:
        return _kept(server, kept)
    picture = server.runtime.newest().picture
    if picture is None or not isinstance(picture.walls, JointWalls):
        raise NotFoundError(NO_WALLS)
    return picture.walls


def _kept(server: State, session: int) -> JointWalls:
    """The walls of a map that is kept. Raises NotFoundError, which says why they cannot be measured."""
    joint = server.landmarks.joint_walls(session)
    if joint is None:
        raise NotFoundError(_why_not(server, session))
    return joint


def _why_not(server: State, id: int) -> str:
    session = server.landmarks.atlas.session(id)
    if server.landmarks.writes(id):
        return BEING_MADE.format(called(session))
    if not session.walls:
        return BARE.format(called(session))
    if session.walls > MOST_WALLS:
        return TOO_MANY.format(called(session), MOST_WALLS)
    is_recorded = any(recording.name == session.source for recording in server.library.list())
    remedy = FROM_RECORDING.format(session.source) if is_recorded else AGAIN
    return NOT_JOINT.format(called(session), COVARIANCE_FILE, MOST_WALLS, remedy)
