"""The command `lidarcore evaluate map`."""

from math import degrees, inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..options import MOST, RecordingPath, Set, SettingsFile, Topic, numbers, plural, settings_from
from ..progress import counting

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lidarcore import Array, Scan
    from lidarcore.body_mask import Mask
    from lidarcore.evaluation.maps.study import MapStudy

# s. Loggers that were late write several scans within milliseconds: a stamp that is farther away is another one's.
_AT_A_SCAN = 0.0005


def evaluate_map(
    recording: RecordingPath,
    odometry: Annotated[
        Literal["auto", "recorded", "poor", "none"],
        typer.Option(
            help="recorded, poor (3 % scale, 1 % a metre turn bias, noise), none; auto is what the recording allows"
        ),
    ] = "auto",
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=MOST, help="seed of the errors of poor odometry; 0 if not given"),
    ] = None,
    seeds: Annotated[
        int,
        typer.Option(
            min=1, max=MOST, help="runs with poor odometry, each with a seed of its own, from --seed on"
        ),
    ] = 1,
    relations: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="relations between scans verified by hand: t1 t2 dx dy dz r p yaw"),
    ] = None,
    around: Annotated[
        bool,
        typer.Option(
            "--backwards", help="turn the recording around in time: another drive through the same rooms"
        ),
    ] = False,
    own: Annotated[
        str, typer.Option(metavar="M,RAD", help="standard deviation of the reference poses themselves")
    ] = "0.02,0.005",
    topic: Topic = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """How far a map of a recording is from reference poses: relative poses, covariances, loops, time."""
    from lidarcore.evaluation.maps.accuracy import has_reference, name_of_reference, read_relations
    from lidarcore.evaluation.maps.study import is_drawn, prepared, study

    from ..map_run import mapper_settings

    drawing = "--seeds" if seeds > 1 else None if seed is None else "--seed"
    _check_drawn(drawing, odometry not in ("recorded", "none"), has_reference=True)
    if around and relations is not None:
        raise typer.BadParameter(
            "--backwards changes the stamps by which --relations are found: leave one out."
        )
    chosen = settings_from(settings, set_)
    sigmas, verified = _sigmas(own), None if relations is None else read_relations(relations)
    scans = _scans(recording, topic, chosen.sensor.mask, around)
    _check_drawn(drawing, odometry == "poor" or is_drawn(scans, odometry), has_reference(scans))
    typer.echo(f"{'reference':26} {name_of_reference(scans)}")
    for number in range(seed or 0, (seed or 0) + seeds):
        given, reference = prepared(scans, odometry, number)
        with counting("scans") as count:
            judged = study(given, reference, mapper_settings(chosen), verified, sigmas, count)
        if seeds > 1:
            typer.echo(f"seed {number}")
        for name, value in lines(judged):
            typer.echo(f"{name:26} {value}")


def _scans(recording: Path, topic: str | None, mask: "Mask | None", around: bool) -> "list[Scan]":
    """The scans of a recording, turned around in time if asked for."""
    from lidarcore import open_recording
    from lidarcore.evaluation.maps.accuracy import backwards

    scans = list(open_recording(recording, topic, mask))
    return backwards(scans) if around else scans


def _check_drawn(option: str | None, are_drawn: bool, has_reference: bool) -> None:
    """Raises BadParameter if an option that says how errors are drawn is given where none are."""
    if option is not None and not are_drawn:
        cure = (
            ", or choose --odometry poor."
            if has_reference
            else ": the recording has no reference poses, which poor odometry is made of."
        )
        raise typer.BadParameter(
            f"{option} is for poor odometry, whose errors are drawn: without it all runs would be one and the same. "
            f"Leave it out{cure}"
        )


def lines(judged: "MapStudy") -> "Iterator[tuple[str, str]]":
    """The figures, by what they are called."""
    import numpy as np

    from lidarcore.evaluation.intervals import LEVEL
    from lidarcore.geometry import chi_square_gate

    yield "scans", f"{judged.scans}, {judged.tracked} of them tracked; {plural(judged.keyframes, 'keyframe')}"
    wrong = "" if judged.wrong is None else f", {judged.wrong} of them wrong"
    yield "loops", f"{judged.loops}{wrong}"
    yield "processor time", f"{judged.seconds:.1f} s; at most {judged.megabytes:.0f} MB"
    if len(judged.pairs):
        yield "relative poses", f"{len(judged.pairs)} pairs: {_errors(judged.pairs)}"
    if len(judged.normalised):
        median, allowed = np.median(judged.normalised), np.median(judged.allowed)
        yield (
            "normalised error",
            f"median {median:.2f}; {allowed:.2f} where the reference is allowed its own error (honest: 2.37)",
        )
    held = [
        f"{np.mean(squares <= chi_square_gate(LEVEL, 3)):.1%} by the {judge}"
        for squares, judge in ((judged.live, "reference"), (judged.live_by_map, "finished map"))
        if len(squares)
    ]
    if held:
        yield "live poses", f"inside the 95 % ellipsoids claimed when each came: {', '.join(held)}"
    found = judged.relations
    at_scans = found[found[:, 2] <= _AT_A_SCAN]
    if judged.given and not len(found):
        yield "relations verified by hand", f"none of the {judged.given} has stamps of this recording"
    if len(found):
        all_ = "" if len(found) == judged.given else f" of {judged.given}, the others of another time"
        yield "relations verified by hand", f"{len(found)}{all_}, poses interpolated: {_errors(found)}"
    if 0 < len(at_scans) < len(found):
        within = f"{1e3 * _AT_A_SCAN:g} ms of a scan"
        yield "  of these", f"{len(at_scans)} with both stamps within {within}: {_errors(at_scans)}"
    if len(judged.of_reference):
        yield "  by the reference", f"{len(judged.of_reference)}: {_errors(judged.of_reference)}"


def _errors(off: "Array") -> str:
    """Mean, median and largest of errors (M, 2 or more) m and rad."""
    import numpy as np

    mean, median, worst = off.mean(axis=0), np.median(off, axis=0), off.max(axis=0)
    return (
        f"mean {mean[0]:.4f} m, {degrees(mean[1]):.3f} degrees; "
        f"median {median[0]:.4f} m, {degrees(median[1]):.3f} degrees; "
        f"largest {worst[0]:.3f} m, {degrees(worst[1]):.2f} degrees"
    )


def _sigmas(text: str) -> tuple[float, float]:
    meaning, example = "two numbers, m and rad, that are not negative", "0.02,0.005"
    distance, turn = numbers("--own", text, meaning, example)
    if not (0 <= distance < inf and 0 <= turn < inf):
        raise typer.BadParameter(f"--own {text!r} should be {meaning}: {example}.")
    return distance, turn
