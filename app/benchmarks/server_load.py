"""A running server under the load of browsers: what it costs and how old its frames are."""

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import psutil
from websockets.asyncio.client import connect

SETTLE = 3.0  # s before measuring
EVERYTHING = (  # what is off by default
    "--set", "view.layers.rejected=true", "--set", "view.layers.clusters=true", "--set", "navigation.mode=slam",
    "--set", "navigation.method=landmarks",
)  # fmt: skip


@dataclass(slots=True)
class Load:
    """What was measured over some seconds with some browsers."""

    clients: int
    cpu_percent: float = 0.0  # of one core
    rate_hz: float = 0.0  # frames a client got per second
    lag: int = 0  # largest number of frames that a client was behind the newest that any client had
    age_ms: list[float] = field(default_factory=list)
    memory_growth: int = 0  # bytes


def measure_load(clients: int, seconds: float) -> Load:
    """Serve an emulated sensor to this many browsers: each a stream of frames and a scene."""
    with server(*EVERYTHING) as (process, port):
        return asyncio.run(_measure(process, port, clients, seconds))


@contextmanager
def server(*options: str) -> Iterator[tuple[psutil.Process, int]]:
    """A server of an emulated sensor, in a process of its own on a free port."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "lidarcore_app.cli.main",
            "serve",
            "--emulator",
            "--http-port",
            "0",
            *options,
        ]
        command += ["--recordings", f"{folder}/recordings"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            lines = (line for line in process.stdout if "http://" in line)
            address = next(lines).split()[-1]
            try:
                yield psutil.Process(process.pid), int(address.rstrip("/").rsplit(":", 1)[1])
            finally:
                process.terminate()


async def _measure(process: psutil.Process, port: int, clients: int, seconds: float) -> Load:
    load, received, newest = Load(clients), [0] * clients, 0
    measuring = False

    async def frames(client: int) -> None:
        nonlocal newest
        async with connect(f"ws://127.0.0.1:{port}/api/v1/stream", proxy=None, max_size=None) as stream:
            async for text in stream:
                message = json.loads(text)
                if message["type"] != "frame":
                    continue
                newest = max(newest, message["sequence"])
                if measuring:
                    received[client] += 1
                    load.lag = max(load.lag, newest - message["sequence"])
                    load.age_ms.append(message["timings"]["age_ms"])

    async def scene() -> None:
        address = f"ws://127.0.0.1:{port}/viser"
        async with connect(address, subprotocols=["viser-v1.1.1"], proxy=None, max_size=None) as view:  # type: ignore[list-item]
            async for _ in view:
                pass

    tasks = [asyncio.create_task(job) for k in range(clients) for job in (frames(k), scene())]
    while not newest:
        await asyncio.sleep(0.1)
        for task in tasks:
            if task.done():
                task.result()
    await asyncio.sleep(SETTLE)
    memory, cpu, start = process.memory_info().rss, _cpu(process), time.monotonic()
    measuring = True
    await asyncio.sleep(seconds)
    elapsed = time.monotonic() - start
    load.cpu_percent = 100 * (_cpu(process) - cpu) / elapsed
    load.memory_growth = process.memory_info().rss - memory
    load.rate_hz = min(received) / elapsed
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return load


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)
