"""Placement of one point by least squares of its observations to placed points."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from catseye.estimation.network.approximate.sightings import (
    BEARING,
    COORDINATE,
    DIFFERENCE,
    LEVEL,
    RANGE,
    ZENITH,
    Sightings,
)
from catseye.estimation.network.unfolding.location import locate

FLOOR = 1e-3  # m: lower limit of sigma, as given points may be poor
RADII = (0.25, 1.0, 3.0)  # of the starts around the known points, in half their extent


@dataclass(frozen=True, eq=False)
class Ties:
    """Observations of one point to placed ones.

    There are m rows, residuals in units of sigma.

    code       (m,) RANGE ... COORDINATE; differences have become coordinates
    anchor     (m, 3) m, other end of the sight, heights of instrument and target applied
    sense      (m,) 1 if the point is the target, -1 if it is the origin
    observed   (m,) m or rad; oriented if the orientation is known
    arm        (m,) m, factor from radians to metres: the measured distance, else the size
    weight     (m,) 1/m
    circle     (m,) index of the point's own unoriented sets, from 0; -1 for others
    axis       (m,) of a coordinate
    size       m, of the surroundings
    """

    code: np.ndarray
    anchor: np.ndarray
    sense: np.ndarray
    observed: np.ndarray
    arm: np.ndarray
    weight: np.ndarray
    circle: np.ndarray
    axis: np.ndarray
    size: float

    @classmethod
    def of(cls, p: int, r: Sightings, xyz: np.ndarray, orientations: dict[int, float]) -> "Ties":
        """Ties of point p by usable rows, and by its known coordinates."""
        sense = np.where(r.origin == p, -1.0, 1.0)
        opposite = np.where(r.origin == p, r.target, r.origin)
        anchor = xyz[opposite] - sense[:, None] * r.shift
        oriented = np.array([w in orientations for w in r.which.tolist()], dtype=bool)
        observed = r.observed + np.where(r.code == BEARING, [orientations.get(w, 0.0) for w in r.which.tolist()], 0.0)
        step = r.code == DIFFERENCE
        observed[step] = anchor[step, r.which[step]] + sense[step] * r.observed[step]
        code = np.where(step, COORDINATE, r.code)
        circle = np.full(len(r), -1)
        free = (code == BEARING) & ~oriented
        circle[free] = np.unique(r.which[free], return_inverse=True)[1]
        lengths = (code == RANGE) | (code == LEVEL)
        about = anchor[code != COORDINATE, :2]
        size = float(max([*np.ptp(about, axis=0)] if len(about) else [0.0])) or 0.0
        size = max([size, *observed[lengths]]) or 1.0
        measured = dict(zip(opposite[lengths].tolist(), observed[lengths].tolist(), strict=True))
        arm = np.array([measured.get(k, size) for k in opposite.tolist()])
        angular = (code == BEARING) | (code == ZENITH)
        weight = 1.0 / np.hypot(np.where(angular, arm, 1.0) * r.sigma, FLOOR)
        ties = cls(
            code=code,
            anchor=anchor,
            sense=sense,
            observed=observed,
            arm=arm,
            weight=weight,
            circle=circle,
            axis=r.which,
            size=size,
        )
        return ties._with_coordinates(xyz[p])

    def _with_coordinates(self, at: np.ndarray) -> "Ties":
        """Ties with one more for each known coordinate of the point."""
        axis = np.flatnonzero(np.isfinite(at))
        if not len(axis):
            return self
        k, zero = len(axis), np.zeros((len(axis), 3))
        more = (np.full(k, COORDINATE), zero, np.ones(k), at[axis], np.ones(k), np.full(k, 1e6), np.full(k, -1), axis)
        names = list(self.__dataclass_fields__)[:-1]
        joined = {n: np.concatenate([getattr(self, n), m]) for n, m in zip(names, more, strict=True)}
        return replace(self, **cast(Any, joined))

    def in_plan(self, level: np.ndarray) -> "Ties":
        """Ties (m,) independent of height, in the plane z = 0."""
        names = list(self.__dataclass_fields__)[:-1]
        flat = replace(self, **cast(Any, {n: getattr(self, n)[level] for n in names}))
        return flat._with_coordinates(np.array([np.nan, np.nan, 0.0]))

    def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residuals (b, m) and derivatives (b, m, 3) of the predicted values, at b positions."""
        along = np.nan_to_num(x[:, None] - self.anchor)
        tiny = 1e-9 * self.size
        far = np.maximum(np.hypot(along[..., 0], along[..., 1]), tiny)
        long = np.hypot(far, along[..., 2])
        flat = along * (1.0, 1.0, 0.0)
        v, slope = np.zeros(along.shape[:2]), np.zeros(along.shape)
        for code, size, direction in ((RANGE, long, along), (LEVEL, far, flat)):
            k = self.code == code
            v[:, k], slope[:, k] = (self.observed - size)[:, k], (direction / size[..., None])[:, k]
        k = self.code == BEARING
        azimuth = np.arctan2(self.sense * along[..., 0], self.sense * along[..., 1])
        turn = np.stack([along[..., 1], -along[..., 0], 0 * far], axis=-1) / (far**2)[..., None]
        v[:, k], slope[:, k] = wrapped(self.observed - azimuth)[:, k], turn[:, k]
        for index in range(self.circle.max(initial=-1) + 1):  # eliminates the orientation of the point's own set
            k = self.circle == index
            mean = np.angle(np.mean(np.exp(1j * v[:, k]), axis=1, keepdims=True))
            v[:, k] = wrapped(v[:, k] - mean)
            slope[:, k] -= slope[:, k].mean(axis=1, keepdims=True)
        k = self.code == ZENITH
        up = along[..., 2]
        fall = np.stack([up * along[..., 0] / far, up * along[..., 1] / far, -far], axis=-1)
        fall = fall * (self.sense / long**2)[..., None]
        v[:, k], slope[:, k] = (self.observed - np.arctan2(far, self.sense * up))[:, k], fall[:, k]
        angular = (self.code == BEARING) | (self.code == ZENITH)
        k = self.code == COORDINATE
        v[:, k] = self.observed[k] - x[:, self.axis[k]]
        slope[:, k] = np.eye(3)[self.axis[k]]
        scale = self.weight * np.where(angular, self.arm, 1.0)
        return v * scale, slope * scale[:, None]

    def solved(self, strictness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (b, 3) by increasing cost (b,), and mask (3,) of determined coordinates of the best."""
        x = self.starts()
        v, slope = self.residuals(x)
        cost, damping, step = np.sum(v**2, axis=1), np.full(len(x), 1e-2), np.full(x.shape, np.inf)
        for _ in range(60):
            normal = np.swapaxes(slope, 1, 2) @ slope
            scale = np.einsum("bii->b", normal) / 3 * damping + 1e-30
            right = np.einsum("bmi,bm->bi", slope, v)
            step = np.linalg.solve(normal + scale[:, None, None] * np.eye(3), right[..., None])[..., 0]
            step *= np.minimum(1.0, self.size / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
            trial_v, trial_slope = self.residuals(x + step)
            trial = np.sum(trial_v**2, axis=1)
            better = trial <= cost
            x = np.where(better[:, None], x + step, x)
            v, slope = np.where(better[:, None], trial_v, v), np.where(better[:, None, None], trial_slope, slope)
            cost, damping = np.where(better, trial, cost), np.clip(damping * np.where(better, 0.1, 8.0), 1e-12, 1e9)
            if np.all(np.linalg.norm(step, axis=1) < 1e-8 * self.size):
                break
        settled = np.linalg.norm(step, axis=1) < 1e-3 * self.size
        order = np.argsort(cost, kind="stable")
        order = order[settled[order] | (order == order[0])]
        plain = slope[order[0]] / self.weight[:, None]
        values, axes = np.linalg.eigh(plain.T @ plain)
        loose = axes[:, values < strictness * values[2]]
        determined = np.sum(loose**2, axis=1) < 1e-4
        return x[order], cost[order], determined

    def starts(self) -> np.ndarray:
        """Start positions (b, 3): polar ones, from three ranges, else all around the known points."""
        fixed = np.full(3, np.nan)
        k = self.code == COORDINATE
        fixed[self.axis[k]] = self.observed[k]
        origins = list(self._polar())
        k = self.code == RANGE
        if k.sum() >= 3 and not origins:
            solutions = locate(self.anchor[k], self.observed[None, k])[0][0]
            origins = [x for x in solutions if np.isfinite(x).all()]
        if origins:
            return np.where(np.isfinite(fixed), fixed, np.array(origins))
        about = self.anchor[self.code != COORDINATE]
        middle = np.nan_to_num(about).sum(axis=0) / np.maximum(np.isfinite(about).sum(axis=0), 1)
        angle = np.arange(12) * np.pi / 6 + 0.1
        rise = (0.0,) if np.any(self.code == ZENITH) or np.isfinite(fixed[2]) else (0.0, 1.0, -1.0)
        ring = [(r * np.sin(a), r * np.cos(a), h * r) for r in RADII for a in angle for h in rise]
        x = middle + 0.5 * self.size * np.array(ring)
        return np.where(np.isfinite(fixed), fixed, x)

    def _polar(self) -> Iterator[np.ndarray]:
        """Positions from an oriented direction, distance and zenith angle (or level) at one point."""
        for b in np.flatnonzero((self.code == BEARING) & (self.circle < 0)):
            at_station = np.all(self.anchor[:, :2] == self.anchor[b, :2], axis=1)
            distance = np.flatnonzero(at_station & ((self.code == RANGE) | (self.code == LEVEL)))
            zenith = np.flatnonzero(at_station & (self.code == ZENITH))
            if len(distance) and (len(zenith) or self.code[distance[0]] == LEVEL):
                d = distance[0]
                tilt = self.observed[zenith[0]] if len(zenith) else np.pi / 2
                far = self.observed[d] * (np.sin(tilt) if self.code[d] == RANGE else 1.0)
                up = far / np.tan(tilt) if abs(np.sin(tilt)) > 1e-9 else np.cos(tilt) * self.observed[d]
                along = np.array([far * np.sin(self.observed[b]), far * np.cos(self.observed[b]), up])
                yield np.nan_to_num(self.anchor[d]) + self.sense[b] * along


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles reduced to [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
