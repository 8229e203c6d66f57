"""The joint Gaussian of SLAM: the motion state and two coordinates for each landmark.

Where pose and landmarks lie and head together is never seen. A correction that moves them changes what an error of the
heading does to each, and a filter that linearises before and after it as if nothing had moved takes the difference for
knowledge of the heading [Julier and Uhlmann 2001, Huang, Mourikis and Roumeliotis 2010]. So the covariance is carried
to the new means: the errors are those of an invariant filter [Barrau and Bonnabel 2015].

Only landmarks in reach are active: the cost of a scan is theirs, and that of the others is put off until they come
into reach. The result is that of the full filter, not an approximation; others are carried when they come into reach.
"""

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.geometry import act, act_jacobians, wrap
from lidarcore.localization.ekf import map_kernels, motion_kernels, sighting_kernels
from lidarcore.localization.ekf.estimate import Innovation
from lidarcore.localization.ekf.passive import Gaussian, Passive

_SAME = 1e-6  # m, as far apart as one thing may lie from itself
_MOST, _KEPT = 160, 20  # rows at which the active part is cut down, and landmarks that then stay


class JointState:
    """Motion state (d,) and L landmarks, numbered in the order in which they were added.

    The active part holds in its rows the motion, active landmarks, and the coefficients of the passive ones: entries
    whose mean is theta, and whose covariance is Phi^T with the others and -Psi with each other (see Passive). To
    the filter they are like landmarks that are never seen.
    """

    def __init__(self, state: Array, P: Array) -> None:
        self._d = len(state)
        self._active, self._passive = Gaussian(state, P), Passive()
        self._slots = np.empty(0, np.int64)  # of each landmark, its place among all there ever were
        self._rows = np.empty(0, np.int64)  # of each slot, its row in the active part, or -1
        self._used = np.empty(0, np.int64)  # of each slot, when it was last needed
        self._left = np.empty((0, 2))  # of each slot, where it became passive: its covariance is told there
        self._coefficients = np.empty(0, np.int64)  # their rows in the active part
        self._free: list[int] = []  # slots of landmarks that were dropped
        self._tick, self._room = 0, _MOST

    def __len__(self) -> int:
        return len(self._slots)

    @property
    def state(self) -> Array:
        """(d,) of the motion."""
        return self._active.x[: self._d]

    @property
    def state_covariance(self) -> Array:
        """(d, d)."""
        return self._active.P[: self._d, : self._d]

    @property
    def landmarks(self) -> Array:
        """(L, 2) m, world frame."""
        return self._survey(self._slots)[0]

    @property
    def landmark_covariances(self) -> Array:
        """(L, 2, 2) m²."""
        Psi = -self._active.P[np.ix_(self._coefficients, self._coefficients)]
        return self._survey(self._slots, self._passive.covariances(Psi))[2]

    def predict(self, state: Array, F: Array, Q: Array) -> None:
        """Put the motion state (d,) in place of the old one; F (d, d) is its Jacobian, Q (d, d) the noise."""
        motion_kernels.propagate(self._active.x, self._active.P, self._active.n, state, F, Q)

    def within_reach(self, xy: Array, noise: Array, gate: float) -> Ints:
        """Landmarks (N,) within the gate of a sighting xy (K, 2) m with noise (K, 2, 2); a few others too."""
        self._passive.settle()
        z, S = sighting_kernels.expect(self.state, self._active.P, *self._survey(self._slots))
        near = sighting_kernels.within_any(sighting_kernels.all_squared_distances(xy, noise, z, S), gate)
        self._use(self._slots[near])
        self._activate(self._slots[near])
        return near

    def expected(self, landmarks: Ints) -> tuple[Array, Array]:
        """Where landmarks (N,) appear in the sensor frame (N, 2), and how uncertain that is (N, 2, 2)."""
        self._activate(self._slots[landmarks])
        return sighting_kernels.expect(self.state, self._active.P, *self._survey(self._slots[landmarks]))

    def jointly_expected(self, landmarks: Ints, noise: Array) -> tuple[Array, Array]:
        """Where the landmarks (P,) appear (P, 2), and S (2 P, 2 P) of their sightings with this noise (P, 2, 2)."""
        z, rows = self.expected(landmarks)[0], self._rows[self._slots[landmarks]]
        return z, sighting_kernels.innovation_covariance(self._active.x, self._active.P, z, noise, rows)

    def correct(self, innovation: Innovation, noise: Array) -> None:
        """Add what the innovation tells, given the noise (P, 2, 2) of its sightings."""
        landmarks = innovation.association.landmark
        z, g = self.expected(landmarks)[0], self._active
        before = g.x.copy()
        sighting_kernels.correct(
            g.x, g.P, g.n, z, innovation.value, noise, self._rows[self._slots[landmarks]]
        )
        self._carry(before)

    def add(self, points: Array, covariances: Array) -> None:
        """Append landmarks seen at points (K, 2) m with covariances (K, 2, 2), sensor frame."""
        g, K = self._active, len(points)
        G_pose, R = act_jacobians(self.state[:3], points)
        m, G = act(self.state[:3], points), G_pose.reshape(-1, 3)
        cross = G @ g.P[:3, : g.n]
        own = cross[:, :3] @ G.T
        own.reshape(K, 2, K, 2)[np.arange(K), :, np.arange(K)] += R @ covariances @ R.T
        slots = self._new_slots(K)
        self._rows[slots] = g.append(m.ravel(), cross, own) + 2 * np.arange(K)
        self._slots = np.concatenate([self._slots, slots])
        self._compress(0)

    def fuse(self, kept: int, dropped: int) -> None:
        """Two landmarks are one and the same thing: the first becomes what both say together, the second is forgotten.

        The correction by R^T (m_kept - m_dropped) = 0, which holds exactly but for _SAME: told as the sensor sees
        it, it says nothing of the heading.
        """
        self._activate(self._slots[[kept, dropped]])
        g = self._active
        a, b = self._rows[self._slots[[kept, dropped]], None] + [0, 1]
        before, (dx, dy) = g.x.copy(), g.x[a] - g.x[b]
        turn = np.array([dy, -dx])
        PHt = g.P[: g.n, a] - g.P[: g.n, b] + g.P[: g.n, [2]] * turn
        C = np.linalg.cholesky(PHt[a] - PHt[b] + np.outer(turn, PHt[2]) + _SAME**2 * np.eye(2))
        W = np.linalg.solve(C, PHt.T).T
        g.x[: g.n] -= W @ np.linalg.solve(C, [dx, dy])
        g.x[2] = wrap(g.x[2])
        g.P[: g.n, : g.n] -= W @ W.T
        self._carry(before)
        self.keep(np.arange(len(self)) != dropped)

    def keep(self, kept: Bools) -> None:
        """Forget the landmarks that are not in kept (L,)."""
        self._slots, dropped = self._slots[kept], self._slots[~kept]
        known = dropped[2 * dropped < self._passive.n]
        self._passive.forget(_columns(known))
        self._rows[dropped] = -1
        self._free.extend(dropped.tolist())

    def _survey(self, slots: Ints, passive: Array | None = None) -> tuple[Array, Array, Array]:
        """Means (N, 2), covariances with the pose (N, 3, 2) and own (N, 2, 2), of passive ones these or at least so."""
        g, far, own = self._active, self._passive, self._passive.own if passive is None else passive
        return map_kernels.survey(
            g.x, g.P, self._rows[slots], slots, self._coefficients, self._left, far.x, far.base, own
        )

    def _carry(self, before: Array) -> None:
        """Say the errors of pose and active landmarks where they are now, which were those at means before."""
        g, rows = self._active, self._rows[self._slots]
        places = np.concatenate([[0], rows[rows >= 0]])
        coordinates = places[:, None] + [0, 1]
        map_kernels.carry(g.P, g.n, places, g.x[coordinates] - before[coordinates])

    def _activate(self, slots: Ints) -> None:
        """Bring landmarks back from the passive part: x = x_0 + B_0^T theta is linear in the coefficients."""
        needed, slots = slots, slots[self._rows[slots] < 0]
        if len(slots) == 0:
            return
        g, far, columns, k = self._active, self._passive, _columns(slots), 2 * len(slots)
        rows, T, old = far.recall(columns), far.base[:, columns].T, self._coefficients
        cross = T @ g.P[old, : g.n]
        xy = far.x[columns] + T @ g.x[old]
        first = g.append(xy, cross, rows[:, columns] + cross[:, old] @ T.T)
        self._rows[slots] = first + 2 * np.arange(len(slots))
        self._follow(first + np.arange(k))
        map_kernels.carry(g.P, g.n, self._rows[slots], xy.reshape(-1, 2) - self._left[slots])
        far.base = np.vstack([far.base, rows])
        self._use(needed)
        self._compress(len(needed))

    def _use(self, slots: Ints) -> None:
        self._tick += 1
        self._used[slots] = self._tick

    def _follow(self, rows: Ints) -> None:
        """Append the coefficients of these rows (k,): the passive part depends on each by itself."""
        k, g = len(rows), self._active
        first = g.append(np.zeros(k), np.eye(g.n)[rows], np.zeros((k, k)))
        self._coefficients = np.concatenate([self._coefficients, first + np.arange(k)])

    def _compress(self, needed: int) -> None:
        """If the active part has become too large, leave in it only the landmarks used most recently."""
        g, far, old = self._active, self._passive, self._coefficients
        if g.n <= self._room:
            return
        live = self._slots[self._rows[self._slots] >= 0]
        recent = live[np.argsort(-self._used[live], kind="stable")]
        kept = recent[: max(_KEPT, needed)]
        motion = np.arange(self._d)
        columns, rows = _columns(live), (self._rows[live, None] + [0, 1]).ravel()
        self._left[live] = g.x[rows].reshape(-1, 2)
        passive = np.zeros(len(self._rows), np.bool_)
        passive[self._slots] = self._rows[self._slots] < 0
        far.absorb(
            columns, g.x[rows], g.P[np.ix_(rows, rows)], g.P[np.ix_(rows, old)],
            -g.P[np.ix_(old, old)], g.x[old], np.repeat(passive, 2),
        )  # fmt: skip
        far.rebase(g.P[np.ix_(motion, old)], g.P[np.ix_(motion, rows)], columns, _columns(kept))
        self._active = g.take(np.concatenate([motion, (self._rows[kept, None] + [0, 1]).ravel()]))
        self._rows[:], self._coefficients = -1, np.empty(0, np.int64)
        self._rows[kept] = self._d + 2 * np.arange(len(kept))
        self._follow(np.arange(self._active.n))
        self._room = max(_MOST, self._active.n + _MOST // 2)

    def _new_slots(self, K: int) -> Ints:
        reused, self._free = np.array(self._free[:K], np.int64), self._free[K:]
        new = K - len(reused)
        slots: Ints = np.concatenate([reused, np.arange(len(self._rows), len(self._rows) + new)])
        self._rows = np.concatenate([self._rows, np.full(new, -1)])
        self._used = np.concatenate([self._used, np.zeros(new, np.int64)])
        self._used[slots] = self._tick
        self._left = np.concatenate([self._left, np.zeros((new, 2))])
        return slots


def _columns(slots: Ints) -> Ints:
    """Coordinates (2 N,) of slots (N,)."""
    columns: Ints = (2 * slots[:, None] + np.arange(2)).ravel()
    return columns
