"""Large systems of blocks and a border: each block's parameters are eliminated, what many share is solved densely.

A night of a whole dish has blocks of a score of parameters (a prism's place, normal, glass), which meet no other
block's in any observation, and a border of thousands (rangers, electronics, air). N = [V B; B' C] gives the border's
S = C - B' V^-1 B, its covariance Z = S^-1, and with W = V^-1 B the blocks' V^-1 + W Z W' and -W Z.

Source: elimination of parameters by blocks, [FOERSTNER16] chapter 15 (bundle adjustment).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import blas, lapack
from scipy.sparse import csr_array, sparray, vstack
from threadpoolctl import threadpool_limits

from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import LARGEST_MATRIX
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.processors import in_parts, on_threads, threads

WIDE = 1000  # parameters of the border from which one more core is worth waking
SAME = 2e-6  # relative change of a row up to which an earlier elimination serves; tests take differences of such
ROUGH = 1e-4  # the same where tests w good to a hundredth will do, of what others check
NEAR = 1e-2  # and for a step, which is refined
MOST_CHANGED = 400  # rows that came or went since, beyond which a new elimination is quicker
DENSE = 30  # columns from which rows of a matrix are multiplied as one
FEW = 30  # parameters whose joint covariance is looked up, not multiplied out; rows that may change in any system
LEAST_LEFT = 1e-7  # of a row that goes: what the others say of it, over its own variance


@dataclass(frozen=True, eq=False)
class TargetBlocks:
    """Partition of a system's parameters into blocks and a border, with the place of each row's entries.

    moving         (k,) parameters that are not held
    columns        of the groups, as the layout was made for
    block, place   (n,) block of each parameter (-1: border, -2: held) and its place there
    inner, outer   parameters of all blocks, block by block, and of the border, in order
    own            (c,) parameters of each block
    border, border_first   border's indices of each block, sorted, and where they begin (c + 1,)
    inside_first, reach_first   (c + 1,) see `bordered_kernel`
    take           (e,) entries of all groups' Jacobians, one after the other, in the kernel's order
    parameter      (e,) of each
    rows_of, row_pointers, at   see `bordered_kernel.eliminate`
    """

    moving: np.ndarray
    columns: tuple[np.ndarray, ...]
    block: np.ndarray
    place: np.ndarray
    inner: np.ndarray
    outer: np.ndarray
    own: np.ndarray
    border: np.ndarray
    border_first: np.ndarray
    inside_first: np.ndarray
    reach_first: np.ndarray
    take: np.ndarray
    parameter: np.ndarray
    rows_of: np.ndarray
    row_pointers: np.ndarray
    at: np.ndarray

    @staticmethod
    def of(rows: Sequence[ActiveRows], moving: np.ndarray, size: int, on_border: np.ndarray) -> "TargetBlocks":
        """The blocks of groups of rows: parameters off the border that meet in a row belong together.

        moving      (k,) parameters that are not held
        size        n
        on_border   (n,) bool
        """
        from scipy.sparse.csgraph import connected_components

        columns = tuple(np.ascontiguousarray(r.row_columns()) for r in rows)
        counts = np.concatenate([np.full(len(c), c.shape[1]) for c in columns])
        flat = np.concatenate([c.ravel() for c in columns])
        of_row = np.repeat(np.arange(len(counts)), counts)
        free = np.zeros(size + 1, dtype=bool)
        free[moving] = True
        take = np.flatnonzero(free[flat])  # -1 is the last, which is not free
        flat, of_row = flat[take], of_row[take]
        local = np.zeros(size, dtype=bool)
        local[moving] = ~on_border[moving]
        inner, outer = np.flatnonzero(local), moving[on_border[moving]]
        mine = local[flat]
        graph = csr_array((np.ones(mine.sum(), dtype=np.int8), (of_row[mine], flat[mine])), shape=(len(counts), size))
        shape = len(counts) + size
        joined = csr_array((graph.data, graph.indices + len(counts), _long(graph.indptr, size)), shape=(shape, shape))
        label = connected_components(joined, directed=False)[1]
        labels, block_of_inner = np.unique(label[len(counts) + inner], return_inverse=True)
        inner = inner[np.argsort(block_of_inner, kind="stable")]
        own = np.bincount(block_of_inner, minlength=len(labels))
        block, place = np.full(size, -2), np.zeros(size, dtype=np.int64)
        block[inner] = np.repeat(np.arange(len(own)), own)
        place[inner] = np.arange(len(inner)) - np.repeat(np.cumsum(own) - own, own)
        block[outer], place[outer] = -1, np.arange(len(outer))
        block_of_row = np.full(len(counts), len(own))
        block_of_row[of_row[mine]] = block[flat[mine]]
        order = np.argsort(block_of_row[of_row], kind="stable")
        take, flat, of_row = take[order], flat[order], of_row[order]
        at, mine = place[flat], local[flat]
        pairs = block_of_row[of_row[~mine]] * (len(outer) + 1) + place[flat[~mine]]
        met = np.unique(pairs[block_of_row[of_row[~mine]] < len(own)])
        border_first = np.searchsorted(met, np.arange(len(own) + 1) * (len(outer) + 1))
        c = block_of_row[of_row]
        reaching = ~mine & (c < len(own))
        at[reaching] = (
            np.searchsorted(met, c[reaching] * (len(outer) + 1) + at[reaching]) - border_first[c[reaching]]
        ) + own[c[reaching]]
        firsts = np.flatnonzero(np.diff(of_row, prepend=-1))
        row_pointers = np.append(firsts, len(of_row))
        rows_of = np.append(np.searchsorted(c[firsts], np.arange(len(own) + 1)), len(firsts))
        wide = np.diff(border_first)
        return TargetBlocks(
            moving=moving,
            columns=columns,
            block=block,
            place=place,
            inner=inner,
            outer=outer,
            own=own,
            border=met % (len(outer) + 1),
            border_first=border_first,
            inside_first=np.append(0, np.cumsum(own * own)),
            reach_first=np.append(0, np.cumsum(own * wide)),
            take=take,
            parameter=flat,
            rows_of=rows_of,
            row_pointers=row_pointers,
            at=at,
        )

    def values(self, jacobians: Sequence[np.ndarray]) -> np.ndarray:
        """(e,) entries of whitened Jacobians, one a group, in the kernel's order."""
        return np.concatenate([j.ravel() for j in jacobians])[self.take]

    def fits(self, rows: Sequence[ActiveRows], moving: np.ndarray) -> bool:
        """True if these blocks are those of the rows."""
        return (
            np.array_equal(moving, self.moving)
            and len(rows) == len(self.columns)
            and all(np.array_equal(r.row_columns(), c) for r, c in zip(rows, self.columns, strict=True))
        )

    @cached_property
    def row_of_entry(self) -> np.ndarray:
        """(e,) row of each entry, counted in the kernel's order."""
        return np.repeat(np.arange(len(self.row_pointers) - 1), np.diff(self.row_pointers))

    @cached_property
    def rows_without_block(self) -> tuple[np.ndarray, list[tuple[np.ndarray, slice]]]:
        """Rows of border parameters alone: single ones, and the columns and entries of matrices of many rows."""
        first, pointers = int(self.rows_of[-2]), self.row_pointers
        widths, starts = np.diff(pointers)[first:], self.at[pointers[first:-1]]
        runs = np.flatnonzero((np.diff(widths, prepend=-1) != 0) | (np.diff(starts, prepend=-1) != 0)) + first
        runs = np.append(runs, len(pointers) - 1)
        single, dense = [np.zeros(0, dtype=np.int64)], []
        for low, high in pairwise(runs.tolist()):
            at = self.at[pointers[low] : pointers[high]].reshape(high - low, -1)
            if at.shape[1] < DENSE or np.any(at != at[0]) or np.any(np.diff(at[0]) <= 0):
                single.append(np.arange(low, high))
            else:
                dense.append((at[0], slice(int(pointers[low]), int(pointers[high]))))
        return np.concatenate(single), dense

    @cached_property
    def reach_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices and pointers of W, (i, g) with a row an inner parameter, as compressed rows."""
        wide = np.diff(self.border_first)
        starts = np.repeat(self.border_first[:-1], self.own)
        lengths = np.repeat(wide, self.own)
        pointers = np.append(0, np.cumsum(lengths))
        shift = np.arange(pointers[-1]) - np.repeat(pointers[:-1], lengths)
        return self.border[np.repeat(starts, lengths) + shift], pointers

    @cached_property
    def inside_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """The same of V^-1, (i, i)."""
        lengths = np.repeat(self.own, self.own)
        first = np.repeat(np.cumsum(self.own) - self.own, self.own)
        pointers = np.append(0, np.cumsum(lengths))
        shift = np.arange(pointers[-1]) - np.repeat(pointers[:-1], lengths)
        return np.repeat(first, lengths) + shift, pointers


def _long(pointers: np.ndarray, size: int) -> np.ndarray:
    return np.concatenate([pointers, np.full(size, pointers[-1])])


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The blocks of N eliminated, with what is left factorised or, once a covariance was asked for, inverted.

    scale    (n,) of the matrix scaled to a unit diagonal
    values   (e,) of the scaled rows, in the kernel's order
    inside, reach   V^-1 (i, i) and W (i, g), sparse
    """

    blocks: TargetBlocks
    scale: np.ndarray
    values: np.ndarray
    inside: csr_array
    reach: csr_array
    held: bool
    _left: list[np.ndarray] = field(default_factory=list)  # factor or inverse
    _inverse: list[bool] = field(default_factory=lambda: [False])

    @staticmethod
    def of(blocks: TargetBlocks, scale: np.ndarray, values: np.ndarray) -> "Eliminated":
        """Blocks eliminated from the rows of `values`."""
        from catseye.estimation.least_squares.bordered_kernel import border_left, eliminate

        b = blocks
        inside = np.zeros(b.inside_first[-1])
        reach, half = np.zeros(b.reach_first[-1]), np.zeros(b.reach_first[-1])
        rows = b.row_pointers, b.rows_of, b.at, values, b.own
        arrays = *rows, b.border_first, b.inside_first, b.reach_first, inside, reach, half
        loose = any(in_parts(len(b.own), lambda low, high: eliminate(low, high, *arrays)))
        s = np.zeros((len(b.outer), len(b.outer)))
        single, dense = b.rows_without_block
        for columns, entries in dense:
            jacobian = values[entries].reshape(-1, len(columns))
            s[np.ix_(columns, columns)] += np.tril(jacobian.T @ jacobian)
        rest = *rows, b.border, b.border_first, b.reach_first, half, single, s
        on_threads(lambda part, parts: border_left(part, parts, *rest))
        i = len(b.inner)
        indices, pointers = b.inside_pattern
        inverse = csr_array((inside, indices, pointers), shape=(i, i))
        indices, pointers = b.reach_pattern
        w = csr_array((reach, indices, pointers), shape=(i, len(b.outer)))
        factor, failed = _on_cores(
            len(s), lambda: lapack.dpotrf(s.T, lower=0, overwrite_a=1)
        )  # s.T: its upper triangle
        return Eliminated(
            blocks=blocks,
            scale=scale,
            values=values,
            inside=inverse,
            reach=w,
            held=not (loose or failed),
            _left=[factor],
        )

    def solve_scaled(self, right: np.ndarray) -> np.ndarray:
        """N^-1 right of all parameters, both scaled, (n,) or (n, k); held ones are zero."""
        b = self.blocks
        inner, outer = right[b.inner], right[b.outer]
        result = np.zeros_like(right)
        if right.ndim == 1:
            outer = self._border(outer - self.reach.T @ inner)
            result[b.outer] = outer
            result[b.inner] = self.inside @ inner - self.reach @ outer
            return result
        from catseye.estimation.least_squares.bordered_kernel import less_inner, less_outer

        arrays = np.append(0, np.cumsum(b.own)), b.border_first, b.border, b.reach_first, self.reach.data
        in_parts(right.shape[1], lambda low, high: less_inner(low, high, *arrays, inner, outer), least=FEW)
        outer = np.ascontiguousarray(self._border(outer))
        solved = self.inside @ inner
        in_parts(len(b.own), lambda low, high: less_outer(low, high, *arrays, outer, solved))
        result[b.outer], result[b.inner] = outer, solved
        return result

    def _border(self, right: np.ndarray) -> np.ndarray:
        if not len(right):
            return right
        if self._inverse[0]:
            z = self._left[0].T
            return blas.dsymv(1.0, z, right, lower=1) if right.ndim == 1 else z @ right
        return lapack.dpotrs(self._left[0], right, lower=0)[0].reshape(right.shape)

    def inverse(self) -> np.ndarray:
        """Covariance Z (g, g) of the border, scaled."""
        if not self._inverse[0]:
            from catseye.estimation.least_squares.bordered_kernel import mirrored

            if len(self._left[0]):
                z = _on_cores(len(self._left[0]), lambda: lapack.dpotri(self._left[0], lower=0, overwrite_c=1))[0].T
                mirrored(z)
                self._left[0] = z
            self._inverse[0] = True
        return self._left[0]

    @cached_property
    def selected(self) -> tuple[np.ndarray, np.ndarray]:
        """Covariance of each block with itself, and with its part of the border, scaled; see `bordered_kernel`."""
        from catseye.estimation.least_squares.bordered_kernel import selected

        b = self.blocks
        with_itself, with_border = self.inside.data.copy(), np.zeros_like(self.reach.data)
        arrays = b.own, b.border_first, b.border, b.inside_first, b.reach_first, self.reach.data, self.inverse()
        in_parts(len(b.own), lambda low, high: selected(low, high, *arrays, with_itself, with_border))
        return with_itself, with_border


def _on_cores(size: int, work: Callable):
    """A factorisation on all free cores where it is large: bound pools make small ones quick, and large ones slow."""
    if size < WIDE:
        return work()
    with threadpool_limits(limits=threads(), user_api="blas"):
        return work()


@dataclass(eq=False)
class Border:
    """Parameters that are not eliminated, with the last elimination of the same shape.

    columns   (n,) bool
    fine      (n,) bool, details that the search for a robust start can hold at their start values
    """

    columns: np.ndarray
    fine: np.ndarray
    _blocks: list[TargetBlocks] = field(default_factory=list)
    _last: Eliminated | None = None
    _since: "BorderedCovariance | None" = None  # the last elimination with what came and went after it,
    _changed: np.ndarray = field(default_factory=lambda: np.zeros(0))  # and the entries that this was

    def blocks(self, rows: Sequence[ActiveRows], moving: np.ndarray, size: int) -> TargetBlocks:
        """The blocks of some rows, remembered."""
        known = next((b for b in self._blocks if b.fits(rows, moving)), None)
        if known is None:
            known = TargetBlocks.of(rows, moving, size, self.columns)
            self._blocks = [known, *self._blocks[:1]]
        return known

    def forget(self) -> None:
        """Let the last elimination go, and its memory."""
        self._last, self._since = None, None

    def solved(
        self, blocks: TargetBlocks, values: np.ndarray, scale: np.ndarray, *, rough: bool = False
    ) -> tuple["BorderedCovariance", bool]:
        """The covariance, and whether the blocks were eliminated now.

        values   (e,) see `TargetBlocks.values`
        scale    (n,) of a unit diagonal
        rough    how nearly the same is enough: `ROUGH`, not `SAME`

        An earlier elimination serves where few rows have come or gone since, and the others are nearly the same.
        """
        return self._served(blocks, values, scale, ROUGH if rough else SAME)

    def near(self, blocks: TargetBlocks, values: np.ndarray, scale: np.ndarray) -> tuple["BorderedCovariance", bool]:
        """The same where a covariance that is nearly that of the rows is enough: a step is refined with it."""
        return self._served(blocks, values, scale, NEAR)

    def _served(
        self, blocks: TargetBlocks, values: np.ndarray, scale: np.ndarray, same: float
    ) -> tuple["BorderedCovariance", bool]:
        last = self._last
        if last is not None and last.blocks is blocks and last.held:
            updated = self._updated(last, values * last.scale[blocks.parameter], same)
            if updated is not None:
                return updated, False
        self.forget()
        self._last = Eliminated.of(blocks, scale, values * scale[blocks.parameter])
        return BorderedCovariance(len(scale), self._last), True

    def _updated(self, last: Eliminated, values: np.ndarray, same: float) -> "BorderedCovariance | None":
        """The covariance by what has changed since an elimination, rows by more than `same`; None for too many."""
        blocks, size = last.blocks, len(last.scale)
        change, row = values - last.values, blocks.row_of_entry
        moved = np.sqrt(np.bincount(row, change**2))
        large = moved > same * np.sqrt(np.bincount(row, np.maximum(values**2, last.values**2)))
        if not large.any():
            return BorderedCovariance(size, last)
        if np.count_nonzero(large) > min(MOST_CHANGED, max(FEW, len(blocks.outer) // 4)):
            return None
        entries = large[row]
        changed = np.concatenate([np.flatnonzero(entries), values[entries]])
        again = self._since is not None and len(changed) == len(self._changed)
        if again and np.abs(changed - self._changed).max() <= same * np.abs(values[entries]).max():
            return self._since
        number = (np.cumsum(large) - 1)[row[entries]]
        count = int(large.sum())
        both = [
            csr_array((part[entries], (number, blocks.parameter[entries])), shape=(count, size))
            for part in (last.values, values)
        ]
        kept = [np.flatnonzero(np.bincount(number, part[entries] ** 2, count) > 0.0) for part in (last.values, values)]
        rows = vstack([both[0][kept[0]], both[1][kept[1]]], format="csr")  # those that go, those that come
        reach = last.solve_scaled(rows.T.toarray())
        middle = rows @ reach + np.diag(np.repeat([-1.0, 1.0], [len(k) for k in kept]))
        values_of, vectors = np.linalg.eigh(0.5 * (middle + middle.T))
        if np.abs(values_of).min() < LEAST_LEFT:
            return None  # something is hardly held any more
        inverse = (vectors / values_of) @ vectors.T
        self._since = BorderedCovariance(size, last, reach * last.scale[:, None], inverse)
        self._changed = changed
        return self._since


@dataclass(frozen=True, eq=False)
class BorderedCovariance:
    """The inverse of N after an elimination: what is asked for is computed; see `covariance.Covariance`.

    reach, middle   (n, r) and (r, r): rows that came and went since take reach middle reach' off it
    """

    size: int
    eliminated: Eliminated
    reach: np.ndarray | None = None
    middle: np.ndarray | None = None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Covariance times right, (n,) or (n, k)."""
        scale = self.eliminated.scale if right.ndim == 1 else self.eliminated.scale[:, None]
        answer = scale * self.eliminated.solve_scaled(scale * right)
        if self.reach is not None:
            answer -= self.reach @ (self.middle @ (self.reach.T @ right))
        return np.asarray(answer)

    def matrix(self) -> np.ndarray:
        if self.size > LARGEST_MATRIX:
            raise EstimationError(
                f"the full covariance of {self.size} parameters takes {8e-9 * self.size**2:.0f} GB "
                f"(limit {LARGEST_MATRIX} parameters); ask for the blocks of single points"
            )
        return self.across(np.arange(self.size))

    def across(self, columns: np.ndarray) -> np.ndarray:
        unit = np.zeros((self.size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        return self.solve(unit)

    def carried(self, matrix: sparray, others: sparray | None = None) -> np.ndarray:
        """(k, k) covariance of k combinations of parameters, the rows of a sparse matrix (k, n); or (k, m) with m."""
        from catseye.estimation.least_squares.reaching import Reaching

        e, b = self.eliminated, self.eliminated.blocks
        both = []
        for each in (matrix,) if others is None else (matrix, others):
            rows = csr_array(each * e.scale)
            inner = rows[:, b.inner]
            both.append((inner, Reaching.of(csr_array(rows[:, b.outer] - inner @ e.reach))))
        (inner, reach), (inner_also, reach_also) = both[0], both[-1]
        answer = reach.carried(e.inverse(), None if others is None else reach_also)
        own = csr_array(inner @ e.inside @ inner_also.T).tocoo()  # has each entry once
        answer[own.coords] += own.data
        if self.reach is not None:
            moved = matrix @ self.reach
            answer -= moved @ self.middle @ (moved if others is None else others @ self.reach).T
        return answer

    def within(self, columns: np.ndarray) -> np.ndarray:
        k, block = len(columns), self.eliminated.blocks.block[columns]
        if k <= FEW and len(np.unique(block[block >= 0])) <= 1:
            return self.products(np.tile(columns, (k, 1)), np.eye(k)).T
        return self.carried(csr_array((np.ones(k), (np.arange(k), columns)), shape=(k, self.size)))

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        from catseye.estimation.least_squares.bordered_kernel import low_rank_products, products

        e, b = self.eliminated, self.eliminated.blocks
        none = columns < 0
        block, place = np.where(none, -2, b.block[columns]), b.place[columns]
        scale = np.where(none, 0.0, e.scale[columns])
        answer = np.zeros(a.shape)
        arrays = b.own, b.border_first, b.border, b.inside_first, b.reach_first, *e.selected, e.reach.data, e.inverse()
        in_parts(len(a), lambda low, high: products(low, high, block, place, a * scale, answer, *arrays))
        answer *= scale
        if self.reach is not None:
            low_rank_products(np.where(none, -1, columns), a, self.reach, self._weighed, answer)
        return np.asarray(answer)

    @cached_property
    def _weighed(self) -> np.ndarray:
        assert self.reach is not None
        return np.asarray(self.reach @ self.middle)

    def blocks(self, first: np.ndarray) -> np.ndarray:
        at = first[:, None] + np.arange(3)
        units = [np.tile(row, (len(at), 1)) for row in np.eye(3)]
        return np.stack([self.products(at, unit) for unit in units], axis=2)

    def diagonal(self) -> np.ndarray:
        return self._diagonal.copy()

    @cached_property
    def _diagonal(self) -> np.ndarray:
        every = np.arange(self.size)[:, None]
        return self.products(every, np.ones((self.size, 1)))[:, 0]
