"""The selected corner and landmark, shared by all pages."""

from typing import Annotated, Self

from fastapi import APIRouter, Body
from pydantic import model_validator

from ...pipeline.frame import Selection
from ..dependencies import Server
from ..problems import documented
from ..schemas import StrictBody

router = APIRouter(prefix="/selection", tags=["selection"])


class SelectionBody(StrictBody):
    """Ids of a corner in the frame and of a landmark of the map, or null; what is left out stays."""

    corner: int | None = None
    landmark: int | None = None

    @model_validator(mode="after")
    def _names_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("give corner, landmark or both")
        return self


@router.get("", response_description="What is selected")
def read(server: Server) -> Selection:
    """Which corner and which landmark are selected, if any."""
    return server.runtime.selection


@router.put("", response_description="What is selected", responses=documented(404, 422, 503))
def select(
    server: Server,
    selection: Annotated[SelectionBody, Body(examples=[{"corner": 12}])],
) -> Selection:
    """Select a corner of the current frame or a landmark of the map by its id, or none."""
    if "corner" in selection.model_fields_set:
        server.runtime.select_corner(selection.corner)
    if "landmark" in selection.model_fields_set:
        server.runtime.select_landmark(selection.landmark)
    return server.runtime.selection
