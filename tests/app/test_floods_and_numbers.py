"""Too much odometry, too large pictures, numbers that are none, and what a refusal says."""

import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest
from lidarcore_app import isolation
from lidarcore_app.jobs.maps import sent_map
from lidarcore_app.sources import odometry_feed
from lidarcore_app.sources.odometry_feed import MOST_PER_SECOND, OdometryFeed
from lidarcore_app.web.routes import map as map_routes
from serving import Server, assert_problem, wait_until
from waiting import PATIENCE

from lidarcore.localization import LocalizationSettings

BODIES = [
    ("PATCH", "/source", {"speed": False}),
    ("POST", "/pose", {"x": True, "y": 0, "heading": 0}),
    ("POST", "/pose", {"x": 0, "y": 0, "heading": 0, "sigma_position": True}),
    ("POST", "/pose", {"x": 0, "y": 0, "heading": 0, "covariance": [[True, 0, 0], [0, 1, 0], [0, 0, 1]]}),
    ("POST", "/odometry", {"stamp": True, "x": 0, "y": 0, "heading": 0}),
    ("POST", "/odometry", [{"stamp": 0, "x": 0, "y": False, "heading": 0}]),
    ("PUT", "/localization/map", {"session": True}),
    ("PUT", "/source", {"kind": "simulation", "settings": {"seed": True}}),
    ("PATCH", "/settings", {"view": {"ellipse_scale": True}}),
]


@pytest.mark.parametrize(("method", "path", "body"), BODIES)
def test_true_and_false_are_no_numbers(shared_server: Server, method: str, path: str, body: object) -> None:
    assert_problem(shared_server.http.request(method, path, json=body), 422)


@pytest.mark.parametrize("speed", [0, 0.1, 2, 100])
def test_speeds_are_numbers(shared_server: Server, speed: float) -> None:
    assert shared_server.http.patch("/source", json={"speed": speed}).status_code == 200


@pytest.mark.parametrize("speed", [0.05, -1, 101, "2"])
def test_other_speeds_are_refused(shared_server: Server, speed: object) -> None:
    assert_problem(shared_server.http.patch("/source", json={"speed": speed}), 422)


def test_more_odometry_than_a_robot_sends_is_dropped_and_counted(monkeypatch) -> None:
    now = 100.0
    monkeypatch.setattr(odometry_feed, "time", SimpleNamespace(monotonic=lambda: now))
    feed, limits = OdometryFeed(), LocalizationSettings()
    second = int(MOST_PER_SECOND)
    taken = sum(feed.put(i * 1e-3, (0.0, 0.0, 0.0), limits) for i in range(3 * second))
    assert taken == second
    assert (feed.status().taken, feed.status().dropped) == (second, 2 * second)
    now += 0.5
    assert sum(feed.put(10 + i * 1e-3, (0.0, 0.0, 0.0), limits) for i in range(second)) == second // 2


@pytest.mark.parametrize(
    ("method", "path", "said"),
    [
        ("GET", "/map?formt=png", "There is no such parameter; there is format, resolution, session."),
        ("GET", "/landmarks/nearest?x=0&y=0&n=3", "k, kind, max_sigma, method"),
        ("POST", "/map?session=1", "there is format, name."),
        ("GET", "/pose?since=3", "there is none."),
    ],
)
def test_parameters_that_would_do_nothing_are_refused(
    shared_server: Server, method: str, path: str, said: str
) -> None:
    problem = assert_problem(shared_server.http.request(method, path), 422)
    assert said in problem["detail"]
    assert len(problem["errors"]) == 1


@pytest.mark.parametrize("format", ["json", "csv", "geojson", "svg", "dxf"])
def test_a_resolution_is_that_of_a_picture(shared_server: Server, format: str) -> None:
    answer = shared_server.http.get("/map", params={"format": format, "resolution": 0.1})
    assert f"leave it out for {format}." in assert_problem(answer, 422)["detail"]


@pytest.mark.parametrize(
    ("body", "said"),
    [("{nope", "Expecting property name enclosed in double quotes (character 2)."), ("[1, ]", "(character")],
)
@pytest.mark.parametrize(("method", "path"), [("PATCH", "/settings"), ("POST", "/odometry")])
def test_a_body_that_is_no_json_is_called_so(
    shared_server: Server, method: str, path: str, body: str, said: str
) -> None:
    declared = {"Content-Type": "application/json"}
    problem = assert_problem(shared_server.http.request(method, path, content=body, headers=declared), 422)
    assert problem["detail"].startswith("The body is not valid JSON: ")
    assert said in problem["detail"]
    assert [error["pointer"] for error in problem["errors"]] == ["/"]


def test_odometry_that_is_not_declared_as_json_is_asked_for_as_such(shared_server: Server) -> None:
    answer = shared_server.http.post("/odometry", content='{"stamp": 0, "x": 0, "y": 0, "heading": 0}')
    assert assert_problem(answer, 422)["detail"].startswith("Send a JSON body")


def test_allow_names_every_method_of_the_path(shared_server: Server) -> None:
    answer = shared_server.http.delete("/source")
    assert_problem(answer, 405)
    assert answer.headers["Allow"] == "GET, PATCH, PUT"


@pytest.mark.parametrize("path", ["/api", "/api/", "/api/v1", "/api/v1/scan", "/static/nothing.js"])
def test_where_there_is_nothing_it_says_where_there_is_something(shared_server: Server, path: str) -> None:
    problem = assert_problem(shared_server.http.get(shared_server.url + path), 404)
    assert problem["detail"].startswith(f"There is nothing at {path}: /docs shows")


def test_every_route_with_a_body_says_that_it_may_be_no_json(shared_server: Server) -> None:
    paths = shared_server.http.get(f"{shared_server.url}/openapi.json").json()["paths"]
    bodies = [
        operation for path in paths.values() for operation in path.values() if "requestBody" in operation
    ]
    assert len(bodies) > 10
    assert all("400" in operation["responses"] for operation in bodies)


def test_a_picture_of_more_pixels_than_allowed_is_refused(shared_server: Server) -> None:
    far = {"format": "lidarcore landmarks", "version": 1, "unit": "m"}
    places = [
        {"x": x, "y": x, "var_x": 1e-4, "cov_xy": 0, "var_y": 1e-4, "kind": "corner"} for x in (0.0, 10.0)
    ]
    session = (
        shared_server.http.post("/map", json=far | {"landmarks": places}).raise_for_status().json()["id"]
    )
    asked = {"session": session, "format": "png", "resolution": 0.001}
    problem = assert_problem(shared_server.http.get("/map", params=asked), 422)
    assert "more than 16000000: give a coarser resolution" in problem["detail"]
    assert shared_server.http.get("/map", params=asked | {"resolution": 0.05}).status_code == 200


def test_a_map_is_read_in_a_process_of_its_own(shared_server: Server, monkeypatch) -> None:
    """One that says nothing for as long as is allowed here: it is ended, and the server goes on."""
    monkeypatch.setattr(isolation, "QUIET", 0.0)
    body = b'{"format": "lidarcore landmarks", "landmarks": [' + b"[]," * 300_000 + b"[]]}"
    problem = assert_problem(shared_server.http.post("/map", content=body), 422)
    assert "Reading the json was stopped" in problem["detail"]


def test_a_map_of_more_landmarks_than_allowed_is_refused(shared_server: Server, monkeypatch) -> None:
    monkeypatch.setattr(sent_map, "MOST", 1500)
    head, row = "x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind\n", "1,1,1,0,1,corner\n"
    asked = {"params": {"format": "csv"}}
    assert shared_server.http.post("/map", content=head + 1500 * row, **asked).status_code == 201
    problem = assert_problem(shared_server.http.post("/map", content=head + 1501 * row, **asked), 422)
    assert "more than 1500 landmarks" in problem["detail"]


def test_heavy_answers_are_made_one_at_a_time_and_light_ones_go_on(
    shared_server: Server, monkeypatch
) -> None:
    head, row = "x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind\n", "1,1,1,0,1,corner\n"
    loaded = shared_server.http.post("/map", params={"format": "csv"}, content=head + row).json()
    making, most, begun, go_on = 0, 0, threading.Semaphore(0), threading.Event()
    original = map_routes.export_picture

    def slow(*arguments: object) -> None:
        nonlocal making, most
        making += 1
        most = max(most, making)
        begun.release()
        assert go_on.wait(PATIENCE)
        original(*arguments)
        making -= 1

    monkeypatch.setattr(map_routes, "export_picture", slow)
    heavy, asked = shared_server.app.state.server.heavy, {"format": "png", "session": loaded["id"]}
    with ThreadPoolExecutor(5) as pool:
        answers = [pool.submit(shared_server.http.get, "/map", params=asked) for _ in range(5)]
        try:
            assert begun.acquire(timeout=PATIENCE)
            wait_until(lambda: heavy.statistics().tasks_waiting == 4)
            assert shared_server.get("/version")
        finally:
            go_on.set()
        assert [answer.result().status_code for answer in answers] == 5 * [200]
    assert most == 1


def test_the_trajectory_does_not_wait_for_a_scan_that_takes_long(shared_server: Server) -> None:
    """A worker that is busy all the time gives up its lock for moments only, which others need not get."""
    with shared_server.runtime.navigation._lock:
        for path in ("/trajectory", "/localization", "/pose?"):
            assert shared_server.http.get(path, timeout=10).status_code in (200, 404)
