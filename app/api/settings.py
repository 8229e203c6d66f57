"""All settings: read, change, and the schema that controls are made from."""

from typing import Annotated, Any

from fastapi import APIRouter, Body

from app.api.dependencies import CurrentRuntime
from app.api.examples import SETTINGS_PATCH, ok
from app.problems import documented
from app.settings import Settings

router = APIRouter(prefix="/settings", tags=["settings"])

EXAMPLE = Settings().model_dump(mode="json")


@router.get("", responses=ok(EXAMPLE, "All settings"))
def read(runtime: CurrentRuntime) -> Settings:
    """All settings, of the extraction and of the view."""
    return runtime.settings


@router.patch("", responses=ok(EXAMPLE, "All settings as they are now") | documented(422))
def change(
    runtime: CurrentRuntime, patch: Annotated[dict[str, Any], Body(examples=[SETTINGS_PATCH])]
) -> Settings:
    """Change some settings by a JSON merge patch (RFC 7396); null puts a default back.

    All of it is taken, or nothing. It holds from the next scan on; while paused, the current one is redone.
    """
    return runtime.set(patch)


@router.get("/schema", responses=ok(Settings.model_json_schema(), "A JSON schema"))
def schema() -> dict[str, Any]:
    """What each setting means, its unit, its range and its default, as JSON schema."""
    return Settings.model_json_schema()
