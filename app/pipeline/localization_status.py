"""What is localized by what, in which map, and what is in the way, as it is told."""

from dataclasses import dataclass
from typing import Literal

from ..sources.odometry_feed import OdometryStatus
from .frame import Frame
from .navigation import NOT_LOCALIZED, Extent, Navigation
from .settings import LiveNavigation, Method


@dataclass(frozen=True, slots=True)
class LocalizationStatus:
    """`session` is built or localized in; `map` was chosen to localize in, null for the newest; `method`: by what.

    A choice that was localized in ends when SLAM begins another map, that of a map which is deleted with mode off. SLAM
    goes by the method that is chosen, a known map by what it holds: null before the first scan in it.
    `extent` is that of the grid that is localized in, if it is one: from and to along x, then along y, m.
    """

    mode: Literal["off", "localize", "slam"]
    method: Method | None
    session: int | None
    map: int | None
    extent: Extent | None
    problem: str | None
    odometry: OdometryStatus


def status_of(navigation: Navigation, wanted: LiveNavigation, newest: Frame | None) -> LocalizationStatus:
    """The status under these settings, given the newest frame."""
    return LocalizationStatus(
        mode=wanted.mode,
        method=_method(navigation, wanted),
        session=navigation.session,
        map=navigation.map,
        extent=navigation.extent,
        problem=navigation.problem,
        odometry=navigation.odometry.status(_why_not_fed(wanted, newest)),
    )


def _method(navigation: Navigation, wanted: LiveNavigation) -> Method | None:
    """What tells the pose: SLAM goes by what is chosen, a known map by what it holds, told by its first scan."""
    by_mode = {"off": None, "slam": wanted.method, "localize": navigation.method}
    return by_mode[wanted.mode]


def _why_not_fed(wanted: LiveNavigation, newest: Frame | None) -> str | None:
    """Why the newest scan takes no odometry from outside, if so."""
    if wanted.mode == "off":
        return NOT_LOCALIZED
    if newest and newest.timed.scan.odometry is not None:
        return "The source has odometry of its own."
    return None
