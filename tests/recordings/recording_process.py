"""Records scans in a process of its own, which tests kill, or let run into a full disk.

    python recording_process.py PATH endless|stalling|full [LIMIT]

The stamp of each scan is printed once it is handed to the recorder.
"""

import json
import resource
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path

from lidarcore_app.jobs.recorder import AsyncRecorder
from recorded_scans import demo

PERIOD = 0.01  # s


def main(path: Path, how: str, limit: int | None) -> None:
    if limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    recorder = AsyncRecorder()
    recorder.start(path)
    scans = demo(5)
    for number in range(3 if how == "stalling" else 10**6):
        stamp = time.time()
        recorder.put(replace(scans[number % 5], stamp=stamp))
        print(repr(stamp), flush=True)
        if recorder.status.state == "failed":
            break
        time.sleep(PERIOD)
    if how == "stalling":
        time.sleep(60)
    print(json.dumps(asdict(recorder.stop())), flush=True)
    if limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        recorder.start(path.with_suffix(".again"))
        recorder.put(scans[0])
        recorder.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]) if sys.argv[3:] else None)
