"""What a server writes into its log while browsers leave in the middle of things."""

import socket
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from server_process import server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

TIMES = 20


def test_uploads_that_break_off_and_refused_connections_are_told_of_in_a_few_lines(tmp_path: Path) -> None:
    with server(tmp_path, "--emulator") as (_, address):
        at = urlsplit(address)
        for number in range(TIMES):
            put = f"PUT /api/v1/recordings/{number}.csv HTTP/1.1"
            with socket.create_connection((at.hostname, at.port)) as upload:
                upload.sendall(f"{put}\r\nHost: {at.netloc}\r\nContent-Length: 9999\r\n\r\n0,1,2\n".encode())
            for path in ("/api/v1/stream", "/viser"):
                with (
                    pytest.raises(InvalidStatus),
                    connect(f"ws://{at.netloc}{path}", origin="http://elsewhere.test"),
                ):
                    pass
        assert httpx.get(f"{address}/api/v1/recordings").is_success
    log = (tmp_path / "log").read_text("utf-8")
    assert "Traceback" not in log
    assert len(log.splitlines()) < TIMES
    assert not list((tmp_path / "recordings").glob(".upload-*"))
