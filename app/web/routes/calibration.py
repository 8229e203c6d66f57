"""The noise of the sensor: measured while it stands still, saved as a profile, chosen."""

from typing import Annotated

from fastapi import APIRouter, Body, Path, Query
from pydantic import Field
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore import SENSORS, SensorNoise
from lidarcore.evaluation.calibration.calibrate import LEAST_SCANS

from ...jobs.calibration import MOST_SCANS, CalibrationStatus
from ...jobs.profiles import Profile, ProfileEntry
from ..dependencies import Server
from ..openapi import example
from ..problems import documented
from ..schemas import StrictBody

router = APIRouter(tags=["calibration"])

Name = Annotated[str, Path(description="a plain file name, without its ending", examples=["hall"])]


class CalibrationStart(StrictBody):
    """What to collect."""

    scans: Annotated[int, Field(ge=LEAST_SCANS, le=MOST_SCANS, description="how many scans to take")] = 100


class SensorJson(TypedDict):
    """A kind of sensor, its usual noise, and the evidence for that."""

    name: str
    title: str
    noise: SensorNoise
    rests_on: str


class ProfilesJson(TypedDict):
    folder: str
    profiles: list[ProfileEntry]
    sensors: list[SensorJson]


SENSOR_LIST: list[SensorJson] = [
    {"name": name, "title": kind.title, "noise": kind.noise, "rests_on": kind.rests_on}
    for name, kind in SENSORS.items()
]


@router.get("/calibration", response_description="How far it is, and what was found")
def read(server: Server) -> CalibrationStatus:
    """The calibration under way, or the last one: metres and radians, with 95 % confidence intervals."""
    return server.calibration.status()


@router.post("/calibration", response_description="It began", responses=documented(409, 422))
def start(
    server: Server, start: Annotated[CalibrationStart, Body(examples=[{"scans": 200}])]
) -> CalibrationStatus:
    """Measure the noise from the next scans of what plays; the sensor has to stand still in a room with walls.

    What is null in the `noise` found could not be told: keep what the settings say.

    All of a recording is taken if it has fewer scans. Ask GET until the state is done or failed.
    """
    server.calibration.start(start.scans)
    return server.calibration.status()


@router.delete("/calibration", status_code=204)
def cancel(server: Server) -> None:
    """Give up the calibration under way; without one, forget what the last one found."""
    server.calibration.cancel()


@router.get("/profiles", response_description="All noise profiles")
def profiles(server: Server) -> ProfilesJson:
    """The noise profiles that were saved, and the usual noise of known kinds of sensor. Use one by PATCH /settings."""
    return {"folder": str(server.profiles.folder), "profiles": server.profiles.list(), "sensors": SENSOR_LIST}


@router.get(
    "/profiles/{name:path}",
    response_model=Profile,
    response_description="The file",
    responses=documented(404, 422),
)
def profile(server: Server, name: Name) -> Response:
    """One profile as a file: a part of the settings, which every command takes as --settings."""
    return Response(server.profiles.read(name).text, media_type="application/json")


@router.put(
    "/profiles/{name:path}",
    status_code=201,
    response_description="Saved",
    responses=documented(409, 422, 507),
)
def save(
    server: Server,
    name: Name,
    profile: Annotated[Profile, Body(examples=[example("Profile")])],
    overwrite: Annotated[bool, Query(description="replace a profile of that name")] = False,
) -> ProfileEntry:
    """Save a profile: the noise a calibration found, or a file that `lidarcore calibrate` wrote."""
    return server.profiles.write(name, profile, overwrite=overwrite)


@router.delete("/profiles/{name:path}", status_code=204, responses=documented(404, 422))
def delete(server: Server, name: Name) -> None:
    """Delete a profile. Settings that came from it stay."""
    server.profiles.delete(name)
