"""How long a large map of landmarks takes to answer while it is written to: `python -m` this module."""

import argparse
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from lidarcore.arrays import Array
from lidarcore.landmarks import Atlas, Box, Circle, Filter, Landmark, LandmarkMap

DENSITY = 1.0  # landmarks per m²
WRITES_HZ, WRITTEN = 10, 12  # what a live run puts: so many landmarks so often
LIMIT_MS = 10.0


@dataclass(frozen=True, slots=True)
class Latency:
    """Median and 99th percentile of one kind of question, ms; and of the yardstick asked in turn with it."""

    what: str
    median: float
    p99: float
    yardstick_p99: float


def measure_landmark_queries(
    path: Path, landmarks: int, sessions: int = 1, questions: int = 1000, seed: int = 0
) -> list[Latency]:
    """Latencies of one of the sessions, all in the same place, which have so many landmarks together, made at `path`.

    Another connection writes meanwhile. The yardstick is reading one landmark by its id: it tells what the machine,
    not the query, does to the slowest.
    """
    rng, each = np.random.default_rng(seed), landmarks // sessions
    side = float(np.sqrt(each / DENSITY))
    with Atlas(path) as atlas, Atlas(path) as other:
        maps = [atlas.begin(f"run {i}", 0.0) for i in range(sessions)]
        for landmark_map in maps:
            ids = landmark_map.put(random_landmarks(each, side, rng))
        with writing(other[landmark_map.session], ids):
            return [
                _latency(what, ask, landmark_map, ids, side, questions, rng)
                for what, ask in _questions(landmark_map, side).items()
            ]


def random_landmarks(n: int, side: float, rng: np.random.Generator) -> Iterator[Landmark]:
    """Landmarks all over a square of this side (m), standard deviations from 3 mm to 0.3 m."""
    xy, sigma = rng.uniform(0, side, (n, 2)), 10 ** rng.uniform(-2.5, -0.5, (n, 2))
    for (x, y), (a, b), rho in zip(
        xy.tolist(), sigma.tolist(), rng.uniform(-0.9, 0.9, n).tolist(), strict=True
    ):
        yield Landmark(x, y, a * a, rho * a * b, b * b, "corner" if rho > 0 else "cluster", "ml", 1)


def _questions(landmark_map: LandmarkMap, side: float) -> dict[str, Callable[[Array], object]]:
    corners = Filter(kinds=("corner",), max_sigma=0.2)
    noise = 0.02**2 * np.eye(2)
    questions: dict[str, Callable[[Array], object]] = {
        f"box of {width:g} m, a page of {page}": partial(_ask_box, landmark_map, width, page)
        for width, page in ((10, 100), (100, 100), (side / 2, 100), (30, 1000))
    }
    nearest = landmark_map.nearest
    return questions | {
        "circle of 10 m": lambda p: landmark_map.find(Circle(p[0], p[1], 10.0)),
        "nearest": lambda p: nearest(p),
        "10 nearest": lambda p: nearest(p, 10),
        "10 nearest corners, sigma below 0.2 m": lambda p: nearest(p, 10, corners),
        "10 nearest, Mahalanobis, 20 mm noise": lambda p: nearest(
            p, 10, metric="mahalanobis", covariance=noise
        ),
        "nearest in a gate of 3, Mahalanobis": lambda p: nearest(
            p, within=3.0, metric="mahalanobis", covariance=noise
        ),
    }


def _ask_box(landmark_map: LandmarkMap, width: float, page: int, middle: Array) -> object:
    return landmark_map.find(Box(*(middle - width / 2), *(middle + width / 2)), limit=page)


def _latency(
    what: str, ask: Callable[[Array], object], landmark_map: LandmarkMap, ids: list[int], side: float, n: int,
    rng: np.random.Generator,
) -> Latency:  # fmt: skip
    took = np.empty((n, 2))
    for i, (place, id) in enumerate(
        zip(rng.uniform(0, side, (n, 2)), rng.choice(ids, n).tolist(), strict=True)
    ):
        before = time.perf_counter()
        ask(place)
        between = time.perf_counter()
        landmark_map[id]
        took[i] = between - before, time.perf_counter() - between
    p99 = 1e3 * np.percentile(took, 99, axis=0)
    return Latency(what, 1e3 * float(np.median(took[:, 0])), float(p99[0]), float(p99[1]))


@contextmanager
def writing(landmark_map: LandmarkMap, ids: list[int]) -> Iterator[None]:
    """A thread that updates some of these landmarks as a live run does, as long as the block runs."""
    stop = threading.Event()
    some = ids[:: max(1, len(ids) // WRITTEN)]

    def write() -> None:
        second = 0
        while not stop.wait(1 / WRITES_HZ):
            second += 1
            seen = (landmark_map[id] for id in some)
            landmark_map.put([replace(mark, count=mark.count + 1, last_seen=float(second)) for mark in seen])

    thread = threading.Thread(target=write)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def main() -> None:
    """Print the latencies of a million landmarks in one session and in a thousand: about two minutes to make."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--landmarks", type=int, default=1_000_000)
    for sessions in (1, 1000):
        print(f"{sessions} sessions in the same place")
        with tempfile.TemporaryDirectory() as folder:
            rows = measure_landmark_queries(Path(folder) / "map.db", parser.parse_args().landmarks, sessions)
        for row in rows:
            judged = "ok" if row.p99 <= LIMIT_MS else "missed"
            print(f"{row.what:40} median {row.median:6.2f} ms, p99 {row.p99:6.2f} ms ({judged}), "
                  f"yardstick p99 {row.yardstick_p99:.2f} ms")  # fmt: skip


if __name__ == "__main__":
    main()
