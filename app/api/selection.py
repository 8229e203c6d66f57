"""The selected corner, shared by all pages."""

from typing import Annotated

from fastapi import APIRouter, Body
from pydantic import BaseModel, ConfigDict

from app.api.dependencies import CurrentRuntime
from app.api.examples import ok
from app.problems import documented

router = APIRouter(prefix="/selection", tags=["selection"])

EXAMPLE = {"corner": 12}


class Selection(BaseModel):
    """The id of a corner in the frame, or null."""

    model_config = ConfigDict(extra="forbid", strict=True)
    corner: int | None


@router.get("", responses=ok(EXAMPLE, "The selected corner"))
def read(runtime: CurrentRuntime) -> Selection:
    """Which corner is selected, if any."""
    return Selection(corner=runtime.selected)


@router.put("", responses=ok(EXAMPLE, "The selected corner") | documented(404, 422))
def select(runtime: CurrentRuntime, selection: Annotated[Selection, Body(examples=[EXAMPLE])]) -> Selection:
    """Select a corner of the current frame by its id, or none."""
    runtime.select(selection.corner)
    return Selection(corner=runtime.selected)
