"""What is done to a server: browsers look, the sensor fails, files come and go, the source changes."""

import asyncio
import io
import json
import random
import time
from collections import Counter
from collections.abc import Coroutine

import httpx
import numpy as np
from websockets.asyncio.client import connect

from lidarcore.rplidar.emulator_process import EmulatorProcess

BROWSERS = 3
PATIENCE = 60.0  # s for an answer
FAULTS = ("lose 0.05", "flip 0.02", "lose-bytes 0.01", "stall 1", "garbage 500", "unplug")
READ = ("frame", "source", "recordings", "settings", "localization", "pose", "trajectory", "landmarks", "sessions",
    "recorder", "walls", "map/grid", "map/grid?format=zip", "devices", "clusters", "profiles", "studies")  # fmt: skip
BROKEN = (
    b"",
    b"\x00" * 100_000,
    b'{"dev1": [[1,2],' + b"[]," * 300_000 + b"[]]}",
    b"SQLite format 3\x00" + bytes(5000),
)


class Load:
    """On the server at an address that plays the sensor."""

    def __init__(self, address: str, sensor: EmulatorProcess, seed: int) -> None:
        # Connections are given up before the server does it, which may be while a request is on its way.
        limits = httpx.Limits(keepalive_expiry=2)
        self._http = httpx.AsyncClient(base_url=f"{address}/api/v1/", timeout=PATIENCE, limits=limits)
        self._address, self._sensor, self._rng = address, sensor, random.Random(seed)
        self.done: Counter[str] = Counter()
        self.wrong: Counter[str] = Counter()

    def jobs(self) -> list[Coroutine[None, None, None]]:
        """All that goes on at once."""
        looks = [job() for _ in range(BROWSERS) for job in (self._stream, self._scene)]
        return [*looks, self._faults(), self._files(), self._sources(), self._questions()]

    async def latency(self) -> float:
        """How long a small answer takes, s."""
        began = time.monotonic()
        await self._ask("GET", "version", 200)
        return time.monotonic() - began

    def summary(self) -> str:
        """What was done, and what was answered wrongly."""
        return f"done: {dict(self.done)}\nwrong: {dict(self.wrong) or 'nothing'}"

    async def _stream(self) -> None:
        async with connect(
            f"{self._stream_address()}/api/v1/stream?points=true", proxy=None, max_size=None
        ) as stream:
            async for text in stream:
                self.done[json.loads(text)["type"]] += 1

    async def _scene(self) -> None:
        address = f"{self._stream_address()}/viser"
        async with connect(address, subprotocols=["viser-v1.1.1"], proxy=None, max_size=None) as view:  # type: ignore[list-item]
            async for _ in view:
                self.done["scene"] += 1

    async def _faults(self) -> None:
        while True:
            fault = self._rng.choice(FAULTS)
            await self._command(fault)
            await asyncio.sleep(5)
            if fault == "unplug":
                await self._command("replug")
            elif not fault.startswith(("stall", "garbage")):
                await self._command(f"{fault.split()[0]} 0")
            await asyncio.sleep(10)

    async def _files(self) -> None:
        while True:
            name = f"room{self._rng.randrange(5)}.npz"
            await self._ask("PUT", f"recordings/{name}?overwrite=true", 201, content=_room(self._rng))
            await self._ask("GET", f"recordings/{name}/facts", 200)
            await self._ask("PUT", "recordings/broken.bag", 422, content=self._rng.choice(BROKEN))
            await asyncio.sleep(3)
            await self._ask("DELETE", f"recordings/{name}", 204)

    async def _sources(self) -> None:
        """A minute of the sensor, and a while of something else."""
        others = (
            {"kind": "simulation"},
            {"kind": "emulator"},
            {"kind": "recording", "name": "real-rplidar-windsor.npz"},
        )
        while True:
            await asyncio.sleep(60)
            await self._ask("PUT", "source", 200, json=self._rng.choice(others))
            await asyncio.sleep(10)
            # Unplugged at this moment it is not there: then again, until it is.
            while not await self._ask(
                "PUT", "source", 200, 404, 503, json={"kind": "device", "port": self._sensor.port}
            ):
                await asyncio.sleep(2)

    async def _questions(self) -> None:
        while True:
            await self._ask("GET", self._rng.choice(READ), 200, 404, 503)
            await asyncio.sleep(0.5)

    async def _command(self, line: str) -> None:
        await asyncio.to_thread(self._sensor.command, line)
        self.done[line.split()[0]] += 1

    async def _ask(self, method: str, path: str, *expected: int, **content: object) -> bool:
        """Whether the answer was the first of those expected; any other than these is noted as wrong."""
        try:
            try:
                answer = await self._http.request(method, path, **content)  # type: ignore[arg-type]
            except (
                httpx.ReadError
            ):  # closed while idle, which a busy client may learn late: again, as browsers do
                answer = await self._http.request(method, path, **content)  # type: ignore[arg-type]
        except httpx.TransportError as error:
            self.wrong[f"{method} {path}: {error!r}"] += 1
            return False
        self.done[f"{method} {answer.status_code}"] += 1
        if answer.status_code not in expected:
            self.wrong[f"{method} {path}: {answer.status_code} {answer.text[:200]}"] += 1
        return answer.status_code == expected[0]

    def _stream_address(self) -> str:
        return self._address.replace("http", "ws", 1)


def _room(rng: random.Random) -> bytes:
    """A recording of some seconds in a square room."""
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    walls = 2 / np.maximum(abs(np.cos(bearings)), abs(np.sin(bearings)))
    ranges = walls + np.random.default_rng(rng.randrange(1000)).normal(0, 0.01, (50, len(bearings)))
    file = io.BytesIO()
    np.savez(file, ranges=ranges, bearings=bearings, stamps=0.1 * np.arange(50))
    return file.getvalue()
