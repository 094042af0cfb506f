"""Blocks of parameters eliminated from normal equations, compiled. Imported only when a large problem needs it.

A block c has l parameters of its own, which meet those of no other block, and b of the border, which many share. Arrays
of all blocks stand one after the other: `inside` (l, l) and `reach` (l, b), row by row. The plain form that these are
tested against is numpy's dense inverse.
"""

import numpy as np
from numba import njit

SMALLEST_PIVOT = 1e-14  # of a block of unit diagonal: what falls below is not held


@njit(cache=True, error_model="numpy", nogil=True)
def eliminate(
    low, high, row_pointers, rows_of, at, values, own, border_first, inside_first, reach_first, inside, reach, half
):
    """Eliminate the blocks low to high from N = A' A; in place.

    row_pointers    (m + 1,) of the rows, block by block, those without a block last
    rows_of         (c + 2,) first row of each block, of those without, and their end
    at              (e,) place of each entry: in its block's own parameters, then l + place in its part of the border;
                    in rows without a block the border's index
    values          (e,)
    own, border     l and b of each block; `border_first` are pointers into the border's indices
    inside_first, reach_first   (c + 1,) where each block's arrays begin
    inside, reach, half         to fill: V^-1, W = V^-1 B and L^-1 B with V = L L'; zero before

    Returns if a block is not held.
    """
    loose = False
    widest = 1
    for c in range(low, high):
        widest = max(widest, own[c])
    v, inverse = np.empty((widest, widest)), np.empty((widest, widest))
    for c in range(low, high):
        n, b, begin = own[c], border_first[c + 1] - border_first[c], reach_first[c]
        v[:n, :n] = 0.0
        crossed = reach[begin : begin + n * b].reshape(n, b)
        solved = half[begin : begin + n * b].reshape(n, b)
        for row in range(rows_of[c], rows_of[c + 1]):
            for p in range(row_pointers[row], row_pointers[row + 1]):
                i, a = at[p], values[p]
                if i >= n:
                    continue
                for q in range(row_pointers[row], row_pointers[row + 1]):
                    j = at[q]
                    if j < n:
                        v[i, j] += a * values[q]
                    else:
                        crossed[i, j - n] += a * values[q]
        for k in range(n):  # Cholesky, lower
            pivot = v[k, k]
            for j in range(k):
                pivot -= v[k, j] * v[k, j]
            if not pivot > SMALLEST_PIVOT:
                loose, pivot = True, SMALLEST_PIVOT
            v[k, k] = np.sqrt(pivot)
            for i in range(k + 1, n):
                value = v[i, k]
                for j in range(k):
                    value -= v[i, j] * v[k, j]
                v[i, k] = value / v[k, k]
        for k in range(n):  # L^-1, lower
            inverse[k, k] = 1.0 / v[k, k]
            for i in range(k + 1, n):
                value = 0.0
                for j in range(k, i):
                    value -= v[i, j] * inverse[j, k]
                inverse[i, k] = value / v[i, i]
        for i in range(n):
            for k in range(i + 1):
                factor = inverse[i, k]
                for j in range(b):
                    solved[i, j] += factor * crossed[k, j]
        first = inside_first[c]
        for i in range(n):
            for j in range(n):
                value = 0.0
                for k in range(max(i, j), n):
                    value += inverse[k, i] * inverse[k, j]
                inside[first + i * n + j] = value
        crossed[:] = 0.0
        for i in range(n):
            for k in range(i, n):
                factor = inverse[k, i]
                for j in range(b):
                    crossed[i, j] += factor * solved[k, j]
    return loose


@njit(cache=True, error_model="numpy", nogil=True)
def border_left(
    part, parts, row_pointers, rows_of, at, values, own, border, border_first, reach_first, half, single, s
):
    """Add every parts-th row, from `part` on, of S = N_bb - (L^-1 B)' L^-1 B, its lower triangle; in place.

    border   border's indices of each block, sorted
    half     as `eliminate` filled it
    single   rows without a block that count here
    s        (g, g)
    """
    count = len(own)
    longest = 1
    for c in range(count):
        longest = max(longest, border_first[c + 1] - border_first[c])
    local = np.empty((longest, longest))  # a block's share: S itself is too large for a cache
    for c in range(count):
        n, first = own[c], border_first[c]
        b, begin = border_first[c + 1] - first, reach_first[c]
        own_border, own_half = border[first : first + b], half[begin : begin + n * b].reshape(n, b)
        mine = own_border % parts == part
        for i in range(b):
            if mine[i]:
                local[i, : i + 1] = 0.0
        for row in range(rows_of[c], rows_of[c + 1]):
            for p in range(row_pointers[row], row_pointers[row + 1]):
                i = at[p] - n
                if i < 0 or not mine[i]:
                    continue
                for q in range(row_pointers[row], row_pointers[row + 1]):
                    j = at[q] - n
                    if 0 <= j <= i:
                        local[i, j] += values[p] * values[q]
        for i in range(b):
            if not mine[i]:
                continue
            for k in range(n):
                factor = own_half[k, i]
                for j in range(i + 1):
                    local[i, j] -= factor * own_half[k, j]
            line = s[own_border[i]]
            for j in range(i + 1):
                line[own_border[j]] += local[i, j]
    for row in single:
        for p in range(row_pointers[row], row_pointers[row + 1]):
            if at[p] % parts != part:
                continue
            for q in range(row_pointers[row], row_pointers[row + 1]):
                if at[p] >= at[q]:
                    s[at[p], at[q]] += values[p] * values[q]


@njit(cache=True, error_model="numpy")
def mirrored(s):
    """Fill the upper triangle of (g, g) from the lower, tile by tile; in place."""
    n, tile = len(s), 64
    for top in range(0, n, tile):
        for left in range(0, top + 1, tile):
            for i in range(top, min(top + tile, n)):
                for j in range(left, min(left + tile, i)):
                    s[j, i] = s[i, j]


@njit(cache=True, error_model="numpy", nogil=True)
def less_outer(low, high, own_first, border_first, border, reach_first, reach, outer, inner):
    """Take W outer off the rows of blocks low to high; in place.

    own_first   (c + 1,) first parameter of each block
    outer       (g, k) of the border
    inner       (i, k)
    """
    for c in range(low, high):
        own_border = border[border_first[c] : border_first[c + 1]]
        w = reach[reach_first[c] : reach_first[c + 1]].reshape(-1, len(own_border))
        for j in range(len(own_border)):
            row = outer[own_border[j]]
            for i in range(len(w)):
                line, factor = inner[own_first[c] + i], w[i, j]
                for k in range(outer.shape[1]):
                    line[k] -= factor * row[k]


@njit(cache=True, error_model="numpy", nogil=True)
def less_inner(low, high, own_first, border_first, border, reach_first, reach, inner, outer):
    """Take W' inner off columns low to high of the border; arrays as in `less_outer`, in place."""
    for c in range(len(own_first) - 1):
        own_border = border[border_first[c] : border_first[c + 1]]
        w = reach[reach_first[c] : reach_first[c + 1]].reshape(-1, len(own_border))
        for i in range(len(w)):
            row = inner[own_first[c] + i]
            if not row[low:high].any():
                continue
            for j in range(len(own_border)):
                line, factor = outer[own_border[j]], w[i, j]
                for k in range(low, high):
                    line[k] -= factor * row[k]


@njit(cache=True, error_model="numpy", nogil=True)
def selected(low, high, own, border_first, border, inside_first, reach_first, reach, z, with_itself, with_border):
    """Covariance of blocks low to high with themselves, and with their parts of the border; arrays as in `eliminate`.

    z             (g, g) covariance of the border
    with_itself   to fill, V^-1 before
    with_border   to fill, zero before
    """
    longest = 1
    for c in range(low, high):
        longest = max(longest, border_first[c + 1] - border_first[c])
    near = np.empty(longest)
    for c in range(low, high):
        n, first = own[c], border_first[c]
        b = border_first[c + 1] - first
        begin, at = inside_first[c], reach_first[c]
        own_border, w = border[first : first + b], reach[at : at + n * b].reshape(n, b)
        across = with_border[at : at + n * b].reshape(n, b)
        for k in range(b):
            line = z[own_border[k]]
            for j in range(b):
                near[j] = line[own_border[j]]
            for i in range(n):
                factor = w[i, k]
                for j in range(b):
                    across[i, j] -= factor * near[j]
        for i in range(n):
            for j in range(n):
                value = 0.0
                for k in range(b):
                    value += across[i, k] * w[j, k]
                with_itself[begin + i * n + j] -= value


@njit(cache=True, error_model="numpy", nogil=True)
def products(
    low, high, block, place, a, result,
    own, border_first, border, inside_first, reach_first, with_itself, with_border, reach, z,
):  # fmt: skip
    """Sum over j of Q_ij a_j for rows low to high of parameters, of one block at most beside those of the border.

    block, place   (m, w) block of each parameter (-1: border, -2: none) and its place there
    a              (m, w)
    result         (m, w) to fill, zero before
    """
    w = block.shape[1]
    inner = np.empty(w, np.int64)
    for row in range(low, high):
        c = -1
        for i in range(w):
            if block[row, i] >= 0:
                c = block[row, i]
        n = own[c] if c >= 0 else 0
        first = border_first[c] if c >= 0 else 0
        b = border_first[c + 1] - first if c >= 0 else 0
        if c >= 0:  # where each parameter of the border is in the block's part of it
            for i in range(w):
                if block[row, i] == -1:
                    left, right = 0, b
                    while left < right:
                        middle = (left + right) // 2
                        if border[first + middle] < place[row, i]:
                            left = middle + 1
                        else:
                            right = middle
                    inner[i] = left if left < b and border[first + left] == place[row, i] else -1
        for i in range(w):
            if block[row, i] == -2:
                continue
            value = 0.0
            for j in range(w):
                if block[row, j] == -2 or a[row, j] == 0.0:
                    continue
                if block[row, i] == -1 and block[row, j] == -1:
                    value += z[place[row, i], place[row, j]] * a[row, j]
                    continue
                if block[row, i] == -1 or block[row, j] == -1:
                    x, k, far = (place[row, j], inner[i], place[row, i])
                    if block[row, i] != -1:
                        x, k, far = (place[row, i], inner[j], place[row, j])
                    at = reach_first[c] + x * b
                    if k >= 0:
                        q = with_border[at + k]
                    else:  # they meet in no observation
                        q = 0.0
                        for p in range(b):
                            q -= reach[at + p] * z[border[first + p], far]
                else:
                    q = with_itself[inside_first[c] + place[row, i] * n + place[row, j]]
                value += q * a[row, j]
            result[row, i] = value


@njit(cache=True, error_model="numpy")
def low_rank_products(columns, a, reach, weighed, result):
    """Take sum over j of (reach middle reach')_ij a_j off each row; in place.

    columns, a       (m, w), -1 for none
    reach, weighed   (n, r), and times middle (r, r)
    result           (m, w)
    """
    m, w = columns.shape
    r = reach.shape[1]
    along = np.empty(r)
    for row in range(m):
        along[:] = 0.0
        for j in range(w):
            if columns[row, j] >= 0 and a[row, j] != 0.0:
                for k in range(r):
                    along[k] += weighed[columns[row, j], k] * a[row, j]
        for i in range(w):
            if columns[row, i] >= 0:
                value = 0.0
                for k in range(r):
                    value += reach[columns[row, i], k] * along[k]
                result[row, i] -= value
