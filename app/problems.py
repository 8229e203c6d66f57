"""Errors as problem details (RFC 9457): one form for everything that can go wrong over HTTP."""

from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json
from starlette.exceptions import HTTPException
from starlette.responses import Response

from app.recorder import RecorderBusyError
from app.runtime import UnknownCornerError
from lidarcore import DeviceError, LidarError, TopicError
from lidarcore.errors import (
    LandmarkMapError,
    MapFileError,
    NoAnswerError,
    NoDeviceError,
    PortBusyError,
    PortPermissionError,
    ProtectionStopError,
    UnknownLandmarkError,
    UnknownSessionError,
    UnpluggedError,
)

DEVICE_STATUS = {
    NoDeviceError: 404,
    PortPermissionError: 403,
    PortBusyError: 409,
    NoAnswerError: 504,
    ProtectionStopError: 503,
    UnpluggedError: 503,
}
MAP_STATUS = {MapFileError: 422, UnknownLandmarkError: 404, UnknownSessionError: 404}  # else the file fails


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


def document(app: FastAPI) -> None:
    """Describe problem details in the app's OpenAPI document, where `documented` refers to them."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        description = describe()
        description["components"]["schemas"]["ProblemJson"] = ProblemJson.model_json_schema()
        return description

    app.openapi = openapi  # type: ignore[method-assign]


def install(app: FastAPI) -> None:
    """Answer every error of the app with problem details."""

    def handle(error_class: type[Exception], convert: Any) -> None:
        async def handler(request: Request, error: Exception) -> Response:
            problem: ProblemError = convert(error)
            return problem.response(request.url.path)

        app.add_exception_handler(error_class, handler)

    handle(ProblemError, lambda error: error)
    handle(HTTPException, lambda e: ProblemError(e.status_code, str(e.detail), dict(e.headers or {})))
    handle(RequestValidationError, _invalid)
    handle(ValidationError, _invalid)
    handle(TopicError, lambda e: ProblemError(409, str(e), topics=list(e.topics)))
    handle(DeviceError, lambda e: ProblemError(DEVICE_STATUS.get(type(e), 422), str(e)))
    handle(RecorderBusyError, lambda e: ProblemError(409, str(e)))
    handle(LandmarkMapError, lambda e: ProblemError(MAP_STATUS.get(type(e), 503), str(e)))
    handle(LidarError, lambda e: ProblemError(422, str(e)))
    handle(UnknownCornerError, lambda e: ProblemError(404, str(e)))
    handle(Exception, lambda e: ProblemError(500, "An error in the server itself; its log says more."))


def _invalid(error: RequestValidationError | ValidationError) -> ProblemError:
    """422 with every error: where it is, as a JSON pointer, and what is wrong."""
    errors = pointed_out(error)
    return ProblemError(422, explained(errors), errors=errors)


def pointed_out(error: RequestValidationError | ValidationError) -> list[dict[str, str]]:
    """Every error: where it is, as a JSON pointer, and what is wrong."""
    return [
        {"pointer": "/" + "/".join(str(part) for part in e["loc"] if part != "body"), "detail": e["msg"]}
        for e in error.errors()
    ]


def explained(errors: list[dict[str, str]]) -> str:
    """All of them in a line."""
    return "; ".join(f"{e['pointer']}: {e['detail']}" for e in errors)


def encode(value: object) -> Response:
    """JSON, fast and without a second validation of what was validated already."""
    return Response(to_json(value), media_type="application/json")
