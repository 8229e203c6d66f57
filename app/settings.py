"""Everything a user can set: one frozen object, swapped whole, changed only through `Settings.patched`."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from pydantic_core import InitErrorDetails, to_json

from lidarcore import FITTERS, ExtractionSettings
from lidarcore.clusters import ClusterSettings
from lidarcore.evaluation.repeatability import WINDOW
from lidarcore.evaluation.scatter import LEAST
from lidarcore.localization import NavigationSettings

Colour = Literal["plain", "segment", "quality", "range"]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Layers(_Frozen):
    """What the scene shows."""

    points: Annotated[bool, Field(description="measured points")] = True
    segments: Annotated[bool, Field(description="wall segments")] = True
    corners: Annotated[bool, Field(description="corners")] = True
    ellipses: Annotated[bool, Field(description="covariance ellipses of the corners")] = True
    rejected: Annotated[bool, Field(description="candidates that were rejected")] = False
    grid: Annotated[bool, Field(description="grid in metres")] = True
    sensor: Annotated[bool, Field(description="the sensor")] = True
    gaps: Annotated[bool, Field(description="sectors lost on the way from the sensor")] = True
    clusters: Annotated[bool, Field(description="clusters, each with the ellipse of its members")] = False
    pose: Annotated[bool, Field(description="the ellipse of the sensor's position")] = True
    trail: Annotated[bool, Field(description="where the sensor has been")] = True
    dead_reckoned: Annotated[bool, Field(description="where odometry alone says it has been")] = True
    truth: Annotated[bool, Field(description="where it truly has been, if that is known")] = True
    landmarks: Annotated[bool, Field(description="landmarks of the map with their ellipses and numbers")] = (
        True
    )
    associations: Annotated[
        bool, Field(description="lines from what is seen to the landmark it is taken for")
    ] = True


class ViewSettings(_Frozen):
    """How the scene shows it."""

    compare: Annotated[bool, Field(description="several methods on the same scan at once")] = False
    methods: Annotated[
        tuple[str, ...],
        Field(
            description="methods shown in compare mode",
            json_schema_extra={"items": {"type": "string", "enum": list(FITTERS)}, "uniqueItems": True},
        ),
    ] = tuple(FITTERS)
    layers: Layers = Layers()
    colour: Annotated[Colour, Field(description="what colours the points")] = "plain"
    ellipse_scale: Annotated[
        float,
        Field(ge=1, le=100, allow_inf_nan=False, description="size of the ellipses in sigma"),
    ] = 10.0
    theme: Annotated[Literal["dark", "light"], Field(description="colours of the scene")] = "dark"
    rotate: Annotated[bool, Field(description="free rotation instead of a map seen from above")] = False

    @field_validator("methods")
    @classmethod
    def _known_and_unique(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in FITTERS:
                raise ValueError(f"unknown fitter {name!r}: choose from {', '.join(FITTERS)}")
        return tuple(dict.fromkeys(names))


class RepeatabilitySettings(_Frozen):
    """Whether the scatter of the corners is held against what each method claims, while the sensor stands still."""

    running: Annotated[bool, Field(description="whether scans are watched for it")] = False
    window: Annotated[int, Field(ge=LEAST, le=1000, description="over how many scans, the newest ones")] = (
        WINDOW
    )


class Settings(_Frozen):
    """All settings: of the extraction, of the clusters, of localization, of the view and of repeatability.

    There is one sensor, so `clusters.noise` always is `extraction.noise`.
    """

    extraction: ExtractionSettings = ExtractionSettings()
    clusters: ClusterSettings = ClusterSettings()
    navigation: NavigationSettings = NavigationSettings()
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
        return self.view.layers.clusters or self.navigation.landmarks == "clusters"

    @property
    def landmark_method(self) -> str:
        """What finds the landmarks in a scan: the fitter of the walls that meet in corners, or the clustering."""
        return self.extraction.fitter if self.navigation.landmarks == "corners" else self.clusters.method

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        object.__setattr__(self, "clusters", replace(self.clusters, noise=self.extraction.noise))
        return self

    def patched(self, patch: Mapping[str, Any]) -> "Settings":
        """These settings with a JSON merge patch (RFC 7396) applied; null puts the default back.

        Raises pydantic.ValidationError if a name is unknown or a value is not valid; nothing changes then.
        """
        merged = _merge(self.model_dump(), patch, ())
        return Settings.model_validate_json(to_json(merged), strict=True)


def _merge(target: Mapping[str, Any], patch: Mapping[str, Any], path: tuple[str, ...]) -> dict[str, Any]:
    merged = dict(target)
    for name, value in patch.items():
        if name not in target:
            unknown = InitErrorDetails(type="extra_forbidden", loc=(*path, name), input=value)
            raise ValidationError.from_exception_data("Settings", [unknown])
        if value is None:
            del merged[name]
        elif isinstance(value, Mapping) and isinstance(target[name], Mapping):
            merged[name] = _merge(target[name], value, (*path, name))
        else:
            merged[name] = value
    return merged
