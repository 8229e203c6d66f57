"""The line fitters, listed once: command line, REST, page and tests derive from FITTERS.

A new fitter is one file with one kernel, one entry in FITTERS and one line in `fit_piece`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.compiled import inlined, kernel
from lidarcore.errors import DegenerateLineError, ScanError
from lidarcore.lines import arras_siegwart, cwlf, ml, tls
from lidarcore.lines.line import Array, Line, Lines, normal_angle
from lidarcore.lines.regression import (
    NO_DIRECTION,
    NOT_FINITE,
    OK,
    THROUGH_SENSOR,
    consistent_covariance,
    store,
)
from lidarcore.noise import SensorNoise
from lidarcore.polar import unit_vectors
from lidarcore.scan import MAX_BEARING, as_row

__all__ = ["FITTERS", "FITTER_IDS", "LINE_FIELDS", "STATUS_MESSAGES", "Fitter", "Line", "Lines", "fit_piece"]

LINE_FIELDS = 11  # unit normal (2), r, published (4), consistent (4)

STATUS_MESSAGES = {
    NO_DIRECTION: "the points coincide or have no direction",
    THROUGH_SENSOR: "the line passes through the sensor, or the points are too close together for this fitter",
    NOT_FINITE: "no finite line with positive covariance came out",
}


@inlined
def fit_piece(
    fitter: int, rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array, out: Array
) -> int:
    """Fit one piece with the fitter of the given number; w (N,) is scratch, out (LINE_FIELDS,) the result."""
    if fitter == 0:
        status, normal, published = arras_siegwart.fit(rho, c, s, v_rho, v_theta, w)
    elif fitter == 1:
        status, normal, published = cwlf.fit(rho, c, s, v_rho, v_theta, w)
    elif fitter == 2:
        status, normal, published = tls.fit_utls(rho, c, s, v_rho, v_theta, w)
    elif fitter == 3:
        status, normal, published = tls.fit_wtls(rho, c, s, v_rho, v_theta, w)
    elif fitter == 4:
        status, normal, published = tls.fit_wctls(rho, c, s, v_rho, v_theta, w)
    elif fitter == 5:
        status, normal, published = ml.fit(rho, c, s, v_rho, v_theta, w)
    else:
        return NOT_FINITE
    if status != OK:
        return status
    return store(out, normal, published, consistent_covariance(w, rho, c, s, v_rho, v_theta, normal))


@dataclass(frozen=True, slots=True)
class Fitter:
    """A line fitting method: what it is called, where it comes from, and `fit`."""

    name: str
    title: str
    reference: str
    summary: str

    def fit(self, ranges: ArrayLike, bearings: ArrayLike, noise: SensorNoise) -> Line:
        """Fit one line to the beams of one wall.

        ranges (N,) m and bearings (N,) rad, sensor frame, in any order; N >= 2.
        Raises ScanError if they differ in shape, or a value is not finite, or a range is not positive;
        DegenerateLineError if the points do not determine a line this fitter can express.
        """
        rho, theta = as_row(ranges, "ranges"), as_row(bearings, "bearings")
        if rho.shape != theta.shape:
            raise ScanError(f"ranges {rho.shape} and bearings {theta.shape} must both have shape (N,).")
        if len(rho) < 2:
            raise DegenerateLineError(f"{len(rho)} point(s) do not determine a line: give at least 2.")
        out = np.empty(LINE_FIELDS)
        status = fit_beams(
            FITTER_IDS[self.name], rho, theta, noise.sigma_range**2, noise.sigma_bearing**2, out
        )
        if status == _BAD_BEAM:
            raise ScanError(
                "Ranges must be positive and finite, bearings finite and in radians: leave missing returns out."
            )
        if status != OK:
            raise DegenerateLineError(f"{self.name}: {STATUS_MESSAGES[status]}.")
        alpha = float(normal_angle(out[0], out[1]))
        return Line(alpha, float(out[2]), out[3:7].reshape(2, 2), out[7:].reshape(2, 2))


_BAD_BEAM = 100


@kernel
def fit_beams(fitter: int, rho: Array, theta: Array, v_rho: float, v_theta: float, out: Array) -> int:
    """Check the beams and fit them: the compiled call behind `Fitter.fit`."""
    for i in range(len(rho)):
        if not (rho[i] > 0 and rho[i] < np.inf and np.abs(theta[i]) <= MAX_BEARING):
            return _BAD_BEAM
    work = np.empty((3, len(rho)))
    unit_vectors(theta, work[0], work[1])
    return fit_piece(fitter, rho, work[0], work[1], v_rho, v_theta, work[2], out)


FITTERS: dict[str, Fitter] = {
    fitter.name: fitter
    for fitter in (
        Fitter(
            "arras_siegwart",
            "Arras-Siegwart, weighted",
            "Prieto-Fernández et al. 2024, eq. 3, 16-19; Arras and Siegwart 1998",
            "Total least squares in polar form, weights from the inverse determinant of each point's covariance.",
        ),
        Fitter(
            "cwlf",
            "CWLF",
            "Prieto-Fernández et al. 2024, eq. 20-35",
            "Regression along x or y with inverse conditional variances; its published covariance is too small.",
        ),
        Fitter(
            "utls",
            "UTLS",
            "Prieto-Fernández et al. 2026, eq. 1-7",
            "Least squares of the implicit line ax + by = -1, all points alike.",
        ),
        Fitter(
            "wtls",
            "WTLS",
            "Prieto-Fernández et al. 2026, eq. 8-15",
            "As UTLS, weights from the inverse determinant of each point's covariance.",
        ),
        Fitter(
            "wctls",
            "WCTLS",
            "Prieto-Fernández et al. 2026, eq. 16-23 (C_Q reconstructed)",
            "The estimate of WTLS with the covariance of the conformal point Q; as published it is too small.",
        ),
        Fitter(
            "ml",
            "Maximum likelihood",
            "this project",
            "Gauss-Newton on the ranges under the sensor's noise model; near the Cramér-Rao bound at low noise.",
        ),
    )
}
FITTER_IDS = {name: i for i, name in enumerate(FITTERS)}
