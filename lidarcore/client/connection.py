"""Requests to the server, and what goes wrong with them as errors of this library."""

import json
from collections.abc import Iterator
from typing import Any

import httpx

from lidarcore.errors import ClientError, ServerUnreachableError
from lidarcore.files import reason


class Connection:
    """A connection to one server, kept open between requests. Raises ServerUnreachableError and ClientError."""

    def __init__(self, url: str, token: str | None, timeout: float) -> None:
        self._url = url.rstrip("/")
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(base_url=f"{self._url}/api/v1", headers=self._headers, timeout=timeout)

    def close(self) -> None:
        """Close it."""
        self._http.close()

    def get(self, path: str, **params: Any) -> Any:
        """The JSON there, for those parameters that are not None."""
        response = self.ask("GET", path, params=given(**params))
        try:
            return response.json()
        except ValueError as error:
            raise _refusal(str(response.url), response.status_code, response.content) from error

    def send(self, method: str, path: str, body: object) -> Any:
        """Send JSON, and get JSON or nothing. Raises ClientError for what JSON cannot say, such as NaN."""
        try:
            text = json.dumps(body, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise ClientError(
                422, "Unprocessable Content", f"{body} cannot be sent as JSON: {error}."
            ) from error
        response = self.ask(method, path, content=text, headers={"Content-Type": "application/json"})
        return response.json() if response.content else None

    def ask(self, method: str, path: str, **options: Any) -> httpx.Response:
        """An answer that is no error."""
        try:
            response = self._http.request(method, path, **options)
        except (httpx.TransportError, httpx.InvalidURL) as error:
            raise self._unreachable(error) from error
        if not response.is_success:
            raise _refusal(str(response.url), response.status_code, response.content)
        return response

    def stream(self, path: str) -> Iterator[dict[str, Any]]:
        """The messages of a WebSocket."""
        from websockets.exceptions import InvalidStatus, WebSocketException
        from websockets.sync.client import connect

        address = f"{self._url.replace('http', 'ws', 1)}/api/v1{path}"
        try:
            with connect(address, additional_headers=self._headers, max_size=None) as stream:
                for text in stream:
                    yield json.loads(text)
        except InvalidStatus as error:
            raise _refusal(address, error.response.status_code, error.response.body) from error
        except (OSError, WebSocketException) as error:
            raise self._unreachable(error) from error

    def _unreachable(self, error: Exception) -> ServerUnreachableError:
        return ServerUnreachableError(
            f"No server answers at {self._url} ({reason(error)}): start `lidarcore serve`, or give the URL it printed."
        )


def given(**values: Any) -> dict[str, Any]:
    """The arguments that are not None, as parameters of a request."""
    return {name: value for name, value in values.items() if value is not None}


def _refusal(url: str, status: int, body: bytes | bytearray) -> ClientError:
    """The error that problem details (RFC 9457), or whatever came in their place, describe."""
    try:
        problem = json.loads(body)
        return ClientError(status, problem["title"], problem["detail"])
    except (ValueError, TypeError, KeyError):
        detail = f"{url} does not answer as lidarcore does: check the URL."
        return ClientError(status, "Unexpected answer", detail)
