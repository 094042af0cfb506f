"""Covariance of all parameters, dense or sparse, through one protocol.

Only the requested blocks are computed.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array, sparray

from catseye.errors import EstimationError

LARGEST_MATRIX = 12_000  # parameters; a larger full matrix takes over a gigabyte
SOLVED = 100  # points per batch, of blocks outside the factor's pattern or of products


class Covariance(Protocol):
    """Covariance of n parameters.

    Rows and columns of fixed ones are zero.
    """

    def matrix(self) -> np.ndarray:
        """Full matrix (n, n); EstimationError if it is too large."""
        ...

    def across(self, columns: np.ndarray) -> np.ndarray:
        """Columns (n, k): all parameters with selected ones."""
        ...

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Products (m, w): sum over j of Q_ij a_j for each row of columns.

        a is (m, w); the columns of a row meet in one observation.
        """
        ...

    def within(self, columns: np.ndarray) -> np.ndarray:
        """Block (k, k) of selected parameters."""
        ...

    def blocks(self, first: np.ndarray) -> np.ndarray:
        """Blocks (k, 3, 3) of the parameter triples that begin at `first` (k,)."""
        ...

    def diagonal(self) -> np.ndarray:
        """Variances (n,) of all parameters."""
        ...

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Covariance times b, (n,) or (n, k)."""
        ...

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        """Covariance (k, k) of k linear combinations of the parameters.

        matrix          (k, n) sparse, a combination per row
        other_matrix    (m, n) sparse; given it, the cross-covariance (k, m)
        """
        ...


@dataclass(frozen=True, eq=False)
class Dense:
    """Covariance stored as a full matrix."""

    full: np.ndarray

    def matrix(self) -> np.ndarray:
        return self.full

    def across(self, columns: np.ndarray) -> np.ndarray:
        return self.full[:, columns]

    def within(self, columns: np.ndarray) -> np.ndarray:
        return self.full[np.ix_(columns, columns)]

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        at, a = np.maximum(columns, 0), np.where(columns < 0, 0.0, a)
        result = np.empty(at.shape)
        step = max(1, 2_000_000 // max(1, at.shape[1] ** 2))
        for low in range(0, len(at), step):
            part = slice(low, low + step)
            inside = self.full[at[part, :, None], at[part, None, :]]
            result[part] = (inside @ a[part, :, None])[:, :, 0]
        return result

    def blocks(self, first: np.ndarray) -> np.ndarray:
        at = first[:, None] + np.arange(3)
        return self.full[at[:, :, None], at[:, None, :]]

    def diagonal(self) -> np.ndarray:
        return np.diag(self.full)

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.asarray(self.full @ b)

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        return np.asarray(matrix @ ((matrix if other_matrix is None else other_matrix) @ self.full).T)


@dataclass(frozen=True, eq=False)
class Sparse:
    """Inverse of a sparse normal matrix, stored on the pattern of its factor.

    The remainder is solved for on request.

    size          n, all parameters
    place         (n,) index of each in the factor, -1 if fixed
    scale         (k,) of the scaled matrix, in the factor's order
    lp, li, lx, d the factor, see `sparse_kernel`
    """

    size: int
    place: np.ndarray
    scale: np.ndarray
    lp: np.ndarray
    li: np.ndarray
    lx: np.ndarray
    d: np.ndarray

    @cached_property
    def _selected(self) -> tuple[np.ndarray, np.ndarray]:
        from catseye.estimation.least_squares.sparse_kernel import selected_inverse

        return selected_inverse(self.lp, self.li, self.lx, self.d)

    def matrix(self) -> np.ndarray:
        if self.size > LARGEST_MATRIX:
            raise EstimationError(
                f"the full covariance of {self.size} parameters takes {8e-9 * self.size**2:.0f} GB "
                f"(limit {LARGEST_MATRIX} parameters); ask for the blocks of single points"
            )
        return self.across(np.arange(self.size))

    def solve(self, b: np.ndarray) -> np.ndarray:
        if b.ndim == 1:
            return self.solve(b[:, None])[:, 0]
        from catseye.estimation.least_squares.sparse_kernel import solve

        inside = np.zeros((len(self.scale), b.shape[1]))
        free = self.place >= 0
        at = self.place[free]
        inside[at] = b[free] * self.scale[at][:, None]
        solve(self.lp, self.li, self.lx, self.d, inside)
        result = np.zeros_like(b)
        result[free] = inside[at] * self.scale[at][:, None]
        return result

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        return np.asarray(matrix @ self.solve((matrix if other_matrix is None else other_matrix).T.toarray()))

    def across(self, columns: np.ndarray) -> np.ndarray:
        unit = np.zeros((self.size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        return self.solve(unit)

    def within(self, columns: np.ndarray) -> np.ndarray:
        from catseye.estimation.least_squares.sparse_kernel import solve_units

        free = np.flatnonzero(self.place[columns] >= 0)
        at = self.place[columns[free]]
        result = np.zeros((len(columns), len(columns)))
        solved = solve_units(self.lp, self.li, self.lx, self.d, at, self.scale[at])
        result[np.ix_(free, free)] = solved * self.scale[at][:, None]
        return result

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        from catseye.estimation.least_squares.sparse_kernel import products

        z, diagonal = self._selected
        at = np.where(columns < 0, -1, self.place[columns])
        scale = np.where(at < 0, 0.0, self.scale[at])
        return scale * products(self.lp, self.li, z, diagonal, at, a * scale)

    def blocks(self, first: np.ndarray) -> np.ndarray:
        at = first[:, None] + np.arange(3)
        units = [np.tile(row, (len(at), 1)) for row in np.eye(3)]
        result = np.stack([self.products(at, unit) for unit in units], axis=2)
        missing = np.flatnonzero(np.isnan(result).any(axis=(1, 2)))  # axes of a point that no observation has in common
        for part in np.split(missing, np.arange(SOLVED, len(missing), SOLVED)):
            if len(part):
                local = self.within(at[part].ravel()).reshape(len(part), 3, len(part), 3)
                result[part] = local[np.arange(len(part)), :, np.arange(len(part))]
        return result

    def diagonal(self) -> np.ndarray:
        result = np.zeros(self.size)
        free = self.place >= 0
        at = self.place[free]
        result[free] = self._selected[1][at] * self.scale[at] ** 2
        return result


@dataclass(frozen=True, eq=False)
class Transformed:
    """Covariance transformed to another datum: S Q S' with S = 1 - T G, an S-transformation ([BAARDA73]).

    inner   Q, in any datum that fixes the null space
    t       (n, d) = H (G H)^-1, with H the datum motions (null space)
    b       (n, d) = Q G'
    c       (d, d) = G Q G'
    """

    inner: Covariance
    t: np.ndarray
    b: np.ndarray
    c: np.ndarray

    def matrix(self) -> np.ndarray:
        cross = self.t @ self.b.T
        return self.inner.matrix() - cross - cross.T + self.t @ self.c @ self.t.T

    def across(self, columns: np.ndarray) -> np.ndarray:
        t, b = self.t[columns], self.b[columns]
        return self.inner.across(columns) - self.t @ b.T - self.b @ t.T + self.t @ (self.c @ t.T)

    def within(self, columns: np.ndarray) -> np.ndarray:
        t, b = self.t[columns], self.b[columns]
        cross = t @ b.T
        return self.inner.within(columns) - cross - cross.T + t @ self.c @ t.T

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        a = np.where(columns < 0, 0.0, a)
        t, b = self.t[columns], self.b[columns]
        at, ab = (np.einsum("mw,mwd->md", a, part) for part in (t, b))
        low_rank = np.einsum("mwd,md->mw", t, ab - at @ self.c) + np.einsum("mwd,md->mw", b, at)
        return self.inner.products(columns, a) - low_rank

    def blocks(self, first: np.ndarray) -> np.ndarray:
        at = first[:, None] + np.arange(3)
        t, b = self.t[at], self.b[at]
        cross = np.einsum("kid,kjd->kij", t, b)
        inside = np.einsum("kid,de,kje->kij", t, self.c, t)
        return self.inner.blocks(first) - cross - cross.transpose(0, 2, 1) + inside

    def solve(self, b: np.ndarray) -> np.ndarray:
        at, ab = self.t.T @ b, self.b.T @ b
        return np.asarray(self.inner.solve(b) - self.t @ (ab - self.c @ at) - self.b @ at)

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        return np.asarray(matrix @ self.solve((matrix if other_matrix is None else other_matrix).T.toarray()))

    def diagonal(self) -> np.ndarray:
        low_rank = 2.0 * np.sum(self.t * self.b, axis=1) - np.einsum("nd,de,ne->n", self.t, self.c, self.t)
        return self.inner.diagonal() - low_rank


@dataclass(frozen=True, eq=False)
class Widened:
    """Covariance with considered effects added: Q + R R'.

    inner   Q
    reach   (n, d): shift of all parameters for one standard uncertainty of each considered effect
    """

    inner: Covariance
    reach: np.ndarray

    def matrix(self) -> np.ndarray:
        return self.inner.matrix() + self.reach @ self.reach.T

    def across(self, columns: np.ndarray) -> np.ndarray:
        return self.inner.across(columns) + self.reach @ self.reach[columns].T

    def within(self, columns: np.ndarray) -> np.ndarray:
        return _widened(self.inner.within(columns), self.reach[columns], self.reach[columns])

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        part = np.where((columns < 0)[..., None], 0.0, self.reach[columns])
        combined = np.einsum("mw,mwd->md", np.where(columns < 0, 0.0, a), part)
        return self.inner.products(columns, a) + np.einsum("mwd,md->mw", part, combined)

    def blocks(self, first: np.ndarray) -> np.ndarray:
        part = self.reach[first[:, None] + np.arange(3)]
        return self.inner.blocks(first) + np.einsum("kid,kjd->kij", part, part)

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.asarray(self.inner.solve(b) + self.reach @ (self.reach.T @ b))

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        shift = np.asarray(matrix @ self.reach)
        other_shift = shift if other_matrix is None else np.asarray(other_matrix @ self.reach)
        return _widened(self.inner.carried(matrix, other_matrix), shift, other_shift)

    def diagonal(self) -> np.ndarray:
        return self.inner.diagonal() + np.sum(self.reach**2, axis=1)


def _is_dense(q: Covariance) -> bool:
    return isinstance(q, Dense) or (isinstance(q, Widened) and _is_dense(q.inner))


@dataclass(frozen=True, eq=False)
class JointPoints:
    """Joint covariance of p points, computed block by block on request.

    q         of all parameters
    columns   (p, 3) of the points' coordinates
    """

    q: Covariance
    columns: np.ndarray

    @staticmethod
    def of(q: Covariance, columns: np.ndarray) -> "JointPoints":
        """Joint covariance of selected parameters.

        A dense one is cut to them.
        """
        if not _is_dense(q):
            return JointPoints(q, columns)
        return JointPoints(Dense(q.within(columns.ravel())), np.arange(columns.size).reshape(columns.shape))

    def matrix(self) -> np.ndarray:
        """Full matrix (3p, 3p), x y z point by point.

        EstimationError if it is too large.
        """
        self.check_size()
        return self.block(np.arange(len(self.columns)))

    def check_size(self) -> None:
        """Raise EstimationError if the full matrix would be too large."""
        if self.columns.size > LARGEST_MATRIX:
            raise EstimationError(
                f"the full covariance of {len(self.columns)} points takes {8e-9 * self.columns.size**2:.0f} GB "
                f"(limit {LARGEST_MATRIX // 3} points); ask for the blocks of single points"
            )

    def block(self, rows: np.ndarray) -> np.ndarray:
        """Block (3k, 3k) of selected points."""
        return self.q.within(self.columns[rows].ravel())

    def held(self) -> "JointPoints":
        """Dense copy, for many requests.

        Returns itself if a dense one would be too large.
        """
        if isinstance(self.q, Dense) or self.columns.size > LARGEST_MATRIX:
            return self
        return JointPoints(Dense(self.matrix()), np.arange(self.columns.size).reshape(-1, 3))

    def times(self, a: np.ndarray) -> np.ndarray:
        """The points' covariance times a (3p, k)."""
        columns = self.columns.ravel()
        right = np.zeros((len(self.q.diagonal()), a.shape[1]))
        right[columns] = a
        return self.q.solve(right)[columns]

    def of_points(self, rows: np.ndarray) -> "JointPoints":
        """Joint covariance of selected points."""
        return JointPoints(self.q, self.columns[rows])

    def between(self, rows: np.ndarray, other_rows: np.ndarray) -> np.ndarray:
        """Cross-covariance (3k, 3m) of selected points with others."""
        if isinstance(self.q, Dense):
            return self.q.full[np.ix_(self.columns[rows].ravel(), self.columns[other_rows].ravel())]
        return self.q.carried(self._selection(rows), self._selection(other_rows))

    def _selection(self, rows: np.ndarray) -> csr_array:
        """Selection matrix (3k, n) of the points' coordinates among all parameters."""
        k = 3 * len(rows)
        at = (np.arange(k), self.columns[rows].ravel())
        return csr_array((np.ones(k), at), shape=(k, len(self.q.diagonal())))

    @cached_property
    def blocks(self) -> np.ndarray:
        """Covariance blocks (p, 3, 3), one per point."""
        return self.q.blocks(self.columns[:, 0])

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (p, 3) of the coordinates."""
        return np.asarray(np.sqrt(np.maximum(np.diagonal(self.blocks, axis1=1, axis2=2), 0.0)))

    def along(self, rows: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Covariance (k, k) of selected points' components along directions (k, 3)."""
        k = len(rows)
        if isinstance(self.q, Dense):
            parts = (slice(low, low + SOLVED) for low in range(0, k, SOLVED))
            return np.concatenate([_combined(self.between(rows[part], rows), directions, part) for part in parts])
        at = (np.repeat(np.arange(k), 3), self.columns[rows].ravel())
        return self.q.carried(csr_array((np.ravel(directions), at), shape=(k, len(self.q.diagonal()))))


def _widened(q: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """q + a b', without a temporary matrix of its size.

    A q that owns its memory is overwritten.
    """
    total = q if q.flags.owndata and q.flags.writeable else q.copy()
    for k in range(0, len(total), SOLVED):
        total[k : k + SOLVED] += a[k : k + SOLVED] @ b.T
    return total


def _combined(q: np.ndarray, directions: np.ndarray, part: slice) -> np.ndarray:
    """Covariance (c, k) of selected components with all, from their rows (3c, 3k)."""
    projected = np.einsum("rmj,mj->rm", q.reshape(len(q), -1, 3), directions)
    return np.asarray(np.einsum("ci,cim->cm", directions[part], projected.reshape(-1, 3, len(directions))))
