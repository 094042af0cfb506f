"""Covariances of all parameters, dense or sparse, behind one face: only what is asked for is computed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array, sparray

from catseye.errors import EstimationError

LARGEST_MATRIX = 12_000  # parameters: a full matrix of more takes over a gigabyte
SOLVED = 100  # points whose block is solved for at once, where the factor's pattern does not hold it; or looked at


class Covariance(Protocol):
    """Covariance of n parameters; rows and columns of held ones are zero."""

    def matrix(self) -> np.ndarray:
        """All of it, (n, n); EstimationError where that is too large."""
        ...

    def across(self, columns: np.ndarray) -> np.ndarray:
        """(n, k) of all parameters with some."""
        ...

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        """(m, w) sum over j of Q_ij a_j for each row of columns, a (m, w), which meet in one observation."""
        ...

    def within(self, columns: np.ndarray) -> np.ndarray:
        """(k, k) of some parameters."""
        ...

    def blocks(self, first: np.ndarray) -> np.ndarray:
        """(k, 3, 3) of the triples of parameters that begin at `first` (k,)."""
        ...

    def diagonal(self) -> np.ndarray:
        """The variances of all parameters, (n,)."""
        ...

    def solve(self, b: np.ndarray) -> np.ndarray:
        """The covariance times b, (n,) or (n, k)."""
        ...

    def carried(self, matrix: sparray, others: sparray | None = None) -> np.ndarray:
        """(k, k) covariance of k combinations of parameters, the rows of a sparse matrix (k, n); or (k, m) with m."""
        ...


@dataclass(frozen=True, eq=False)
class Dense:
    """A covariance held whole."""

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

    def carried(self, matrix: sparray, others: sparray | None = None) -> np.ndarray:
        return np.asarray(matrix @ ((matrix if others is None else others) @ self.full).T)


@dataclass(frozen=True, eq=False)
class Sparse:
    """The inverse of a sparse normal matrix, held on the pattern of its factor; the rest is solved for when asked.

    size          n, all parameters
    place         (n,) where each stands in the factor, -1 where held
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
        moving = self.place >= 0
        at = self.place[moving]
        inside[at] = b[moving] * self.scale[at][:, None]
        solve(self.lp, self.li, self.lx, self.d, inside)
        result = np.zeros_like(b)
        result[moving] = inside[at] * self.scale[at][:, None]
        return result

    def carried(self, matrix: sparray, others: sparray | None = None) -> np.ndarray:
        return np.asarray(matrix @ self.solve((matrix if others is None else others).T.toarray()))

    def across(self, columns: np.ndarray) -> np.ndarray:
        unit = np.zeros((self.size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        return self.solve(unit)

    def within(self, columns: np.ndarray) -> np.ndarray:
        return self.across(columns)[columns]

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
        loose = np.flatnonzero(np.isnan(result).any(axis=(1, 2)))  # axes of a point that no observation joins
        for part in np.split(loose, np.arange(SOLVED, len(loose), SOLVED)):
            if len(part):
                own = self.within(at[part].ravel()).reshape(len(part), 3, len(part), 3)
                result[part] = own[np.arange(len(part)), :, np.arange(len(part))]
        return result

    def diagonal(self) -> np.ndarray:
        result = np.zeros(self.size)
        moving = self.place >= 0
        at = self.place[moving]
        result[moving] = self._selected[1][at] * self.scale[at] ** 2
        return result


@dataclass(frozen=True, eq=False)
class Transformed:
    """A covariance carried to another datum: S Q S' with S = 1 - T G, an S-transformation ([BAARDA73]).

    inner   Q, of any datum that holds what floats
    t       (n, d) = H (G H)^-1, with H the motions that float
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

    def carried(self, matrix: sparray, others: sparray | None = None) -> np.ndarray:
        return np.asarray(matrix @ self.solve((matrix if others is None else others).T.toarray()))

    def diagonal(self) -> np.ndarray:
        low_rank = 2.0 * np.sum(self.t * self.b, axis=1) - np.einsum("nd,de,ne->n", self.t, self.c, self.t)
        return self.inner.diagonal() - low_rank


@dataclass(frozen=True, eq=False)
class Widened:
    """A covariance and what else is considered: Q + R R'.

    inner   Q
    reach   (n, d): what all parameters move by, for one standard uncertainty of each thing considered
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
        both = np.einsum("mw,mwd->md", np.where(columns < 0, 0.0, a), part)
        return self.inner.products(columns, a) + np.einsum("mwd,md->mw", part, both)

    def blocks(self, first: np.ndarray) -> np.ndarray:
        part = self.reach[first[:, None] + np.arange(3)]
        return self.inner.blocks(first) + np.einsum("kid,kjd->kij", part, part)

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.asarray(self.inner.solve(b) + self.reach @ (self.reach.T @ b))

    def carried(self, matrix: sparray, others: sparray | None = None) -> np.ndarray:
        moved = np.asarray(matrix @ self.reach)
        also = moved if others is None else np.asarray(others @ self.reach)
        return _widened(self.inner.carried(matrix, others), moved, also)

    def diagonal(self) -> np.ndarray:
        return self.inner.diagonal() + np.sum(self.reach**2, axis=1)


def _held_whole(q: Covariance) -> bool:
    return isinstance(q, Dense) or (isinstance(q, Widened) and _held_whole(q.inner))


@dataclass(frozen=True, eq=False)
class JointPoints:
    """The joint covariance of p points, of which only what is asked for is computed.

    q         of all parameters
    columns   (p, 3) of the points' coordinates
    """

    q: Covariance
    columns: np.ndarray

    @staticmethod
    def of(q: Covariance, columns: np.ndarray) -> "JointPoints":
        """Of some parameters; a covariance that is whole is cut to them."""
        if not _held_whole(q):
            return JointPoints(q, columns)
        return JointPoints(Dense(q.within(columns.ravel())), np.arange(columns.size).reshape(columns.shape))

    def matrix(self) -> np.ndarray:
        """(3p, 3p), x y z point by point; EstimationError where that is too large."""
        self.check_size()
        return self.block(np.arange(len(self.columns)))

    def check_size(self) -> None:
        """Raise EstimationError where the matrix would be too large."""
        if self.columns.size > LARGEST_MATRIX:
            raise EstimationError(
                f"the full covariance of {len(self.columns)} points takes {8e-9 * self.columns.size**2:.0f} GB "
                f"(limit {LARGEST_MATRIX // 3} points); ask for the blocks of single points"
            )

    def block(self, rows: np.ndarray) -> np.ndarray:
        """(3k, 3k) of some points."""
        return self.q.within(self.columns[rows].ravel())

    def held(self) -> "JointPoints":
        """The same with all its matrix at hand, for who asks for much of it; itself where that would be too large."""
        if isinstance(self.q, Dense) or self.columns.size > LARGEST_MATRIX:
            return self
        return JointPoints(Dense(self.matrix()), np.arange(self.columns.size).reshape(-1, 3))

    def times(self, a: np.ndarray) -> np.ndarray:
        """(3p, k) the points' covariance times a (3p, k)."""
        own = self.columns.ravel()
        right = np.zeros((len(self.q.diagonal()), a.shape[1]))
        right[own] = a
        return self.q.solve(right)[own]

    def of_points(self, rows: np.ndarray) -> "JointPoints":
        """The joint covariance of some of the points."""
        return JointPoints(self.q, self.columns[rows])

    def between(self, some: np.ndarray, others: np.ndarray) -> np.ndarray:
        """(3k, 3m) of some points with others."""
        if isinstance(self.q, Dense):
            return self.q.full[np.ix_(self.columns[some].ravel(), self.columns[others].ravel())]
        return self.q.carried(self._picked(some), self._picked(others))

    def _picked(self, some: np.ndarray) -> csr_array:
        """(3k, n) that takes some points' coordinates out of all parameters."""
        k = 3 * len(some)
        at = (np.arange(k), self.columns[some].ravel())
        return csr_array((np.ones(k), at), shape=(k, len(self.q.diagonal())))

    @cached_property
    def blocks(self) -> np.ndarray:
        """(p, 3, 3) of each point."""
        return self.q.blocks(self.columns[:, 0])

    @property
    def u(self) -> np.ndarray:
        """(p, 3) standard uncertainties of the coordinates."""
        return np.asarray(np.sqrt(np.maximum(np.diagonal(self.blocks, axis1=1, axis2=2), 0.0)))

    def along(self, rows: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(k, k) of some points' components along directions (k, 3)."""
        k = len(rows)
        if isinstance(self.q, Dense):
            parts = (slice(low, low + SOLVED) for low in range(0, k, SOLVED))
            return np.concatenate([_combined(self.between(rows[part], rows), directions, part) for part in parts])
        at = (np.repeat(np.arange(k), 3), self.columns[rows].ravel())
        return self.q.carried(csr_array((np.ravel(directions), at), shape=(k, len(self.q.diagonal()))))


def _widened(q: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """q + a b', without another matrix of its size; a q that nobody else has is written over."""
    total = q if q.flags.owndata and q.flags.writeable else q.copy()
    for k in range(0, len(total), SOLVED):
        total[k : k + SOLVED] += a[k : k + SOLVED] @ b.T
    return total


def _combined(q: np.ndarray, directions: np.ndarray, part: slice) -> np.ndarray:
    """(c, k) of some points' components with all, from their rows (3c, 3k)."""
    seen = np.einsum("rmj,mj->rm", q.reshape(len(q), -1, 3), directions)
    return np.asarray(np.einsum("ci,cim->cm", directions[part], seen.reshape(-1, 3, len(directions))))
