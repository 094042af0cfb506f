"""Effect of leaving out observations on all other tests, without a new solution."""

from collections.abc import Sequence

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY, LeastSquaresSolution
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.observations.kinds import ObservationGroup

UNSEEN = 1e-6  # share of a pattern left by the parameters, below which it is rounding
BATCH = 32  # observations per batch
WIDE_BATCH = 250  # the same where all are required


class Influence:
    """Test statistics of an adjustment as observations are left out one by one.

    With P_v = P - P A Q A' P and g = P v over the active rows, an error in observation k adds a parameter to the model;
    without k they are P_v - c c' / c_k and g - c g_k / c_k, c being column k of P_v. That equals the
    adjustment without k, as far as the model is linear.

    Source: [BAARDA68] for w = g / sqrt(diag P_v); bordering a matrix by a row (any textbook of linear algebra).
    """

    def __init__(self, groups: Sequence[ObservationGroup], solution: LeastSquaresSolution):
        """Stack the rows of all groups.

        groups, solution   input and result of `adjust`
        """
        fits = solution.fits
        self._q = solution.q
        self._rows = [ActiveRows.of(g, f.active) for g, f in zip(groups, fits, strict=True)]
        self._designs = [
            np.where(r.active[:, None], r.spread(g.predict(solution.x)[1]), 0.0)
            for r, g in zip(self._rows, groups, strict=True)
        ]
        self.first = np.cumsum([0, *(len(f.active) for f in fits)])
        self.active = np.concatenate([f.active for f in fits])
        self.sigma = np.concatenate([f.sigma for f in fits])
        self.visible = np.concatenate([(NONCENTRALITY / f.detectable_error) ** 2 for f in fits])
        self.weight = np.concatenate([r.own_weight() for r in self._rows])  # diagonal of P
        self.weighed = np.concatenate([f.standardised for f in fits]) * np.sqrt(self.visible)
        self._least = 1e-9 * self.visible
        self._columns: dict[int, np.ndarray] = {}
        self._out = np.zeros((0, len(self.active)))  # columns / root of diagonal, in order

    @property
    def standardised(self) -> np.ndarray:
        """Standardised residual w of every row."""
        return self.weighed / np.sqrt(self.visible)

    @property
    def left_out(self) -> int:
        """Number of rows left out beyond the solution's own."""
        return len(self._out)

    @property
    def detectable(self) -> np.ndarray:
        """Detectable error of every row, as in `GroupFit`."""
        return NONCENTRALITY / np.sqrt(self.visible)

    def leave_out(self, k: int, likely: np.ndarray) -> tuple[np.ndarray, float]:
        """Leave out one more row.

        k        row
        likely   rows that may be left out next; cheaper in one batch

        Returns its column (rows,) of P_v and its P v, each over the root of the column's diagonal.
        """
        if k not in self._columns:
            batch = [k, *(int(j) for j in likely if j != k and j not in self._columns)][:BATCH]
            self._columns.update(zip(batch, self._of(np.array(batch)), strict=True))
        column = self._columns.pop(k) - self._out[:, k] @ self._out
        root = np.sqrt(max(column[k], self._least[k]))
        weighed = float(self.weighed[k] / root)
        self.weighed = self.weighed - column * (self.weighed[k] / root**2)
        self.visible = np.maximum(self.visible - (column / root) ** 2, self._least)
        self.active[k] = False
        self._out = np.concatenate([self._out, (column / root)[None]])
        return column / root, weighed

    def errors_of(self, patterns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Error of each of k patterns (rows, k) in the observations: estimates (k,) and their u (k,).

        Each is estimated by itself, from the solution before any row is left out; patterns are 0 in inactive rows.
        A pattern that the parameters absorb completely has infinite u.
        """
        information = np.sum(patterns * self.through(patterns).T, axis=0)
        usual = np.sum(patterns**2 * self.visible[:, None], axis=0)
        estimable = information > UNSEEN * np.maximum(usual, 1e-300)
        information = np.where(estimable, information, 1.0)
        estimate = np.where(estimable, patterns.T @ self.weighed / information, 0.0)
        return estimate, np.where(estimable, information**-0.5, np.inf)

    def between(self, rows: np.ndarray) -> np.ndarray:
        """P_v (k, k) between some rows, of the solution before any row is left out."""
        batches = np.array_split(rows, max(1, len(rows) // WIDE_BATCH))
        return np.concatenate([self._of(batch)[:, rows] for batch in batches])

    def _of(self, batch: np.ndarray) -> np.ndarray:
        """Columns of P_v of the original solution, one per row."""
        unit = np.zeros((int(self.first[-1]), len(batch)))
        unit[batch, np.arange(len(batch))] = 1.0
        return self.through(unit)

    def through(self, vectors: np.ndarray) -> np.ndarray:
        """P_v times vectors (rows, k), one product per row."""
        unit, pull = self._pulled(vectors)
        moved = self._q.solve(pull)
        columns = []
        for rows, design, one in zip(self._rows, self._designs, unit, strict=True):
            if rows.columns.ndim == 1:
                shift = design @ moved[rows.columns]
            else:
                at = rows.row_columns()
                masked = np.where(at < 0, 0.0, design)
                shift = np.zeros_like(one)
                for j in range(at.shape[1]):
                    shift += masked[:, j : j + 1] * moved[at[:, j]]
            columns.append(one - rows.weigh(shift))
        return np.concatenate(columns).T

    def moved(self, vectors: np.ndarray) -> np.ndarray:
        """Shift (n, k) of the parameters by errors of the observations (rows, k): Q A'P times these."""
        return self._q.solve(self._pulled(vectors)[1])

    def _pulled(self, vectors: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """P times vectors (rows, k), group by group, and A'P times them (n, k)."""
        unit, pull = [], np.zeros((len(self._q.diagonal()), vectors.shape[1]))
        for rows, design, low, high in zip(self._rows, self._designs, self.first, self.first[1:], strict=False):
            one = vectors[low:high]
            if one.any():
                one = rows.weigh(np.where(rows.active[:, None], one, 0.0))
                touched = np.flatnonzero(one.any(axis=1))
                if rows.columns.ndim == 1:
                    pull[rows.columns] += design[touched].T @ one[touched]
                else:
                    at = rows.row_columns()[touched]
                    change = design[touched][:, :, None] * one[touched][:, None]
                    np.add.at(pull, np.maximum(at, 0), np.where(at[..., None] < 0, 0.0, change))
            unit.append(one)
        return unit, pull
