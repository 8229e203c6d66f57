"""The noise of the sensor: measured while it stands still, saved as a profile, chosen."""

from typing import Annotated

from fastapi import APIRouter, Body, Path, Query
from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import Response
from typing_extensions import TypedDict

from app.api.dependencies import CurrentCalibration, CurrentProfiles
from app.api.examples import Json, ok
from app.calibration import MOST_SCANS, CalibrationBusyError
from app.calibration_wire import CalibrationStateJson
from app.problems import ProblemError, documented
from app.profiles import Profile, ProfileEntryJson
from lidarcore.evaluation.calibration import LEAST_SCANS

router = APIRouter(tags=["calibration"])

Name = Annotated[str, Path(description="a plain file name, without its ending", examples=["hall"])]


class Start(BaseModel):
    """What to collect."""

    model_config = ConfigDict(extra="forbid", strict=True)
    scans: Annotated[int, Field(ge=LEAST_SCANS, le=MOST_SCANS, description="how many scans to take")] = 100


class ProfilesJson(TypedDict):
    folder: str
    profiles: list[ProfileEntryJson]


NOISE = {"sigma_range": 0.00997, "sigma_bearing": 0.00102}
PROFILE = {"extraction": {"noise": NOISE}}
ENTRY = {"name": "hall", "noise": NOISE, "problem": None}


def _figure(value: float, half: float) -> Json:
    return {"value": value, "low": round(value - half, 6), "high": round(value + half, 6)}


def _bands(*edges: float) -> Json:
    sigmas = [_figure(sigma, 0.0001) for sigma in (0.00991, 0.01003, 0.00998, 0.00996)]
    return {"edges": list(edges), "sigmas": sigmas, "p_value": 0.41, "differs": False}


RESULT: Json = {
    "noise": NOISE,
    "sigma_range": _figure(0.00997, 0.00005),
    "sigma_bearing": _figure(0.00102, 0.00003),
    "by_range": _bands(1.2, 2.1, 3.4, 4.6, 6.8),
    "by_incidence": _bands(0.01, 0.21, 0.43, 0.72, 1.31),
    "outliers": _figure(0.0012, 0.0003),
    "range_bias": _figure(0.0006, 0.0021),
    "alignment": _figure(0.0523, 0.0009),
    "drift": 0.0011,
    "walls": 14,
    "beams": 71230,
    "remarks": ["No range bias is seen: it lies between −1.5 and 2.7 mm."],
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
def read(calibration: CurrentCalibration) -> CalibrationStateJson:
    """The calibration under way, or the last one: metres and radians, with 95 % confidence intervals."""
    return calibration.status()


@router.post("/calibration", responses=ok(RUNNING, "It began") | documented(409, 422))
def start(
    calibration: CurrentCalibration, start: Annotated[Start, Body(examples=[{"scans": 200}])]
) -> CalibrationStateJson:
    """Measure the noise from the next scans of what plays; the sensor has to stand still in a room with walls.

    What is null in the `noise` found could not be told: keep what the settings say.

    All of a recording is taken if it has fewer scans. Ask GET until the state is done or failed.
    """
    try:
        calibration.start(start.scans)
    except CalibrationBusyError as error:
        raise ProblemError(409, str(error)) from error
    return calibration.status()


@router.delete("/calibration", status_code=204)
def cancel(calibration: CurrentCalibration) -> None:
    """Give up the calibration under way; without one, forget what the last one found."""
    calibration.cancel()


@router.get("/profiles", responses=ok({"folder": "profiles", "profiles": [ENTRY]}, "All noise profiles"))
def profiles(profiles: CurrentProfiles) -> ProfilesJson:
    """The noise profiles that were saved. Use one by PATCH /settings with what GET gives of it."""
    return {"folder": str(profiles.folder), "profiles": profiles.list()}


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
) -> ProfileEntryJson:
    """Save a profile: the noise a calibration found, or a file that `lidarcore calibrate` wrote."""
    return profiles.write(name, profile, overwrite=overwrite)


@router.delete("/profiles/{name:path}", status_code=204, responses=documented(404, 422))
def delete(profiles: CurrentProfiles, name: Name) -> None:
    """Delete a profile. Settings that came from it stay."""
    profiles.delete(name)
