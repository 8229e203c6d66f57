"""What the YAML file beside the image of a ROS map says: where the grid lies, and what its shades mean."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, model_validator
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from lidarcore.errors import MapFileError

_LONGEST_YAML = 100_000  # bytes
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class Header(BaseModel):
    """What the YAML file says. Other entries are left alone."""

    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    origin: tuple[_Finite, _Finite, _Finite]
    negate: bool
    occupied_thresh: _Share
    free_thresh: _Share
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @model_validator(mode="after")
    def _check_order(self) -> "Header":
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError("free_thresh must be below occupied_thresh")
        return self


def read_header(path: Path) -> Header:
    """The header in a YAML file.

    Raises MapFileError if it is too long, no YAML or makes no sense, OSError or ValueError if it is no text to be read.
    """
    if path.stat().st_size > _LONGEST_YAML:
        raise MapFileError(f"{path.name} is too long for the YAML of a map: give the .yaml, not the image.")
    try:
        document: Any = YAML(typ="safe", pure=True).load(path.read_text("utf-8"))
        if not isinstance(document, dict):
            raise MapFileError(
                f"{path.name} holds no entries: it should say image, resolution, origin and more."
            )
        return Header.model_validate(document)
    except ValidationError as error:
        wrong = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'header'}: {e['msg']}" for e in error.errors())
        raise MapFileError(f"{path.name} cannot be used as a map: {wrong}.") from error
    except (YAMLError, RecursionError) as error:
        raise MapFileError(
            f"{path.name} is no valid YAML{_where(error)}: mend it, or save the map anew."
        ) from error


def _where(error: Exception) -> str:
    mark = error.problem_mark if isinstance(error, MarkedYAMLError) else None
    return f" (line {mark.line + 1})" if mark else ""
