"""Segments and corners as flat columns, declared once: for CSV, JSON and `lidarcore process`."""

from collections.abc import Callable, Iterable, Mapping

from lidarcore import Array, Features, Ints

Columns = Mapping[str, Callable[[Features], "Array | Ints"]]

# Line in normal form, end points, fit and covariance: m and rad, sensor frame.
SEGMENT_COLUMNS: Columns = {
    "alpha": lambda features: features.lines.alpha,
    "r": lambda features: features.lines.r,
    "x_start": lambda features: features.segments.start[:, 0],
    "y_start": lambda features: features.segments.start[:, 1],
    "x_end": lambda features: features.segments.end[:, 0],
    "y_end": lambda features: features.segments.end[:, 1],
    "length": lambda features: features.segments.length,
    "n_points": lambda features: features.segments.n_points,
    "rms": lambda features: features.segments.rms,
    "var_alpha": lambda features: features.lines.covariance[:, 0, 0],
    "cov_alpha_r": lambda features: features.lines.covariance[:, 0, 1],
    "var_r": lambda features: features.lines.covariance[:, 1, 1],
}

# The segments that meet, position and covariance: m and rad, sensor frame.
CORNER_COLUMNS: Columns = {
    "segment_1": lambda features: features.corners.segments[:, 0],
    "segment_2": lambda features: features.corners.segments[:, 1],
    "x": lambda features: features.corners.xy[:, 0],
    "y": lambda features: features.corners.xy[:, 1],
    "sigma_x": lambda features: features.corners.sigma[:, 0],
    "sigma_y": lambda features: features.corners.sigma[:, 1],
    "area": lambda features: features.corners.area,
    "angle": lambda features: features.corners.angle,
    "var_x": lambda features: features.corners.covariance[:, 0, 0],
    "cov_xy": lambda features: features.corners.covariance[:, 0, 1],
    "var_y": lambda features: features.corners.covariance[:, 1, 1],
}
INTEGERS = frozenset(("n_points", "segment_1", "segment_2"))


def values(columns: Columns, features: Features) -> dict[str, list[float]]:
    """The columns of one scan, an entry for each segment or corner."""
    return {name: column(features).tolist() for name, column in columns.items()}


def csv_text(columns: Mapping[str, Iterable[object]]) -> str:
    """The columns as CSV (RFC 4180) with a header; floats round-trip."""
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    return "\r\n".join(lines) + "\r\n"
