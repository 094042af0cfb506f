"""Lines of a ranger: the shots on one target as one observation, tested by everything else."""

from dataclasses import dataclass

import numpy as np

from catseye.estimation.least_squares.adjustment import GroupFit, LeastSquaresSolution
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.reduction.epoch.shots import ShotGroup

SMALLEST = 1e-12  # share of an error that shows, below which it is rounding


@dataclass(frozen=True, eq=False)
class LineTests:
    """Tests of one ranger's lines that have a used shot.

    targets   of the k lines, in order
    line      (m,) number of each shot's line; -1 for a shot that is not used
    error     (k,) m, error common to the shots of each line, by everything else
    u         (k,) m, its standard uncertainty
    moved     (k, 2, 3) m, shift of ranger and target by an error of one u
    """

    targets: tuple[str, ...]
    line: np.ndarray
    error: np.ndarray
    u: np.ndarray
    moved: np.ndarray


def line_tests(
    group: ShotGroup, targets: tuple[str, ...], fit: GroupFit, *, solution: LeastSquaresSolution
) -> LineTests:
    """Error of each line by all others and the records, and what it does to both ends.

    Optical metres. Used repeats on one line come from one coarse length and one path, so that they are wrong together:
    their common error is e'Pv / e'P_v e, e being 1 for them, as `adjust` has it for a single shot; it moves the
    parameters by Q A'P e.
    """
    on = np.flatnonzero(fit.active)
    line = np.full(len(targets), -1)
    names, line[on] = np.unique(np.array(targets)[on], return_inverse=True)
    if group.covariance.ndim == 1:
        return LineTests(tuple(names.tolist()), line, *_apart(group, line, fit, solution))
    count = len(names)
    pattern = (line[on][:, None] == np.arange(count)).astype(float)
    weighed = np.linalg.solve(group.covariance[np.ix_(on, on)], pattern)
    gradient = full_jacobian(group, solution.x)[on].T @ weighed
    shift = solution.q.solve(gradient)
    total = np.sum(weighed * pattern, axis=0)
    visible = np.maximum(total - np.sum(gradient * shift, axis=0), SMALLEST * total)
    first = on[np.argmax(pattern, axis=0)] if count else on
    ends = np.stack([group.origin[first], group.target[first]], axis=1)[..., None] + np.arange(3)
    u = visible**-0.5
    moved = np.take_along_axis(shift.T, ends.reshape(count, 6), axis=1).reshape(count, 2, 3)
    error = weighed.T @ fit.residual[on] / visible
    return LineTests(tuple(names.tolist()), line, error, u, u[:, None, None] * moved)


def _apart(
    group: ShotGroup, line: np.ndarray, fit: GroupFit, solution: LeastSquaresSolution
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of the lines of independent rows, their u, and shifts."""
    jacobian = group.predict(solution.x)[1]
    rows = np.argsort(line, kind="stable")[np.count_nonzero(line < 0) :]
    repeats = np.bincount(line[rows]) if len(rows) else rows
    first = np.cumsum(repeats) - repeats
    error, u, moved = np.zeros(len(repeats)), np.zeros(len(repeats)), np.zeros((len(repeats), 2, 3))
    for count in np.unique(repeats):
        mine = rows[first[repeats == count][:, None] + np.arange(count)]
        weight = 1.0 / group.covariance[mine]
        columns = group.columns[mine].reshape(len(mine), -1)
        gradient = (jacobian[mine] * weight[..., None]).reshape(len(mine), -1)
        shift = solution.q.products(columns, gradient)
        total = weight.sum(axis=1)
        visible = np.maximum(total - np.sum(shift * gradient, axis=1), SMALLEST * total)
        error[repeats == count] = np.sum(weight * fit.residual[mine], axis=1) / visible
        u[repeats == count] = visible**-0.5
        moved[repeats == count] = shift[:, :6].reshape(-1, 2, 3) * visible[:, None, None] ** -0.5
    return error, u, moved
