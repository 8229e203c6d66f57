"""The line fitters, listed once: command line, REST, page and tests derive from FITTERS.

A new fitter is one file with one kernel, a number, a line in `fit_piece` and an entry in FITTERS.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.compiled import inlined, kernel
from lidarcore.errors import DegenerateLineError, ScanError
from lidarcore.lines import arras_siegwart, cwlf, ml, tls
from lidarcore.lines.covariance import covariances
from lidarcore.lines.line import ABOUT_MEAN, ABOUT_TRUTH, Line, Lines, normal_angle, to_second_order
from lidarcore.lines.regression import (
    BEYOND,
    LINE_CONSISTENT,
    LINE_FIELDS,
    LINE_MAP,
    LINE_PUBLISHED,
    NO_DIRECTION,
    NOT_CONVERGED,
    NOT_FINITE,
    OK,
    THROUGH_SENSOR,
    Work,
    store,
)
from lidarcore.lines.unevenness import Free
from lidarcore.noise import NoiseModel, SensorNoise
from lidarcore.polar import cos_sin
from lidarcore.scan import MAX_BEARING, as_row

__all__ = [
    "FITTERS",
    "FITTER_IDS",
    "LINE_FIELDS",
    "STATUS_MESSAGES",
    "WORK",
    "Fitter",
    "Line",
    "Lines",
    "fit_piece",
]

WORK = 3  # arrays of scratch for the points of a piece, see regression.Work
ARRAS_SIEGWART, CWLF, UTLS, WTLS, WCTLS, ML = range(6)

STATUS_MESSAGES = {
    NO_DIRECTION: "the points coincide or have no direction",
    THROUGH_SENSOR: "the line passes through the sensor, or the points are too close together for this fitter",
    NOT_FINITE: "no finite line with positive covariance came out",
    NOT_CONVERGED: "the search for the likeliest line did not come to an end",
    BEYOND: "the line is farther away than every point: they do not lie along a wall",
}
_BEYOND = 1.1  # times the range of the farthest point, to which noise may move a line


@inlined
def fit_piece(
    fitter: int, rho: Array, c: Array, s: Array, noise: NoiseModel, work: Work, free: Free, out: Array
) -> int:
    """Fit one piece with the fitter of the given number; work is scratch, out (LINE_FIELDS,) the result.

    free as in `covariances`.
    """
    w, v_rho, v_theta = work[0], noise.v_rho, noise.v_theta
    if fitter == ARRAS_SIEGWART:
        status, normal, published = arras_siegwart.fit(rho, c, s, v_rho, v_theta, w)
    elif fitter == CWLF:
        status, normal, published = cwlf.fit(rho, c, s, v_rho, v_theta, w)
    elif fitter == UTLS:
        status, normal, published = tls.fit_utls(rho, c, s, v_rho, v_theta, w)
    elif fitter == WTLS:
        status, normal, published = tls.fit_wtls(rho, c, s, v_rho, v_theta, w)
    elif fitter == WCTLS:
        status, normal, published = tls.fit_wctls(rho, c, s, v_rho, v_theta, w)
    elif fitter == ML:
        status, normal, published = ml.fit(rho, c, s, noise, work)
    else:
        return NOT_FINITE
    if status != OK:
        return status
    if normal[2] > _BEYOND * rho.max():
        return BEYOND
    consistent, for_maps = covariances(work, rho, c, s, noise, normal, fitter == ML, free)
    return store(out, normal, published, consistent, for_maps)


@dataclass(frozen=True, slots=True)
class Fitter:
    """A line fitting method: its number in the kernels, what it is called, where it comes from, and `fit`."""

    number: int
    name: str
    title: str
    reference: str
    summary: str

    def fit(
        self, ranges: ArrayLike, bearings: ArrayLike, noise: SensorNoise, *, latent_bearings: bool = True
    ) -> Line:
        """Fit one line to the beams of one wall.

        ranges (N,) m and bearings (N,) rad, sensor frame, in any order; N >= 2. latent_bearings as in
        ExtractionSettings.
        Raises ScanError if they differ in shape, or a value is not finite, or a range is not positive;
        DegenerateLineError if the points do not determine a line this fitter can express.

        >>> import numpy as np
        >>> from lidarcore import FITTERS, SensorNoise
        >>> bearings = np.linspace(-0.5, 0.5, 50)
        >>> line = FITTERS["ml"].fit(2 / np.cos(bearings), bearings, SensorNoise(0.02, 0.001))
        >>> round(line.r, 3), abs(round(line.alpha, 3)), line.covariance_consistent.shape
        (2.0, 0.0, (2, 2))
        """
        rho, theta = as_row(ranges, "ranges"), as_row(bearings, "bearings")
        if rho.shape != theta.shape:
            raise ScanError(f"ranges {rho.shape} and bearings {theta.shape} must both have shape (N,).")
        if len(rho) < 2:
            raise DegenerateLineError(f"{len(rho)} point(s) do not determine a line: give at least 2.")
        if noise.unevenness > 0:
            rho, theta = _along_the_wall(rho, theta)
        out = np.empty(LINE_FIELDS)
        status = fit_beams(self.number, rho, theta, noise.model(latent_bearings), out)
        if status == _BAD_BEAM:
            raise ScanError(
                "Ranges must be positive and finite, bearings finite and in radians: leave missing returns out."
            )
        if status != OK:
            raise DegenerateLineError(f"{self.name}: {STATUS_MESSAGES[status]}.")
        alpha = float(normal_angle(out[0], out[1]))
        published, consistent, for_maps = (
            out[at : at + 4].reshape(2, 2) for at in (LINE_PUBLISHED, LINE_CONSISTENT, LINE_MAP)
        )
        if noise.unevenness > 0:
            consistent = to_second_order(consistent, out[2], ABOUT_MEAN)
            for_maps = to_second_order(for_maps, out[2], ABOUT_TRUTH)
        return Line(alpha, float(out[2]), published, consistent, for_maps)


_BAD_BEAM = 100


def _along_the_wall(rho: Array, theta: Array) -> tuple[Array, Array]:
    """Beams sorted along the wall: neighbours share its unevenness."""
    middle = np.angle(np.exp(1j * theta).sum())
    order = np.argsort((theta - middle + np.pi) % (2 * np.pi))
    return rho[order], theta[order]


@kernel
def fit_beams(fitter: int, rho: Array, theta: Array, noise: NoiseModel, out: Array) -> int:
    """Check the beams and fit them: the compiled call behind `Fitter.fit`."""
    for i in range(len(rho)):
        if not (rho[i] > 0 and rho[i] < np.inf and np.abs(theta[i]) <= MAX_BEARING):
            return _BAD_BEAM
    rows = np.empty((2 + WORK, len(rho)))
    cos_sin(theta, rows[0], rows[1])
    return fit_piece(fitter, rho, rows[0], rows[1], noise, (rows[2], rows[3], rows[4]), (True, True), out)


FITTERS: dict[str, Fitter] = {
    fitter.name: fitter
    for fitter in (
        Fitter(
            ARRAS_SIEGWART,
            "arras_siegwart",
            "Arras-Siegwart, weighted",
            "Prieto-Fernández et al. 2024, eq. 3, 16-19; Arras and Siegwart 1998",
            "Total least squares in polar form, weights from the inverse determinant of each point's covariance.",
        ),
        Fitter(
            CWLF,
            "cwlf",
            "CWLF",
            "Prieto-Fernández et al. 2024, eq. 20-35",
            "Regression along x or y with inverse conditional variances; its published covariance is too small.",
        ),
        Fitter(
            UTLS,
            "utls",
            "UTLS",
            "Prieto-Fernández et al. 2026, eq. 1-7",
            "Least squares of the implicit line ax + by = -1, all points alike.",
        ),
        Fitter(
            WTLS,
            "wtls",
            "WTLS",
            "Prieto-Fernández et al. 2026, eq. 8-15",
            "As UTLS, weights from the inverse determinant of each point's covariance.",
        ),
        Fitter(
            WCTLS,
            "wctls",
            "WCTLS",
            "Prieto-Fernández et al. 2026, eq. 16-23 (C_Q reconstructed)",
            "The estimate of WTLS with the covariance of the conformal point Q; as published it is too small.",
        ),
        Fitter(
            ML,
            "ml",
            "Maximum likelihood",
            "this project",
            "Gauss-Newton on the ranges under the sensor's noise model; near the Cramér-Rao bound at low noise.",
        ),
    )
}
FITTER_IDS = {name: fitter.number for name, fitter in FITTERS.items()}
