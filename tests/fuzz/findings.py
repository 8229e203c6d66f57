"""What was tried, and what went wrong: each with the seed that makes it again."""

import random
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path


class Findings:
    """Of a run with this seed; inputs that did harm are kept in the folder."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.seed, self._folder = seed, folder
        self.tried: Counter[str] = Counter()
        self.found: dict[str, int] = {}

    def rounds(self, what: str, seconds: float) -> Iterator[tuple[str, random.Random]]:
        """Names of rounds for so long, each with randomness of its own: it can be made again alone."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            name = f"{what} {self.tried[what]}"
            self.tried[what] += 1
            yield name, random.Random(f"{self.seed} {name}")

    def add(self, name: str, what: str, problem: object, data: bytes | None = None) -> None:
        """Note a problem of a round; of several alike the first."""
        text = f"{what}: {problem}".strip()
        kind = text.splitlines()[-1][:150]
        self.found[kind] = self.found.get(kind, 0) + 1
        if self.found[kind] > 1:
            return
        print(f"FOUND in round {name} of seed {self.seed}: {text}", flush=True)
        if data is not None:
            self._folder.mkdir(exist_ok=True)
            kept = self._folder / f"{name.replace(' ', '-')}-{what}"
            kept.write_bytes(data)
            print(f"  kept as {kept}", flush=True)

    def summary(self) -> str:
        """How much was tried and what was found how often."""
        lines = [f"{count} x {kind}" for kind, count in self.found.items()]
        return "\n".join([f"tried: {dict(self.tried)}", *lines, f"{len(lines)} kinds of problems found"])
