"""The commands `lidarcore evaluate relocation` and `lidarcore evaluate walls`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import RecordingPath, Set, SettingsFile, Topic, settings_from
from ..progress import counting

if TYPE_CHECKING:
    from lidarcore.evaluation.maps.relocation import Attempts


def relocation(
    recording: RecordingPath,
    other: Annotated[
        list[Path] | None,
        typer.Option(help="a recording of another place, where no pose may be found; may be repeated"),
    ] = None,
    topic: Topic = None,
) -> None:
    """How often a pose is found without a guess in a map of the first 60 %, and whether one believed is wrong."""
    from lidarcore import open_recording
    from lidarcore.evaluation.maps.relocation import study_relocation

    scans = list(open_recording(recording, topic))
    strange = [scan for path in other or () for scan in open_recording(path)]
    with counting("queries") as count:
        study = study_relocation(scans, strange, count)
    typer.echo("             queries  known place  found there  outside  found there  wrong  median s  p95 s")
    _show("one scan", study.single)
    _show("six keyframes", study.several)
    if strange:
        _show("other places", study.foreign)


def _show(name: str, attempts: "Attempts") -> None:
    import numpy as np

    a = attempts
    share = f"{100 * a.share_found:10.1f}%" if a.inside.any() else f"{'':11}"
    typer.echo(
        f"{name:13}{len(a.found):7}{int(a.inside.sum()):13}{share:>13}{int(a.outside.sum()):9}"
        f"{int((a.found & a.outside).sum()):13}{int(a.wrong.sum()):7}"
        f"{np.median(a.seconds):10.3f}{np.quantile(a.seconds, 0.95):7.3f}"
    )


def walls(
    recording: Annotated[
        Path | None,
        typer.Argument(
            help="a recording with reference poses; simulated rooms, whose truth is known, if not given"
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="drives through every simulated room")] = 10,
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """How well walls and grid of a map agree, and whether walls are where their covariances say."""
    if recording is None:
        if settings is not None or set_:
            raise typer.BadParameter(
                "--settings and --set are for a recording: name one, or leave them out. "
                "Simulated rooms have settings of their own."
            )
        _simulated(seeds)
        return
    from lidarcore import open_recording
    from lidarcore.evaluation.maps.walls import mapped_log, occupied_at_walls, walls_over_free

    chosen = settings_from(settings, set_)
    scans = list(open_recording(recording, topic, chosen.sensor.mask))
    grid, found = mapped_log(scans, chosen.extraction)
    typer.echo(
        f"{len(found)} walls, {found.length.sum():.1f} m, {int((found.length > 2).sum())} longer than 2 m, "
        f"{len(found.corners)} corners.\n"
        f"{100 * occupied_at_walls(found, grid):.1f} % of the occupied cells lie at a wall, "
        f"{100 * walls_over_free(found, grid):.2f} % of the walls' length runs over free cells."
    )


def _simulated(seeds: int) -> None:
    import numpy as np
    from scipy.stats import chi2

    from lidarcore.evaluation.maps.walls import compare_with_truth, wall_rooms

    rooms = [compare_with_truth(*room) for room in wall_rooms(seeds)]
    times, line, z = (
        np.concatenate(column)
        for column in zip(*((room.times, room.line_chi2, room.length_z) for room in rooms), strict=True)
    )
    typer.echo(
        f"{len(times)} walls longer than 1 m in view: {100 * (times == 1).mean():.1f} % found once, "
        f"{int((times == 0).sum())} never, {int((times > 1).sum())} in pieces.\n"
        f"Within their 95 % intervals: {100 * (line < chi2.ppf(0.95, 2)).mean():.1f} % of {len(line)} lines, "
        f"{100 * (np.abs(z) < 1.96).mean():.1f} % of {len(z)} lengths."
    )
