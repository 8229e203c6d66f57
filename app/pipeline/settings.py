"""Everything a user can set: one frozen object, swapped whole, changed only through `Settings.patched`."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from difflib import get_close_matches
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError

from lidarcore import FITTERS, ExtractionSettings, SensorNoise
from lidarcore.body_mask import Mask
from lidarcore.clusters import ClusterSettings
from lidarcore.evaluation.repeatability.scatter import LEAST
from lidarcore.evaluation.repeatability.statistics import WINDOW
from lidarcore.localization import NavigationSettings

from .sensor_setups import SensorSetup

Colour = Literal["plain", "segment", "quality", "range"]
Method = Literal["scans", "landmarks"]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Layers(_Frozen):
    """What the scene shows, where a browser does not show it otherwise."""

    points: bool = Field(default=True, description="measured points")
    segments: bool = Field(default=True, description="wall segments")
    corners: bool = Field(default=True, description="corners")
    ellipses: bool = Field(default=True, description="covariance ellipses of the corners")
    rejected: bool = Field(default=False, description="candidates that were rejected")
    grid: bool = Field(default=True, description="grid in metres")
    sensor: bool = Field(default=True, description="the sensor")
    gaps: bool = Field(default=True, description="sectors whose data were lost")
    clusters: bool = Field(default=False, description="clusters, each with the ellipse of its members")
    pose: bool = Field(default=True, description="the ellipse of the sensor's position")
    trail: bool = Field(default=True, description="estimated path of the sensor")
    dead_reckoned: bool = Field(default=True, description="its path by odometry alone")
    truth: bool = Field(default=True, description="its true path, if known")
    occupancy: bool = Field(
        default=True, description="which parts of the map of whole scans are occupied and free"
    )
    walls: bool = Field(default=True, description="walls of the map of whole scans")
    landmarks: bool = Field(default=True, description="landmarks of the map with their ellipses and numbers")
    associations: bool = Field(
        default=True, description="lines from observations to the landmarks they match"
    )


class ViewSettings(_Frozen):
    """How the scene shows it.

    What is compared and what colours the points is the same for all. Layers, the size of ellipses, theme and rotation
    belong to each browser, which may show them otherwise than they are set here; setting one here sets it for all.
    """

    compare: bool = Field(default=False, description="several methods on the same scan at once")
    methods: tuple[str, ...] = Field(
        default=tuple(FITTERS),
        description="methods shown in compare mode",
        json_schema_extra={"items": {"type": "string", "enum": list(FITTERS)}, "uniqueItems": True},
    )
    layers: Layers = Layers()
    colour: Colour = Field(default="plain", description="what colours the points")
    ellipse_scale: float = Field(
        default=30.0,
        ge=1,
        le=100,
        allow_inf_nan=False,
        description="size of the corners' ellipses in sigma. "
        "More: larger ellipses on the screen; what they claim stays",
    )
    theme: Literal["dark", "light"] = Field(
        default="dark", description="colours of the scene, and of a browser that prefers none"
    )
    rotate: bool = Field(default=False, description="free rotation instead of a map seen from above")

    @field_validator("methods")
    @classmethod
    def _known_and_unique(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in FITTERS:
                raise ValueError(f"unknown fitter {name!r}: choose from {', '.join(FITTERS)}")
        return tuple(dict.fromkeys(names))


class RepeatabilitySettings(_Frozen):
    """Whether the scatter of the corners is held against what each method claims, while the sensor stands still."""

    running: bool = Field(default=False, description="whether new scans are compared")
    window: int = Field(
        default=WINDOW,
        ge=LEAST,
        le=1000,
        description="how many of the newest scans to compare. More: surer verdicts, later",
    )


@dataclass(config=ConfigDict(extra="forbid"), frozen=True, slots=True, kw_only=True)
class LiveNavigation(NavigationSettings):
    """What a navigator does with each scan, and what SLAM makes its map of."""

    method: Annotated[
        Method,
        Field(description="what SLAM finds the pose by: whole scans matched to each other, or landmarks"),
    ] = "scans"


class SensorSettings(_Frozen):
    """How the sensor sits on its robot."""

    mask: Mask | None = Field(
        default=None,
        description="sectors, from `first` counter-clockwise to `last` (rad), in which the robot's own body is "
        "seen: what is nearer than `reach` (m) is left out before everything else; if not given, those kept "
        "with the recording",
    )


class Settings(_Frozen):
    """All settings: of sensor, extraction, clusters, localization, view and repeatability.

    There is one sensor, so `clusters.noise` always is `extraction.noise`.
    """

    sensor: SensorSettings = SensorSettings()
    extraction: ExtractionSettings = ExtractionSettings()
    clusters: ClusterSettings = ClusterSettings()
    navigation: LiveNavigation = LiveNavigation()
    view: ViewSettings = ViewSettings()
    repeatability: RepeatabilitySettings = RepeatabilitySettings()

    @property
    def methods(self) -> tuple[str, ...]:
        """The fitters to run, the main one first."""
        extra = self.view.methods if self.view.compare else ()
        return tuple(dict.fromkeys((self.extraction.fitter, *extra)))

    @property
    def clustered(self) -> bool:
        """Whether scans are clustered: to be shown, or as landmarks."""
        wanted = self.navigation
        located = wanted.mode == "localize" or (wanted.mode == "slam" and wanted.method == "landmarks")
        return self.view.layers.clusters or (located and wanted.landmarks == "clusters")

    @property
    def landmark_method(self) -> str:
        """What finds the landmarks in a scan: the fitter of the walls that meet in corners, or the clustering."""
        return self.extraction.fitter if self.navigation.landmarks == "corners" else self.clusters.method

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        object.__setattr__(self, "clusters", replace(self.clusters, noise=self.extraction.noise))
        return self

    def with_noise(self, noise: SensorNoise) -> "Settings":
        """These settings for a sensor of that noise."""
        return self.patched({"extraction": {"noise": asdict(noise)}})

    def with_setup(self, setup: SensorSetup) -> "Settings":
        """These settings for a sensor of that noise and mask."""
        mask = [asdict(sector) for sector in setup.mask]
        return self.with_noise(setup.noise).patched({"sensor": {"mask": mask}})

    def patched(self, patch: Mapping[str, Any]) -> "Settings":
        """These settings with a JSON merge patch (RFC 7396) applied; null puts the default back.

        Raises pydantic.ValidationError if a name is unknown or a value is not valid; nothing changes then.
        """
        merged = _merge(self.model_dump(), patch, ())
        return Settings.model_validate_json(json.dumps(merged), strict=True)


def _no_setting(name: str, known: Iterable[str]) -> PydanticCustomError:
    near = get_close_matches(name, known) or sorted(known)
    return PydanticCustomError(
        "no_setting", "There is no such setting; there is {known}.", {"known": ", ".join(near)}
    )


def _merge(target: Mapping[str, Any], patch: Mapping[str, Any], path: tuple[str, ...]) -> dict[str, Any]:
    merged = dict(target)
    for name, value in patch.items():
        if name not in target:
            unknown = InitErrorDetails(type=_no_setting(name, target), loc=(*path, name), input=value)
            raise ValidationError.from_exception_data("Settings", [unknown])
        if value is None:
            del merged[name]
        elif isinstance(value, Mapping) and isinstance(target[name], Mapping):
            merged[name] = _merge(target[name], value, (*path, name))
        else:
            merged[name] = value
    return merged
