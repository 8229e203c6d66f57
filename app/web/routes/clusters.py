"""The clusters of the current frame."""

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import Response

from lidarcore.clusters import CLUSTERERS, cluster

from ...errors import NotFoundError
from ..problems import documented, encode
from ..schemas import ClusterJson
from ..serializers import clusters_json
from .dependencies import CurrentFrame

router = APIRouter(tags=["frame"])

Method = Annotated[
    str | None,
    Query(description="a clustering method; the one of the settings if not given", examples=["dbscan"]),
]


@router.get(
    "/clusters",
    response_model=list[ClusterJson],
    response_description="The clusters of the newest scan",
    responses=documented(404, 422),
)
def clusters(frame: CurrentFrame, method: Method = None) -> Response:
    """The clusters of the newest scan, found when asked for. Metres, sensor frame."""
    if method is not None and method not in CLUSTERERS:
        raise NotFoundError(f"There is no clustering method {method!r}: choose from {', '.join(CLUSTERERS)}.")
    wanted = frame.settings.clusters
    chosen = replace(wanted, method=method or wanted.method)
    return encode(clusters_json(cluster(frame.scan, chosen)))
