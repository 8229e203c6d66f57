import http.client
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from serving import Server, assert_problem
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

EVIL = "http://evil.example"
TOKEN = "s3cret-t0ken"
MUTATIONS = [
    ("PATCH", "/settings", {"view": {"rotate": True}}),
    ("PUT", "/source", {"kind": "emulator"}),
    ("PATCH", "/source", {"loop": False}),
    ("POST", "/source/step", {"by": 1}),
    ("PUT", "/selection", {"corner": None}),
    ("POST", "/recorder/start", {}),
    ("POST", "/recorder/stop", None),
    ("POST", "/emulator", {"command": "unplug"}),
    ("PUT", "/recordings/new.npz", {}),
    ("DELETE", "/recordings/room.npz", None),
    ("PATCH", "/recordings/other.npz", {"name": "renamed.npz"}),
    ("POST", "/recordings/room.npz/restore", None),
    ("POST", "/pose", {"x": 1, "y": 1, "heading": 0}),
    ("POST", "/odometry", {"stamp": 1, "x": 1, "y": 1, "heading": 0}),
    ("POST", "/localization/reset", None),
    ("PUT", "/localization/map", {"session": None}),
    ("POST", "/map", {"format": "lidarcore landmarks"}),
    ("POST", "/map/making", {"recording": "room.npz"}),
    ("DELETE", "/map/making", None),
    ("DELETE", "/landmarks", None),
    ("PATCH", "/sessions/1", {"name": "hall"}),
    ("DELETE", "/sessions/1", None),
    ("DELETE", "/repeatability", None),
    ("POST", "/calibration", {}),
    ("DELETE", "/calibration", None),
    ("PUT", "/profiles/new.npz", {"extraction": {"noise": {"sigma_range": 0.01, "sigma_bearing": 0.001}}}),
    ("DELETE", "/profiles/room.npz", None),
    ("POST", "/studies/consistency", {}),
    ("POST", "/studies/cwlf", {}),
    ("POST", "/studies/wctls", {}),
    ("POST", "/studies/clustering-ekf", {}),
    ("DELETE", "/studies/running", None),
    ("DELETE", "/studies/reports/cwlf_2026-11-21_10-00-00", None),
]
WEBSOCKETS = [("/api/v1/stream", None), ("/viser", ["viser-v1.1.1"])]


@pytest.mark.parametrize(("method", "path", "body"), MUTATIONS)
@pytest.mark.parametrize("origin", [EVIL, "null", "http://127.0.0.1:1", "https://localhost", "http://["])
def test_a_page_of_another_origin_changes_nothing(
    shared_server: Server, method: str, path: str, body: object, origin: str
) -> None:
    for kind in ("application/json", "text/plain"):
        headers = {"origin": origin, "content-type": kind}
        response = shared_server.http.request(method, path, json=body, headers=headers)
        assert_problem(response, 403)
    assert shared_server.get("/settings")["view"]["rotate"] is False
    assert [r["name"] for r in shared_server.recordings()] == ["room.npz"]
    assert shared_server.get("/source")["kind"] == "recording"
    assert shared_server.get("/recorder")["state"] == "idle"


def test_every_mutating_route_is_covered_by_these_tests(shared_server: Server) -> None:
    paths = httpx.get(f"{shared_server.url}/openapi.json").json()["paths"]
    routes = {(m.upper(), path) for path, methods in paths.items() for m in methods if m != "get"}
    names = {f"/api/v1{path}": method for method, path, _ in MUTATIONS}
    assert (
        len(routes) == len(names) + 4
    )  # PUT and PATCH of /source, POST and DELETE of /calibration and /map/making, PATCH and DELETE of /sessions/{id}
    assert all(
        path.replace("{name}", "new.npz").replace("{id}", "1") in names or "{name}" in path
        for _, path in routes
    )


@pytest.mark.parametrize(("path", "protocols"), WEBSOCKETS)
@pytest.mark.parametrize("origin", [EVIL, "null", None])
def test_a_websocket_opens_for_own_pages_and_programs_only(
    shared_server: Server, path: str, protocols: list | None, origin: str | None
) -> None:
    url = f"ws://127.0.0.1:{shared_server.port}{path}"
    if origin is None:
        for own in (None, shared_server.url):
            with connect(url, origin=own, subprotocols=protocols, max_size=None) as websocket:
                assert websocket.recv(timeout=10)
        return
    with pytest.raises(InvalidStatus) as refused, connect(url, origin=origin, subprotocols=protocols):
        pass
    assert refused.value.response.status_code == 403


def test_own_pages_may_change_things(server: Server) -> None:
    for name in ("127.0.0.1", "localhost"):
        headers = {"origin": f"http://{name}:{server.port}", "host": f"{name}:{server.port}"}
        server.http.patch("/settings", json={"view": {"theme": "light"}}, headers=headers).raise_for_status()


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8000", "localhost.evil.example", "[", ""])
def test_a_name_that_is_not_ours_is_not_served_even_with_a_matching_origin(
    shared_server: Server, host: str
) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", shared_server.port)
    for method, path in (("GET", "/"), ("GET", "/api/v1/frame"), ("PATCH", "/api/v1/settings")):
        connection.putrequest(method, path, skip_host=True)
        for header, value in (("Host", host), ("Origin", f"http://{host}"), ("Content-Length", "0")):
            connection.putheader(header, value)
        connection.endheaders()
        response = connection.getresponse()
        assert response.status == 421
        assert response.headers["content-type"] == "application/problem+json"
        response.read()


def test_names_allowed_at_the_start_are_served(make_server: Callable[..., Server]) -> None:
    server = make_server(hosts=("lidar.example",))
    assert server.http.get("/version", headers={"host": "Lidar.example:8000"}).status_code == 200
    assert server.http.get("/version", headers={"host": "[::1]:8000"}).status_code == 200


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory, background: Path) -> Server:
    server = Server(tmp_path_factory.mktemp("guarded"), recording=background, token=TOKEN)
    yield server
    server.stop()


@pytest.mark.parametrize(
    "path", ["/", "/docs", "/openapi.json", "/static/viser_bridge.js", "/viser/", "/metrics", "/api/v1/frame"]
)
def test_without_the_token_there_is_nothing_to_see(guarded: Server, path: str) -> None:
    for headers in (
        {},
        {"authorization": "Bearer wrong"},
        {"cookie": "lidarcore_token=wrong"},
        {"authorization": TOKEN},
    ):
        response = httpx.get(guarded.url + path, headers=headers)
        assert_problem(response, 401)
        assert response.headers["www-authenticate"] == "Bearer"
    assert_problem(httpx.get(guarded.url + path, params={"token": "wrong"}), 401)


def test_the_bearer_of_the_token_may_do_everything(guarded: Server) -> None:
    headers = {"authorization": f"Bearer {TOKEN}"}
    assert guarded.http.get("/health", headers=headers).json()["status"] == "ok"
    assert guarded.http.patch("/settings", json={}, headers=headers).status_code == 200


def test_the_token_in_the_address_becomes_a_cookie_and_leaves_the_address(guarded: Server) -> None:
    with httpx.Client(base_url=guarded.url) as browser:
        response = browser.get("/docs", params={"token": TOKEN, "x": "1"})
        assert (response.status_code, response.headers["location"]) == (303, "/docs?x=1")
        cookie = response.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert browser.get("/docs").status_code == 200
        jar = "; ".join(f"{name}={value}" for name, value in browser.cookies.items())
    for path, protocols in WEBSOCKETS:
        url = f"ws://127.0.0.1:{guarded.port}{path}"
        with pytest.raises(InvalidStatus) as refused, connect(url, subprotocols=protocols):
            pass
        assert refused.value.response.status_code == 401
        headers = {"cookie": jar}
        with connect(url, subprotocols=protocols, additional_headers=headers, max_size=None) as websocket:
            assert websocket.recv(timeout=10)


def test_the_cookie_does_not_help_a_page_of_another_origin(guarded: Server) -> None:
    headers = {"authorization": f"Bearer {TOKEN}", "origin": EVIL}
    assert_problem(guarded.http.patch("/settings", json={}, headers=headers), 403)


@pytest.mark.parametrize(
    "path", ["/", "/docs", "/viser/", "/api/v1/health", "/static/viser_bridge.js", "/nowhere"]
)
def test_every_answer_tells_the_browser_to_be_careful(shared_server: Server, path: str) -> None:
    headers = httpx.get(shared_server.url + path).headers
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "frame-ancestors 'self'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "same-origin"
    assert headers["cross-origin-resource-policy"] == "same-origin"


@pytest.mark.parametrize("chunked", [False, True])
def test_a_huge_body_is_refused_where_none_is_expected(shared_server: Server, chunked: bool) -> None:
    body = b'{"view": ' + b" " * (2 << 20) + b"{}}"
    content = iter([body[: 1 << 20], body[1 << 20 :]]) if chunked else body
    response = shared_server.http.patch(
        "/settings", content=content, headers={"content-type": "application/json"}
    )
    assert_problem(response, 413)


def test_unknown_paths_and_methods_are_problems_too(shared_server: Server) -> None:
    assert_problem(shared_server.http.get("/nowhere"), 404)
    assert_problem(shared_server.http.post("/frame"), 405)
    assert_problem(httpx.get(f"{shared_server.url}/static/../app/cli.py"), 404)


def test_nothing_of_the_machine_is_served_as_static(shared_server: Server) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", shared_server.port)
    for path in (
        "/static/../app/cli.py",
        "/static/%2e%2e/app/cli.py",
        "/static//etc/passwd",
        "/static/..%2fapp/cli.py",
    ):
        connection.request("GET", path)
        response = connection.getresponse()
        assert response.status == 404
        assert b"import" not in response.read()
    assert Path(__file__).exists()
