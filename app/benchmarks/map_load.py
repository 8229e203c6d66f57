"""How fast a running server answers about a large map while its live run writes."""

import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlencode

import numpy as np

from lidarcore import Array
from lidarcore.evaluation.speed.landmarks import DENSITY, random_landmarks
from lidarcore.landmarks import Atlas

from .server_load import SETTLE, server

API = "/api/v1"
START_WITHIN = 120.0  # s: kernels are compiled first, if need be
YARDSTICK = f"{API}/version"  # the same server, without a question


@dataclass(frozen=True, slots=True)
class Answers:
    """Latencies of one kind of question, ms, and of the yardstick asked in turn with it; median size of an answer."""

    what: str
    median: float
    p99: float
    yardstick_median: float
    yardstick_p99: float
    kilobytes: float


def measure_map_queries(landmarks: int, questions: int = 1000, seed: int = 0) -> list[Answers]:
    """Latencies over HTTP of a server in a process of its own that maps an emulated room, and has a large map, too."""
    rng, side = np.random.default_rng(seed), float(np.sqrt(landmarks / DENSITY))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "landmarks.db"
        with Atlas(path) as atlas:
            session = atlas.begin("large", 0.0, landmarks=random_landmarks(landmarks, side, rng)).session
        with server(
            "--map", str(path), "--set", "navigation.mode=slam", "--set", "navigation.method=landmarks"
        ) as (_, port):
            _wait_for_landmarks(port)
            asked = {
                what: _paths(ask, session, rng.uniform(0, side, (questions, 2)))
                for what, ask in QUESTIONS.items()
            }
            return [_latencies(what, port, paths) for what, paths in asked.items()]


def _box(width: float, **options: object) -> Callable[[float, float], str]:
    def ask(x: float, y: float) -> str:
        bounds = (x - width / 2, y - width / 2, x + width / 2, y + width / 2)
        return f"/landmarks?bbox={','.join(f'{bound:.3f}' for bound in bounds)}&{urlencode(options)}"

    return ask


def _nearest(**options: object) -> Callable[[float, float], str]:
    return lambda x, y: f"/landmarks/nearest?x={x:.3f}&y={y:.3f}&{urlencode(options)}"


QUESTIONS: dict[str, Callable[[float, float], str]] = {
    "box of 5 m": _box(5),
    "box of 10 m": _box(10),
    "box of 100 m": _box(100),
    "box of 500 m": _box(500),
    "box of 30 m, a page of 1000": _box(30, limit=1000),
    "circle of 10 m": lambda x, y: f"/landmarks?x={x:.3f}&y={y:.3f}&radius=10",
    "nearest": _nearest(),
    "10 nearest": _nearest(k=10),
    "10 nearest corners, sigma below 0.2 m": _nearest(k=10, kind="corner", max_sigma=0.2),
    "10 nearest, Mahalanobis, 20 mm noise": _nearest(k=10, metric="mahalanobis", sigma=0.02),
}


def _paths(ask: Callable[[float, float], str], session: int, places: Array) -> list[str]:
    return [f"{API}{ask(x, y)}&session={session}" for x, y in places.tolist()]


def _latencies(what: str, port: int, paths: list[str]) -> Answers:
    connection = HTTPConnection("127.0.0.1", port)
    took, sizes = np.empty((len(paths), 2)), np.empty(len(paths))
    for i, path in enumerate(paths):
        begin = time.perf_counter()
        sizes[i] = len(_get(connection, path))
        between = time.perf_counter()
        _get(connection, YARDSTICK)
        took[i] = between - begin, time.perf_counter() - between
    connection.close()
    (median, yardstick_median), (p99, yardstick_p99) = 1e3 * np.percentile(took, (50, 99), axis=0)
    return Answers(what, median, p99, yardstick_median, yardstick_p99, float(np.median(sizes)) / 1000)


def _get(connection: HTTPConnection, path: str) -> bytes:
    connection.request("GET", path)
    response = connection.getresponse()
    body = response.read()
    if response.status != 200:
        raise RuntimeError(f"{path} was answered with {response.status}: {body[:200]!r}")
    return body


def _wait_for_landmarks(port: int) -> None:
    """Until the live run has some on the disk. Raises RuntimeError if that does not come true."""
    connection, end = HTTPConnection("127.0.0.1", port), time.monotonic() + START_WITHIN
    while not json.loads(_get(connection, f"{API}/sessions"))["store"]["landmarks"]:
        if time.monotonic() > end:
            raise RuntimeError("The live run writes no landmarks: nothing to measure beside.")
        time.sleep(0.2)
    connection.close()
    time.sleep(SETTLE)
