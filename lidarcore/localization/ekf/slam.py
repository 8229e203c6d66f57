"""Simultaneous localization and mapping: pose and landmarks in one extended Kalman filter [EKF 14-26]."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.geometry import act_inverse, chi_square_gate
from lidarcore.geometry.kernels import compose_with_jacobians
from lidarcore.localization.coincidence import densities, evidence
from lidarcore.localization.ekf.association import Association, match
from lidarcore.localization.ekf.estimate import Estimate, Innovation, Instant, as_pose
from lidarcore.localization.ekf.joint import JointState
from lidarcore.localization.ekf.motion import motion_model, start
from lidarcore.localization.ekf.register import Register, find_duplicate
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.observations import in_moments, joined
from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.localization.visibility import Costs

Visible = Callable[[Array], Costs]
"""Which of the points (L, 2) m, sensor frame, should be seen if they are there: the trust they lose if they are not."""

ORIGIN = 1e-6 * np.eye(3)  # m², m rad, rad²: covariance of the pose at which a map begins
_ENOUGH = 3  # confirmed landmarks fix a pose and leave a check; with fewer, tentative ones have to help


class Slam:
    """Tracks T_world_sensor and builds the map of the landmarks it sees.

    pose (3,) m, m, rad and covariance (3, 3) say where the world frame is: by default the sensor starts at its
    origin, known to a millimetre and a milliradian. A map to go on with, independent of that pose, may be given.
    A landmark is tentative until seen often enough, and dropped when views of its place without it outweigh the
    sightings. Tentative ones correct the pose only while not enough confirmed ones are in sight: their other
    sightings are not used at all, so the filter stays consistent.
    After an error the filter is as before the call.
    """

    def __init__(
        self,
        settings: LocalizationSettings | None = None,
        pose: ArrayLike = (0.0, 0.0, 0.0),
        covariance: ArrayLike | None = None,
        landmarks: Landmarks | None = None,
    ) -> None:
        self.settings = settings or LocalizationSettings()
        self._motion = motion_model(self.settings, with_velocity=True)
        d = self._motion.size
        self._unknown_velocity = start(np.zeros(3), ORIGIN, self.settings, d)[1][3:, 3:]
        self._joint, self._register = JointState(np.zeros(d), np.zeros((d, d))), Register(self.settings)
        if landmarks is not None and len(landmarks):
            self._joint.add(landmarks.points.xy, landmarks.points.covariance)
            self._register.add_known(landmarks)
        self._last: Instant | None = None
        self.reset(pose, ORIGIN if covariance is None else covariance)

    @property
    def landmarks(self) -> Points:
        """All landmarks in the world frame, tentative ones too, in the order of `ids` and `confirmed`."""
        return Points(self._joint.landmarks, self._joint.landmark_covariances, self._register.kinds)

    @property
    def ids(self) -> NDArray[np.int64]:
        """(L,) a number for each landmark that is never given again."""
        return self._register.ids.copy()

    @property
    def confirmed(self) -> Bools:
        """(L,) true for landmarks that were seen often enough."""
        return self._register.confirmed

    @property
    def map(self) -> Landmarks:
        """The landmarks with all that is known of them."""
        known = self._register
        return Landmarks(
            known.ids, self.landmarks, known.confirmed, known.counts, known.first_seen, known.last_seen
        )

    def reset(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Go on from a pose (3,) with covariance (3, 3) that are independent of the map, as when placed by hand."""
        state, P = start(as_pose(pose, "pose"), covariance, self.settings, self._motion.size)
        self._joint.predict(state, np.zeros((len(state), len(state))), P)

    def drive_by(self, motion: Literal["odometry", "constant velocity"]) -> None:
        """Predict by this from now on, with the pose, its velocity and the map as they are."""
        self.settings = replace(self.settings, motion=motion)
        self._motion = motion_model(self.settings, with_velocity=True)

    def start_over(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Begin a new map from a pose (3,) with covariance (3, 3); ids go on."""
        self.reset(pose, covariance)
        nothing = np.zeros(len(self._joint), np.bool_)
        self._joint.keep(nothing)
        self._register.keep(nothing)

    def restart_clock(self) -> None:
        """Take the next stamp and odometry as they come, after a clock or an encoder was reset."""
        self._last = None

    def displace(self, increment: Array, covariance: Array) -> None:
        """Move by an increment (3,) seen from the sensor, with its covariance (3, 3)."""
        state = self._joint.state.copy()
        F, Q = np.eye(len(state)), np.zeros((len(state), len(state)))
        state[:3], F[:3, :3], G = compose_with_jacobians(state[:3], increment)
        Q[:3, :3] = G @ covariance @ G.T
        F[3:, 3:], Q[3:, 3:] = 0.0, self._unknown_velocity  # whatever it is by now
        self._joint.predict(state, F, Q)

    def step(
        self,
        observed: Points,
        stamp: float,
        odometry: ArrayLike | None = None,
        visible: Visible | None = None,
        times: Array | None = None,
    ) -> Estimate:
        """Predict to the stamp (s), match the points seen (sensor frame), correct, and keep the map.

        odometry is T_odom_sensor (3,); visible tells which landmarks should be seen, without it none is dropped.
        times (K,) s after the stamp say when each point was seen from where the sensor was then; only a filter with
        a velocity can use them. The association's landmarks are indices into the map before this step.
        Raises MotionError if the clock went back, or odometry is missing or jumped.
        """
        now = Instant(stamp, None if odometry is None else np.asarray(odometry, np.float64))
        moved = None if self._last is None else self._last.until(now, self.settings)
        joint, self._last = self._joint, now
        if moved is not None:
            joint.predict(*self._motion.predict(joint.state, *moved))
        moments = in_moments(times, len(observed))
        innovation = joined([self._correct(observed, *moment) for moment in moments])
        self._count(innovation.association, len(observed), stamp, visible)
        self._merge(stamp)
        if not self._register.is_at_odds:
            for time, seen in moments:
                self._add(observed.subset(np.intersect1d(seen, innovation.association.new)), stamp, time)
        return Estimate.of(stamp, joint.state, joint.state_covariance, innovation)

    @property
    def is_at_odds(self) -> bool:
        """The last scan did not show what it should have, but other things: the sensor is not where it seems to be."""
        return self._register.is_at_odds

    @property
    def _needs_tentative(self) -> bool:
        known = self._register
        return known.recognised < _ENOUGH and not known.is_at_odds

    @contextmanager
    def _at(self, time: float) -> Iterator[JointState]:
        """The state so many seconds later, at the velocity it has: a change of variables, undone at the end."""
        self._shift(time)
        yield self._joint
        self._shift(-time)

    def _shift(self, time: float) -> None:
        if time != 0:
            state, F = self._motion.glide(self._joint.state, time)
            self._joint.predict(state, F, np.zeros_like(F))

    def _correct(self, observed: Points, time: float, seen: Ints) -> tuple[Ints, Innovation]:
        """Match the points that were seen (K,) at one time (s after the stamp), and correct."""
        points = observed.subset(seen)
        with self._at(time) as joint:
            near = joint.within_reach(points.xy, points.covariance, chi_square_gate(self.settings.new_gate))
            z, S = joint.expected(near)
            association = match(points, z, S, self._register.kinds[near], self.settings).of(near)
            if not self._needs_tentative:
                association = association.trusting(self._register.confirmed)
            i, j = association.observed, association.landmark
            noise = points.covariance[i]
            z, S = joint.jointly_expected(j, noise)
            innovation, kept = Innovation(association, points.xy[i] - z, S).compatible(self.settings.gate)
            if self._is_chance(innovation):
                return seen, innovation.doubted()
            joint.correct(innovation, noise[kept])
        return seen, innovation

    def _is_chance(self, innovation: Innovation) -> bool:
        """Whether what was matched may as well be new; where nothing is confirmed yet, all of it is what was seen."""
        known, matched = self._register, innovation.association.landmark
        if not known.confirmed[matched].any():
            return False
        density = densities(self._joint.landmarks, known.kinds, matched)
        return evidence(innovation.value, innovation.covariance, density) < 0

    def _count(self, association: Association, observed: int, stamp: float, visible: Visible | None) -> None:
        """Count sightings and misses, and drop what is not there."""
        joint, landmarks = self._joint, self._joint.landmarks
        if visible is None:
            costs = Costs(np.zeros(len(landmarks)), np.zeros(len(landmarks)))
        else:
            costs = visible(act_inverse(joint.state[:3], landmarks))
        kept = self._register.count(association, observed, stamp, costs, joint.state[:2] - landmarks)
        if not kept.all():
            self._joint.keep(kept)
            self._register.keep(kept)

    def _merge(self, stamp: float) -> None:
        """Make one of two landmarks that are the same thing, which was lost and found again as a new one."""
        known = self._register
        while (
            pair := find_duplicate(
                self._joint, known.kinds, known.confirmed, known.last_seen == stamp, self.settings
            )
        ) is not None:
            kept, dropped = sorted(pair, key=lambda landmark: known.ids[landmark])
            known.merge(kept, dropped)
            self._joint.fuse(kept, dropped)
            known.keep(np.arange(len(known.ids)) != dropped)

    def _add(self, new: Points, stamp: float, time: float) -> None:
        """Take up what was seen at a time (s after the stamp) and is new."""
        if len(new):
            with self._at(time) as joint:
                joint.add(new.xy, new.covariance)
            self._register.add(np.asarray(new.kinds), stamp)
