"""Kernels of maps that are compiled ahead: afterwards a map, live or from a recording, has nothing left to compile."""

import subprocess
import sys

import pytest

CHECK = """
import sys
from itertools import islice
from lidarcore.mapping import WholeScans, precompile
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

def compiled():
    kernels = [v for name, m in list(sys.modules.items()) if name.startswith("lidarcore.") for v in vars(m).values()]
    return {k.py_func.__qualname__: len(k.signatures) for k in kernels if hasattr(k, "py_func")}

precompile.warm_up()
assert not precompile.is_missing()
before = compiled()
slam = WholeScans()
for scan in islice(SimulatedRobot(SimulationSettings(world="two rooms", seed=2)), 300):
    slam.step(slam.deskewed(scan))
slam.close()
after = compiled()
print({name: count for name, count in after.items() if count > before.get(name, 0)})
print(len([name for name, count in after.items() if count]))
"""


@pytest.mark.long
def test_nothing_is_left_to_compile_for_a_live_map() -> None:
    """In a process of its own, as other tests compile kernels, too."""
    done = subprocess.run([sys.executable, "-c", CHECK], capture_output=True, text=True, check=True)
    left, number = done.stdout.splitlines()
    assert left == "{}"
    assert int(number) > 10  # from the cache only those that Python calls
