"""The noise of the sensor: measured while it stands still, saved as a profile, chosen."""

from typing import Annotated

from fastapi import APIRouter, Body, Path, Query
from fastapi.encoders import jsonable_encoder
from pydantic import Field
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore import SENSORS, SensorNoise
from lidarcore.evaluation.calibration.calibrate import LEAST_SCANS

from ...jobs.calibration import MOST_SCANS, CalibrationStatus
from ...jobs.profiles import Profile, ProfileEntry
from ..problems import documented
from ..schemas import StrictBody
from .dependencies import CurrentCalibration, CurrentProfiles
from .examples import Json, ok

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


NOISE = {
    "sigma_range": 0.00997,
    "sigma_bearing": 0.00102,
    "range_growth": 0.0003,
    "unevenness": 0.0038,
    "unevenness_length": 0.091,
    "systematic": 0.0,
    "tails": 0.1,
    "renewal": 0.4,
    "resampling": 0.98,
}
FOUND = {name: value for name, value in NOISE.items() if name != "systematic"}
PROFILE = {"extraction": {"noise": NOISE}}
ENTRY = {"name": "hall", "noise": NOISE, "problem": None}
PROFILES = {"folder": "profiles", "profiles": [ENTRY], "sensors": jsonable_encoder(SENSOR_LIST)}


def _figure(value: float, half: float) -> Json:
    return {"value": value, "low": round(value - half, 6), "high": round(value + half, 6)}


def _bands(*edges: float) -> Json:
    sigmas = [_figure(sigma, 0.0001) for sigma in (0.00991, 0.01003, 0.00998, 0.00996)]
    return {"edges": list(edges), "sigmas": sigmas, "p_value": 0.41, "differs": False}


RESULT: Json = {
    "noise": FOUND,
    "sigma_range": _figure(0.00997, 0.00005),
    "sigma_bearing": _figure(0.00102, 0.00003),
    "range_growth": _figure(0.0003, 0.00002),
    "unevenness": _figure(0.0038, 0.0004),
    "unevenness_length": _figure(0.091, 0.021),
    "scans_needed": {"sigma_range": 0, "sigma_bearing": 0, "range_growth": 0, "unevenness": 20},
    "by_range": _bands(1.2, 2.1, 3.4, 4.6, 6.8),
    "by_incidence": _bands(0.01, 0.21, 0.43, 0.72, 1.31),
    "outliers": _figure(0.0012, 0.0003),
    "range_bias": _figure(0.0006, 0.0021),
    "alignment": _figure(0.0523, 0.0009),
    "drift": 0.0011,
    "walls": 14,
    "beams": 71230,
    "remarks": ["No range bias is detected: it lies between −1.5 and 2.7 mm."],
}
RUNNING = {
    "state": "collecting",
    "source": "emulator",
    "scans": 41,
    "wanted": 100,
    "message": None,
    "result": None,
}
DONE = RUNNING | {"state": "done", "scans": 100, "result": RESULT}


@router.get("/calibration", responses=ok(DONE, "How far it is, and what was found"))
def read(calibration: CurrentCalibration) -> CalibrationStatus:
    """The calibration under way, or the last one: metres and radians, with 95 % confidence intervals."""
    return calibration.status()


@router.post("/calibration", responses=ok(RUNNING, "It began") | documented(409, 422))
def start(
    calibration: CurrentCalibration, start: Annotated[CalibrationStart, Body(examples=[{"scans": 200}])]
) -> CalibrationStatus:
    """Measure the noise from the next scans of what plays; the sensor has to stand still in a room with walls.

    What is null in the `noise` found could not be told: keep what the settings say.

    All of a recording is taken if it has fewer scans. Ask GET until the state is done or failed.
    """
    calibration.start(start.scans)
    return calibration.status()


@router.delete("/calibration", status_code=204)
def cancel(calibration: CurrentCalibration) -> None:
    """Give up the calibration under way; without one, forget what the last one found."""
    calibration.cancel()


@router.get("/profiles", responses=ok(PROFILES, "All noise profiles"))
def profiles(profiles: CurrentProfiles) -> ProfilesJson:
    """The noise profiles that were saved, and the usual noise of known kinds of sensor. Use one by PATCH /settings."""
    return {"folder": str(profiles.folder), "profiles": profiles.list(), "sensors": SENSOR_LIST}


@router.get(
    "/profiles/{name:path}", response_model=Profile, responses=ok(PROFILE, "The file") | documented(404, 422)
)
def profile(profiles: CurrentProfiles, name: Name) -> Response:
    """One profile as a file: a part of the settings, which every command takes as --settings."""
    return Response(profiles.read(name).text, media_type="application/json")


@router.put(
    "/profiles/{name:path}", status_code=201, responses=ok(ENTRY, "Saved", 201) | documented(409, 422, 507)
)
def save(
    profiles: CurrentProfiles,
    name: Name,
    profile: Annotated[Profile, Body(examples=[PROFILE])],
    overwrite: Annotated[bool, Query(description="replace a profile of that name")] = False,
) -> ProfileEntry:
    """Save a profile: the noise a calibration found, or a file that `lidarcore calibrate` wrote."""
    return profiles.write(name, profile, overwrite=overwrite)


@router.delete("/profiles/{name:path}", status_code=204, responses=documented(404, 422))
def delete(profiles: CurrentProfiles, name: Name) -> None:
    """Delete a profile. Settings that came from it stay."""
    profiles.delete(name)
