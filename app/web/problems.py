"""Errors as problem details (RFC 9457): one form for everything that can go wrong over HTTP."""

from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.routing import Match

from lidarcore import LidarError, TopicError
from lidarcore import errors as library

from ..errors import (
    ConflictError,
    NotFoundError,
    NotYetError,
    StorageError,
    TooLargeError,
    explained,
    invalid_values,
)

# The nearest class of an error decides.
STATUS: dict[type, int] = {
    LidarError: 422,
    NotFoundError: 404,
    NotYetError: 503,
    ConflictError: 409,
    TooLargeError: 413,
    StorageError: 507,
    TopicError: 409,
    library.PortPermissionError: 403,
    library.NoDeviceError: 404,
    library.PortBusyError: 409,
    library.ProtectionStopError: 503,
    library.UnpluggedError: 503,
    library.NoAnswerError: 504,
    library.MaskError: 409,  # nothing to suggest one from yet
    library.UnknownLandmarkError: 404,
    library.UnknownWallError: 404,
    library.UnknownSessionError: 404,
    library.MapFileError: 422,
    library.LandmarkMapError: 503,  # the file of maps fails
}

RETRY = {"Retry-After": "2"}  # s
_METHODS = ("DELETE", "GET", "HEAD", "PATCH", "POST", "PUT")


class ProblemJson(BaseModel):
    """What every error looks like."""

    model_config = ConfigDict(extra="allow")

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    instance: str


class ProblemError(Exception):
    """An error with everything its problem details need; `members` are added to them."""

    def __init__(
        self, status: int, detail: str, headers: dict[str, str] | None = None, **members: Any
    ) -> None:
        super().__init__(detail)
        self.status, self.detail, self.headers, self.members = status, detail, headers, members

    def response(self, path: str) -> Response:
        problem = ProblemJson(
            title=HTTPStatus(self.status).phrase,
            status=self.status,
            detail=self.detail,
            instance=quote(path),
            **self.members,
        )
        return Response(
            problem.model_dump_json(), self.status, self.headers, media_type="application/problem+json"
        )


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entries of the problems a route may answer with."""
    schema = {"schema": {"$ref": "#/components/schemas/ProblemJson"}}
    return {
        status: {"description": HTTPStatus(status).phrase, "content": {"application/problem+json": schema}}
        for status in statuses
    }


def install(app: FastAPI) -> None:
    """Answer every error of the app with problem details."""

    def handle(error_class: type[Exception], convert: Any) -> None:
        async def handler(request: Request, error: Exception) -> Response:
            problem: ProblemError = convert(error)
            return problem.response(request.url.path)

        app.add_exception_handler(error_class, handler)

    handle(ProblemError, lambda error: error)
    handle(HTTPException, lambda e: ProblemError(e.status_code, str(e.detail), dict(e.headers or {})))
    app.add_exception_handler(404, _not_found)
    app.add_exception_handler(405, _not_allowed)
    handle(RequestValidationError, _invalid)
    handle(ValidationError, _invalid)
    handle(LidarError, _problem)
    handle(ClientDisconnect, lambda e: ProblemError(400, "The connection broke off before all was sent."))
    handle(Exception, lambda e: ProblemError(500, "The server failed to answer this; see its log."))


async def _not_found(request: Request, error: Exception) -> Response:
    """404 of a path that no route has; what a route does not find it says itself."""
    detail = f"There is nothing at {request.url.path}: /docs shows what the API has, and / is the page."
    return ProblemError(404, detail).response(request.url.path)


async def _not_allowed(request: Request, error: Exception) -> Response:
    """405 with every method of the path: each is a route of its own, and the first one answers for itself alone."""
    methods = [method for method in _METHODS if _answers(request, method)]
    headers = {"Allow": ", ".join(methods)} if methods else dict(getattr(error, "headers", None) or {})
    detail = f"{request.method} is not allowed here: use {headers.get('Allow', 'GET')}."
    return ProblemError(405, detail, headers).response(request.url.path)


def _answers(request: Request, method: str) -> bool:
    scope = {**request.scope, "method": method}
    return any(route.matches(scope)[0] == Match.FULL for route in request.app.routes)


def _problem(error: LidarError) -> ProblemError:
    status = next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)
    members: dict[str, Any] = {"topics": list(error.topics)} if isinstance(error, TopicError) else {}
    headers = RETRY if isinstance(error, NotYetError) else None
    return ProblemError(status, str(error), headers, **members)


def _invalid(error: RequestValidationError | ValidationError) -> ProblemError:
    """422 with every error: where it is, as a JSON pointer, and what is wrong."""
    errors = [{"pointer": "/" + "/".join(path), "detail": detail} for path, detail in invalid_values(error)]
    return ProblemError(422, explained(error), errors=errors)


def encode(value: object) -> Response:
    """JSON, fast and without a second validation of what was validated already."""
    return Response(to_json(value), media_type="application/json")
