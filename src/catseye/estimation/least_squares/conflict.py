"""Search for the fewest wrong observations among those that meet in one point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations

import numpy as np
from scipy.special import chdtri

from catseye.estimation.least_squares.adjustment import GroupFit, LeastSquaresSolution
from catseye.estimation.least_squares.rows import variances
from catseye.estimation.observations.kind import value
from catseye.estimation.observations.kinds import Distances, MovingDistances, ObservationGroup

MOST_AT_ONE_POINT = 2  # wrong observations searched for at one point, exhaustively
LARGEST_SEARCH = 24  # observations at a point; more give enough redundancy for the robust fit alone
ROUNDS = 6  # per point, each linearised at the likeliest position of the previous one
FAR = 6.0  # sigmas from a point's prior information, beyond which its observations are searched
SLACK = 2.0  # factor on sigma in the search, because everything but the point is fixed there


@dataclass(frozen=True, eq=False)
class LocalConflict:
    """Observations that meet in one point, everything else fixed, as a search problem.

    rows       (group, row) of each observation that may be wrong
    residual   (k,) over sigma
    slopes     (k, 3) derivatives by the point's coordinates, over sigma
    prior      (q,) residuals over sigma of the point's prior information, which is trusted
    prior_slopes   (q, 3)

    >>> slopes = np.vstack([np.eye(3), np.ones((1, 3)), [[1.0, -1.0, 0.0]], [[0.0, 1.0, -1.0]]])
    >>> wrong = slopes @ np.array([5.0, -3.0, 2.0]) + np.array([0, 0, 30.0, 0, 0, 0])
    >>> LocalConflict([(0, k) for k in range(6)], wrong, slopes, np.zeros(0), np.zeros((0, 3))).smallest_conflict()
    (2,)
    """

    rows: list[tuple[int, int]]
    residual: np.ndarray
    slopes: np.ndarray
    prior: np.ndarray
    prior_slopes: np.ndarray

    def cost(self, out: Sequence[int]) -> float:
        """Sum of squares at the best position of the point without some observations."""
        return self._best(out)[0]

    def _best(self, out: Sequence[int]) -> tuple[float, np.ndarray]:
        mask = np.ones(len(self.rows), dtype=bool)
        mask[list(out)] = False
        v = np.concatenate([self.residual[mask], self.prior])
        a = np.concatenate([self.slopes[mask], self.prior_slopes])
        place = np.linalg.lstsq(a, v, rcond=None)[0]
        return float(np.sum((v - a @ place) ** 2)), place

    def likeliest_place(self) -> np.ndarray | None:
        """Shift (3,) of the point for the best fit without the largest number searched for.

        None if too few observations remain for a check.
        """
        k = len(self.rows)
        size = min(MOST_AT_ONE_POINT, k + len(self.prior) - 4)
        if size < 1:
            return None
        return min((self._best(out) for out in combinations(range(k), size)), key=lambda best: best[0])[1]

    def smallest_conflict(self) -> tuple[int, ...] | None:
        """Smallest set of observations whose removal lets the others agree.

        None if two are not enough.

        The others agree if their sum of squares is below the chi-square quantile at 99.9 %; of several sets of one
        size the one that leaves the smallest sum is taken.
        """
        k = len(self.rows)
        for size in range(min(MOST_AT_ONE_POINT, k - 1) + 1):
            degrees = k - size + len(self.prior) - 3
            if degrees < 1:
                return None
            sets = {out: self.cost(out) for out in combinations(range(k), size)}
            best = min(sets, key=sets.__getitem__)
            if sets[best] < chdtri(degrees, 0.001):
                return best
        return None

    def decisive(self, out: tuple[int, ...], margin: float) -> bool:
        """True if every other set of the same size leaves a sum of squares larger by the margin."""
        limit = self.cost(out) + margin
        alternatives = (rival for rival in combinations(range(len(self.rows)), len(out)) if rival != out)
        return all(self.cost(rival) > limit for rival in alternatives)


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Errors that m observations share with others, as parameters of the adjustment.

    columns    (m, w) of the parameters, -1 for none
    slopes     (m, w) derivatives of the observed values by them
    variance   (m,) of the observed values, shared errors included

    An observation that contradicts its neighbours at a point is tested with all its errors, not after these parameters
    have absorbed a part of them: they were estimated with it.
    """

    columns: np.ndarray
    slopes: np.ndarray
    variance: np.ndarray

    def with_shared(self, residual: np.ndarray, x: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Residuals with the shared errors put back.

        rows   selected rows; all if None
        """
        columns, slopes = (self.columns, self.slopes) if rows is None else (self.columns[rows], self.slopes[rows])
        return np.asarray(residual + np.sum(slopes * value(x, columns), axis=1))


def total_residuals(
    fits: Sequence[GroupFit], x: np.ndarray, shared: Sequence[SharedErrors | None]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Residuals and sigmas of each group, shared errors included."""
    padded = [*shared, *[None] * (len(fits) - len(shared))]
    return [
        (f.residual, f.sigma) if s is None else (s.with_shared(f.residual, x), np.sqrt(s.variance))
        for f, s in zip(fits, padded, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class PointObservations:
    """Index of observations and prior information by the parameters they depend on.

    groups, removable   as of `adjust_robustly`
    advice              prior information on single points
    x                   (n,) parameters
    residual, sigma     one (m,) a group, at x
    jacobians           one a group, at x
    by_column           sorted columns, with group and row of each entry
    advice_at           column of a point: indices of its advice
    shared              of the first groups
    settled             columns that many observations determine: rows that depend on them and one point count as the
                        point's alone
    """

    groups: Sequence[ObservationGroup]
    removable: Sequence[np.ndarray]
    advice: Sequence[ObservationGroup]
    x: np.ndarray
    residual: Sequence[np.ndarray]
    sigma: Sequence[np.ndarray]
    jacobians: Sequence[np.ndarray]
    by_column: tuple[np.ndarray, np.ndarray, np.ndarray]
    advice_at: Mapping[int, Sequence[int]]
    shared: Sequence[SharedErrors | None]
    settled: np.ndarray

    @staticmethod
    def of(
        groups: Sequence[ObservationGroup],
        solution: LeastSquaresSolution,
        removable: Sequence[np.ndarray],
        advice: Sequence[ObservationGroup],
        shared: Sequence[SharedErrors | None] = (),
        settled: Sequence[int] = (),
    ) -> "PointObservations":
        """Index the groups of a solution."""
        advice_at: dict[int, list[int]] = {}
        for i, prior_group in enumerate(advice):
            for column in np.unique(prior_group.columns).tolist():
                advice_at.setdefault(column, []).append(i)
        jacobians = [g.predict(solution.x)[1] for g in groups]
        totals = total_residuals(solution.fits, solution.x, shared)
        return PointObservations(
            groups=groups,
            removable=removable,
            advice=advice,
            x=solution.x,
            residual=[residual for residual, _ in totals],
            sigma=[sigma for _, sigma in totals],
            jacobians=jacobians,
            by_column=_by_column(groups, jacobians),
            advice_at=advice_at,
            shared=shared,
            settled=np.array(settled, dtype=int),
        )

    def rows(self, columns: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """Groups, and their rows, that depend on given columns."""
        order, group, row = self.by_column
        ends = np.searchsorted(order, columns), np.searchsorted(order, columns, side="right")
        near = np.concatenate([np.arange(low, high) for low, high in zip(*ends, strict=True)])
        groups = group[near]
        return [(int(i), np.unique(row[near[groups == i]])) for i in np.unique(groups)]

    def at(self, x: np.ndarray, columns: np.ndarray) -> "PointObservations":
        """Linearised at other parameters, valid only for observations of the given columns."""
        residual, jacobians = list(self.residual), list(self.jacobians)
        for i, near in self.rows(columns):
            group = self.groups[i]
            part = _part(group, near)
            values, slopes = part.predict(x)
            residual[i], jacobians[i] = residual[i].copy(), jacobians[i].copy()
            if part is group:
                residual[i], jacobians[i] = group.observed - values, slopes
            else:
                shared_errors = self.shared[i] if i < len(self.shared) else None
                partial_residual = part.observed - values
                residual[i][near] = (
                    partial_residual if shared_errors is None else shared_errors.with_shared(partial_residual, x, near)
                )
                jacobians[i][near] = slopes
        return replace(self, x=x, residual=residual, jacobians=jacobians)


def _by_column(
    groups: Sequence[ObservationGroup], jacobians: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Non-zero Jacobian entries sorted by column: column, group, row."""
    columns, owners, rows = [], [], []
    for i, (group, jacobian) in enumerate(zip(groups, jacobians, strict=True)):
        row, entry = np.nonzero(jacobian)
        columns.append(group.columns[entry] if group.columns.ndim == 1 else group.columns[row, entry])
        owners.append(np.full(len(row), i))
        rows.append(row)
    column = np.concatenate(columns)
    order = np.argsort(column, kind="stable")
    return column[order], np.concatenate(owners)[order], np.concatenate(rows)[order]


def _part(group: ObservationGroup, rows: np.ndarray) -> ObservationGroup:
    """Selected rows of a group of independent lengths.

    Returns any other group unchanged.
    """
    if group.covariance.ndim != 1 or not isinstance(group, Distances | MovingDistances):
        return group
    m = len(group.observed)
    cut = {
        f.name: value[rows]
        for f in fields(group)
        if isinstance(value := getattr(group, f.name), np.ndarray) and value.ndim and len(value) == m
    }
    return replace(group, **cut)


def search(columns: np.ndarray, meeting: PointObservations) -> tuple[LocalConflict, tuple[int, ...] | None]:
    """Smallest conflict at a point, searched again at the likeliest position if there is none.

    A wrong range of half a metre moves its point so far that derivatives there are not accurate to 25 um.
    """
    for _ in range(ROUNDS):
        local = at_point(columns, meeting, slack=SLACK)
        if not 2 <= len(local.rows) <= LARGEST_SEARCH:
            return local, None
        conflict = local.smallest_conflict()
        shift = local.likeliest_place()
        if conflict is not None or shift is None:
            return local, conflict
        x = meeting.x.copy()
        x[columns] += shift
        meeting = meeting.at(x, columns)
    return local, None


def at_point(columns: np.ndarray, meeting: PointObservations, *, slack: float) -> LocalConflict:
    """Observations that meet in a point.

    Removable ones are those that depend on it; others, and advice, count if they depend on it alone.
    """
    rows: list[tuple[int, int]] = []
    removable: list[tuple[float, np.ndarray]] = []
    prior: list[tuple[float, np.ndarray]] = []
    for i, near in meeting.rows(columns):
        slope, alone = _slopes(columns, meeting.groups[i].columns, meeting.jacobians[i], near, meeting.settled)
        residual, sigma, mask = meeting.residual[i][near], meeting.sigma[i][near], meeting.removable[i][near]
        for k in np.flatnonzero(mask):
            removable.append((residual[k] / (slack * sigma[k]), slope[k] / (slack * sigma[k])))
            rows.append((i, int(near[k])))
        prior += [(residual[k] / sigma[k], slope[k] / sigma[k]) for k in np.flatnonzero(alone & ~mask)]
    for i in dict.fromkeys(i for c in columns.tolist() for i in meeting.advice_at.get(c, ())):
        group = meeting.advice[i]
        values, jacobian = group.predict(meeting.x)
        slope, alone = _slopes(columns, group.columns, jacobian, np.arange(len(values)), meeting.settled)
        sigma, residual = np.sqrt(variances(group)), group.observed - values
        prior += [(residual[k] / sigma[k], slope[k] / sigma[k]) for k in np.flatnonzero(alone)]
    (residual, slopes), (prior_residual, prior_slopes) = (
        (np.array([v for v, _ in part]), np.array([a for _, a in part]).reshape(-1, 3)) for part in (removable, prior)
    )
    return LocalConflict(rows, residual, slopes, prior_residual, prior_slopes)


def _slopes(
    columns: np.ndarray, group_columns: np.ndarray, jacobian: np.ndarray, rows: np.ndarray, settled: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (k, 3) of selected rows by a point, and mask of those that depend on it alone."""
    at, jacobian = (group_columns if group_columns.ndim == 1 else group_columns[rows]), jacobian[rows]
    on_point = at[..., None] == columns  # in any order, and perhaps not all three
    fixed = on_point.any(axis=-1) | np.isin(at, settled)
    if on_point.ndim == 2:
        slope, remainder = jacobian @ on_point, jacobian[:, ~fixed]
    else:
        slope, remainder = np.einsum("mw,mwa->ma", jacobian, on_point), np.where(fixed, 0.0, jacobian)
    return slope, np.any(slope != 0.0, axis=1) & ~np.any(remainder != 0.0, axis=1)


def contradicted(points: Sequence[np.ndarray], meeting: PointObservations) -> list[np.ndarray]:
    """Points far from their prior information although their observations agree."""
    far = [
        ~may & (np.abs(v) > FAR * sigma)
        for v, sigma, may in zip(meeting.residual, meeting.sigma, meeting.removable, strict=True)
    ]
    columns = set()
    for group in meeting.advice:
        values, jacobian = group.predict(meeting.x)
        columns |= set(_columns_of(group, jacobian, np.abs(group.observed - values) > FAR * np.sqrt(variances(group))))
    near = touched(points, meeting, chosen=far)
    near += [p for p in points if columns.intersection(p.tolist()) and not any(p is one for one in near)]
    return [p for p in near if np.any(np.abs(at_point(p, meeting, slack=SLACK).prior) > FAR)]


def touched(
    points: Sequence[np.ndarray], meeting: PointObservations, *, chosen: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Points that the chosen observations depend on."""
    columns = {
        int(c)
        for group, jacobian, rows in zip(meeting.groups, meeting.jacobians, chosen, strict=True)
        if rows.any()
        for c in _columns_of(group, jacobian, rows)
    }
    return [p for p in points if columns.intersection(p.tolist())]


def _columns_of(group: ObservationGroup, jacobian: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Columns that selected rows of a group depend on."""
    used = jacobian[rows] != 0.0
    return group.columns[np.any(used, axis=0)] if group.columns.ndim == 1 else group.columns[rows][used]
