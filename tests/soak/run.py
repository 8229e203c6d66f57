"""Does a server that runs for long stay as it was after five minutes?

    python tests/soak/run.py [--minutes 60] [--warm 5] [--seed N]

A server in a process of its own plays an emulated sensor that moves and has faults, with SLAM, while three browsers
look, recordings are uploaded and deleted, and the source is switched. Its memory, file handles, threads, processes and
answers are printed every minute. The exit code is 1 if one of them grew beyond its band (measures.py), or if a request
was answered wrongly.
"""

import argparse
import asyncio
import platform
import secrets
import sys
import tempfile
from pathlib import Path

import psutil
from load import Load
from measures import Measures

sys.path.append(str(Path(__file__).parents[1]))

from server_process import server

from lidarcore.rplidar.emulator_process import EmulatorProcess


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--warm", type=float, default=5.0, help="minutes until what is compared with")
    parser.add_argument("--seed", type=int, default=secrets.randbits(32))
    chosen = parser.parse_args()
    if chosen.minutes < 2 * chosen.warm:
        parser.error("--minutes should be twice --warm at least")
    print(f"seed {chosen.seed}; Python {platform.python_version()}, {psutil.cpu_count()} cores", flush=True)
    with tempfile.TemporaryDirectory() as name, EmulatorProcess(moving=True, seed=chosen.seed) as sensor:
        folder = Path(name)
        options = ("--port", sensor.port, "--set", "navigation.mode=slam")
        with server(folder, *options) as (process, address):
            load, measures = Load(address, sensor, chosen.seed), Measures(process, chosen.warm)
            asyncio.run(soak(load, measures, chosen.minutes))
        log = (folder / "log").read_text("utf-8")
    print(load.summary())
    print(measures.summary())
    print(f"log of the server: {len(log)} bytes; its end:\n{log[-2000:]}")
    sys.exit(bool(load.wrong or measures.grown()))


async def soak(load: Load, measures: Measures, minutes: float) -> None:
    """Do everything at once for so long. Raises what one of them raises."""
    async with asyncio.timeout(60 * minutes + 60), asyncio.TaskGroup() as group:
        tasks = [group.create_task(job) for job in load.jobs()]
        await asyncio.sleep(5)
        await measures.take(load.latency, 60 * minutes)
        for task in tasks:
            task.cancel()


if __name__ == "__main__":
    main()
