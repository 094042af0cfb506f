"""What leaving out observations does to the tests of all others, from one solution and without another."""

from collections.abc import Sequence

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY, LeastSquaresSolution
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.observations.kinds import ObservationGroup

UNSEEN = 1e-6  # share of a pattern that the parameters leave, below which it is rounding
AT_ONCE = 32  # observations whose influence is computed together


class Influence:
    """The tests of an adjustment's observations while some are left out, one after the other.

    With P_v = P - P A Q A' P and g = P v over the active rows, an error in observation k adds a parameter to the model;
    without k they are P_v - c c' / c_k and g - c g_k / c_k, c being column k of P_v. That is what the adjustment
    without k would give, as far as the model is linear.

    Source: [BAARDA68] for w = g / sqrt(diag P_v); bordering a matrix by a row, as any book of linear algebra has it.
    """

    def __init__(self, groups: Sequence[ObservationGroup], solution: LeastSquaresSolution):
        """All rows of all groups, one after the other.

        groups, solution   as `adjust` took and gave them
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
        self.weighed = np.concatenate([f.standardised for f in fits]) * np.sqrt(self.visible)
        self._least = 1e-9 * self.visible
        self._columns: dict[int, np.ndarray] = {}
        self._out = np.zeros((0, len(self.active)))  # columns over the roots of their own element, as they left

    @property
    def standardised(self) -> np.ndarray:
        """Standardised residual w of every row."""
        return self.weighed / np.sqrt(self.visible)

    @property
    def left_out(self) -> int:
        """How many rows are left out beyond the solution's own."""
        return len(self._out)

    @property
    def detectable(self) -> np.ndarray:
        """The smallest error of every row that its test finds, as in `GroupFit`."""
        return NONCENTRALITY / np.sqrt(self.visible)

    def leave_out(self, k: int, likely: np.ndarray) -> None:
        """One more row without which the tests are.

        likely   rows that may be asked for next; they cost little together
        """
        if k not in self._columns:
            wanted = [k, *(int(j) for j in likely if j != k and j not in self._columns)][:AT_ONCE]
            self._columns.update(zip(wanted, self._of(np.array(wanted)), strict=True))
        column = self._columns.pop(k) - self._out[:, k] @ self._out
        root = np.sqrt(max(column[k], self._least[k]))
        self.weighed = self.weighed - column * (self.weighed[k] / root**2)
        self.visible = np.maximum(self.visible - (column / root) ** 2, self._least)
        self.active[k] = False
        self._out = np.concatenate([self._out, (column / root)[None]])

    def errors_of(self, patterns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """An error of each of k patterns (rows, k) in the observations, by itself: estimate (k,) and its u (k,).

        Of the solution itself, before any row is left out; patterns are 0 in inactive rows. What the parameters take up
        wholly has an infinite u.
        """
        seen = np.sum(patterns * self._through(patterns).T, axis=0)
        usual = np.sum(patterns**2 * self.visible[:, None], axis=0)
        shown = seen > UNSEEN * np.maximum(usual, 1e-300)
        seen = np.where(shown, seen, 1.0)
        estimate = np.where(shown, patterns.T @ self.weighed / seen, 0.0)
        return estimate, np.where(shown, seen**-0.5, np.inf)

    def _of(self, wanted: np.ndarray) -> np.ndarray:
        """Columns of P_v of the solution itself, a row each."""
        unit = np.zeros((int(self.first[-1]), len(wanted)))
        unit[wanted, np.arange(len(wanted))] = 1.0
        return self._through(unit)

    def _through(self, vectors: np.ndarray) -> np.ndarray:
        """P_v times vectors (rows, k), a row each."""
        unit, right = [], np.zeros((len(self._q.diagonal()), vectors.shape[1]))
        for rows, design, low, high in zip(self._rows, self._designs, self.first, self.first[1:], strict=False):
            one = vectors[low:high]
            if one.any():
                one = rows.weigh(np.where(rows.active[:, None], one, 0.0))
                touched = np.flatnonzero(one.any(axis=1))
                if rows.columns.ndim == 1:
                    right[rows.columns] += design[touched].T @ one[touched]
                else:
                    at = rows.row_columns()[touched]
                    pull = design[touched][:, :, None] * one[touched][:, None]
                    np.add.at(right, np.maximum(at, 0), np.where(at[..., None] < 0, 0.0, pull))
            unit.append(one)
        moved = self._q.solve(right)
        columns = []
        for rows, design, one in zip(self._rows, self._designs, unit, strict=True):
            if rows.columns.ndim == 1:
                shift = design @ moved[rows.columns]
            else:
                at = rows.row_columns()
                held = np.where(at < 0, 0.0, design)
                shift = np.zeros_like(one)
                for j in range(at.shape[1]):
                    shift += held[:, j : j + 1] * moved[at[:, j]]
            columns.append(one - rows.weigh(shift))
        return np.concatenate(columns).T
