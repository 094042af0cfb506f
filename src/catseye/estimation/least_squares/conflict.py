"""Observations that meet in one point and cannot all be right: which are the fewest that might be wrong?"""

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
LARGEST_SEARCH = 24  # observations at a point; a point with more has redundancy enough for the robust fit alone
SEARCHES = 6  # at one point, each about the place that the one before found likeliest
FAR = 6.0  # sigmas from what is known of a point besides, which its observations are then asked about
SLACK = 2.0  # on sigma in the search, because everything but the point itself is held there


@dataclass(frozen=True, eq=False)
class LocalConflict:
    """The observations that meet in one point, everything else held: which of them cannot all be right?

    rows       (group, row) of each observation that may be wrong
    residual   (k,) over sigma
    slopes     (k, 3) derivatives by the point's coordinates, over sigma
    prior      (q,) residuals over sigma of what is known of the point besides, and is not in doubt
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
        """Sum of squares at the best place for the point when some observations are left out."""
        return self._best(out)[0]

    def _best(self, out: Sequence[int]) -> tuple[float, np.ndarray]:
        keep = np.ones(len(self.rows), dtype=bool)
        keep[list(out)] = False
        v = np.concatenate([self.residual[keep], self.prior])
        a = np.concatenate([self.slopes[keep], self.prior_slopes])
        place = np.linalg.lstsq(a, v, rcond=None)[0]
        return float(np.sum((v - a @ place) ** 2)), place

    def likeliest_place(self) -> np.ndarray | None:
        """Where the point moves (3,) when as many are left out as is searched for; None where the rest is no check."""
        k = len(self.rows)
        size = min(MOST_AT_ONE_POINT, k + len(self.prior) - 4)
        if size < 1:
            return None
        return min((self._best(out) for out in combinations(range(k), size)), key=lambda best: best[0])[1]

    def smallest_conflict(self) -> tuple[int, ...] | None:
        """The fewest observations whose absence lets the rest agree, or None where two are not enough.

        The rest agrees when its sum of squares stays below the chi-square quantile at 99.9 %; of several sets of one
        size the one with the best rest is taken.
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
        """True where leaving out any others, as many, leaves a sum of squares larger by the margin."""
        limit = self.cost(out) + margin
        others = (each for each in combinations(range(len(self.rows)), len(out)) if each != out)
        return all(self.cost(each) > limit for each in others)


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Errors that m observations share with others, where these are parameters of the adjustment.

    columns    (m, w) of the parameters, -1 for none
    slopes     (m, w) derivatives of the observed values by them
    variance   (m,) of the observed values, with all that they share

    An observation that contradicts its neighbours at a point is judged with all its errors, and not after these
    parameters have taken up what they could: they were found with it.
    """

    columns: np.ndarray
    slopes: np.ndarray
    variance: np.ndarray

    def whole(self, residual: np.ndarray, x: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Residuals of some rows (all if None) as if nothing were known of what they share."""
        columns, slopes = (self.columns, self.slopes) if rows is None else (self.columns[rows], self.slopes[rows])
        return np.asarray(residual + np.sum(slopes * value(x, columns), axis=1))


def whole_residuals(
    fits: Sequence[GroupFit], x: np.ndarray, shared: Sequence[SharedErrors | None]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Residual and sigma of each group's observations with all their errors."""
    every = [*shared, *[None] * (len(fits) - len(shared))]
    return [
        (f.residual, f.sigma) if s is None else (s.whole(f.residual, x), np.sqrt(s.variance))
        for f, s in zip(fits, every, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class MeetingLines:
    """Where observations and what is known besides stand, so that those that meet in a point are quickly found.

    groups, removable   as of `adjust_robustly`
    advice              what is known of single points besides
    x                   (n,) parameters
    residual, sigma     one (m,) a group, at x
    jacobians           one a group, at x
    by_column           columns in order, and group and row of the entries that stand in them
    advice_at           column of a point: index of an advice
    shared              of the first groups
    settled             columns that so many observations know that who depends on them and a point depends on that
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
    ) -> "MeetingLines":
        """Of a solution of the groups."""
        advice_at: dict[int, list[int]] = {}
        for i, one in enumerate(advice):
            for column in np.unique(one.columns).tolist():
                advice_at.setdefault(column, []).append(i)
        jacobians = [g.predict(solution.x)[1] for g in groups]
        whole = whole_residuals(solution.fits, solution.x, shared)
        return MeetingLines(
            groups,
            removable,
            advice,
            solution.x,
            [residual for residual, _ in whole],
            [sigma for _, sigma in whole],
            jacobians,
            _by_column(groups, jacobians),
            advice_at,
            shared,
            np.array(settled, dtype=int),
        )

    def rows(self, columns: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """Groups, and their rows, that depend on some columns."""
        order, group, row = self.by_column
        ends = np.searchsorted(order, columns), np.searchsorted(order, columns, side="right")
        near = np.concatenate([np.arange(low, high) for low, high in zip(*ends, strict=True)])
        of = group[near]
        return [(int(i), np.unique(row[near[of == i]])) for i in np.unique(of)]

    def at(self, x: np.ndarray, columns: np.ndarray) -> "MeetingLines":
        """The same at other parameters, as far as some columns reach; elsewhere it is not to be asked."""
        residual, jacobians = list(self.residual), list(self.jacobians)
        for i, near in self.rows(columns):
            group = self.groups[i]
            part = _part(group, near)
            values, slopes = part.predict(x)
            residual[i], jacobians[i] = residual[i].copy(), jacobians[i].copy()
            if part is group:
                residual[i], jacobians[i] = group.observed - values, slopes
            else:
                one = self.shared[i] if i < len(self.shared) else None
                left = part.observed - values
                residual[i][near] = left if one is None else one.whole(left, x, near)
                jacobians[i][near] = slopes
        return replace(self, x=x, residual=residual, jacobians=jacobians)


def _by_column(
    groups: Sequence[ObservationGroup], jacobians: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every entry of the Jacobians that is not zero, by its column: column, group, row."""
    columns, of, rows = [], [], []
    for i, (group, jacobian) in enumerate(zip(groups, jacobians, strict=True)):
        row, place = np.nonzero(jacobian)
        columns.append(group.columns[place] if group.columns.ndim == 1 else group.columns[row, place])
        of.append(np.full(len(row), i))
        rows.append(row)
    column = np.concatenate(columns)
    order = np.argsort(column, kind="stable")
    return column[order], np.concatenate(of)[order], np.concatenate(rows)[order]


def _part(group: ObservationGroup, rows: np.ndarray) -> ObservationGroup:
    """Some rows of a group of independent lengths; any other group itself."""
    if group.covariance.ndim != 1 or not isinstance(group, Distances | MovingDistances):
        return group
    m = len(group.observed)
    cut = {
        f.name: value[rows]
        for f in fields(group)
        if isinstance(value := getattr(group, f.name), np.ndarray) and value.ndim and len(value) == m
    }
    return replace(group, **cut)


def search(columns: np.ndarray, meeting: MeetingLines) -> tuple[LocalConflict, tuple[int, ...] | None]:
    """The smallest conflict at a point; where there is none, searched again about the place of the best explanation.

    A wrong range of half a metre carries its point so far that slopes taken there explain nothing to 25 um.
    """
    for _ in range(SEARCHES):
        local = at_point(columns, meeting, slack=SLACK)
        if not 2 <= len(local.rows) <= LARGEST_SEARCH:
            return local, None
        wrong = local.smallest_conflict()
        place = local.likeliest_place()
        if wrong is not None or place is None:
            return local, wrong
        x = meeting.x.copy()
        x[columns] += place
        meeting = meeting.at(x, columns)
    return local, None


def at_point(columns: np.ndarray, meeting: MeetingLines, *, slack: float) -> LocalConflict:
    """What meets in a point: removable observations that depend on it; others, and advice, that depend on it alone."""
    rows: list[tuple[int, int]] = []
    doubted: list[tuple[float, np.ndarray]] = []
    prior: list[tuple[float, np.ndarray]] = []
    for i, near in meeting.rows(columns):
        slope, alone = _slopes(columns, meeting.groups[i].columns, meeting.jacobians[i], near, meeting.settled)
        residual, sigma, may = meeting.residual[i][near], meeting.sigma[i][near], meeting.removable[i][near]
        for k in np.flatnonzero(may):
            doubted.append((residual[k] / (slack * sigma[k]), slope[k] / (slack * sigma[k])))
            rows.append((i, int(near[k])))
        prior += [(residual[k] / sigma[k], slope[k] / sigma[k]) for k in np.flatnonzero(alone & ~may)]
    for i in dict.fromkeys(i for c in columns.tolist() for i in meeting.advice_at.get(c, ())):
        group = meeting.advice[i]
        values, jacobian = group.predict(meeting.x)
        slope, alone = _slopes(columns, group.columns, jacobian, np.arange(len(values)), meeting.settled)
        sigma, residual = np.sqrt(variances(group)), group.observed - values
        prior += [(residual[k] / sigma[k], slope[k] / sigma[k]) for k in np.flatnonzero(alone)]
    (residual, slopes), (prior_residual, prior_slopes) = (
        (np.array([v for v, _ in part]), np.array([a for _, a in part]).reshape(-1, 3)) for part in (doubted, prior)
    )
    return LocalConflict(rows, residual, slopes, prior_residual, prior_slopes)


def _slopes(
    columns: np.ndarray, own: np.ndarray, jacobian: np.ndarray, rows: np.ndarray, settled: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (k, 3) of some rows of a group by a point, and which of them depend on nothing else that is open."""
    at, jacobian = (own if own.ndim == 1 else own[rows]), jacobian[rows]
    here = at[..., None] == columns  # in any order, and perhaps not all three
    known = here.any(axis=-1) | np.isin(at, settled)
    if here.ndim == 2:
        slope, others = jacobian @ here, jacobian[:, ~known]
    else:
        slope, others = np.einsum("mw,mwa->ma", jacobian, here), np.where(known, 0.0, jacobian)
    return slope, np.any(slope != 0.0, axis=1) & ~np.any(others != 0.0, axis=1)


def contradicted(points: Sequence[np.ndarray], meeting: MeetingLines) -> list[np.ndarray]:
    """The points that are far from what is known of each besides its observations, for all that these agree."""
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


def touched(points: Sequence[np.ndarray], meeting: MeetingLines, *, chosen: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The points that the chosen observations depend on."""
    columns = {
        int(c)
        for group, jacobian, rows in zip(meeting.groups, meeting.jacobians, chosen, strict=True)
        if rows.any()
        for c in _columns_of(group, jacobian, rows)
    }
    return [p for p in points if columns.intersection(p.tolist())]


def _columns_of(group: ObservationGroup, jacobian: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Columns that some rows of a group depend on."""
    used = jacobian[rows] != 0.0
    return group.columns[np.any(used, axis=0)] if group.columns.ndim == 1 else group.columns[rows][used]
