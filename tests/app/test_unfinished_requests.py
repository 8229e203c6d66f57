"""Clients that begin requests and never end them: they go, everybody else is served."""

import logging
import socket
from contextlib import ExitStack
from http.client import HTTPResponse

import pytest
from lidarcore_app.web import transport
from lidarcore_app.web.log import OFTEN, Throttle
from serving import Server
from waiting import PATIENCE

HEAD = b"GET /api/v1/version HTTP/1.1\r\nHost: localhost\r\n"
BODY = (
    b"PATCH /api/v1/settings HTTP/1.1\r\nHost: localhost\r\n"
    b"Content-Type: application/json\r\nContent-Length: 100\r\n\r\n{"
)


def begin(server: Server, stack: ExitStack, sent: bytes) -> socket.socket:
    connection = stack.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE))
    connection.sendall(sent)
    return connection


def is_closed(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def answer(connection: socket.socket) -> int:
    response = HTTPResponse(connection)
    response.begin()
    response.read()
    return response.status


def test_more_half_requests_than_are_waited_for_push_out_the_oldest_and_nobody_else(shared_server):
    most = transport.MOST_UNFINISHED
    with ExitStack() as stack, shared_server.stream() as stream:
        first = stream.frame()["sequence"]
        halves = [begin(shared_server, stack, HEAD) for _ in range(most + 50)]
        assert all(is_closed(half) for half in halves[:40])
        assert shared_server.get("/version")
        stream.frame(lambda frame: frame["sequence"] > first + 3)


@pytest.mark.parametrize(
    ("sent", "limit"), [(b"", "HEAD_WITHIN"), (HEAD, "HEAD_WITHIN"), (BODY, "BODY_WITHIN")]
)
def test_a_request_that_does_not_go_on_is_dropped(shared_server, monkeypatch, sent, limit):
    monkeypatch.setattr(transport, limit, 0.3)
    with ExitStack() as stack:
        assert is_closed(begin(shared_server, stack, sent))


def test_a_client_that_takes_its_time_between_requests_and_pieces_is_served(shared_server):
    """A connection that is kept, a head in two pieces, a body in two pieces."""
    with ExitStack() as stack:
        connection = begin(shared_server, stack, HEAD[:20])
        connection.sendall(HEAD[20:] + b"\r\n")
        assert answer(connection) == 200
        connection.sendall(BODY)
        connection.sendall(b" " * 98 + b"}")
        assert answer(connection) == 200


def test_what_is_said_again_and_again_is_counted_instead(caplog):
    log = logging.getLogger("flooded")
    log.addFilter(Throttle())
    for i in range(1000):
        log.warning("connection %d failed", i)
    log.warning("something else")
    assert [record.getMessage() for record in caplog.records] == [
        *(f"connection {i} failed" for i in range(OFTEN)),
        "something else",
    ]
