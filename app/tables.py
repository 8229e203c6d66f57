"""Segments and corners as flat columns: one declaration for CSV over REST and for `lidarcore process`."""

from collections.abc import Iterable, Mapping

from lidarcore import Features

Columns = dict[str, list[float]]


def segment_columns(features: Features) -> Columns:
    """One entry per segment: line in normal form, end points, fit and covariance. m and rad, sensor frame."""
    s, lines = features.segments, features.segments.lines
    return {
        "alpha": lines.alpha.tolist(),
        "r": lines.r.tolist(),
        "x_start": s.start[:, 0].tolist(),
        "y_start": s.start[:, 1].tolist(),
        "x_end": s.end[:, 0].tolist(),
        "y_end": s.end[:, 1].tolist(),
        "length": s.length.tolist(),
        "n_points": s.n_points.tolist(),
        "rms": s.rms.tolist(),
        "var_alpha": lines.covariance[:, 0, 0].tolist(),
        "cov_alpha_r": lines.covariance[:, 0, 1].tolist(),
        "var_r": lines.covariance[:, 1, 1].tolist(),
    }


def corner_columns(features: Features) -> Columns:
    """One entry per corner: position, covariance and the segments that meet. m and rad, sensor frame."""
    c = features.corners
    return {
        "segment_1": c.segments[:, 0].tolist(),
        "segment_2": c.segments[:, 1].tolist(),
        "x": c.xy[:, 0].tolist(),
        "y": c.xy[:, 1].tolist(),
        "sigma_x": c.sigma[:, 0].tolist(),
        "sigma_y": c.sigma[:, 1].tolist(),
        "area": c.area.tolist(),
        "angle": c.angle.tolist(),
        "var_x": c.covariance[:, 0, 0].tolist(),
        "cov_xy": c.covariance[:, 0, 1].tolist(),
        "var_y": c.covariance[:, 1, 1].tolist(),
    }


def csv_text(columns: Mapping[str, Iterable[object]]) -> str:
    """The columns as CSV (RFC 4180) with a header; floats round-trip."""
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    return "\r\n".join(lines) + "\r\n"
