"""Does the suite catch faults? Puts each seeded fault into a copy of the tree and runs the tests that concern it.

    python tests/mutants/run.py [NUMBER or part of a file's path ...]

Only tests that `make test` runs count. A fault that no test notices is printed as MISSED, and the exit code is 1.
`interpreted` faults are in compiled kernels: their tests run them as plain Python, which saves compiling those that use
them.
"""

import os
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from shutil import copy2

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_name("mutants.toml")
KERNELS = ROOT / "lidarcore" / "__pycache__" / "kernels"  # what no fault is in need not be compiled anew
LIMIT = 600  # s; a fault that makes the tests hang is caught, too


@dataclass(frozen=True)
class Mutant:
    """A fault: in this file the text `find`, which is there once, becomes `replace`; the tests ought to notice."""

    file: str
    find: str
    replace: str
    tests: list[str]
    interpreted: bool = False

    def changed(self, root: Path) -> str:
        """The file with the fault. Raises ValueError unless the text is there exactly once."""
        text = (root / self.file).read_text("utf-8")
        if text.count(self.find) != 1:
            raise ValueError(f"{self.file} has {text.count(self.find)} of {self.find!r}: mend {LIST.name}.")
        return text.replace(self.find, self.replace)


def mutants() -> list[Mutant]:
    """All of the list."""
    return [Mutant(**entry) for entry in tomllib.loads(LIST.read_text("utf-8"))["mutant"]]


def copy_of_tree(folder: Path) -> Path:
    """What git knows of the tree, importable: the application under the name that it has when it is installed."""
    names = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            copy2(ROOT / name, folder / name)
    (folder / "lidarcore_app").symlink_to(folder / "app")
    return folder


def is_caught(mutant: Mutant, root: Path) -> bool:
    """Whether a test fails in the tree with the fault; the tree is afterwards as before."""
    path = root / mutant.file
    before, status = path.read_text("utf-8"), path.stat()
    path.write_text(mutant.changed(root), "utf-8")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-m",
        "not long",
        *mutant.tests,
    ]
    environment = os.environ | {
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": str(KERNELS),
    }
    if mutant.interpreted:
        environment["NUMBA_DISABLE_JIT"] = "1"
    try:
        done = subprocess.run(
            command, cwd=root, env=environment, capture_output=True, text=True, timeout=LIMIT
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        path.write_text(before, "utf-8")
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # what was compiled of it stays valid
    if done.returncode not in (0, 1):
        raise RuntimeError(f"The tests of {mutant.file} could not be run:\n{done.stdout}{done.stderr}")
    return done.returncode == 1


def main(chosen: list[str]) -> int:
    """Try those whose number or file is named, or all; the number of those that were missed."""
    missed = 0
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        root = copy_of_tree(Path(folder))
        for number, mutant in enumerate(mutants(), 1):
            if chosen and not any(c == str(number) or (not c.isdigit() and c in mutant.file) for c in chosen):
                continue
            begin = time.monotonic()
            caught = is_caught(mutant, root)
            missed += not caught
            took = time.monotonic() - begin
            print(
                f"{number:3} {'caught' if caught else 'MISSED'} {took:5.0f} s  {mutant.file}: {mutant.replace}",
                flush=True,
            )
    return missed


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
