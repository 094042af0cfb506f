"""One point placed by least squares of all that ties it to placed points: its starts, its descent, what is held."""

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

FLOOR = 1e-3  # m: no sigma counts as smaller, for the points that are given may be poor
RADII = (0.25, 1.0, 3.0)  # of the starts about the known points, in half their extent


@dataclass(frozen=True, eq=False)
class Ties:
    """What ties one point to placed ones; m rows, residuals in metres over their standard uncertainties.

    code       (m,) RANGE ... COORDINATE; differences have become coordinates
    anchor     (m, 3) m, where the sight begins or ends, heights of instrument and target applied
    sense      (m,) 1 where the point is the target, -1 where it is the origin
    observed   (m,) m or rad; oriented where the orientation is known
    arm        (m,) m, what turns radians into metres: the measured distance, else the size
    weight     (m,) 1/m
    own        (m,) the point's own unoriented set, numbered from 0; -1 for others
    axis       (m,) of a coordinate
    size       m, of the surroundings
    """

    code: np.ndarray
    anchor: np.ndarray
    sense: np.ndarray
    observed: np.ndarray
    arm: np.ndarray
    weight: np.ndarray
    own: np.ndarray
    axis: np.ndarray
    size: float

    @classmethod
    def of(cls, p: int, r: Sightings, xyz: np.ndarray, orientations: dict[int, float]) -> "Ties":
        """Ties of point p by usable rows; coordinates of p that are known tie it too."""
        sense = np.where(r.origin == p, -1.0, 1.0)
        other = np.where(r.origin == p, r.target, r.origin)
        anchor = xyz[other] - sense[:, None] * r.shift
        oriented = np.array([w in orientations for w in r.which.tolist()], dtype=bool)
        observed = r.observed + np.where(r.code == BEARING, [orientations.get(w, 0.0) for w in r.which.tolist()], 0.0)
        step = r.code == DIFFERENCE
        observed[step] = anchor[step, r.which[step]] + sense[step] * r.observed[step]
        code = np.where(step, COORDINATE, r.code)
        own = np.full(len(r), -1)
        free = (code == BEARING) & ~oriented
        own[free] = np.unique(r.which[free], return_inverse=True)[1]
        lengths = (code == RANGE) | (code == LEVEL)
        about = anchor[code != COORDINATE, :2]
        size = float(max([*np.ptp(about, axis=0)] if len(about) else [0.0])) or 0.0
        size = max([size, *observed[lengths]]) or 1.0
        measured = dict(zip(other[lengths].tolist(), observed[lengths].tolist(), strict=True))
        arm = np.array([measured.get(k, size) for k in other.tolist()])
        angular = (code == BEARING) | (code == ZENITH)
        weight = 1.0 / np.hypot(np.where(angular, arm, 1.0) * r.sigma, FLOOR)
        ties = cls(code, anchor, sense, observed, arm, weight, own, r.which, size)
        return ties._with_known(xyz[p])

    def _with_known(self, at: np.ndarray) -> "Ties":
        """With a coordinate for each of the point's own that is known."""
        axis = np.flatnonzero(np.isfinite(at))
        if not len(axis):
            return self
        k, zero = len(axis), np.zeros((len(axis), 3))
        more = (np.full(k, COORDINATE), zero, np.ones(k), at[axis], np.ones(k), np.full(k, 1e6), np.full(k, -1), axis)
        names = list(self.__dataclass_fields__)[:-1]
        joined = {n: np.concatenate([getattr(self, n), m]) for n, m in zip(names, more, strict=True)}
        return replace(self, **cast(Any, joined))

    def in_plan(self, level: np.ndarray) -> "Ties":
        """Those of the ties (m,) that do not depend on height, in the plane z = 0."""
        names = list(self.__dataclass_fields__)[:-1]
        flat = replace(self, **cast(Any, {n: getattr(self, n)[level] for n in names}))
        return flat._with_known(np.array([np.nan, np.nan, 0.0]))

    def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residuals (b, m) and their derivatives (b, m, 3), of the predicted value, at b positions."""
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
        for own in range(self.own.max(initial=-1) + 1):  # the orientation of the point's own set is eliminated
            k = self.own == own
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
        """Positions (b, 3) by rising cost (b,), and which of the best one's coordinates (3,) the ties hold."""
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
        held = np.sum(loose**2, axis=1) < 1e-4
        return x[order], cost[order], held

    def starts(self) -> np.ndarray:
        """Positions (b, 3) to begin from: polar ones, those of three ranges, else all around the known points."""
        known = np.full(3, np.nan)
        k = self.code == COORDINATE
        known[self.axis[k]] = self.observed[k]
        origins = list(self._polar())
        k = self.code == RANGE
        if k.sum() >= 3 and not origins:
            both = locate(self.anchor[k], self.observed[None, k])[0][0]
            origins = [x for x in both if np.isfinite(x).all()]
        if origins:
            return np.where(np.isfinite(known), known, np.array(origins))
        about = self.anchor[self.code != COORDINATE]
        middle = np.nan_to_num(about).sum(axis=0) / np.maximum(np.isfinite(about).sum(axis=0), 1)
        angle = np.arange(12) * np.pi / 6 + 0.1
        rise = (0.0,) if np.any(self.code == ZENITH) or np.isfinite(known[2]) else (0.0, 1.0, -1.0)
        ring = [(r * np.sin(a), r * np.cos(a), h * r) for r in RADII for a in angle for h in rise]
        x = middle + 0.5 * self.size * np.array(ring)
        return np.where(np.isfinite(known), known, x)

    def _polar(self) -> Iterator[np.ndarray]:
        """Positions from one oriented direction, distance and zenith angle (level where there is none) at one point."""
        for b in np.flatnonzero((self.code == BEARING) & (self.own < 0)):
            same = np.all(self.anchor[:, :2] == self.anchor[b, :2], axis=1)
            distance = np.flatnonzero(same & ((self.code == RANGE) | (self.code == LEVEL)))
            zenith = np.flatnonzero(same & (self.code == ZENITH))
            if len(distance) and (len(zenith) or self.code[distance[0]] == LEVEL):
                d = distance[0]
                tilt = self.observed[zenith[0]] if len(zenith) else np.pi / 2
                far = self.observed[d] * (np.sin(tilt) if self.code[d] == RANGE else 1.0)
                up = far / np.tan(tilt) if abs(np.sin(tilt)) > 1e-9 else np.cos(tilt) * self.observed[d]
                along = np.array([far * np.sin(self.observed[b]), far * np.cos(self.observed[b]), up])
                yield np.nan_to_num(self.anchor[d]) + self.sense[b] * along


def wrapped(angle: np.ndarray) -> np.ndarray:
    """The angles brought into [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
