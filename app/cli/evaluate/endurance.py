"""The command `lidarcore evaluate endurance`."""

from collections.abc import Sequence
from typing import Annotated

import typer

from ..options import Seed
from ..progress import counted

_STRETCHES = 12
_HEADINGS = (
    "after", "a scan, median", "99 %", "memory", "keyframes", "free", "walls", "farthest off", "tracked",
)  # fmt: skip
_WIDTHS = (8, 15, 9, 9, 10, 9, 8, 13, 9)


def endurance(
    world: Annotated[str, typer.Option(help="a simulated world")] = "office",
    minutes: Annotated[
        float, typer.Option(min=0.1, max=600, help="how long the robot drives, in min")
    ] = 60.0,
    people: Annotated[int, typer.Option(min=0, max=20, help="how many walk about")] = 6,
    seed: Seed = 0,
) -> None:
    """Whether a live map from whole scans stays as it was while a simulated robot drives on and on.

    Scans come as fast as they are worked off: an hour takes about half an hour. Memory is that of map and simulation.
    """
    from lidarcore.evaluation.maps.endurance import endurance
    from lidarcore.simulation.settings import SimulationSettings

    settings = SimulationSettings(world=world, people=people, seed=seed)
    _print(_HEADINGS)
    with counted(_STRETCHES) as done:
        for one in endurance(settings, minutes, _STRETCHES, done):
            _print(
                (
                    f"{one.minute:.3g} min", f"{1e3 * one.median:.1f} ms", f"{1e3 * one.p99:.1f} ms",
                    f"{one.memory / 2**20:.0f} MB", str(one.keyframes), f"{one.free:.0f} m²", f"{one.walls:.0f} m",
                    f"{one.off:.2f} m", f"{100 * one.tracked:.1f} %",
                )
            )  # fmt: skip


def _print(cells: Sequence[str]) -> None:
    """A row at once: who waits for an hour wants to see the first ones, and may stop there."""
    typer.echo("  ".join(cell.rjust(width) for cell, width in zip(cells, _WIDTHS, strict=True)))
