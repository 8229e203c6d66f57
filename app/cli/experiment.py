"""The command `lidarcore experiment`: experiments of papers, run again, and a report of each."""

import os
from dataclasses import replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import MOST, Seed, Topic, Workers, check_folder, end_like_ctrl_c, to_file
from .progress import ForPrograms, counted

if TYPE_CHECKING:
    from lidarcore.experiments.claim_rules import Claim

QUICK_RUNS = 2

experiment = typer.Typer(help="Repeat the experiment of a paper, and write a report.", no_args_is_help=True)


@experiment.callback()
def begin() -> None:
    """Repeat the experiment of a paper, and write a report."""
    end_like_ctrl_c()


Output = Annotated[Path, to_file("FILE.html for the report; replaced if it exists")]
Quick = Annotated[bool, typer.Option("--quick", help="only 100 scans of each room, to try it out")]
Recording = Annotated[
    Path | None,
    typer.Option(help="a recording of a sensor at rest, in place of the simulated rooms", exists=True),
]
Scans = Annotated[
    int | None,
    typer.Option(min=10, max=MOST, help="scans of each room, 2000 if not given; or of the recording, all"),
]
SigmaRange = Annotated[
    float | None,
    typer.Option(
        help="range noise in m that the methods assume; the papers' 0.05 if not given; for a real sensor, calibrate it"
    ),
]
SigmaBearing = Annotated[
    float | None,
    typer.Option(help="bearing noise in rad that the methods assume; 0.0035 (0.2°) if not given"),
]


def _add_corner_paper(name: str, about: str) -> None:
    @experiment.command(name, help=about)
    def repeat(
        output: Output = Path(f"{name}.html"),
        seed: Seed = 0,
        scans: Scans = None,
        recording: Recording = None,
        topic: Topic = None,
        sigma_range: SigmaRange = None,
        sigma_bearing: SigmaBearing = None,
        quick: Quick = False,
        workers: Workers = None,
        for_programs: ForPrograms = False,
    ) -> None:
        check_folder(output)
        from lidarcore import files, open_recording
        from lidarcore.experiments.environments import Design

        paper, paper_claims, report = (
            import_module(f"lidarcore.experiments.{name}{part}") for part in ("", "_claims", "_report")
        )
        design = Design(seed=seed).with_noise(sigma_range, sigma_bearing)
        design = replace(design, split_threshold=getattr(paper, "THRESHOLD", design.split_threshold))
        if quick:
            design = design.quick()
        if scans is not None:
            design = replace(design, scans=scans)
        looked_at = None
        if recording is not None:
            looked_at = list(islice(open_recording(recording, topic), scans))
            if design.assumption:
                typer.echo(design.assumption)
        with counted(1 if recording else paper.PARTS, for_programs) as done:
            result = paper.run(design, workers or os.cpu_count() or 1, looked_at, done)
        files.write(output, report.html(result))
        _tell(output, paper_claims.claims(result))


_add_corner_paper(
    "cwlf",
    "Conditional weighted linear fitting: corners in two rooms, their claimed and true uncertainty, and time.",
)
_add_corner_paper(
    "wctls",
    "Weighted conformal total least squares: corners in two rooms, their claimed and true uncertainty.",
)


@experiment.command("clustering-ekf")
def clustering_ekf(
    output: Output = Path("clustering-ekf.html"),
    seed: Seed = 0,
    runs: Annotated[
        int | None,
        typer.Option(min=1, max=MOST, help="drives along each trajectory; 20 if not given, 2 with --quick"),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="only one scan a second, to try it out")] = False,
    workers: Workers = None,
    for_programs: ForPrograms = False,
) -> None:
    """Four ways to cluster lidar points, with and without a Kalman filter, on three trajectories."""
    check_folder(output)
    from lidarcore import files
    from lidarcore.experiments import clustering_ekf as paper
    from lidarcore.experiments.clustering_ekf_report import html

    design = paper.Design(seed=seed, runs=runs or (QUICK_RUNS if quick else paper.Design().runs))
    if quick:
        design = design.quick()
    with counted(design.runs * len(paper.TRAJECTORIES), for_programs) as done:
        result = paper.run(design, workers or os.cpu_count() or 1, done)
    files.write(output, html(result))
    typer.echo(f"{output}: {len(result.outcomes)} drives, runs x trajectories x methods")


def _tell(output: Path, claims: "list[Claim]") -> None:
    from lidarcore.reporting import NOT_COMPARABLE

    verdicts = [verdict for *_, verdict in claims]
    words = {"agree": True, "differ": False, "open": None, NOT_COMPARABLE: NOT_COMPARABLE}
    told = ", ".join(f"{word} {verdicts.count(verdict)}" for word, verdict in words.items())
    typer.echo(f"{output}: {len(claims)} claims of the paper: {told}")
