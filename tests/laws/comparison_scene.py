"""Two epochs of a network of any dimension and datum, some of whose points moved; and the answer by plain numpy."""

from dataclasses import dataclass

import numpy as np

from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.model import NetworkPoints, ObservationNetwork
from catseye.estimation.observations.kinds import Distances, HeightDifferences, HorizontalDistances, Vectors

KINDS = ("heights", "plane", "mixed", "space", "vectors")
DATUMS = ("free", "minimal", "held")
AXES = {"heights": [2], "plane": [0, 1], "mixed": [0, 1, 2], "space": [0, 1, 2], "vectors": [0, 1, 2]}
MINIMAL = {  # (point, axis) of coordinates that just hold what the observations leave floating
    "heights": [(0, 2)],
    "plane": [(0, 0), (0, 1), (1, 0)],
    "mixed": [(0, 0), (0, 1), (1, 0), (0, 2)],
    "space": [(0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 2)],
    "vectors": [(0, 0), (0, 1), (0, 2)],
}
FLOATING = {"heights": 1, "plane": 3, "mixed": 4, "space": 6, "vectors": 3}


def lengths(x, pairs, axes):
    return np.linalg.norm((x[pairs[:, 1]] - x[pairs[:, 0]])[:, axes], axis=1)


@dataclass
class Rows:
    """Observations of one kind between points: what they are of a set of coordinates, and the group that says so."""

    kind: str
    pairs: np.ndarray

    def of(self, x):
        if self.kind == "heights":
            return x[self.pairs[:, 1], 2] - x[self.pairs[:, 0], 2]
        if self.kind == "vectors":
            return (x[self.pairs[:, 1]] - x[self.pairs[:, 0]]).ravel()
        return lengths(x, self.pairs, [0, 1] if self.kind == "plane" else [0, 1, 2])

    def group(self, observed, sigma):
        made = {"heights": HeightDifferences, "vectors": Vectors, "plane": HorizontalDistances, "space": Distances}
        ends = 3 * self.pairs.T
        return made[self.kind](self.kind, observed, np.full(len(observed), sigma**2), *ends)


@dataclass
class Scene:
    """What is common to both epochs: n points at x (n, 3), coordinates that exist, and those held."""

    kind: str
    datum: str
    x: np.ndarray
    existing: np.ndarray
    held: np.ndarray
    sigma: float
    names: tuple

    @classmethod
    def of(cls, rng, kind, datum, n=9):
        x = rng.uniform(-40.0, 40.0, (n, 3)) * [1.0, 1.0, 0.6]
        existing = np.zeros((n, 3), dtype=bool)
        existing[:, AXES[kind]] = True
        if kind == "mixed":
            existing[rng.permutation(np.arange(2, n))[:2], 2] = False  # plane points
        held = np.zeros((n, 3), dtype=bool)
        if datum == "held":
            held[: 4 if kind in ("space", "plane") else 3] = True
            held &= existing
        elif datum == "minimal":
            held[tuple(np.transpose(MINIMAL[kind]))] = True
        return cls(kind, datum, x, existing, held, 10.0 ** rng.uniform(-5, -2), tuple(f"P{i}" for i in range(n)))

    def pairs(self, bare):
        """All pairs, or with `bare` as few as determine the points: nothing is redundant then."""
        n = len(self.x)
        if not bare:
            return np.array([(i, j) for i in range(n) for j in range(i)])
        k = {"plane": 2, "mixed": 2, "space": 3}.get(self.kind, 1)
        known = int(self.held.any(axis=1).sum()) if self.datum == "held" else 0
        return np.array([(i, j) for i in range(known, n) for j in (range(k) if known else range(max(i - k, 0), i))])

    def rows(self, bare):
        pairs = self.pairs(bare)
        if self.kind != "mixed":
            return [Rows(self.kind, pairs)]
        high = self.existing[:, 2]
        both = pairs[high[pairs].all(axis=1)] if not bare else self._levelled()
        return [Rows("plane", pairs), Rows("heights", both)]

    def _levelled(self):
        """A line of levelling through all points with heights; from the first where some are held."""
        high = np.flatnonzero(self.existing[:, 2])
        if self.datum == "held":
            return np.array([(high[0], i) for i in high if not self.held[i, 2]])
        return np.column_stack([high[:-1], high[1:]])

    def epoch(self, rng, x, *, bare=False):
        """One epoch of points that are at x, adjusted."""
        xyz = np.where(self.existing, self.x, np.nan)
        points = NetworkPoints(
            self.names, xyz, self.held, self.existing & ~self.held & (self.datum == "free"), absent=~self.existing
        )
        values = [(rows, rows.of(x)) for rows in self.rows(bare)]
        groups = tuple(r.group(v + self.sigma * rng.standard_normal(len(v)), self.sigma) for r, v in values)
        return adjust_network(ObservationNetwork(points, (), groups), engine="dense")

    def movement(self, rng, which, size):
        """(n, 3) m: points which moved by `size` sigmas of an observation in random directions of what exists."""
        step = np.zeros(self.x.shape)
        for i in which:
            v = rng.standard_normal(3) * self.existing[i]
            step[i] = size * self.sigma * v / np.linalg.norm(v)
        return step


def by_numpy(scene, epochs, bare, own):
    """Displacements (k, 3) of the points `own`, all others taken as unmoved, and their covariance (k, 3, k, 3).

    One nonlinear adjustment of both epochs by Gauss and Newton, derivatives by differences: coordinates of all points,
    and for the second epoch a displacement of those that are not taken as unmoved. nan where a coordinate is absent.
    """
    n, free = len(scene.x), (scene.existing & ~scene.held).ravel()
    if scene.datum == "minimal":
        free = scene.existing.ravel()  # a convention
    own = list(own)
    moving = np.zeros(3 * n, dtype=bool)
    moving[(3 * np.array(own, dtype=int)[:, None] + np.arange(3)).ravel()] = True
    moving &= free
    first, later = np.flatnonzero(free), np.flatnonzero(moving)
    rows = [scene.rows(b) for b in bare]
    observed = np.concatenate([g.observed for e in epochs for g in e.network.groups]) / scene.sigma

    def predicted(u):
        x = scene.x.ravel().copy()
        x[first] += u[: len(first)]
        y = x.copy()
        y[later] += u[len(first) :]
        parts = [r.of(p.reshape(n, 3)) for p, group in zip((x, y), rows, strict=True) for r in group]
        return np.concatenate(parts) / scene.sigma

    start = [e.state[: 3 * n] for e in epochs]
    u = np.concatenate([(start[0] - scene.x.ravel())[first], np.zeros(len(later))])
    h = 1e-4
    for _ in range(8):
        a = np.array([(predicted(u + h * e) - predicted(u - h * e)) / (2 * h) for e in np.eye(len(u))]).T
        _, s, vt = np.linalg.svd(a, full_matrices=False)
        keep = s > 1e-7 * s[0]
        inverse = (vt[keep].T / s[keep] ** 2) @ vt[keep]
        step = inverse @ (a.T @ (observed - predicted(u)))
        u = u + step
        if np.abs(step).max() < 1e-11:
            break
    d, q = np.full(3 * n, np.nan), np.full((3 * n, 3 * n), np.nan)
    d[later] = u[len(first) :]
    q[np.ix_(later, later)] = inverse[len(first) :, len(first) :]
    q = q.reshape(n, 3, n, 3)
    rank_lost = int((~keep).sum())
    return d.reshape(n, 3), q[np.arange(n), :, np.arange(n)], rank_lost
