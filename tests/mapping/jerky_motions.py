"""Motions of one dimension whose acceleration wanders: their jerk is white noise."""

import numpy as np

from lidarcore.mapping.motion.jerk import STEADY, Drive

USUAL = (0.1, 0.5, 0.3)  # m, m/s, m/s²


def motions(rng, n, jerk, steps, step):
    """States (n, steps + 1, 3), `step` s apart: m, m/s, m/s²; they begin with random ones of the usual size."""
    A = np.array([[1, step, step**2 / 2], [0, 1, step], [0, 0, 1]])
    Q = np.array(
        [
            [step**5 / 20, step**4 / 8, step**3 / 6],
            [step**4 / 8, step**3 / 3, step**2 / 2],
            [step**3 / 6, step**2 / 2, step],
        ]
    )
    L = jerk * np.linalg.cholesky(Q + 1e-30 * np.eye(3))
    states = np.empty((n, steps + 1, 3))
    states[:, 0] = rng.normal(0, USUAL, (n, 3))
    for k in range(steps):
        states[:, k + 1] = states[:, k] @ A.T + rng.normal(size=(n, 3)) @ L.T
    return states


def only(number):
    """A drive all of whose jerks are of one density, and whose places are as noisy as they say."""
    return Drive(1.0, STEADY.densities[number : number + 1], np.ones((1, 3)))
