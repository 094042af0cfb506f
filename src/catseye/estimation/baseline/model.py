"""Linear model of a baseline: set means, directions, prior positions; and its solution.

The effects are described in `adjustment`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from catseye.errors import EstimationError

LEAST_SEPARATION = 1e-4  # smallest singular value of determined parameters; rounding and slopes simulate as much


@dataclass(frozen=True, eq=False)
class BaselineSights:
    """Shots between pillars.

    start, end    (m,) numbers of pillars
    set           (m,) number of the set, 0 to M - 1: consecutive shots on one target
    setup         (m,) number of the set-up, 0 to K - 1
    distance      (m,) horizontal distance at the common height, m
    stretch       (m,) derivative of distance by slope length: 1 over the cosine of the slope
    systematic    (m, q) m, effect of one standard uncertainty of each common effect
    effects       (q,) their names
    direction     (m,) horizontal circle reading, clockwise, rad; nan if none
    u_direction   (m,) rad, of the recorded reading
    pillars       names of the pillars by number, for messages; empty: numbers
    """

    start: np.ndarray
    end: np.ndarray
    set: np.ndarray
    setup: np.ndarray
    distance: np.ndarray
    stretch: np.ndarray
    systematic: np.ndarray
    effects: tuple[str, ...]
    direction: np.ndarray
    u_direction: np.ndarray
    pillars: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.distance)

    def only(self, mask: np.ndarray) -> "BaselineSights":
        """Selected shots, with sets and set-ups renumbered."""
        set_numbers, setup = (np.unique(c[mask], return_inverse=True)[1] for c in (self.set, self.setup))
        return replace(
            self,
            start=self.start[mask],
            end=self.end[mask],
            set=set_numbers,
            setup=setup,
            distance=self.distance[mask],
            stretch=self.stretch[mask],
            systematic=self.systematic[mask],
            direction=self.direction[mask],
            u_direction=self.u_direction[mask],
        )

    @cached_property
    def shots(self) -> np.ndarray:
        """Number of shots (M,) per set."""
        return np.bincount(self.set)

    @cached_property
    def first(self) -> np.ndarray:
        """First shot (M,) of each set."""
        return np.unique(self.set, return_index=True)[1]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Means (M, ...) over the sets."""
        total = np.zeros((len(self.shots), *values.shape[1:]))
        np.add.at(total, self.set, values)
        return total / self.shots.reshape(-1, *[1] * (values.ndim - 1))

    @cached_property
    def within(self) -> np.ndarray:
        """Distances (m,) less their set's mean."""
        return self.distance - self.mean(self.distance)[self.set]


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """Prior positions with covariance.

    x, y         (n,) m
    rows         (r,) indices in [x, y] with prior: i for x of pillar i, n + i for y
    covariance   (r, r) m²
    """

    x: np.ndarray
    y: np.ndarray
    rows: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class Extra:
    """Further linear terms: cyclic terms, response to the weather.

    names     (e,)
    columns   (m, e) effect of a unit coefficient on each distance, m
    """

    names: tuple[str, ...]
    columns: np.ndarray


@dataclass(frozen=True)
class Claim:
    """Variances of the noise.

    shot   of one shot, m²
    set    of one set, m²; or (M,) of each
    air    of one set, over the square of its distance
    """

    shot: float
    set: Any
    air: float


def pillar_label(number: int, names: Sequence[str]) -> str:
    """Pillar in a message: its name, or its number without names.

    >>> pillar_label(1, ["A", "B"]), pillar_label(1, ())
    ('pillar B', 'pillar number 1')
    """
    return f"pillar {names[number]}" if names else f"pillar number {number}"


def place_label(row: int, count: int, names: Sequence[str]) -> str:
    """Coordinate in a message, by its index in [x, y].

    >>> place_label(1, 2, ["A", "B"]), place_label(2, 2, ())
    ('x of B', 'y 0')
    """
    axis, number = ("x", row) if row < count else ("y", row - count)
    return f"{axis} of {names[number]}" if names else f"{axis} {number}"


class BaselineModel:
    """Linear model at given values: set means, directions, prior positions."""

    def __init__(self, sights, x, y, known, scale, extra, u_centring):
        self.sights, self.known, self.scale, self.extra, self.u_centring = sights, known, scale, extra, u_centring
        n = len(x)
        self.x0, self.y0 = x.copy(), y.copy()
        self.start, self.end = sights.start[sights.first], sights.end[sights.first]
        self.setup = sights.setup[sights.first]
        self.distance, self.shots = sights.mean(sights.distance), sights.shots
        self.systematic, self.stretch = sights.mean(sights.systematic), sights.mean(sights.stretch)
        measured = np.isfinite(sights.direction)
        self.aimed = np.flatnonzero(np.bincount(sights.set, measured) > 0)
        self.direction, self.var_direction = self._directions(measured)
        along = np.argsort(x, kind="stable")
        touched = np.zeros(n, bool)
        touched[self.start] = touched[self.end] = True
        if known is not None:
            self.free = known.rows
        else:
            missing = np.flatnonzero(~touched)
            if len(missing):
                raise EstimationError(f"{pillar_label(missing[0], sights.pillars)} has no distance")
            across = n + along[1:-1] if len(self.aimed) else np.empty(0, int)
            self.free = np.concatenate([along[1:], across])
        self.lengths = len(self.free)
        aimed_setups = np.unique(self.setup[self.aimed])
        self.names = (
            *(f"x {i}" if i < n else f"y {i - n}" for i in self.free),
            "zero",
            *(("scale",) if scale else ()),
            *(extra.names if extra is not None else ()),
            *(f"orientation {k}" for k in aimed_setups),
        )
        self.labels = (*(place_label(i, n, sights.pillars) for i in self.free), *self.names[self.lengths :])
        self.orientation = {int(k): len(self.names) - len(aimed_setups) + i for i, k in enumerate(aimed_setups)}
        unknown = 1 + int(scale) + (len(extra.names) if extra is not None else 0)
        self.freedom_sets = len(self.distance) - unknown - (0 if known is not None else n - 1)

    def _directions(self, measured):
        """Mean of each aimed set, about its first reading, and variance of the reading."""
        s = self.sights
        mean, variance = np.full(len(self.shots), np.nan), np.full(len(self.shots), np.nan)
        for k in self.aimed:
            in_set = np.flatnonzero((s.set == k) & measured)
            turn = s.direction[in_set] - s.direction[in_set[0]]
            weight = 1.0 / s.u_direction[in_set] ** 2
            mean[k] = s.direction[in_set[0]] + np.sum(weight * np.arctan2(np.sin(turn), np.cos(turn))) / np.sum(weight)
            variance[k] = np.min(s.u_direction[in_set]) ** 2  # repetitions share the reading's error
        return mean, variance

    def at(self, values):
        """Positions for given values."""
        n = len(self.x0)
        coordinates = np.concatenate([self.x0, self.y0])
        coordinates[self.free] += values[: self.lengths]
        return coordinates[:n], coordinates[n:]

    def rows(self, values):
        """Misclosures and design of all rows."""
        x, y = self.at(values)
        i, j, n, m = self.start, self.end, len(x), len(self.distance)
        dx, dy = x[j] - x[i], y[j] - y[i]
        size = np.hypot(dx, dy)
        slopes = np.zeros((m, 2 * n))
        rows = np.arange(m)
        for column, slope in ((j, dx / size), (i, -dx / size), (n + j, dy / size), (n + i, -dy / size)):
            slopes[rows, column] += slope
        rate = self.stretch**2  # a scale acts on the slope length D/cos, and enters D by another 1/cos
        factor = 1.0 + rate * (values[self.lengths + 1] if self.scale else 0.0)
        design = np.zeros((m, len(self.names)))
        design[:, : self.lengths] = factor[:, None] * slopes[:, self.free]
        design[:, self.lengths] = self.stretch
        predicted = factor * size + self.stretch * values[self.lengths]
        at = self.lengths + 1
        if self.scale:
            design[:, at] = rate * size
            at += 1
        if self.extra is not None:
            columns = self.sights.mean(self.extra.columns)
            design[:, at : at + columns.shape[1]] = columns
            predicted = predicted + columns @ values[at : at + columns.shape[1]]
        parts = [(self.distance - predicted, design), self._aims(values, dx, dy, size), self._priors(values)]
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])

    def _aims(self, values, dx, dy, size):
        """Clockwise reading + orientation = -atan2(dy, dx)."""
        k, n = self.aimed, len(self.x0)
        design = np.zeros((len(k), len(self.names)))
        slopes = np.zeros((len(k), 2 * n))
        rows = np.arange(len(k))
        across, along = (dy / size**2)[k], (-dx / size**2)[k]
        i, j = self.start[k], self.end[k]
        for column, slope in ((j, across), (i, -across), (n + j, along), (n + i, -along)):
            slopes[rows, column] += slope
        design[:, : self.lengths] = slopes[:, self.free]
        orientation = np.array([self.orientation[int(s)] for s in self.setup[k]], int)
        design[rows, orientation] = -1.0
        turn = self.direction[k] + values[orientation] + np.arctan2(dy[k], dx[k])
        return np.arctan2(np.sin(turn), np.cos(turn)), design

    def _priors(self, values):
        design = np.zeros((self.lengths if self.known is not None else 0, len(self.names)))
        if self.known is None:
            return np.zeros(0), design
        design[:, : self.lengths] = np.eye(self.lengths)
        offsets = np.concatenate([self.known.x - self.x0, self.known.y - self.y0])
        return offsets[self.free] - values[: self.lengths], design

    def cofactors(self):
        """Diagonals (3, M) of the noise cofactors of the means."""
        return np.stack([1.0 / self.shots, np.ones(len(self.shots)), self.distance**2])

    def noise_only(self, noise: Claim):
        m, a, r = len(self.distance), len(self.aimed), self.lengths if self.known is not None else 0
        v = np.zeros((m + a + r, m + a + r))
        shot, one, square = self.cofactors()
        v[:m, :m] = np.diag(noise.shot * shot + noise.set * one + noise.air * square)
        size = self.distance[self.aimed]
        v[m : m + a, m : m + a] = np.diag(self.var_direction[self.aimed] + 2 * (self.u_centring / size) ** 2)
        return v

    def variance(self, noise: Claim):
        v, m = self.noise_only(noise), len(self.distance)
        v[:m, :m] += self.systematic @ self.systematic.T
        if self.known is not None:
            v[-self.lengths :, -self.lengths :] = self.known.covariance
        return v

    def step(self, values, noise: Claim):
        """Next step and its normal equations."""
        y, a = self.rows(values)
        normal = Normal(y, a, self.variance(noise), self.labels)
        return normal.values, normal


class Normal:
    """Generalised least squares of dense rows: values, covariance, and the projector P."""

    def __init__(self, y, a, v, labels):
        root = np.linalg.cholesky(v)
        white, target = np.linalg.solve(root, a), np.linalg.solve(root, y)
        length = np.linalg.norm(white, axis=0)
        length = np.where(length > 0.0, length, 1.0)
        u, size, vt = np.linalg.svd(white / length, full_matrices=False)
        if len(y) < len(labels) or size[-1] < LEAST_SEPARATION:
            weak = ", ".join(labels[i] for i in np.flatnonzero(np.abs(vt[-1]) > 0.2)[:6])
            raise EstimationError(
                f"the distances do not determine {weak}: measure more pairs, parts of the line and its full length"
            )
        self.separation = float(size[-1])
        self.values = (vt.T @ ((u.T @ target) / size)) / length
        scaled = vt.T / size / length[:, None]
        self.covariance = scaled @ scaled.T
        self.gain = scaled @ np.linalg.solve(root.T, u).T  # values = gain y
        self.v, self.y, self.a = v, y, a
        inverse = np.linalg.inv(root)
        image = np.linalg.solve(root.T, u)
        self.p = inverse.T @ inverse - image @ image.T
        self.log_v = 2.0 * float(np.sum(np.log(np.diag(root))))
        self.log_n = float(2.0 * np.sum(np.log(size)) + 2.0 * np.sum(np.log(length)))
