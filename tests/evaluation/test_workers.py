"""Where chunks are worked on: what is said when a cluster is asked for and its package is missing."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

# An interpreter in which `import distributed` fails, as where the extra was not installed.
WITHOUT = "import sys; sys.modules['distributed'] = None; "
COMMAND = WITHOUT + (
    "from lidarcore_app.cli.main import main; "
    "sys.argv = ['lidarcore', 'evaluate', 'consistency', '--scheduler', 'tcp://127.0.0.1:8786', '--trials', '100']; "
    "main()"
)
LIBRARY = WITHOUT + (
    "from lidarcore.errors import EvaluationError\n"
    "from lidarcore.evaluation.workers import outcomes\n"
    "assert list(outcomes(abs, [-1, 2], 1)) == [(-1, 1), (2, 2)]\n"
    "try:\n"
    "    list(outcomes(abs, [-1], 1, 'tcp://127.0.0.1:8786'))\n"
    "except EvaluationError as error:\n"
    "    print(error)\n"
)
SENTENCE = "A Dask scheduler needs dask.distributed: pip install 'lidarcore[cluster]'.\n"


def run(program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=120
    )


def test_a_missing_dask_is_named_by_the_command_with_the_cure() -> None:
    result = run(COMMAND)
    assert (result.returncode, result.stdout, result.stderr) == (2, "", f"lidarcore: {SENTENCE}")


def test_a_missing_dask_hinders_only_what_needs_it() -> None:
    result = run(LIBRARY)
    assert (result.returncode, result.stdout, result.stderr) == (0, SENTENCE, "")
