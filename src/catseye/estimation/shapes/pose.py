"""The pose of a group of points: its rigid motion from one epoch, or from its design, to another, in six numbers.

Six numbers mean nothing without the frame of their axes and the pivot about which the group turns; both are part of a
`Pose` and can be changed, and the covariance follows. The fit is `rigid_body.fit_transformation`. A point that moved
on its own against the others can be found (robust start) or named (single tests) and is left out whole.
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
from catseye.estimation.shapes.place_covariances import PlaceCovariances, turned_covariance
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
RIGID = 0.01  # chance below which points do not move as one
LIMIT = 4.0  # |w| from which a coordinate speaks against its point: one good coordinate in 16 000


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a group of points is against where it was: second = pivot + translation + R (first - pivot).

    frame         whose axes all numbers are in
    motion        the fit: pivot, translation, matrix, covariance (6, 6), residuals, status
    names         n, of the points that count, in the order of the residuals
    gain          (6, 3n): small changes of second less first, turned with the motion, to changes of the six numbers
    p             chance of such a sum of squares or a larger one, if the group is rigid; nan without redundancy
    left_out      name: its largest |w| against all that count
    linear        the estimate at the end, for `w`, which costs as much as the fit and is computed when asked for
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
        """(n,) largest |w| of a point's three coordinates; nan where nothing checks it."""
        return _largest_w(self.linear)

    @property
    def pivot(self) -> np.ndarray:
        """The point that the pose turns about, (3,) m."""
        return self.motion.pivot

    @property
    def translation(self) -> np.ndarray:
        """Shift of the pivot, (3,) m."""
        return self.motion.translation

    @property
    def rotation(self) -> np.ndarray:
        """(3,) rad, rotation vector, right-hand rule."""
        return self.motion.rotation

    @property
    def covariance(self) -> np.ndarray:
        """(6, 6) m and rad, translation then rotation (a further small turn about the frame's axes)."""
        return self.motion.covariance

    @property
    def u(self) -> np.ndarray:
        """(6,) standard uncertainties of translation and rotation, m and rad."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def about(self, pivot: np.ndarray) -> "Pose":
        """The same motion about another pivot (3,) m: no point goes elsewhere, the covariance follows. Exact."""
        move = pivot_change(np.asarray(pivot, dtype=float) - self.pivot, self.motion.matrix)
        return replace(self, motion=self.motion.about(pivot), gain=move @ self.gain)

    def in_frame(self, to_from: Transform) -> "Pose":
        """The same motion in other axes: pivot, translation, rotation and covariance follow. Exact.

        to_from   from this pose's frame; raises FrameError where it starts elsewhere
        """
        if to_from.from_ != self.frame:
            raise FrameError(f"a pose in the frame '{self.frame}' cannot be told by {to_from}")
        turn, m = to_from.rotation, self.motion
        both = np.kron(np.eye(2), turn)
        moved = replace(
            m,
            pivot=to_from.points(m.pivot),
            translation=turn @ m.translation,
            matrix=turn @ m.matrix @ turn.T,
            covariance=both @ m.covariance @ both.T,
            residual=m.residual @ turn.T,
        )
        gain = turned_covariance(both @ self.gain, turn, columns=True)
        return replace(self, frame=to_from.to, motion=moved, gain=gain)

    def displacement(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far points (k, 3) m of the first place go, (k, 3) m, with the covariance (3k, 3k) of the pose alone."""
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
    """The rigid motion that takes a group's first places to its second, weighted, with full covariance.

    names           n, of the points
    first, second   (n, 3) m, in the frame
    frame           whose axes they are in
    covariance      of the places
    pivot           (3,) m, about which the rotation is told; the points' mean if None
    robust          None keeps every point; one of METHODS leaves out points that moved on their own: an L1 start, then
                    that method's weights, by `quality.robustness.estimate_robustly`; what it rejects, |w| of a
                    coordinate beyond LIMIT, goes whole

    After a robust start the points that stay count fully, so the covariance is that of plain least squares with them;
    that they were chosen is not in it. Raises EstimationError as `fit_transformation`.
    """
    called = tuple(names)
    if covariance.first is None and covariance.second is None:
        raise EstimationError("a pose needs the covariance of one epoch at least, both are missing")
    if robust is not None and robust not in METHODS:
        raise EstimationError(f"robust method {robust!r} is none of {', '.join(METHODS)}")
    x, y = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    where = x.mean(axis=0) if pivot is None else np.asarray(pivot, dtype=float)
    problem = _Problem(called, x, y, covariance.checked(len(called)), where)
    keep, statistic = np.ones(len(called), dtype=bool), np.zeros(len(called))
    if robust is not None and len(called) > POINTS["rigid"]:
        keep, statistic = _kept(problem, robust)
    chosen = problem.of(keep)
    motion, linear = chosen.fit()
    return Pose(
        frame=frame,
        motion=motion,
        names=chosen.names,
        gain=linear.gain,
        p=_chance(motion),
        linear=linear,
        left_out={name: float(w) for name, w, k in zip(called, statistic, keep, strict=True) if not k},
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """Points of two epochs with their covariances; `fit` solves for the motion."""

    names: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    known: PlaceCovariances
    pivot: np.ndarray

    def of(self, keep: np.ndarray) -> "_Problem":
        """The same with some points (n,) bool only."""
        names = tuple(n for n, k in zip(self.names, keep, strict=True) if k)
        return replace(self, names=names, x=self.x[keep], y=self.y[keep], known=self.known.of(keep))

    def fit(self, extra: np.ndarray | None = None) -> tuple[Transformation, LinearEstimate]:
        """The motion and its linear estimate; `extra` (3n,) m^2 adds to the variances of the second epoch."""
        return adjusted_motion(self.x, self.y, self.known, pivot=self.pivot, names=self.names, extra=extra)


def _kept(problem: _Problem, method: str) -> tuple[np.ndarray, np.ndarray]:
    """(n,) bool which points stay, and (n,) the largest |w| of each, nothing being left out for being unchecked."""
    sigma = np.sqrt(np.diag(problem.known.difference(len(problem.names), np.eye(3))))

    def solve(inflation: Sequence[np.ndarray]) -> list[GroupFit]:
        (factor,) = inflation
        extra = (np.square(factor) - 1.0) * sigma**2
        motion, linear = problem.fit(extra)
        return [_fit(linear, motion, sigma)]

    estimate = estimate_robustly(solve, [len(sigma)], options=RobustOptions(method=method, start="l1", limit=LIMIT))
    if estimate.status != CONVERGED:
        return _one_left_out(problem, f"robust weights ({method}) did not settle")
    statistic = np.abs(np.nan_to_num(estimate.statistic[0])).reshape(-1, 3).max(axis=1)
    keep = np.asarray(~np.any(estimate.rejected[0].reshape(-1, 3), axis=1))
    if (left := int(keep.sum())) < POINTS["rigid"]:
        text = f"robust weights ({method}) would leave {left} of {len(keep)} points (expected 3 or more)"
        return _one_left_out(problem, text)
    if (
        left <= POINTS["rigid"] + 1 and _chance(problem.of(keep).fit()[0]) < RIGID
    ):  # few points: weights found a wrong one
        with suppress(EstimationError):  # else the weights' answer, whose chance says what it is worth
            return _one_left_out(problem, f"what robust weights ({method}) leave does not move as one")
    return keep, statistic


def _one_left_out(problem: _Problem, why: str) -> tuple[np.ndarray, np.ndarray]:
    """The one point without which the others move as one, sought like `_kept` where weights fail.

    Each is left out of a copy in turn. Raises EstimationError where none or more than one does, with their chances.
    """
    everyone = np.arange(len(problem.names))
    chance = np.array([_chance(problem.of(everyone != k).fit()[0]) for k in everyone])
    good = np.flatnonzero(chance >= RIGID)
    if len(good) == 1:
        return everyone != good[0], np.nan_to_num(_largest_w(problem.fit()[1]))
    if len(good):
        named = " or ".join(f"{problem.names[k]} (p {chance[k]:.2g})" for k in good)
        text = f"without {named} the others move as one, and nothing says which of them moved"
    else:
        best = int(np.argmax(np.nan_to_num(chance)))
        text = (
            f"the others do not move as one without any of the {len(everyone)} points (best without "
            f"{problem.names[best]}, p {chance[best]:.2g}): more than one moved, or the covariance is too small"
        )
    raise EstimationError(f"{why}; {text}; fit without robust and look at the residuals, or take other points")


def _fit(linear: LinearEstimate, motion: Transformation, sigma: np.ndarray) -> GroupFit:
    """One group of 3n rows for `estimate_robustly`; its own weight undone is the estimator's business.

    The error in row i alone that explains the residuals best is (P v)_i / P_ii, of variance 1 / P_ii.
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
    """(n,) largest |w| of each point's coordinates: w_i = (P v)_i / sqrt(P_ii), Baarda's test with correlations."""
    weight = linear.weight_diagonal
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.where(weight > 0.0, np.abs(linear.weighted_residual) / np.sqrt(weight), np.nan)
    by_point = w.reshape(-1, 3)
    known = np.isfinite(by_point).any(axis=1)
    largest = np.max(np.where(np.isfinite(by_point), by_point, -1.0), axis=1)
    return np.asarray(np.where(known, largest, np.nan))


def _chance(motion: Transformation) -> float:
    from scipy import special

    if not motion.degrees_of_freedom:
        return float("nan")
    return float(special.chdtrc(motion.degrees_of_freedom, motion.pvv))


def pivot_change(arm: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(6, 6) that takes the six numbers to a pivot further by an arm (3,) m: t' = t + w x (R arm).

    arm      (3,) m, new pivot less old
    matrix   (3, 3) R of the motion
    """
    move = np.eye(6)
    move[:3] = motion_columns((arm @ matrix.T)[None], np.zeros(3))[:, :6]
    return move


def relative_pose(body: Pose, to: Pose, cross: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Small motion (6,) of a body as seen from another that moved too, about the body's pivot, and covariance (6, 6).

    body, to   poses in one frame, of small turns
    cross      (6, 6) covariance of the body's six numbers (rows) with the other's; zero where their points share none

    relative = (t - t_o - w_o x (p - p_o), w - w_o). First order in the turns: what is left out is their product, a
    nanometre for 2 arc seconds at 10 m. Raises FrameError for two frames.
    """
    if body.frame != to.frame:
        raise FrameError(f"poses in the frames '{body.frame}' and '{to.frame}' cannot be subtracted")
    carried = to.about(body.pivot)
    difference = np.concatenate([body.translation - carried.translation, body.rotation - carried.rotation])
    mixed = cross @ pivot_change(body.pivot - to.pivot, to.motion.matrix).T
    return difference, body.covariance + carried.covariance - mixed - mixed.T
