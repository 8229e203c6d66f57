"""Experiments of the papers, run on this machine, and their reports."""

from collections.abc import Callable
from typing import Annotated, Any

from fastapi import APIRouter, Body, Depends, Path
from starlette.responses import FileResponse
from typing_extensions import TypedDict

from ...jobs.studies import ExpectedTime, StudyStatus, expected
from ...jobs.study_kinds import KINDS, ConsistencyOptions, CornerOptions, DriveOptions, Options
from ...jobs.study_reports import ReportEntry
from ..problems import documented
from .dependencies import CurrentLibrary, CurrentRuntime, CurrentStudies

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


STARTED = documented(404, 409, 422, 507)
HTML: dict[int | str, dict[str, Any]] = {
    200: {"description": "The report", "content": {"text/html": {"schema": {"type": "string"}}}}
}


def _starter(
    studies: CurrentStudies, runtime: CurrentRuntime, library: CurrentLibrary
) -> Callable[[str, Options], StudyStatus]:
    """Starts a study of that kind with these options, under the noise set now."""

    def start(kind: str, options: Options) -> StudyStatus:
        noise = runtime.settings.extraction.noise
        return studies.start(kind, options, options.arguments(noise, library.path), noise)

    return start


Start = Annotated[Callable[[str, Options], StudyStatus], Depends(_starter)]


@router.get("", response_description="Studies and reports")
def read(studies: CurrentStudies) -> StudiesJson:
    """The studies there are with their options, what runs, and the reports of those that are finished."""
    run, reports = studies.run, studies.finished()
    kinds: list[KindJson] = [
        {
            "name": kind.name,
            "title": kind.title,
            "question": kind.question,
            "expected_s": expected(kind.name, reports),
            "schema": kind.options.model_json_schema(),
        }
        for kind in KINDS.values()
    ]
    return {"folder": str(studies.reports.folder), "kinds": kinds, "run": run, "reports": reports}


@router.post("/consistency", response_description="What runs now", responses=STARTED)
def consistency(
    start: Start,
    options: Annotated[
        ConsistencyOptions, Body(examples=[{"quick": True}, {"trials": 50000, "noise": "settings"}])
    ],
) -> StudyStatus:
    """Which ellipses can be believed: corners simulated with known truth, by every method. One study at a time."""
    return start("consistency", options)


@router.post("/cwlf", response_description="What runs now", responses=STARTED)
def cwlf(
    start: Start,
    options: Annotated[CornerOptions, Body(examples=[{"quick": True}, {"scans": 500, "noise": "settings"}])],
) -> StudyStatus:
    """The experiment of the paper on CWLF, in simulated rooms or from a recording. One study at a time."""
    return start("cwlf", options)


@router.post("/wctls", response_description="What runs now", responses=STARTED)
def wctls(
    start: Start,
    options: Annotated[CornerOptions, Body(examples=[{"quick": True}, {"quick": False, "seed": 7}])],
) -> StudyStatus:
    """The experiment of the paper on WCTLS, in simulated rooms or from a recording. One study at a time."""
    return start("wctls", options)


@router.post("/clustering-ekf", response_description="What runs now", responses=STARTED)
def clustering_ekf(
    start: Start, options: Annotated[DriveOptions, Body(examples=[{"quick": True, "runs": 1}])]
) -> StudyStatus:
    """The experiment of the paper on clusters and the Kalman filter, simulated. One study at a time."""
    return start("clustering-ekf", options)


@router.delete("/running", status_code=204, responses=documented(404))
def cancel(studies: CurrentStudies) -> None:
    """End the study that runs; nothing of it stays."""
    studies.cancel()


@router.get("/reports/{name}", response_class=FileResponse, responses=HTML | documented(404))
def report(studies: CurrentStudies, name: Name) -> FileResponse:
    """A report: a page that needs nothing else. No script runs in it."""
    headers = {"Content-Security-Policy": POLICY}
    return FileResponse(studies.reports.path(name), media_type="text/html; charset=utf-8", headers=headers)


@router.delete("/reports/{name}", status_code=204, responses=documented(404))
def delete(studies: CurrentStudies, name: Name) -> None:
    """Delete a report."""
    studies.reports.delete(name)
