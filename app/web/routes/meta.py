"""Health, version, and what methods there are."""

import platform
import time
from importlib import metadata

import psutil
from fastapi import APIRouter
from typing_extensions import TypedDict

from lidarcore import FITTERS
from lidarcore.clusters import CLUSTERERS

from ...records import record
from ...scene.palette import METHOD_STYLES
from ..dependencies import Server
from ..openapi import formats

router = APIRouter(tags=["meta"])

_process = psutil.Process()


class HealthJson(TypedDict):
    status: str
    ready: bool
    uptime_s: float
    clients: int
    memory_bytes: int
    cpu_s: float


class VersionJson(TypedDict):
    version: str
    python: str
    viser: str
    numba: str


class FitterJson(TypedDict):
    """`colour` is for a dark ground, `colour_light` for a light one; outlines have a `dash`, pixels on and off."""

    name: str
    title: str
    reference: str
    summary: str
    colour: str
    colour_light: str
    dash: tuple[int, ...]


class ClustererJson(TypedDict):
    """`parameters` are those of the settings of clusters that only this method, or few, use."""

    name: str
    title: str
    reference: str
    summary: str
    parameters: list[str]


class MethodsJson(TypedDict):
    fitters: list[FitterJson]
    clusterers: list[ClustererJson]
    covariances: list[str]


METHODS: MethodsJson = {
    "fitters": [
        record(FitterJson, fitter, colour=style.dark, colour_light=style.light, dash=style.dash)
        for fitter in FITTERS.values()
        for style in [METHOD_STYLES[fitter.name]]
    ],
    "clusterers": [
        record(ClustererJson, one, parameters=[name for name in one.parameters if name != "noise"])
        for one in CLUSTERERS.values()
    ],
    "covariances": ["consistent", "published"],
}


@router.get("/health", response_description="The server is running")
def health(server: Server) -> HealthJson:
    """Whether the kernels are compiled, and what the process has used so far."""
    cpu = _process.cpu_times()
    return {
        "status": "ok",
        "ready": server.runtime.ready,
        "uptime_s": time.time() - _process.create_time(),
        "clients": server.hub.clients,
        "memory_bytes": _process.memory_info().rss,
        "cpu_s": cpu.user + cpu.system,
    }


@router.get("/version", response_description="Versions")
def version() -> VersionJson:
    """Versions of this project and of what its results and pictures depend on."""
    return {
        "version": version_of("lidarcore"),
        "python": platform.python_version(),
        "viser": version_of("viser"),
        "numba": version_of("numba"),
    }


@router.get("/methods", response_description="The methods", responses=formats(json=METHODS))
def methods() -> MethodsJson:
    """The line fitters, the clustering methods and the kinds of covariance there are."""
    return METHODS


def version_of(distribution: str) -> str:
    """The version installed; a checkout that is not installed has none."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "checkout"
