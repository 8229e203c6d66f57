"""All settings: read, change, and the schema that controls are made from."""

from typing import Annotated, Any

from fastapi import APIRouter, Body

from ...pipeline.settings import Settings
from ..dependencies import Server
from ..openapi import example, formats
from ..problems import documented

router = APIRouter(prefix="/settings", tags=["settings"])

EXAMPLE = Settings().patched({"sensor": example("SuggestionJson")}).model_dump(mode="json")
PATCH = {"extraction": {"fitter": "wctls", "min_points": 8}, "view": {"compare": True}}


@router.get("", response_description="All settings", responses=formats(json=EXAMPLE))
def read(server: Server) -> Settings:
    """Every setting with its present value, in sections."""
    return server.runtime.settings


@router.patch(
    "", response_description="All settings as they are now", responses=formats(json=EXAMPLE) | documented(422)
)
def change(server: Server, patch: Annotated[dict[str, Any], Body(examples=[PATCH])]) -> Settings:
    """Change some settings by a JSON merge patch (RFC 7396); null puts a default back.

    All of it is taken, or nothing. It holds from the next scan on; while paused, the current one is redone.

    Settings are shared by all who use the server, but for layers, ellipse_scale, theme and rotate of `view`: each
    browser has its own, and takes over what is set here for all.
    """
    return server.runtime.set(patch)


@router.get(
    "/schema", response_description="A JSON schema", responses=formats(json=Settings.model_json_schema())
)
def schema() -> dict[str, Any]:
    """What each setting means, its unit, its range and its default, as JSON schema."""
    return Settings.model_json_schema()
