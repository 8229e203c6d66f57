"""Does anything that a stranger may send break something?

    python tests/fuzz/run.py [--minutes 5] [--seed N] [files|wire|sockets|rest ...]

Breaks files of every format, bytes of a sensor, messages to both WebSockets and requests to REST, each for a share of
the time. No reader, decoder or route may raise what is no LidarError or answer 5xx, take more than ten seconds or more
memory than a file may (four times its size, and 100 MB); the server may not log a traceback, nor take a GiB. The seed
is printed, and makes the same again; what did harm is kept. The exit code is 1 if anything was found.
"""

import argparse
import secrets
import sys
import tempfile
from pathlib import Path

import psutil

TESTS = Path(__file__).parents[1]
sys.path += [str(TESTS / name) for name in ("attacks", "recordings", ".")]

import files  # noqa: E402
import rest  # noqa: E402
import sockets  # noqa: E402
import wire  # noqa: E402
from findings import Findings  # noqa: E402
from lidarcore_app.isolation import MEMORY  # noqa: E402
from server_process import server  # noqa: E402

SHARES = {"files": 0.35, "wire": 0.15, "sockets": 0.1, "rest": 0.4}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=secrets.randbits(32))
    parser.add_argument("parts", nargs="*", choices=[*SHARES, []], help="all if none is named")
    chosen = parser.parse_args()
    shares = {part: SHARES[part] for part in chosen.parts or SHARES}
    print(f"seed {chosen.seed}", flush=True)
    findings = Findings(chosen.seed, Path("fuzz-findings"))
    seconds = {part: 60 * chosen.minutes * share / sum(shares.values()) for part, share in shares.items()}
    with tempfile.TemporaryDirectory() as name:
        if "files" in seconds:
            files.fuzz(Path(name), seconds["files"], findings)
        if "wire" in seconds:
            wire.fuzz(seconds["wire"], findings)
        if {"sockets", "rest"} & seconds.keys():
            with_server(Path(name), seconds, findings)
    print(findings.summary())
    sys.exit(bool(findings.found))


def with_server(folder: Path, seconds: dict[str, float], findings: Findings) -> None:
    """What is sent to a server that plays an emulated sensor, and how the server does in the end."""
    options = ("--emulator", "--set", "navigation.mode=slam", "--set", "navigation.method=landmarks")
    with server(folder, *options) as (process, address):
        if "sockets" in seconds:
            sockets.fuzz(address, seconds["sockets"], findings)
        if "rest" in seconds:
            rest.fuzz(address, seconds["rest"], findings, folder)
        if process.status() == psutil.STATUS_ZOMBIE:
            findings.add("at the end", "server", "it has ended")
        elif (memory := process.memory_info().rss) > MEMORY:
            findings.add("at the end", "server", f"it takes {memory >> 20} MiB")
    log = (folder / "log").read_text("utf-8")
    if "Traceback" in log:
        findings.add("at the end", "log", log[log.index("Traceback") - 500 :][:5000])


if __name__ == "__main__":
    main()
