"""Observation rows of one group, whitened by the Cholesky factor of their covariance."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.observations.kinds import ObservationGroup


def shared(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sorted distinct columns (k,) of rows (m, w), and each entry's index among them (k: none)."""
    distinct, position = np.unique(columns, return_inverse=True)
    position = position.reshape(columns.shape)
    if len(distinct) and distinct[0] < 0:
        return distinct[1:], np.where(columns < 0, len(distinct) - 1, position - 1)
    return distinct, position


def dense_jacobian(jacobian: np.ndarray, position: np.ndarray, width: int) -> np.ndarray:
    """Jacobian (m, w) over each row's own columns as (m, width) over shared ones.

    Repeats add up.
    """
    m = len(jacobian)
    flat = (np.arange(m)[:, None] * (width + 1) + position).ravel()
    return np.bincount(flat, jacobian.ravel(), m * (width + 1)).reshape(m, width + 1)[:, :width]


def full_jacobian(group: ObservationGroup, x: np.ndarray) -> np.ndarray:
    """Derivatives (m, n) of a group by all n parameters."""
    jacobian = group.predict(x)[1]
    columns = np.broadcast_to(group.columns, jacobian.shape)
    return dense_jacobian(jacobian, np.where(columns < 0, len(x), columns), len(x))


def variances(group: ObservationGroup) -> np.ndarray:
    """Variances (m,) of the observed values."""
    c = group.covariance
    return c if c.ndim == 1 else np.diag(c) if c.ndim == 2 else np.diagonal(c, axis1=1, axis2=2).ravel()


@dataclass(frozen=True, eq=False)
class ActiveRows:
    """Active observation rows of a group.

    group       the observation group
    active      (m,) bool; inactive rows stay in place with zeros, so that blocks keep their shape
    factor      root of variances (m,), Cholesky factors (m, m) or (b, r, r) without the inactive rows
    weight      (m,) 1 for active rows, 0 for others
    position    index of each row's columns among the shared ones, for groups with one covariance matrix; or None
    columns     (k,) shared; or (m, w) of independent rows, or (b, r w) of blocks
    """

    group: ObservationGroup
    active: np.ndarray
    factor: np.ndarray
    weight: np.ndarray
    position: np.ndarray | None
    columns: np.ndarray

    @classmethod
    def of(
        cls,
        group: ObservationGroup,
        active: np.ndarray | None = None,
        extra: np.ndarray | None = None,
        inflation: np.ndarray | None = None,
    ) -> "ActiveRows":
        """Rows of a group.

        EstimationError if the active ones' covariance is not positive definite.

        active      (m,) bool, all if None
        extra       (m,) added to the variances
        inflation   (m,) factor on the standard uncertainties; correlations are unchanged
        """
        m = len(group.observed)
        chosen = np.ones(m, dtype=bool) if active is None else np.asarray(active, dtype=bool)
        covariance, more = group.covariance, np.zeros(m) if extra is None else extra
        if inflation is not None:
            f = np.where(chosen, inflation, 1.0).reshape(covariance.shape[: max(1, covariance.ndim - 1)])
            covariance = covariance * (f**2 if covariance.ndim == 1 else f[..., :, None] * f[..., None, :])
        try:
            if covariance.ndim == 1:
                variance = covariance + more
                if not np.all(variance[chosen] > 0.0):
                    raise np.linalg.LinAlgError
                factor = np.sqrt(np.where(chosen, variance, 1.0))
            else:
                b, r = (1, m) if covariance.ndim == 2 else covariance.shape[:2]
                on = chosen.reshape(b, r)
                matrix = np.where(on[:, :, None] & on[:, None, :], covariance.reshape(b, r, r), 0.0)
                matrix[:, np.arange(r), np.arange(r)] += np.where(on, more.reshape(b, r), 1.0)
                factor = np.linalg.cholesky(matrix).reshape(covariance.shape)
        except np.linalg.LinAlgError:
            raise EstimationError(
                f"{group.name}: the covariance of its {int(chosen.sum())} observations is not positive definite; "
                "a sigma is zero or two observations repeat each other"
            ) from None
        position, columns = None, group.columns
        if covariance.ndim == 2 and columns.ndim == 2:
            columns, position = shared(columns)
        elif covariance.ndim == 3 and columns.ndim == 2:
            columns = columns.reshape(len(covariance), -1)
        return cls(
            group=group, active=chosen, factor=factor, weight=chosen.astype(float), position=position, columns=columns
        )

    def whiten(self, a: np.ndarray) -> np.ndarray:
        """L^-1 a for (m,) or (m, k)."""
        if self.factor.ndim == 1:
            return a / (self.factor if a.ndim == 1 else self.factor[:, None])
        if self.factor.ndim == 2:
            return solve_triangular(self.factor, a, lower=True, check_finite=False)
        inside = a.reshape(*self.factor.shape[:2], -1)
        return np.linalg.solve(self.factor, inside).reshape(a.shape)

    def cost(self, x: np.ndarray) -> float:
        """Sum of squares of the whitened residuals."""
        v = (self.group.observed - self.group.predict(x)[0]) * self.weight
        return float(np.sum(self.whiten(np.where(self.active, v, 0.0)) ** 2))

    def linear(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whitened residuals (m,) and Jacobian over `self.columns`."""
        values, jacobian = self.group.predict(x)
        v = self.whiten(np.where(self.active, self.group.observed - values, 0.0))
        return v, self.whiten(self.spread(np.where(self.active[:, None], jacobian, 0.0)))

    def spread(self, jacobian: np.ndarray) -> np.ndarray:
        """Jacobian over `self.columns`, one row per observation."""
        if self.position is not None:
            return dense_jacobian(jacobian, self.position, len(self.columns))
        if self.factor.ndim == 3 and self.columns.ndim == 2:
            b, r = self.factor.shape[:2]
            w = jacobian.shape[1]
            wide = np.zeros((b, r, r, w))
            wide[:, np.arange(r), np.arange(r)] = jacobian.reshape(b, r, w)
            return wide.reshape(b * r, r * w)
        return jacobian

    def row_columns(self) -> np.ndarray:
        """Columns (m, w) of every row."""
        m = len(self.active)
        if self.columns.ndim == 1:
            return np.broadcast_to(self.columns, (m, len(self.columns)))
        return self.columns if len(self.columns) == m else np.repeat(self.columns, self.factor.shape[1], axis=0)

    def products(self, q: Covariance, a: np.ndarray, chosen: np.ndarray | None = None) -> np.ndarray:
        """Q a' for each row of a, over `self.columns` or its row's columns.

        chosen   rows; all if None
        """
        if self.columns.ndim == 1:
            return a @ q.within(self.columns)
        columns = self.row_columns()
        return q.products(columns if chosen is None else columns[chosen], a)

    def weigh(self, a: np.ndarray) -> np.ndarray:
        """C^-1 a for (m,) or (m, k), over the active rows."""
        white = self.whiten(a)
        if self.factor.ndim == 1:
            return white / (self.factor if a.ndim == 1 else self.factor[:, None])
        if self.factor.ndim == 2:
            return solve_triangular(self.factor, white, lower=True, trans=1, check_finite=False)
        inside = white.reshape(*self.factor.shape[:2], -1)
        return np.linalg.solve(self.factor.transpose(0, 2, 1), inside).reshape(a.shape)

    def own_weight(self) -> np.ndarray:
        """Diagonal (m,) of C^-1 over the active rows.

        1 for inactive ones.
        """
        if self.factor.ndim == 1:
            return 1.0 / self.factor**2
        if self.factor.ndim == 2:
            white = solve_triangular(self.factor, np.eye(len(self.factor)), lower=True, check_finite=False)
            return np.sum(white**2, axis=0)
        return np.sum(np.linalg.inv(self.factor) ** 2, axis=1).ravel()

    def prediction(self, out: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
        """Gain (o, m) that predicts left-out rows from active residuals, and remaining variance (o,).

        The gain is None for independent rows.
        """
        c = self.group.covariance
        if c.ndim == 1:
            return None, c[out]
        m = len(self.active)
        cross = np.zeros((len(out), m))
        if c.ndim == 2:
            cross[:] = c[out]
        else:
            r = c.shape[1]
            at = (out // r)[:, None] * r + np.arange(r)
            np.put_along_axis(cross, at, c[out // r, out % r], axis=1)
        cross[:, ~self.active] = 0.0
        gain = self.weigh(np.ascontiguousarray(cross.T)).T
        return gain, variances(self.group)[out] - np.sum(gain * cross, axis=1)
