"""Where the sensor is: pose, trajectory, initial pose, odometry from outside, the map to localize in."""

from dataclasses import fields
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Body, Query
from pydantic import Field, TypeAdapter, WithJsonSchema
from starlette.responses import Response
from typing_extensions import TypedDict

from ...errors import NO_BODY, NotFoundError, NotYetError
from ...pipeline.localization_status import LocalizationStatus
from ...pipeline.navigation import NOT_LOCALIZED, SIGMA_HEADING, SIGMA_POSITION, Navigation
from ...pipeline.runtime import Runtime
from ...pipeline.slam_run import Localization
from ...pipeline.tables import csv_text
from ...pipeline.trails import TrackedPose
from ...records import record
from ..answers.downloads import file_of
from ..answers.serializers import pose_json
from ..dependencies import Server
from ..openapi import formats
from ..problems import ProblemError, documented, encode
from ..schemas import Body as Model
from ..schemas import Coordinate, Matrix3, Number, OdometryPose, Row3

router = APIRouter(tags=["localization"], responses=documented(422))

MOST_POSES = 10_000
COLUMNS = [field.name for field in fields(TrackedPose)]
ODOMETRY = {"stamp": 1795255000.1, "x": 1.2, "y": -0.3, "heading": 0.5}
ONE = OdometryPose.model_json_schema()
ONE_OR_SOME = {"anyOf": [ONE, {"type": "array", "items": ONE}], "examples": [ODOMETRY]}


class CurrentPoseJson(TypedDict):
    """T_world_sensor at `stamp` with its covariance (m², m rad, rad²), and what the filter thinks of itself.

    While a map is localized in and the state is `starting`, nothing is known of the pose yet: its numbers count from
    zero, and its covariance is that of a pose that may be anywhere. In the state `lost` they go on from where the
    sensor was last found, and are not to be trusted.
    """

    stamp: float
    mode: Literal["localize", "slam"]
    state: Literal["starting", "tracking", "coasting", "lost"]
    message: str | None
    x: float
    y: float
    heading: float
    covariance: Matrix3
    nis: float
    dof: int


class TrajectoryJson(TypedDict):
    poses: list[TrackedPose]


class InitialPose(Model):
    """T_world_sensor, with its covariance or the standard deviations of position and heading."""

    x: Coordinate
    y: Coordinate
    heading: Annotated[Number, Field(description="rad")]
    covariance: tuple[Row3, Row3, Row3] | None = Field(None, description="of x, y, heading: m², m rad, rad²")
    sigma_position: Annotated[Number, Field(gt=0, le=100, description="m")] = SIGMA_POSITION
    sigma_heading: Annotated[Number, Field(gt=0, le=10, description="rad")] = SIGMA_HEADING


class MapChoice(Model):
    """The session to localize in; null for the newest that has landmarks."""

    session: Annotated[int, Field(strict=True)] | None


Since = Annotated[float | None, Query(allow_inf_nan=False, description="only poses after this stamp, s")]
Limit = Annotated[int, Query(ge=1, le=MOST_POSES, description="at most so many, the newest")]
Format = Annotated[Literal["json", "csv"], Query(description="JSON, or CSV with a header")]


@router.get("/localization", response_description="What is localized, and in which map")
def read(server: Server) -> LocalizationStatus:
    """Whether the pose is estimated, and in which map."""
    return server.runtime.localization()


@router.post("/localization/reset", response_description="What is localized now")
def reset(server: Server) -> LocalizationStatus:
    """Start over: SLAM with an empty map in a new session, localization from nothing."""
    server.runtime.navigate(Navigation.reset)
    return server.runtime.localization()


@router.put("/localization/map", response_description="What is localized in", responses=documented(404))
def choose_map(
    server: Server, choice: Annotated[MapChoice, Body(examples=[{"session": 3}])]
) -> LocalizationStatus:
    """Choose the map to localize in; the mode stays what it is."""
    server.runtime.navigate(lambda navigation: navigation.choose_map(choice.session))
    return server.runtime.localization()


@router.get("/pose", response_description="The pose after the newest scan", responses=documented(404, 503))
def pose(server: Server) -> CurrentPoseJson:
    """Where the sensor is."""
    found = _localized(server.runtime).tracking
    estimate = found.estimate
    return record(CurrentPoseJson, found, **pose_json(estimate.pose), covariance=estimate.covariance.tolist())


@router.post("/pose", response_description="The pose is set", responses=documented(409))
def place(
    server: Server,
    pose: Annotated[InitialPose, Body(examples=[{"x": 1.0, "y": 0.5, "heading": 0.0}])],
) -> LocalizationStatus:
    """Tell where the sensor is. 409 if nothing is localized, or SLAM builds a map of whole scans."""
    variances = [pose.sigma_position**2, pose.sigma_position**2, pose.sigma_heading**2]
    covariance = np.diag(variances) if pose.covariance is None else np.array(pose.covariance)
    wanted, at = server.runtime.settings.navigation, (pose.x, pose.y, pose.heading)
    server.runtime.navigate(lambda navigation: navigation.place(at, covariance, wanted))
    return server.runtime.localization()


@router.get(
    "/trajectory",
    response_model=TrajectoryJson,
    response_description="The poses of this run, the oldest first",
    responses=formats(csv=",".join(COLUMNS)),
)
def trajectory(server: Server, since: Since = None, limit: Limit = 1000, format: Format = "json") -> Response:
    """Where the sensor has been in this run, as the filter had it at each moment; empty if nothing is localized."""
    poses = server.runtime.navigation.trajectory
    rows = [row for row in poses if since is None or row.stamp > since][-limit:]
    if format == "csv":
        columns = {name: [getattr(row, name) for row in rows] for name in COLUMNS}
        return file_of(csv_text(columns), "csv", "trajectory")
    return encode({"poses": rows})


@router.post("/odometry", status_code=204)
def odometry(
    server: Server,
    poses: Annotated[Any, WithJsonSchema(ONE_OR_SOME), Body()],
) -> None:
    """Feed T_odom_sensor, one pose or some in their order; stamps are Unix seconds, as those of the scans.

    Refused, and left out, if the clock went back or the pose jumped: what came before it in a list is taken.
    More than a thousand a second are left out. GET /localization tells what became of them.
    """
    for pose in _poses(poses):
        server.runtime.feed(pose.stamp, (pose.x, pose.y, pose.heading))


def _poses(body: Any) -> list[OdometryPose]:
    """One pose or several; a union of both would complain about both. Raises ProblemError or ValidationError."""
    if isinstance(body, bytes):  # FastAPI hands over what is not declared to be JSON as it came
        raise ProblemError(422, NO_BODY)
    if isinstance(body, list):
        return TypeAdapter(list[OdometryPose]).validate_python(body)
    return [OdometryPose.model_validate(body)]


def _localized(runtime: Runtime) -> Localization:
    """What the newest frame says of the pose. Raises NotFoundError, NotYetError."""
    problem = NOT_LOCALIZED if runtime.settings.navigation.mode == "off" else runtime.navigation.problem
    if problem:
        raise NotFoundError(f"There is no pose. {problem}")
    if (found := runtime.newest().localization) is None:
        raise NotYetError("There is no pose yet: no scan has been localized. Ask again in a while.")
    return found
