"""Everything a user can set: one frozen object, swapped whole, changed only through `Settings.patched`."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from pydantic_core import InitErrorDetails, to_json

from lidarcore import FITTERS, ExtractionSettings

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


class Settings(_Frozen):
    """All settings: of the extraction and of the view."""

    extraction: ExtractionSettings = ExtractionSettings()
    view: ViewSettings = ViewSettings()

    @property
    def methods(self) -> tuple[str, ...]:
        """The fitters to run, the main one first."""
        extra = self.view.methods if self.view.compare else ()
        return tuple(dict.fromkeys((self.extraction.fitter, *extra)))

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
