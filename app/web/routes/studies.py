"""Experiments of the papers, run on this machine, and their reports."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Path
from starlette.responses import FileResponse
from typing_extensions import TypedDict

from ...jobs.studies.kinds import KINDS, Kind
from ...jobs.studies.reports import ReportEntry
from ...jobs.studies.runner import ExpectedTime, StudyStatus, expected
from ...records import record
from ..dependencies import Server
from ..problems import documented

router = APIRouter(prefix="/studies", tags=["studies"])

# A report is text, tables and drawings; whatever else may be in it does nothing.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"

Name = Annotated[str, Path(description="kind, date and time", examples=["cwlf_2026-11-21_10-00-00"])]


class KindJson(TypedDict):
    """`schema` is the JSON schema of the options."""

    name: str
    title: str
    question: str
    expected_s: ExpectedTime
    schema: dict[str, Any]


class StudiesJson(TypedDict):
    """`run` is what runs, or ran last since the server started."""

    folder: str
    kinds: list[KindJson]
    run: StudyStatus | None
    reports: list[ReportEntry]


HTML: dict[int | str, dict[str, Any]] = {
    200: {"description": "The report", "content": {"text/html": {"schema": {"type": "string"}}}}
}


@router.get("", response_description="Studies and reports")
def read(server: Server) -> StudiesJson:
    """The studies there are with their options, what runs, and the reports of those that are finished."""
    run, reports = server.studies.run, server.studies.finished()
    kinds: list[KindJson] = [
        record(
            KindJson,
            kind,
            expected_s=expected(kind.name, reports),
            schema=kind.options.model_json_schema(),
        )
        for kind in KINDS.values()
    ]
    return {"folder": str(server.studies.reports.folder), "kinds": kinds, "run": run, "reports": reports}


def _add_start(kind: Kind) -> None:
    @router.post(
        f"/{kind.name}",
        name=kind.name.replace("-", "_"),
        description=f"{kind.does} One study at a time.",
        response_description="What runs now",
        responses=documented(404, 409, 422, 507),
    )
    def start(
        server: Server,
        options: Annotated[kind.options, Body(examples=list(kind.examples))],  # type: ignore[name-defined]
    ) -> StudyStatus:
        noise = server.runtime.settings.extraction.noise
        return server.studies.start(kind.name, options, options.arguments(noise, server.library.path), noise)


for kind in KINDS.values():
    _add_start(kind)


@router.delete("/running", status_code=204, responses=documented(404))
def cancel(server: Server) -> None:
    """End the study that runs; nothing of it stays."""
    server.studies.cancel()


@router.get("/reports/{name}", response_class=FileResponse, responses=HTML | documented(404))
def report(server: Server, name: Name) -> FileResponse:
    """A report: a page that needs nothing else. No script runs in it."""
    headers = {"Content-Security-Policy": POLICY}
    return FileResponse(
        server.studies.reports.path(name), media_type="text/html; charset=utf-8", headers=headers
    )


@router.delete("/reports/{name}", status_code=204, responses=documented(404))
def delete(server: Server, name: Name) -> None:
    """Delete a report."""
    server.studies.reports.delete(name)
