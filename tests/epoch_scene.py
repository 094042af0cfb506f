"""A linear free network measured twice: the scene of the tests of what moved between epochs."""

import numpy as np

from catseye.estimation.deformation.congruence import KNOWN, Epochs, differences, global_test
from catseye.estimation.shapes.rigid_body import motion_columns

SIGMA = 20e-6  # m


class Field:
    """A free network of ranges, linear about its true points: n common points, each to every other."""

    def __init__(self, seed=0, n=9):
        rng = np.random.default_rng(seed)
        self.n, self.points = n, rng.uniform(-40, 40, (n, 3)) * [1, 1, 0.5]
        self.names = tuple(f"P{i}" for i in range(n))
        pairs = [(i, j) for i in range(n) for j in range(i)]
        self.design = np.zeros((len(pairs), 3 * n))
        for row, (i, j) in enumerate(pairs):
            unit = (self.points[i] - self.points[j]) / np.linalg.norm(self.points[i] - self.points[j])
            self.design[row, 3 * i : 3 * i + 3], self.design[row, 3 * j : 3 * j + 3] = unit, -unit
        self.solve = np.linalg.pinv(self.design)  # inner constraints of all points
        self.q = SIGMA**2 * np.linalg.pinv(self.design.T @ self.design)
        self.q = 0.5 * (self.q + self.q.T)
        self.g = motion_columns(self.points, self.points.mean(axis=0))[:, :6]

    def held(self, six):
        """Solution matrix and covariance with six coordinates held, by plain deletion."""
        free = np.setdiff1d(np.arange(3 * self.n), six)
        a, solve, q = self.design[:, free], np.zeros_like(self.solve), np.zeros_like(self.q)
        solve[free] = np.linalg.pinv(a)
        q[np.ix_(free, free)] = SIGMA**2 * np.linalg.inv(a.T @ a)
        return solve, q

    def ranges(self, rng, movement=None):
        """Two epochs of observations, less the computed ranges."""
        m = len(self.design)
        movement = np.zeros(3 * self.n) if movement is None else movement
        return rng.normal(size=m) * SIGMA, self.design @ np.ravel(movement) + rng.normal(size=m) * SIGMA

    def epochs(self, ranges, *, first=None, second=None, **options):
        (s1, q1), (s2, q2) = first or (self.solve, self.q), second or (self.solve, self.q)
        x1, x2 = (self.points + (s @ r).reshape(-1, 3) for s, r in zip((s1, s2), ranges, strict=True))
        return Epochs(self.names, x1, x2, q1, q2, **options)


FIELD = Field()


def congruence_test(epochs, *, datum="rigid", variance_factor=KNOWN):
    """The test that nothing moved, alone: what `moved_points` begins with."""
    fit = differences(epochs, datum, np.ones(len(epochs.names), dtype=bool)).fit()
    return global_test(fit.pvv, fit.degrees_of_freedom, variance_factor)


def movement(moves, n=9):
    vector = np.zeros((n, 3))
    for i, v in moves.items():
        vector[i] = v
    return vector
