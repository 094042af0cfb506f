"""Pose of a group of points: rigid motion from one epoch, or from its design, to another.

The six parameters refer to the frame of their axes and the pivot of the rotation; both are part of a `Pose` and can be
changed, and the covariance follows. The fit is `rigid_body.fit_transformation`. A point that moved relative to the
others can be detected (robust start) or named (single tests) and is left out completely.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from catseye.errors import EstimationError, FrameError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit
from catseye.estimation.least_squares.singular import LinearEstimate
from catseye.estimation.quality.robustness import RobustOptions, estimate_robustly
from catseye.estimation.shapes.place_covariances import PlaceCovariances, rotated_covariance
from catseye.estimation.shapes.rigid_body import (
    CONVERGED,
    POINTS,
    Transformation,
    adjusted_motion,
    motion_columns,
)
from catseye.geometry.frames.frame import Transform

COMPONENTS = tuple(f"{kind} {axis}" for kind in ("translation", "rotation") for axis in "xyz")
METHODS = ("l1", "huber", "igg3", "biweight")
RIGID = 0.01  # p-value below which points do not move as one
LIMIT = 4.0  # |w| from which a coordinate rejects its point: one good coordinate in 16 000


@dataclass(frozen=True, eq=False)
class Pose:
    """Rigid motion of a group of points: second = pivot + translation + R (first - pivot).

    frame         of all values
    motion        the fit: pivot, translation, matrix, covariance (6, 6), residuals, status
    names         n, of the points used, in the order of the residuals
    gain          (6, 3n): derivatives of the six parameters by second less rotated first
    p             probability of a sum of squares at least as large if the group is rigid; nan without redundancy
    left_out      name: its largest |w| against the points used
    linear        final estimate, for `w`, which costs as much as the fit and is computed on request
    """

    frame: str
    motion: Transformation
    names: tuple[str, ...]
    gain: np.ndarray
    p: float
    left_out: dict[str, float]
    linear: LinearEstimate

    @cached_property
    def w(self) -> np.ndarray:
        """Largest |w| (n,) of each point's coordinates; nan if unchecked."""
        return _largest_w(self.linear)

    @property
    def pivot(self) -> np.ndarray:
        """Pivot of the rotation, (3,) m."""
        return self.motion.pivot

    @property
    def translation(self) -> np.ndarray:
        """Translation of the pivot, (3,) m."""
        return self.motion.translation

    @property
    def rotation(self) -> np.ndarray:
        """Rotation vector (3,) rad, right-hand rule."""
        return self.motion.rotation

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (6, 6) m and rad: translation, then a further small rotation about the frame's axes."""
        return self.motion.covariance

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (6,) of translation and rotation, m and rad."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def about(self, pivot: np.ndarray) -> "Pose":
        """The same motion about another pivot (3,) m, with its covariance. Exact."""
        move = pivot_change(np.asarray(pivot, dtype=float) - self.pivot, self.motion.matrix)
        return replace(self, motion=self.motion.about(pivot), gain=move @ self.gain)

    def in_frame(self, to_from: Transform) -> "Pose":
        """The same motion in other axes: pivot, translation, rotation and covariance. Exact.

        to_from   from this pose's frame; raises FrameError for another frame
        """
        if to_from.from_ != self.frame:
            raise FrameError(f"a pose in the frame '{self.frame}' cannot be transformed by {to_from}")
        turn, m = to_from.rotation, self.motion
        blocks = np.kron(np.eye(2), turn)
        moved = replace(
            m,
            pivot=to_from.points(m.pivot),
            translation=turn @ m.translation,
            matrix=turn @ m.matrix @ turn.T,
            covariance=blocks @ m.covariance @ blocks.T,
            residual=m.residual @ turn.T,
        )
        gain = rotated_covariance(blocks @ self.gain, turn, columns=True)
        return replace(self, frame=to_from.to, motion=moved, gain=gain)

    def displacement(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (k, 3) m of points (k, 3) m of the first epoch, and its covariance (3k, 3k).

        The covariance is that of the pose alone.
        """
        x = np.asarray(points, dtype=float)
        columns = motion_columns((x - self.pivot) @ self.motion.matrix.T, np.zeros(3))[:, :6]
        return self.motion.apply(x) - x, columns @ self.covariance @ columns.T


def fit_pose(
    names: Sequence[str],
    first: np.ndarray,
    second: np.ndarray,
    *,
    frame: str,
    covariance: PlaceCovariances,
    pivot: np.ndarray | None = None,
    robust: str | None = None,
) -> Pose:
    """Weighted rigid motion of a group's first places to its second, with full covariance.

    names           n, of the points
    first, second   (n, 3) m, in the frame
    frame           of the coordinates
    covariance      of the places
    pivot           (3,) m, pivot of the rotation; the points' mean if None
    robust          None: use every point; one of METHODS: leave out points that moved individually: an L1 start, then
                    that method's weights, by `quality.robustness.estimate_robustly`; a point with a coordinate
                    rejected, |w| beyond LIMIT, is left out completely

    After a robust start the remaining points have full weight, so the covariance is that of plain least squares with
    them; it does not include the selection. Raises EstimationError as `fit_transformation`.
    """
    labels = tuple(names)
    if covariance.first is None and covariance.second is None:
        raise EstimationError("a pose needs the covariance of one epoch at least, both are missing")
    if robust is not None and robust not in METHODS:
        raise EstimationError(f"unknown robust method {robust!r} (expected one of {', '.join(METHODS)})")
    x, y = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    centre = x.mean(axis=0) if pivot is None else np.asarray(pivot, dtype=float)
    problem = _Problem(labels, x, y, covariance.checked(len(labels)), centre)
    mask, statistic = np.ones(len(labels), dtype=bool), np.zeros(len(labels))
    if robust is not None and len(labels) > POINTS["rigid"]:
        mask, statistic = _retained(problem, robust)
    chosen = problem.of(mask)
    motion, linear = chosen.fit()
    return Pose(
        frame=frame,
        motion=motion,
        names=chosen.names,
        gain=linear.gain,
        p=_chance(motion),
        linear=linear,
        left_out={name: float(w) for name, w, k in zip(labels, statistic, mask, strict=True) if not k},
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """Points of two epochs with their covariances, to be fitted."""

    names: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    covariances: PlaceCovariances
    pivot: np.ndarray

    def of(self, mask: np.ndarray) -> "_Problem":
        """Problem of selected points (n,) bool."""
        names = tuple(n for n, k in zip(self.names, mask, strict=True) if k)
        return replace(self, names=names, x=self.x[mask], y=self.y[mask], covariances=self.covariances.of(mask))

    def fit(self, extra: np.ndarray | None = None) -> tuple[Transformation, LinearEstimate]:
        """Motion and its linear estimate.

        `extra` (3n,) m^2 is added to the second epoch's variances.
        """
        return adjusted_motion(self.x, self.y, self.covariances, pivot=self.pivot, names=self.names, extra=extra)


def _retained(problem: _Problem, method: str) -> tuple[np.ndarray, np.ndarray]:
    """Mask (n,) of retained points, and largest |w| (n,) of each point.

    Unchecked points stay.
    """
    sigma = np.sqrt(np.diag(problem.covariances.difference(len(problem.names), np.eye(3))))

    def solve(inflation: Sequence[np.ndarray]) -> list[GroupFit]:
        (factor,) = inflation
        extra = (np.square(factor) - 1.0) * sigma**2
        motion, linear = problem.fit(extra)
        return [_fit(linear, motion, sigma)]

    estimate = estimate_robustly(solve, [len(sigma)], options=RobustOptions(method=method, start="l1", limit=LIMIT))
    if estimate.status != CONVERGED:
        return _one_left_out(problem, f"robust weights ({method}) did not settle")
    statistic = np.abs(np.nan_to_num(estimate.statistic[0])).reshape(-1, 3).max(axis=1)
    mask = np.asarray(~np.any(estimate.rejected[0].reshape(-1, 3), axis=1))
    if (remaining := int(mask.sum())) < POINTS["rigid"]:
        text = f"robust weights ({method}) would leave {remaining} of {len(mask)} points (expected 3 or more)"
        return _one_left_out(problem, text)
    if (
        remaining <= POINTS["rigid"] + 1 and _chance(problem.of(mask).fit()[0]) < RIGID
    ):  # few points: the weights rejected a wrong one
        with suppress(EstimationError):  # otherwise the weights' result, with its p-value
            return _one_left_out(problem, f"the points retained by robust weights ({method}) do not move as one")
    return mask, statistic


def _one_left_out(problem: _Problem, why: str) -> tuple[np.ndarray, np.ndarray]:
    """Mask without the one point that prevents a rigid fit, as `_retained`.

    Used if the weights fail.

    Each point is left out in turn. Raises EstimationError if none or several qualify, with their p-values.
    """
    everyone = np.arange(len(problem.names))
    chance = np.array([_chance(problem.of(everyone != k).fit()[0]) for k in everyone])
    good = np.flatnonzero(chance >= RIGID)
    if len(good) == 1:
        return everyone != good[0], np.nan_to_num(_largest_w(problem.fit()[1]))
    if len(good):
        named = " or ".join(f"{problem.names[k]} (p {chance[k]:.2g})" for k in good)
        text = f"without {named} the others move as one; which of them moved cannot be decided"
    else:
        best = int(np.argmax(np.nan_to_num(chance)))
        text = (
            f"the others do not move as one without any of the {len(everyone)} points (best without "
            f"{problem.names[best]}, p {chance[best]:.2g}): more than one moved, or the covariance is too small"
        )
    raise EstimationError(f"{why}; {text}; fit without robust and check the residuals, or use other points")


def _fit(linear: LinearEstimate, motion: Transformation, sigma: np.ndarray) -> GroupFit:
    """Fit of one group of 3n rows for `estimate_robustly`.

    The best estimate of an error in row i alone is (P v)_i / P_ii, of variance 1 / P_ii.
    """
    weight = linear.weight_diagonal
    with np.errstate(divide="ignore", invalid="ignore"):
        estimated = np.where(weight > 0.0, linear.weighted_residual / weight, 0.0)
        u = np.where(weight > 0.0, 1.0 / np.sqrt(weight), np.inf)
    return GroupFit(
        name="points",
        active=np.ones(len(sigma), dtype=bool),
        residual=motion.residual.ravel(),
        sigma=sigma,
        redundancy=linear.redundancy,
        standardised=estimated / u,
        estimated_error=estimated,
        detectable_error=NONCENTRALITY * u,
        pvv=linear.pvv,
    )


def _largest_w(linear: LinearEstimate) -> np.ndarray:
    """Largest |w| (n,) of each point's coordinates: w_i = (P v)_i / sqrt(P_ii), Baarda's test."""
    weight = linear.weight_diagonal
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.where(weight > 0.0, np.abs(linear.weighted_residual) / np.sqrt(weight), np.nan)
    by_point = w.reshape(-1, 3)
    checked = np.isfinite(by_point).any(axis=1)
    largest = np.max(np.where(np.isfinite(by_point), by_point, -1.0), axis=1)
    return np.asarray(np.where(checked, largest, np.nan))


def _chance(motion: Transformation) -> float:
    from scipy import special

    if not motion.degrees_of_freedom:
        return float("nan")
    return float(special.chdtrc(motion.degrees_of_freedom, motion.pvv))


def pivot_change(arm: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Transformation (6, 6) of the six parameters to a pivot shifted by an arm (3,) m: t' = t + w x (R arm).

    arm      (3,) m, new pivot less old
    matrix   (3, 3) R of the motion
    """
    move = np.eye(6)
    move[:3] = motion_columns((arm @ matrix.T)[None], np.zeros(3))[:, :6]
    return move


def relative_pose(body: Pose, to: Pose, cross: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Small motion (6,) of a body relative to another, about the body's pivot, and covariance (6, 6).

    body, to   poses in one frame, of small rotations
    cross      (6, 6) covariance of the body's parameters (rows) with the other's; zero for independent points

    relative = (t - t_o - w_o x (p - p_o), w - w_o). First order in the rotations: their product is neglected, a
    nanometre for 2 arc seconds at 10 m. Raises FrameError for two frames.
    """
    if body.frame != to.frame:
        raise FrameError(f"poses in the frames '{body.frame}' and '{to.frame}' cannot be subtracted")
    reference = to.about(body.pivot)
    difference = np.concatenate([body.translation - reference.translation, body.rotation - reference.rotation])
    mixed = cross @ pivot_change(body.pivot - to.pivot, to.motion.matrix).T
    return difference, body.covariance + reference.covariance - mixed - mixed.T
