import re
from functools import reduce
from operator import getitem
from typing import Any

import httpx
import pytest
from pydantic import TypeAdapter, ValidationError
from serving import Json, Server, strict_json

import lidarcore
from app.api.calibration import ProfilesJson
from app.api.landmarks import LandmarkHistoryJson, LandmarksJson, NeighboursJson
from app.api.localization import TrajectoryJson, WhereJson
from app.api.meta import HealthJson, MethodsJson, VersionJson
from app.api.recordings import RecordingsJson
from app.api.selection import SelectionBody
from app.api.sensor import FoundDeviceJson
from app.api.sessions import SessionJson, SessionsJson
from app.api.source import SimulationJson
from app.api.studies import StudiesJson
from app.calibration_wire import CalibrationStateJson
from app.library import RecordingJson
from app.player import SourceJson
from app.profiles import Profile, ProfileEntryJson
from app.recorder import RecorderJson
from app.repeatability_wire import DeviationsJson, RepeatabilityJson
from app.settings import Settings
from app.studies import RunJson
from app.wire import ClusterJson, CornerJson, FrameJson, LocalizationStateJson, SegmentJson

TYPES = {
    ("get", "/health"): HealthJson,
    ("get", "/version"): VersionJson,
    ("get", "/methods"): MethodsJson,
    ("get", "/settings"): Settings,
    ("patch", "/settings"): Settings,
    ("get", "/settings/schema"): dict,
    ("get", "/frame"): FrameJson,
    ("get", "/segments"): list[SegmentJson],
    ("get", "/corners"): list[CornerJson],
    ("get", "/recordings"): RecordingsJson,
    ("put", "/recordings/{name}"): RecordingJson,
    ("delete", "/recordings/{name}"): None,
    ("get", "/devices"): list[FoundDeviceJson],
    ("post", "/emulator"): None,
    ("get", "/recorder"): RecorderJson,
    ("post", "/recorder/start"): RecorderJson,
    ("post", "/recorder/stop"): RecorderJson,
    ("get", "/metrics"): None,
    ("get", "/landmarks"): LandmarksJson,
    ("get", "/landmarks/nearest"): NeighboursJson,
    ("get", "/landmarks/{id}"): LandmarkHistoryJson,
    ("delete", "/landmarks"): None,
    ("get", "/sessions"): SessionsJson,
    ("delete", "/sessions/{id}"): None,
    ("get", "/map"): dict,
    ("post", "/map"): SessionJson,
    ("get", "/source"): SourceJson,
    ("put", "/source"): SourceJson,
    ("patch", "/source"): SourceJson,
    ("post", "/source/step"): SourceJson,
    ("get", "/selection"): SelectionBody,
    ("put", "/selection"): SelectionBody,
    ("get", "/clusters"): list[ClusterJson],
    ("get", "/source/simulation"): SimulationJson,
    ("get", "/localization"): LocalizationStateJson,
    ("post", "/localization/reset"): LocalizationStateJson,
    ("put", "/localization/map"): LocalizationStateJson,
    ("get", "/repeatability"): RepeatabilityJson,
    ("delete", "/repeatability"): None,
    ("get", "/repeatability/corners/{id}"): DeviationsJson,
    ("get", "/studies"): StudiesJson,
    ("post", "/studies/consistency"): RunJson,
    ("post", "/studies/cwlf"): RunJson,
    ("post", "/studies/wctls"): RunJson,
    ("post", "/studies/clustering-ekf"): RunJson,
    ("delete", "/studies/running"): None,
    ("get", "/studies/reports/{name}"): None,
    ("delete", "/studies/reports/{name}"): None,
    ("get", "/calibration"): CalibrationStateJson,
    ("post", "/calibration"): CalibrationStateJson,
    ("delete", "/calibration"): None,
    ("get", "/profiles"): ProfilesJson,
    ("get", "/profiles/{name}"): Profile,
    ("put", "/profiles/{name}"): ProfileEntryJson,
    ("delete", "/profiles/{name}"): None,
    ("get", "/pose"): WhereJson,
    ("post", "/pose"): LocalizationStateJson,
    ("get", "/trajectory"): TrajectoryJson,
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


def validate(adapter: TypeAdapter[Any], example: Json) -> None:
    """The example, with the nulls that FastAPI leaves out where a field is missing."""
    try:
        adapter.validate_python(example)
    except ValidationError as error:
        for *path, name in [e["loc"] for e in error.errors() if e["type"] == "missing"]:
            reduce(getitem, path, example)[name] = None
        adapter.validate_python(example)


def test_every_answer_has_an_example_that_is_what_its_schema_says(document: Json) -> None:
    for route, type_ in TYPES.items():
        if type_ is None:
            continue
        answers = [
            a for status, a in operations(document)[route]["responses"].items() if status.startswith("2")
        ]
        example = answers[0]["content"]["application/json"]["example"]
        validate(TypeAdapter(type_), example)


# What the examples name and is not there: a sensor, a recording, a corner, a map.
# Nothing is localized, one recording at a time is recorded, and one study runs at a time.
IN_VAIN = {
    ("/source", 404),
    ("/selection", 404),
    ("/recorder/start", 409),
    ("/localization/map", 404),
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
                status = server.http.request(method, path, json=here).status_code
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


def test_the_page_shows_every_route_and_needs_nothing_from_elsewhere(
    shared_server: Server, document: Json
) -> None:
    page = httpx.get(f"{shared_server.url}/docs")
    assert page.headers["content-type"].startswith("text/html")
    for path in document["paths"]:
        assert f"<code>{path}</code>" in page.text
    assert "<script" not in page.text
    assert not re.findall(r"(?:src|href)=['\"]?(?:https?:)?//", page.text)


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
    assert "viser/" in page.text
    for path in set(re.findall(r"(?:src|href)=\"(static/[^\"]+)\"", page.text)):
        assert httpx.get(f"{shared_server.url}/{path}").status_code == 200, path
