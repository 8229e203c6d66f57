"""A line in Hesse normal form, x cos(alpha) + y sin(alpha) = r, whichever fitter made it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.geometry import unit_vectors


def normal_angle(nx: ArrayLike, ny: ArrayLike) -> Array:
    """Angle (rad) of a normal, in (-pi, pi]."""
    alpha = np.arctan2(ny, nx)
    return np.where(alpha > -np.pi, alpha, np.pi)


ABOUT_TRUTH, ABOUT_MEAN = 3 / 4, 6 / 4


def to_second_order(covariance: Array, r: Array | float, about: float) -> Array:
    """Covariance (..., 2, 2) of (alpha, r) of lines at r (...) m, from that to first order, with variance v of alpha.

    A line that turns by dalpha about a point of its wall comes nearer by r dalpha² / 2, whichever way it turns: on a
    short wall far away that is more than all else that is not known of r. Its mean square is 3/4 (r v)² about the
    true line, and 6/4 about the mean of many that were found, which is nearer itself by r v / 2.
    """
    turned = np.zeros_like(covariance)
    turned[..., 1, 1] = about * (r * covariance[..., 0, 0]) ** 2
    return covariance + turned


@dataclass(frozen=True, eq=False, slots=True)
class Line:
    """One line in the sensor frame.

    alpha                  rad, direction of the normal, in (-pi, pi]
    r                      m, distance from the sensor, >= 0
    covariance_published   (2, 2) of (alpha, r) in rad and m, by the formula of the fitter's paper
    covariance_consistent  (2, 2), of the noise model: by how much the line found from here differs from scan to scan;
                           exact to first order, and to second order (`to_second_order`) if walls are uneven
    covariance_map         (2, 2), what is not known of where the wall is: all of its unevenness, and what a sensor errs
                           by in every scan from one place; for maps and whatever looks from several places
    """

    alpha: float
    r: float
    covariance_published: Array
    covariance_consistent: Array
    covariance_map: Array

    @property
    def normal(self) -> Array:
        """(2,) unit normal, pointing away from the sensor."""
        return unit_vectors(self.alpha)


@dataclass(frozen=True, eq=False, slots=True)
class Lines:
    """M lines in the sensor frame; the fields of `Line`, with a leading axis.

    alpha (M,) rad, r (M,) m, covariance_published, covariance_consistent and covariance_map (M, 2, 2);
    covariance is the one the settings ask for.
    """

    alpha: Array
    r: Array
    covariance_published: Array
    covariance_consistent: Array
    covariance_map: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.alpha)

    def __repr__(self) -> str:
        return f"<{len(self)} lines>"

    def __getitem__(self, i: int) -> Line:
        return Line(
            float(self.alpha[i]),
            float(self.r[i]),
            self.covariance_published[i],
            self.covariance_consistent[i],
            self.covariance_map[i],
        )

    def __iter__(self) -> Iterator[Line]:
        return (self[i] for i in range(len(self)))
