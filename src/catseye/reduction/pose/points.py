"""Pose of any points of two tables, without a site: all common points, or those named, in the tables' own axes."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.estimation.shapes.place_covariances import Known, PlaceCovariances, RotatedPoints
from catseye.estimation.shapes.pose import RIGID, Pose, fit_pose
from catseye.estimation.shapes.rigid_body import closed_form
from catseye.records.network.solved_points import SolvedPoints
from catseye.reduction.pose.pose import FEWEST, GroupPose

GROUND, TABLE = "ground", "table"  # axes of the answer: those of two reductions, or of tables
SAME_SIZE = 2.0  # ratio of both epochs' extents beyond which their units differ
TURNED = 30.0 * DEGREE  # rotation from which exchanged axes are looked for
SMALL = 0.2  # of that rotation, or of the misfit: what an exchange of axes leaves if it is the mistake
AXES = "xyz"


def pose_of_points(
    later: SolvedPoints,
    earlier: SolvedPoints,
    *,
    points: Sequence[str] | None = None,
    pivot: np.ndarray | None = None,
    robust: str | None = None,
) -> GroupPose:
    """Motion of points from an earlier epoch, or a design without uncertainties, to a later one.

    later     epoch
    earlier   epoch; where it has no uncertainties its places are exact
    points    names; None: all common points
    pivot     (3,) m; the points' mean without
    robust    as `estimation.shapes.pose.fit_pose`

    Raises InputError for fewer than three common points and for two different units, EstimationError as `fit_pose`.
    """
    names, missing = _common(later, earlier, points)
    first, second = earlier.places(names), later.places(names)
    _refuse_units(later, earlier, first, second)
    frame = GROUND if later.posture is not None and earlier.posture is not None else TABLE
    covariance = PlaceCovariances(first=_covariance_of(earlier, names), second=_covariance_of(later, names))
    if covariance.first is None and covariance.second is None:
        raise InputError(
            f"{later.file} and {earlier.file}: neither has uncertainties (expected a column u_mm in one of them, or "
            "the argument u_mm (--u-mm))"
        )
    fitted = fit_pose(names, first, second, frame=frame, covariance=covariance, robust=robust)
    used = np.isin(names, fitted.names)
    return GroupPose(
        group="points",
        pose=fitted if pivot is None else fitted.about(pivot),
        against=earlier.campaign or earlier.file,
        places=first[used],
        missing=missing,
        epoch=later,
        earlier=earlier,
        suspicion=_exchanged(later, first[used], second[used], fitted)
        or _alone(names, first, second, covariance, fitted),
    )


def _common(
    later: SolvedPoints, earlier: SolvedPoints, points: Sequence[str] | None
) -> tuple[list[str], tuple[str, ...]]:
    """Names of both epochs, and those of one alone."""
    if points is None:
        names = [name for name in later.names if name in set(earlier.names)]
        missing = sorted(set(later.names) ^ set(earlier.names))
    else:
        names, missing = list(points), []
        for epoch in (later, earlier):
            if absent := [name for name in names if name not in epoch.names]:
                raise InputError(f"{epoch.file}: has no point {absent[0]!r} (expected points of both epochs)")
    if len(names) < FEWEST:
        raise InputError(
            f"{later.file} and {earlier.file} have {len(names)} points in common (expected {FEWEST} at least, of the "
            "same names)"
        )
    return names, tuple(missing)


def _covariance_of(epoch: SolvedPoints, names: Sequence[str]) -> Known | None:
    """Covariance of some points: of all together or of each; None where they are exact."""
    rows = epoch.rows(names)
    if isinstance(epoch.covariance, JointPoints):
        return RotatedPoints(epoch.covariance.of_points(rows), np.eye(3))
    covariance = epoch.covariance[rows] if epoch.covariance.ndim == 3 else epoch.block(names)
    return covariance if covariance.any() else None


def _refuse_units(later: SolvedPoints, earlier: SolvedPoints, first: np.ndarray, second: np.ndarray) -> None:
    """Raise InputError where the same points are much farther apart in one epoch."""
    sizes = [float(np.median(np.linalg.norm(x - np.median(x, axis=0), axis=1))) for x in (first, second)]
    ratio = sizes[1] / sizes[0] if sizes[0] > 0.0 else np.inf
    if not 1.0 / SAME_SIZE < ratio < SAME_SIZE:
        raise InputError(
            f"{later.file}: its points are {ratio:.4g} times as far apart as those of {earlier.file} (expected the "
            "same body): another unit than a heading says, such as mm in x_m?"
        )


def _exchanged(later: SolvedPoints, first: np.ndarray, second: np.ndarray, fitted: Pose) -> str:
    """Exchange of axes that explains a mirrored or much turned body, as a text; "" for none."""
    turn = float(np.linalg.norm(fitted.rotation))
    misfit = float(np.sqrt(np.mean(np.square(fitted.motion.residual))))
    if turn < TURNED and (fitted.motion.converged or fitted.p >= RIGID):
        return ""
    for order in list(permutations(range(3)))[1:]:
        changed = second[:, order]
        matrix, mirrored = closed_form(first, changed)
        centred = changed - changed.mean(axis=0) - (first - first.mean(axis=0)) @ matrix.T
        unexplained = float(np.sqrt(np.mean(centred**2)))
        angle = float(np.arccos(np.clip(0.5 * (np.trace(matrix) - 1.0), -1.0, 1.0)))
        explains = unexplained < SMALL * misfit or (angle < SMALL * turn and unexplained < 2.0 * misfit)
        if not mirrored and angle < SMALL * TURNED and explains:
            changed_axes = [AXES[k] for k in range(3) if order[k] != k]
            axes = ", ".join(AXES[k] for k in order)
            text = f"{' and '.join(changed_axes)} exchanged" if len(changed_axes) == 2 else f"axes in the order {axes}"
            return f"turned by {turn / DEGREE:.0f}°; with {text} in {later.file} by {angle / DEGREE:.2f}°"
    return ""


def _alone(
    names: Sequence[str], first: np.ndarray, second: np.ndarray, covariance: PlaceCovariances, fitted: Pose
) -> str:
    """Point without which the others move as one, or that with the largest residual, as a text; "" if all do."""
    if not fitted.motion.degrees_of_freedom or fitted.p >= RIGID or not np.isfinite(fitted.w).any():
        return ""
    name = fitted.names[int(np.nanargmax(fitted.w))]
    text = f"{name} has the largest |w|, {np.nanmax(fitted.w):.1f}"
    remaining = np.isin(names, fitted.names) & (np.array(names) != name)
    if remaining.sum() <= FEWEST:
        return text
    refit = fit_pose(
        [n for n, stays in zip(names, remaining, strict=True) if stays],
        first[remaining],
        second[remaining],
        frame=fitted.frame,
        covariance=covariance.of(remaining),
    )
    if refit.p >= RIGID:
        return f"{text}; without it the others move as one (p {refit.p:.2g}); leave it out by points or robust"
    return f"{text}; without it the others do not move as one either (p {refit.p:.2g})"
