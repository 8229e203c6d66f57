"""Compiles the kernels of maps before anybody waits for them: `python -m lidarcore.mapping.precompile`, once."""

import hashlib
import os
from itertools import islice
from pathlib import Path

from lidarcore.compiled import folder, is_kept
from lidarcore.mapping.grid import build_grid
from lidarcore.mapping.mapper import Mapper
from lidarcore.mapping.relocation import Relocator, query_of
from lidarcore.mapping.settings import MapperSettings
from lidarcore.mapping.walls import find_walls
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

_SCANS = 300  # of a simulated robot, which comes back to where it was: loops have kernels of their own
_PRIORITY = 10


def is_missing() -> bool:
    """Whether the cache lacks the kernels of maps as they are now, and would keep them."""
    return is_kept() and not _mark().exists()


def warm_up() -> None:
    """Compile every kernel of maps, or load it from the cache; says so in the cache."""
    scans = list(islice(SimulatedRobot(SimulationSettings(world="two rooms")), _SCANS))
    mapper = Mapper(MapperSettings())
    for scan in scans:
        mapper.step(scan)
    mapper.finish()
    found = mapper.views
    grid = build_grid(found.scans, found.poses)
    find_walls(found.scans, found.poses, found.covariances, grid)
    Relocator(grid).find(query_of([scans[-1]]))
    _mark().touch()


def _mark() -> Path:
    """A file that is there if the kernels of this very source are: kernels use constants of other modules."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(source.read_bytes())
    return folder() / f"maps-{digest.hexdigest()[:16]}"


if __name__ == "__main__":
    os.nice(_PRIORITY)
    warm_up()
