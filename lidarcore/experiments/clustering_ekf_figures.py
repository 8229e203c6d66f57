"""Figures 3 to 6 of the experiment of [EKF] anew, with the tables of what they show."""

import math
from collections.abc import Sequence

import numpy as np

from lidarcore import reporting
from lidarcore.arrays import Array
from lidarcore.clusters import CLUSTERERS
from lidarcore.evaluation.intervals import Interval, mean
from lidarcore.experiments.clustering_ekf import (
    METHODS,
    MODES,
    TRAJECTORIES,
    ClusteringStudy,
    Design,
    simulate,
)
from lidarcore.experiments.tracks import Drive, Track
from lidarcore.geometry import act, unit_vectors
from lidarcore.reporting import Bar, Map, bars, chart

NAMES = tuple(CLUSTERERS[name].title for name in METHODS)
WORDS = {"without": "without EKF", "with": "with EKF", "lost": "with EKF, objects lost"}
_BOX = (-2.0, 23.0, -6.5, 6.5)


def _of(values: Array) -> list[list[Interval]]:
    """Intervals of values (runs, rows, columns)."""
    return [[mean(values[:, i, j]) for j in range(values.shape[2])] for i in range(values.shape[1])]


def _farthest(cells: Sequence[Sequence[Interval]]) -> float:
    """Up to where bars and their intervals reach."""
    return max(
        cell.value + (cell.half_width if math.isfinite(cell.half_width) else 0)
        for row in cells
        for cell in row
    )


def _bars(row: Sequence[Interval], digits: int) -> list[Bar]:
    """One for each method."""
    return [
        Bar(name, cell.value, cell.low, cell.high, cell.text(digits), f"m{m}")
        for m, (name, cell) in enumerate(zip(NAMES, row, strict=True))
    ]


def figure3(result: ClusteringStudy) -> str:
    """Run time of each method and trajectory; of a scan in a table."""
    total = _of(result.values(lambda o: o.clustering_s + o.filter_s))
    most, least = _farthest(total), 1e-2
    panels = [
        (
            trajectory,
            bars(
                _bars(row, 2),
                most,
                least=least,
                title=f"Run time by method, {trajectory}",
            ),
        )
        for trajectory, row in zip(TRAJECTORIES, total, strict=True)
    ]
    caption = (
        "Figure 3. Processor time of clustering and filter for one drive, s; the bars are logarithmic from 0.01 s. "
        "Scans are simulated beforehand."
    )
    per_scan = [
        1e3 * result.values(lambda o, name=name: getattr(o, name) / o.scans).mean(axis=1)  # type: ignore[misc]
        for name in ("clustering_s", "given_k_s", "filter_s")
    ]
    rows = [[name, *(mean(values[:, m]).text(2) for values in per_scan)] for m, name in enumerate(NAMES)]
    headers = ("method", "clustering", "number of clusters told", "filter")
    return reporting.figure(caption, panels) + reporting.table("Processor time of a scan, ms", headers, rows)


def figure4(result: ClusteringStudy) -> str:
    """Accumulated error of each method, trajectory and mode; with other errors in tables."""
    cells = {mode: _of(result.error(mode, "accumulated")) for mode in MODES}
    most = _farthest([row for of in cells.values() for row in of])
    panels = []
    for t, trajectory in enumerate(TRAJECTORIES):
        rows: list[Bar | str] = []
        for mode in MODES:
            rows += [WORDS[mode], *_bars(cells[mode][t], 1)]
        panels.append((trajectory, bars(rows, most, title=f"Accumulated error by method, {trajectory}, m")))
    caption = (
        "Figure 4. Accumulated error, m: distance in y from the trajectory at the same x, summed over the scans of a "
        "drive. Without the filter the pose is that of the odometry, whatever the method."
    )
    tables = (
        _error_table(result, "accumulated", "Accumulated error, m", 1.0, 1)
        + _error_table(result, "rms", "RMS distance from the true position, mm", 1e3, 0)
        + _error_table(result, "final", "Distance from the true position at the end, mm", 1e3, 0)
    )
    return reporting.figure(caption, panels) + tables


def _error_table(result: ClusteringStudy, name: str, caption: str, factor: float, digits: int) -> str:
    cells = {mode: _of(result.error(mode, name)) for mode in MODES}
    rows = [
        ["" if m else trajectory, method, *(cells[mode][t][m].text(digits, factor) for mode in MODES)]
        for t, trajectory in enumerate(TRAJECTORIES)
        for m, method in enumerate(NAMES)
    ]
    return reporting.table(caption, ("trajectory", "method", *WORDS.values()), rows, texts=2)


def figure5(result: ClusteringStudy) -> str:
    """Clusters by k-means where odometry alone puts them."""
    design, method = result.design, "kmeans"
    drive, track = simulate(design, 0, TRAJECTORIES[-1]), _track(result, TRAJECTORIES[-1], method, "without")
    last, scan = drive.truth[-1], drive.scans[-1]
    angles = last[2] + np.linspace(-0.5, 0.5, 60) * design.field_of_view
    reach = last[:2] + design.max_range * unit_vectors(angles)
    points = act(track.poses[-1], scan.xy[scan.valid])
    map_ = Map(
        "Clusters by k-means without the filter",
        (*_BOX[:1], 30.0, -9.0, 9.0),
        _posts(drive),
        design.radius,
        [("reference", drive.truth[:, :2]), ("estimate", track.poses[:, :2])],
        [("seen", _posts(drive)[_within(drive, design)]), ("lilac", points)],
        _ellipses(track, 20),
        np.vstack([last[:2], reach]),
    )
    caption = (
        f"Figure 5. k-means without the filter, {TRAJECTORIES[-1]}: where the robot believes that it sees objects, "
        "drawn for 20 of the scans. "
        "Ellipses (95 %) hold the region of the object and the uncertainty of the pose by odometry, and grow with the "
        "way. Grey with a red edge is what the sensor sees at the end."
    )
    legend = [
        ("reference", "var(--soft)"), ("estimated path", "var(--estimate)"), ("clusters", "var(--m0)"),
        ("lidar points at the end", "var(--lilac)"), ("objects seen at the end", "var(--seen)"),
    ]  # fmt: skip
    return reporting.figure(caption, [("", chart(map_, width=900))], legend)


def figure6(result: ClusteringStudy) -> str:
    """Every drive of the first run: a map for each trajectory, method and mode."""
    design, blocks = result.design, []
    for trajectory in TRAJECTORIES:
        drive = simulate(design, 0, trajectory)
        panels = [
            (
                f"{name}, {WORDS[mode]}",
                chart(_drive_map(design, drive, _track(result, trajectory, method, mode), mode)),
            )
            for method, name in zip(METHODS, NAMES, strict=True)
            for mode in MODES
        ]
        caption = (
            f"Figure 6, {trajectory}. Rows: methods. Columns: without the filter, with it, with objects lost."
        )
        legend = [
            ("reference, which is the true path", "var(--soft)"), ("estimated path", "var(--estimate)"),
            ("while objects are lost", "var(--lost)"), ("clusters or landmarks, 95 %", "var(--m0)"),
        ]  # fmt: skip
        blocks.append(reporting.figure(caption, panels, legend))
    return "".join(blocks)


def _drive_map(design: Design, drive: Drive, track: Track, mode: str) -> Map:
    lines = [("reference", drive.truth[:, :2]), ("estimate", track.poses[:, :2])]
    if mode == "lost":
        blind = (track.stamps >= design.blind[0]) & (track.stamps < design.blind[1])
        lines.append(("lost", track.poses[blind, :2]))
    every = 12 if mode == "without" else len(track.stamps)
    return Map(mode, _BOX, _posts(drive), design.radius, lines, ellipses=_ellipses(track, every))


def _ellipses(track: Track, scans: int) -> list[tuple[str, Array, Array]]:
    """Ellipses of the clusters of so many scans, spread over the drive; a map at the end belongs to the last one."""
    shown = np.unique(np.linspace(0, len(track.stamps) - 1, scans).astype(int))
    chosen = np.isin(track.of_scan, shown)
    return [("", track.landmarks[chosen], track.landmark_covariances[chosen])]


def _track(result: ClusteringStudy, trajectory: str, method: str, mode: str) -> Track:
    """The track of the first run."""
    outcome = next(o for o in result.outcomes if (o.run, o.trajectory, o.method) == (0, trajectory, method))
    return outcome.tracks[mode]


def _posts(drive: Drive) -> Array:
    return np.empty((0, 2)) if drive.place.posts is None else drive.place.posts.centres


def _within(drive: Drive, design: Design) -> Array:
    """Which objects are in view at the end."""
    x, y, heading = drive.truth[-1]
    to_post = (_posts(drive) - [x, y]) @ [1, 1j] * np.exp(-1j * heading)
    return (np.abs(to_post) < design.max_range) & (np.abs(np.angle(to_post)) < design.field_of_view / 2)
