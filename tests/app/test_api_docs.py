import re
from typing import Any

import httpx
import pytest
from lidarcore_app.jobs.calibration import CalibrationStatus
from lidarcore_app.jobs.maps.making import MakingStatus
from lidarcore_app.jobs.profiles import Profile, ProfileEntry
from lidarcore_app.jobs.recorder import RecorderStatus
from lidarcore_app.jobs.studies.runner import StudyStatus
from lidarcore_app.pipeline.frame import Selection
from lidarcore_app.pipeline.localization_status import LocalizationStatus
from lidarcore_app.pipeline.settings import Settings
from lidarcore_app.sources.library import RecordingEntry
from lidarcore_app.sources.player import SourceStatus
from lidarcore_app.sources.recording_facts import RecordingFacts
from lidarcore_app.web.routes.calibration import ProfilesJson
from lidarcore_app.web.routes.landmarks import LandmarkHistoryJson, LandmarksJson, NeighboursJson
from lidarcore_app.web.routes.localization import CurrentPoseJson, TrajectoryJson
from lidarcore_app.web.routes.map_making import MakingJson
from lidarcore_app.web.routes.measure import MeasureJson
from lidarcore_app.web.routes.meta import HealthJson, MethodsJson, VersionJson
from lidarcore_app.web.routes.recordings import RecordingsJson
from lidarcore_app.web.routes.repeatability import DeviationsJson, RepeatabilityJson
from lidarcore_app.web.routes.sensor import FoundDeviceJson, SuggestionJson
from lidarcore_app.web.routes.sessions import SessionsJson
from lidarcore_app.web.routes.source import SimulationJson
from lidarcore_app.web.routes.studies import StudiesJson
from lidarcore_app.web.routes.wall_history import WallHistoryJson
from lidarcore_app.web.routes.walls import WallsJson
from lidarcore_app.web.schemas import ClusterJson, CornerJson, FrameJson, SegmentJson
from pydantic import TypeAdapter
from serving import Json, Server, strict_json

import lidarcore
from lidarcore.landmarks import Session

TYPES = {
    ("get", "/health"): HealthJson,
    ("get", "/version"): VersionJson,
    ("get", "/methods"): MethodsJson,
    ("get", "/settings"): Settings,
    ("patch", "/settings"): Settings,
    ("get", "/settings/schema"): dict,
    ("get", "/frame"): FrameJson,
    ("get", "/measure"): MeasureJson,
    ("get", "/segments"): list[SegmentJson],
    ("get", "/corners"): list[CornerJson],
    ("get", "/recordings"): RecordingsJson,
    ("put", "/recordings/{name}"): RecordingEntry,
    ("get", "/recordings/{name}"): None,
    ("patch", "/recordings/{name}"): RecordingEntry,
    ("get", "/recordings/{name}/facts"): RecordingFacts,
    ("post", "/recordings/{name}/restore"): RecordingEntry,
    ("delete", "/recordings/{name}"): None,
    ("get", "/devices"): list[FoundDeviceJson],
    ("get", "/sensor/mask/suggestion"): SuggestionJson,
    ("post", "/emulator"): None,
    ("get", "/recorder"): RecorderStatus,
    ("post", "/recorder/start"): RecorderStatus,
    ("post", "/recorder/stop"): RecorderStatus,
    ("get", "/metrics"): None,
    ("get", "/landmarks"): LandmarksJson,
    ("get", "/landmarks/nearest"): NeighboursJson,
    ("get", "/landmarks/{id}"): LandmarkHistoryJson,
    ("delete", "/landmarks"): None,
    ("get", "/sessions"): SessionsJson,
    ("patch", "/sessions/{id}"): Session,
    ("delete", "/sessions/{id}"): None,
    ("get", "/map"): dict,
    ("post", "/map"): Session,
    ("post", "/map/making"): MakingStatus,
    ("get", "/map/making"): MakingJson,
    ("delete", "/map/making"): None,
    ("get", "/map/making/files"): None,
    ("get", "/source"): SourceStatus,
    ("put", "/source"): SourceStatus,
    ("patch", "/source"): SourceStatus,
    ("post", "/source/step"): SourceStatus,
    ("get", "/selection"): Selection,
    ("put", "/selection"): Selection,
    ("get", "/clusters"): list[ClusterJson],
    ("get", "/source/simulation"): SimulationJson,
    ("get", "/localization"): LocalizationStatus,
    ("post", "/localization/reset"): LocalizationStatus,
    ("put", "/localization/map"): LocalizationStatus,
    ("get", "/repeatability"): RepeatabilityJson,
    ("delete", "/repeatability"): None,
    ("get", "/repeatability/corners/{id}"): DeviationsJson,
    ("get", "/repeatability/walls/{id}"): DeviationsJson,
    ("get", "/studies"): StudiesJson,
    ("post", "/studies/consistency"): StudyStatus,
    ("post", "/studies/cwlf"): StudyStatus,
    ("post", "/studies/wctls"): StudyStatus,
    ("post", "/studies/clustering-ekf"): StudyStatus,
    ("delete", "/studies/running"): None,
    ("get", "/studies/reports/{name}"): None,
    ("delete", "/studies/reports/{name}"): None,
    ("get", "/calibration"): CalibrationStatus,
    ("post", "/calibration"): CalibrationStatus,
    ("delete", "/calibration"): None,
    ("get", "/profiles"): ProfilesJson,
    ("get", "/profiles/{name}"): Profile,
    ("put", "/profiles/{name}"): ProfileEntry,
    ("delete", "/profiles/{name}"): None,
    ("get", "/pose"): CurrentPoseJson,
    ("post", "/pose"): LocalizationStatus,
    ("get", "/trajectory"): TrajectoryJson,
    ("get", "/walls"): WallsJson,
    ("get", "/walls/nearest"): WallsJson,
    ("get", "/walls/{id}/history"): WallHistoryJson,
    ("get", "/map/grid"): None,
    ("post", "/odometry"): None,
}


@pytest.fixture(scope="module")
def document(shared_server: Server) -> Json:
    return strict_json(httpx.get(f"{shared_server.url}/openapi.json").text)


def operations(document: Json) -> dict[tuple[str, str], Json]:
    return {
        (method, path.removeprefix("/api/v1")): operation
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }


def test_every_route_is_documented_in_words(document: Json) -> None:
    assert operations(document).keys() == TYPES.keys()
    for operation in operations(document).values():
        assert operation["summary"]
        assert len(operation["description"]) > 10
        assert operation["tags"]


def test_every_answer_has_an_example_that_is_what_its_schema_says(document: Json) -> None:
    for route, type_ in TYPES.items():
        if type_ is None:
            continue
        answers = [
            a for status, a in operations(document)[route]["responses"].items() if status.startswith("2")
        ]
        example = answers[0]["content"]["application/json"]["example"]
        TypeAdapter(type_).validate_python(example)


# What the examples name and is not there: a sensor, a recording, a corner, a map.
# Nothing is localized, one recording at a time is recorded, and one study runs at a time.
IN_VAIN = {
    ("/source", 404),
    ("/recordings/{name}", 404),
    ("/selection", 404),
    ("/recorder/start", 409),
    ("/localization/map", 404),
    ("/sessions/{id}", 404),
    ("/map/making", 404),
    ("/pose", 409),
    ("/studies/consistency", 409),
    ("/studies/cwlf", 409),
    ("/studies/wctls", 409),
    ("/studies/clustering-ekf", 409),
}


def test_every_body_has_an_example_that_the_route_takes(server: Server, document: Json) -> None:
    answers = set()
    for (method, path), operation in operations(document).items():
        for kind, content in operation.get("requestBody", {}).get("content", {}).items():
            if kind != "application/json":
                continue
            assert content["schema"]["examples"]
            for example in content["schema"]["examples"]:
                here = example | {"port": "/dev/nothing"} if "port" in example else example
                status = server.http.request(method, path.replace("{id}", "3"), json=here).status_code
                assert status in (200, 201, 204) or (path, status) in IN_VAIN, (path, example)
                answers.add((path, status))
    assert {("/source", 200), ("/emulator", 204), ("/recorder/start", 200)} < answers


def test_every_error_is_documented_as_a_problem(document: Json) -> None:
    assert "ProblemJson" in document["components"]["schemas"]
    for route, operation in operations(document).items():
        for status, answer in operation["responses"].items():
            if not status.startswith("2"):
                assert list(answer["content"]) == ["application/problem+json"], (route, status)


def references(node: Any) -> set[str]:
    if isinstance(node, dict):
        here = {node["$ref"]} if isinstance(node.get("$ref"), str) else set()
        return here.union(*map(references, (v for k, v in node.items() if k != "example")))
    return set().union(*map(references, node)) if isinstance(node, list) else set()


def test_no_reference_leads_nowhere(document: Json) -> None:
    for reference in references(document):
        assert reference.rpartition("/")[2] in document["components"]["schemas"], reference


def test_the_page_needs_nothing_from_elsewhere(shared_server: Server) -> None:
    page = httpx.get(f"{shared_server.url}/docs")
    assert page.headers["content-type"].startswith("text/html")
    needed = re.findall(r"(?:src|href)=['\"]?([^'\" >]+)", page.text)
    assert len(needed) >= 4
    for path in needed:
        assert not re.match(r"(https?:)?//", path)
        assert httpx.get(f"{shared_server.url}/{path}").status_code == 200


def test_health_version_and_methods_say_what_is(server: Server) -> None:
    server.next_frame()
    health = server.get("/health")
    TypeAdapter(HealthJson).validate_python(health)
    assert health["status"] == "ok"
    assert health["ready"] is True
    assert health["cpu_s"] > 0
    assert health["memory_bytes"] > 10e6
    with server.stream() as stream:
        stream.frame(lambda _: server.get("/health")["clients"] == 1)
    version = server.get("/version")
    assert version["viser"] == "1.1.1"
    methods = server.get("/methods")
    assert [f["name"] for f in methods["fitters"]] == list(lidarcore.FITTERS)
    for method in methods["fitters"]:
        fitter = lidarcore.FITTERS[method["name"]]
        assert (method["title"], method["summary"]) == (fitter.title, fitter.summary)
        assert re.fullmatch(r"#[0-9a-f]{6}", method["colour"])
    assert methods["covariances"] == ["consistent", "published"]


def test_the_page_and_its_files_are_served(shared_server: Server) -> None:
    page = httpx.get(f"{shared_server.url}/")
    assert page.headers["content-type"].startswith("text/html")
    assert '<iframe id="scene"' in page.text
    for path in set(re.findall(r"(?:src|href)=\"(static/[^\"]+)\"", page.text)):
        assert httpx.get(f"{shared_server.url}/{path}").status_code == 200, path
