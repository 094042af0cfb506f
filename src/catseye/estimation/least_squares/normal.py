"""Normal equations of groups of observations, dense or sparse: one step, what floats, and the covariance.

Rank is judged on the Jacobian with its columns scaled to unit length, not on the normal matrix alone: a direction v
floats when |A v|^2 < FLOATS |v|^2. Units and sizes of sigmas cancel there, and the square is taken after the product,
so that rounding (1e-16 |A|)^2 stays far below the limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, lapack
from scipy.sparse import csc_array, csr_array

from catseye.estimation.least_squares.bordered import Border, BorderedCovariance
from catseye.estimation.least_squares.covariance import Covariance, Dense, Sparse
from catseye.estimation.least_squares.rows import ActiveRows

FLOATS = 1e-15  # |A v|^2 / |v|^2: correlation of one parameter with all others within 5e-16 of 1
DOUBTFUL = 1e-10  # reciprocal condition of the scaled normal matrix from which directions are examined one by one
LARGEST_DENSE = 2000  # parameters; beyond it the sparse form is faster and smaller
REFINED, REFINEMENTS = 1e-8, 20  # of a step in its sigmas, and how often at most;
ENOUGH = 1e-5  # sigmas that a step may be off, all parameters together
STACKED, WIDE = 300, 3  # columns, and one of how many, from which a group hangs on most parameters
LOOKED_FOR = 8  # directions that the sparse form looks for at once when something floats


@dataclass(eq=False)
class NormalEquations:
    """N = A' P A of the active rows, over the moving parameters.

    rows     the groups
    moving   (k,) indices of the parameters that are not held
    size     n of all parameters
    sparse   form
    border   of a third form, or None
    """

    rows: Sequence[ActiveRows]
    moving: np.ndarray
    size: int
    sparse: bool
    border: Border | None = None
    _jacobians: list[np.ndarray] = field(default_factory=list)
    _factor: tuple[Any, ...] = ()
    _scale: np.ndarray = field(default_factory=lambda: np.zeros(0))
    _floating: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    _order: tuple[np.ndarray, ...] = ()
    _pattern: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None  # places, indices, pointers
    _solved: BorderedCovariance | None = None
    _values: np.ndarray = field(default_factory=lambda: np.zeros(0))  # of the rows that are to be solved,
    _refine: bool = False  # by a covariance that is nearly theirs

    @classmethod
    def of(
        cls,
        rows: Sequence[ActiveRows],
        moving: np.ndarray,
        size: int,
        sparse: bool | None,
        border: Border | None = None,
    ) -> "NormalEquations":
        """With a border where one is given; sparse when asked, or when large and no group ties most parameters."""
        if border is not None and len(moving):
            return cls(rows, moving, size, False, border)
        if sparse is None:
            sparse = len(moving) > LARGEST_DENSE and all(r.columns.shape[-1] < len(moving) / 3 for r in rows)
        return cls(rows, moving, size, sparse)

    def step(self, x: np.ndarray) -> tuple[np.ndarray, float, float]:
        """The Gauss-Newton step (n,) from x, its size in standard deviations, and the cost at x (nan: undefined)."""
        linear = [r.linear(x) for r in self.rows]
        residuals, self._jacobians = [v for v, _ in linear], [j for _, j in linear]
        cost = float(sum(v @ v for v in residuals))
        if not (np.isfinite(cost) and all(np.isfinite(j).all() for j in self._jacobians)):
            return np.zeros(self.size), np.nan, np.nan
        right = np.zeros(self.size)
        for r, j, v in zip(self.rows, self._jacobians, residuals, strict=True):
            if r.columns.ndim == 1:
                right[r.columns] += j.T @ v
            else:
                at, pull = r.row_columns(), j * v[:, None]
                right += np.bincount(np.maximum(at, 0).ravel(), np.where(at < 0, 0.0, pull).ravel(), self.size)
        step = np.zeros(self.size)
        self._floating = np.zeros((0, self.size))
        if self.border is not None:
            self._factorise_bordered(self.border)
        elif self.sparse:
            self._factorise_sparse()
        else:
            self._factorise_dense()
        if not len(self._floating):
            step[self.moving] = self._solve(right[self.moving])
        return step, max(float(right @ step), 0.0) ** 0.5, cost

    def floating(self) -> np.ndarray:
        """(f, n) directions that nothing holds at the x of the last step, over columns scaled to unit length."""
        return self._floating

    def covariance(self, *, rough: bool = False) -> Covariance:
        """Inverse of N at the x of the last step; where a border is eliminated, of nearly the same rows if rough."""
        if self.border is not None and self._solved is not None:
            scale = np.zeros(self.size)
            scale[self.moving] = self._scale
            blocks = self.border.blocks(self.rows, self.moving, self.size)
            self._solved = None  # large, and no longer needed
            self._solved, self._refine = self.border.solved(blocks, self._values, scale, rough=rough)[0], False
            return self._solved
        if self.sparse:
            order, place, *_ = self._order
            lp, li, lx, d = self._factor
            return Sparse(size=self.size, place=place, scale=self._scale[order], lp=lp, li=li, lx=lx, d=d)
        full = np.zeros((self.size, self.size))
        if len(self.moving):
            inverse = np.tril(lapack.dpotri(self._factor[0], lower=1)[0])
            inverse = (inverse + np.tril(inverse, -1).T) * self._scale[:, None] * self._scale
            full[np.ix_(self.moving, self.moving)] = inverse
        return Dense(full)

    def _solve(self, right: np.ndarray) -> np.ndarray:
        if not len(right):
            return right
        if self._solved is not None:
            whole = np.zeros(self.size)
            whole[self.moving] = right
            return (self._refined(whole) if self._refine else self._solved.solve(whole))[self.moving]
        if not self.sparse:
            return self._scale * cho_solve((self._factor[0], True), self._scale * right, check_finite=False)
        from catseye.estimation.least_squares.sparse_kernel import solve

        order = self._order[0]
        inside = (self._scale * right)[order][:, None].copy()
        lp, li, lx, d = self._factor
        solve(lp, li, lx, d, inside)
        result = np.empty_like(right)
        result[order] = inside[:, 0]
        return result * self._scale

    def _refined(self, right: np.ndarray) -> np.ndarray:
        """N^-1 right (n,) by conjugate gradients, a covariance that is nearly N^-1 being known."""
        assert self.border is not None
        assert self._solved is not None
        blocks = self.border.blocks(self.rows, self.moving, self.size)
        pointers = blocks.row_pointers
        rows = csr_array((self._values, blocks.parameter, pointers), shape=(len(pointers) - 1, self.size))
        x, left = np.zeros(self.size), right.copy()
        towards = pulled = self._solved.solve(left)
        power = first = float(left @ pulled)
        for _ in range(REFINEMENTS):
            if power <= max(REFINED**2 * first, ENOUGH**2):
                return x
            image = rows @ towards
            length = power / float(image @ image)
            x += length * towards
            left -= length * (rows.T @ image)
            pulled = self._solved.solve(left)
            before, power = power, float(left @ pulled)
            towards = pulled + power / before * towards
        return self.covariance().solve(right)

    def _energy(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Combinations (d, d) of scaled directions (k, d), least determined first, and their |A v|^2."""
        scaled = np.zeros((self.size, directions.shape[1]))
        scaled[self.moving] = directions * self._scale[:, None]
        triangles = []
        for r, j in zip(self.rows, self._jacobians, strict=True):
            if r.columns.ndim == 1:
                image = j @ scaled[r.columns]
            else:
                at = r.row_columns()
                image = np.einsum("mw,mwd->md", np.where(at < 0, 0.0, j), scaled[at])
            triangles.append(np.linalg.qr(image, mode="r") if len(image) > directions.shape[1] else image)
        _, singular, turned = np.linalg.svd(np.concatenate(triangles), full_matrices=True)
        squares = np.zeros(directions.shape[1])
        squares[: len(singular)] = singular**2
        return turned[::-1].T, squares[::-1]

    def _factorise_dense(self) -> None:
        if not len(self.moving):
            self._scale = np.zeros(0)
            return
        normal = self._dense_normal()
        if len(self.moving) < self.size:
            normal = normal[np.ix_(self.moving, self.moving)]
        diagonal = np.diag(normal)
        unheld = diagonal <= 0.0
        self._scale = 1.0 / np.sqrt(np.where(unheld, 1.0, diagonal))
        if unheld.any():
            self._set_floating(np.eye(len(normal))[:, unheld])
            return
        scaled = normal * self._scale[:, None] * self._scale
        factor, failed = lapack.dpotrf(scaled, lower=1)
        self._factor = (factor,)
        condition = 0.0 if failed else lapack.dpocon(factor, np.abs(scaled).sum(axis=0).max(), uplo="L")[0]
        if condition < DOUBTFUL:
            values, vectors = np.linalg.eigh(scaled)
            weak = vectors[:, values < max(1e-9, 10.0 * values[0])]
            turned, squares = self._energy(weak)
            none = squares < FLOATS
            if none.any() or failed:
                self._set_floating(weak @ turned[:, none if none.any() else slice(1)])

    def _dense_normal(self) -> np.ndarray:
        """N (n, n). Groups that hang on most parameters are multiplied as one matrix, others each by itself."""
        wide = [r.columns.ndim == 1 and len(r.columns) > max(STACKED, self.size // WIDE) for r in self.rows]
        pairs = list(zip(self.rows, self._jacobians, strict=True))
        stacked = np.zeros((sum(len(j) for (_, j), on in zip(pairs, wide, strict=True) if on), self.size))
        first = 0
        for (r, j), on in zip(pairs, wide, strict=True):
            if on:
                stacked[first : first + len(j), r.columns] = j
                first += len(j)
        normal = stacked.T @ stacked
        for (r, j), on in zip(pairs, wide, strict=True):
            if not on and r.columns.ndim == 1:
                normal[np.ix_(r.columns, r.columns)] += j.T @ j
            elif not on:
                own, gram = _gram(r, j)
                normal[np.ix_(own, own)] += gram.toarray()
        return normal

    def _factorise_bordered(self, border: Border) -> None:
        blocks = border.blocks(self.rows, self.moving, self.size)
        values = blocks.values(self._jacobians)
        diagonal = np.bincount(blocks.parameter, values**2, self.size)[self.moving]
        unheld = diagonal <= 0.0
        if unheld.any():
            self._scale = 1.0 / np.sqrt(np.where(unheld, 1.0, diagonal))
            self._set_unheld(unheld)
            return
        scale = np.zeros(self.size)
        scale[self.moving] = 1.0 / np.sqrt(diagonal)
        solved, new = border.near(blocks, values, scale)
        if not solved.eliminated.held:  # the sparse form says what floats
            self.border, self._solved, self.sparse = None, None, True
            self._factorise_sparse()
            return
        self._solved, self._scale = solved, scale[self.moving]
        self._values, self._refine = values, not new
        if not new:
            return
        every = np.zeros((self.size, LOOKED_FOR))
        every[self.moving] = np.random.default_rng(0).standard_normal((len(self.moving), LOOKED_FOR))
        for _ in range(2):
            every[self.moving] = np.linalg.qr(every[self.moving])[0]
            every[self.moving] /= self._scale[:, None]
            every = solved.solve(every)
            every[self.moving] /= self._scale[:, None]
        probe = every[self.moving]
        if 1.0 / np.linalg.norm(probe, axis=0).max() < DOUBTFUL:
            directions = np.linalg.qr(probe)[0]
            turned, squares = self._energy(directions)
            none = squares < FLOATS
            if none.any():
                self._set_floating(directions @ turned[:, none])

    def _set_unheld(self, unheld: np.ndarray) -> None:
        """Some of the parameters that no row depends on float."""
        unit = np.zeros((len(unheld), min(int(unheld.sum()), LOOKED_FOR)))
        unit[np.flatnonzero(unheld)[: unit.shape[1]], np.arange(unit.shape[1])] = 1.0
        self._set_floating(unit)

    def _factorise_sparse(self) -> None:
        from catseye.estimation.least_squares.sparse_kernel import numeric, solve, symbolic

        normal = self._on_pattern()[:, self.moving][self.moving]
        diagonal = normal.diagonal()
        unheld = diagonal <= 0.0
        self._scale = 1.0 / np.sqrt(np.where(unheld, 1.0, diagonal))
        if unheld.any():
            self._set_unheld(unheld)
            return
        if not self._order:
            self._order = _ordering(normal, self.moving, self.size)
        order = self._order[0]
        coo = normal.tocoo()
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        i, j, values = place[coo.row], place[coo.col], coo.data * self._scale[coo.row] * self._scale[coo.col]
        upper = i <= j
        triangle = csc_array((values[upper], (i[upper], j[upper])), shape=normal.shape)
        ap, ai = triangle.indptr.astype(np.int64), triangle.indices.astype(np.int64)
        k = len(order)
        if len(self._order) == 2:
            self._order = (*self._order, *symbolic(k, ap, ai))
        parent, lp = self._order[2:]
        li, lx, d, raised = numeric(k, ap, ai, triangle.data, parent, lp)
        self._factor = (lp, li, lx, d)
        probe = np.random.default_rng(0).standard_normal((k, LOOKED_FOR))  # a seed: the same question every time
        for _ in range(4 if raised else 2):
            probe, _r = np.linalg.qr(probe)
            solve(lp, li, lx, d, probe)
        if raised or 1.0 / np.linalg.norm(probe, axis=0).max() < DOUBTFUL:
            directions = np.empty_like(probe)
            directions[order] = np.linalg.qr(probe)[0]
            turned, squares = self._energy(directions)
            none = squares < FLOATS
            if none.any():
                self._set_floating(directions @ turned[:, none])

    def _on_pattern(self) -> csc_array:
        """N (n, n) with an entry for each two parameters that meet in a row, also where their products cancel to zero.

        A covariance is wanted of such pairs as of others. Groups are added in their order, each over its own entries.
        """
        if self._pattern is None:
            ones = [
                _places(*_gram(r, np.ones_like(j)), self.size) for r, j in zip(self.rows, self._jacobians, strict=True)
            ]
            places = np.unique(np.concatenate(ones))
            pointers = np.searchsorted(places, self.size * np.arange(self.size + 1, dtype=np.int64))
            self._pattern = places, (places % self.size).astype(np.int32), pointers.astype(np.int32)
        places, indices, pointers = self._pattern
        data = np.zeros(len(places))
        for r, j in zip(self.rows, self._jacobians, strict=True):
            own, gram = _gram(r, j)
            data[np.searchsorted(places, _places(own, gram, self.size))] += gram.data
        return csc_array((data, indices, pointers), shape=(self.size, self.size))

    def _set_floating(self, directions: np.ndarray) -> None:
        self._floating = np.zeros((directions.shape[1], self.size))
        self._floating[:, self.moving] = directions.T


def _places(own: np.ndarray, gram: csc_array, size: int) -> np.ndarray:
    """Column times size plus row of each entry of a group's A' A, ascending.

    own   (k,) parameters of its rows and columns
    """
    return np.repeat(own, np.diff(gram.indptr)).astype(np.int64) * size + own[gram.indices]


def _gram(r: ActiveRows, j: np.ndarray) -> tuple[np.ndarray, csc_array]:
    """Parameters (k,) of rows with columns of their own, ascending, and A' A (k, k) over them, sparse."""
    at = r.row_columns()
    used = at >= 0
    own, local = np.unique(at[used], return_inverse=True)
    pointers = np.concatenate([[0], np.cumsum(np.sum(used, axis=1))])
    a = csr_array((j[used], local.ravel(), pointers), shape=(len(at), len(own)))
    gram = csc_array(a.T @ a)
    gram.sort_indices()
    return own, gram


def _ordering(normal: csc_array, moving: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Minimum degree order of the moving parameters, and the place (n,) of every parameter in it (-1: held)."""
    from scipy.sparse.linalg import splu

    pattern = csc_array(normal, copy=True)  # splu sorts indices in place
    pattern.data = np.where(pattern.indices == np.repeat(np.arange(len(moving)), np.diff(pattern.indptr)), 1.0, 1e-6)
    order = np.argsort(
        splu(pattern, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).perm_c
    )
    place = np.full(size, -1)
    place[moving[order]] = np.arange(len(moving))
    return order, place
