import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from lidarcore_app.pipeline.settings import Settings
from pydantic import TypeAdapter
from serving import Server, assert_problem, chosen

from lidarcore.simulation.settings import SimulationSettings

AT_START = Settings(sensor={"mask": []})  # of a recording that keeps no mask


def test_a_patch_changes_what_it_names_and_returns_everything(server: Server) -> None:
    before = server.get("/settings")
    assert before == json.loads(AT_START.model_dump_json())
    after = server.change("PATCH", "/settings", {"extraction": {"noise": {"sigma_range": 0.03}}})
    for part in ("extraction", "clusters"):  # there is one sensor
        before[part]["noise"]["sigma_range"] = 0.03
    assert after == before == server.get("/settings")


def numbers(schema: dict, node: dict, path: str = "") -> Iterator[tuple[str, str]]:
    """Path and description of every number below a node of a schema."""
    kinds = {kind.get("type") for kind in (node, *node.get("anyOf", []))}
    if kinds & {"number", "integer"}:
        yield path, node["description"]
    reference = node.get("$ref", "").removeprefix("#/$defs/")
    properties = (schema["$defs"][reference] if reference else node).get("properties", {})
    for name, part in properties.items():
        yield from numbers(schema, part, f"{path}/{name}")


def test_every_number_says_what_more_of_it_does(server: Server) -> None:
    robot = TypeAdapter(SimulationSettings).json_schema()
    said = [
        *numbers(schema := server.get("/settings/schema"), schema),
        *numbers(robot, robot, "/simulation"),
    ]
    assert len(said) > 60
    assert [path for path, text in said if "More: " not in text and not path.endswith("/seed")] == []


def test_null_puts_the_default_back(server: Server) -> None:
    server.change(
        "PATCH", "/settings", {"extraction": {"gap": 0.7, "min_points": 9}, "view": {"compare": True}}
    )
    after = server.change("PATCH", "/settings", {"extraction": {"gap": None}, "view": None})
    assert after["extraction"]["gap"] == Settings().extraction.gap
    assert after["extraction"]["min_points"] == 9
    assert after["view"]["compare"] is False


def test_a_method_switched_is_in_the_next_frames(server: Server) -> None:
    with server.stream() as stream:
        assert stream.frame()["fitter"] == "ml"
        server.change("PATCH", "/settings", {"extraction": {"fitter": "wctls", "covariance": "published"}})
        assert stream.state(lambda s: s["settings"]["extraction"]["fitter"] == "wctls")
        frame = stream.frame(lambda f: f["fitter"] == "wctls")
        assert frame["methods"] == ["wctls"]
        assert frame["covariance"] == "published"


def test_while_paused_the_current_scan_is_processed_again(server: Server, room: Path) -> None:
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": room.name, "index": 3, "paused": True})
        paused = stream.frame(chosen)
        server.change("PATCH", "/settings", {"extraction": {"min_length": 4.5}})
        again = stream.frame(lambda f: f["sequence"] > paused["sequence"])
    assert again["source"]["index"] == paused["source"]["index"] == 3
    assert len(paused["segments"]["ml"]) == 4
    assert len(again["segments"]["ml"]) == 2
    assert {r["kind"] for r in again["rejections"]} >= {"segment"}


@pytest.mark.parametrize(
    ("patch", "pointer"),
    [
        ({"extraction": {"gapp": 1}}, "/extraction/gapp"),
        ({"extraction": {"noise": {"sigma": 1}}}, "/extraction/noise/sigma"),
        ({"view": {"layers": {"ceilings": True}}}, "/view/layers/ceilings"),
        ({"colour": "red"}, "/colour"),
        ({"extraction": {"gap": -1}}, "/extraction/gap"),
        ({"extraction": {"gap": "0.3"}}, "/extraction/gap"),
        ({"extraction": {"gap": True}}, "/extraction/gap"),
        ({"extraction": {"min_points": 6.5}}, "/extraction/min_points"),
        ({"extraction": {"fitter": "magic"}}, "/extraction/fitter"),
        ({"extraction": 5}, "/extraction"),
        ({"view": {"methods": ["ml", "magic"]}}, "/view/methods"),
        ({"view": {"theme": "pink"}}, "/view/theme"),
        ({"view": {"ellipse_scale": 1000}}, "/view/ellipse_scale"),
    ],
)
def test_a_bad_patch_names_the_place_and_changes_nothing(
    shared_server: Server, patch: dict, pointer: str
) -> None:
    patch = {"view": {"rotate": True}} | patch
    problem = assert_problem(shared_server.http.patch("/settings", json=patch), 422)
    assert pointer in {error["pointer"] for error in problem["errors"]}
    assert shared_server.get("/settings") == json.loads(AT_START.model_dump_json())


@pytest.mark.parametrize(
    "body",
    [
        '{"extraction": {"gap": NaN}}',
        '{"extraction": {"noise": {"sigma_range": Infinity}}}',
        '{"view": {"ellipse_scale": -Infinity}}',
        '{"extraction": ',
        "[]",
        "null",
        "",
        b"\xff\xfe",
    ],
)
def test_what_is_no_json_object_of_finite_numbers_is_refused(
    shared_server: Server, body: str | bytes
) -> None:
    response = shared_server.http.patch(
        "/settings", content=body, headers={"content-type": "application/json"}
    )
    assert response.status_code in (400, 422)
    assert_problem(response, response.status_code)
    assert shared_server.get("/settings") == json.loads(AT_START.model_dump_json())


def test_where_no_json_is_sent_the_answer_asks_for_some(shared_server: Server) -> None:
    for request in ({}, {"content": "gap=1", "headers": {"content-type": "text/plain"}}):
        problem = assert_problem(shared_server.http.patch("/settings", **request), 422)
        assert problem["detail"].startswith("Send a JSON body")


def test_json_that_is_no_object_is_told_so(shared_server: Server) -> None:
    for body in ([], 3, "gap", True):
        problem = assert_problem(shared_server.http.patch("/settings", json=body), 422)
        assert problem["detail"].startswith("The body is JSON, but no object")


def test_the_schema_describes_every_number_with_range_and_meaning(server: Server) -> None:
    schema = server.get("/settings/schema")

    def values(settings: object) -> int:
        return sum(map(values, settings.values())) if isinstance(settings, dict) else 1

    def leaves(node: dict) -> list[dict]:
        if "$ref" in node:
            return leaves(schema["$defs"][node["$ref"].rpartition("/")[2]])
        properties = node.get("properties", {}).values()
        return [leaf for child in properties for leaf in leaves(child)] or [node]

    found = leaves(schema)
    assert len(found) == values(server.get("/settings"))
    for leaf in found:
        assert leaf["description"]
        assert "default" in leaf
        for kind in leaf.get("anyOf", [leaf]):
            if kind.get("type") in ("number", "integer"):
                assert "maximum" in kind
                assert "minimum" in kind or "exclusiveMinimum" in kind
