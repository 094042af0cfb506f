"""Compiled sparse L D L' factor, and the inverse on its pattern.

Imported only for large problems. All arrays are of the permuted upper triangle in compressed columns (ap, ai, ax), as
in [DAVIS05]; tested against numpy's dense inverse.
"""

import numpy as np
from numba import njit

SMALLEST_PIVOT = 1e-14  # of a matrix of unit diagonal: smaller pivots are raised to it, so that null vectors appear


@njit(cache=True, error_model="numpy")
def symbolic(n, ap, ai):
    """Elimination tree (n,) and column pointers (n + 1,) of L. Source: [DAVIS05] ldl_symbolic."""
    parent, flag, count = np.full(n, -1), np.full(n, -1), np.zeros(n, np.int64)
    for k in range(n):
        flag[k] = k
        for p in range(ap[k], ap[k + 1]):
            i = ai[p]
            while i < k and flag[i] != k:
                if parent[i] == -1:
                    parent[i] = k
                count[i] += 1
                flag[i] = k
                i = parent[i]
    pointers = np.zeros(n + 1, np.int64)
    for k in range(n):
        pointers[k + 1] = pointers[k] + count[k]
    return parent, pointers


@njit(cache=True, error_model="numpy")
def numeric(n, ap, ai, ax, parent, lp):
    """L (rows and values, unit diagonal left out), D (n,), and True if a pivot was raised.

    Source: [DAVIS05] ldl_numeric.
    """
    li, lx, d = np.empty(lp[n], np.int64), np.empty(lp[n]), np.empty(n)
    y, pattern, flag, filled = np.zeros(n), np.empty(n, np.int64), np.full(n, -1), np.zeros(n, np.int64)
    raised = False
    for k in range(n):
        top, flag[k] = n, k
        for p in range(ap[k], ap[k + 1]):
            i = ai[p]
            y[i] += ax[p]
            length = 0
            while flag[i] != k:
                pattern[length] = i
                length += 1
                flag[i] = k
                i = parent[i]
            while length > 0:
                top -= 1
                length -= 1
                pattern[top] = pattern[length]
        d[k] = y[k]
        y[k] = 0.0
        for q in range(top, n):
            i = pattern[q]
            yi, y[i] = y[i], 0.0
            end = lp[i] + filled[i]
            for p in range(lp[i], end):
                y[li[p]] -= lx[p] * yi
            lki = yi / d[i]
            d[k] -= lki * yi
            li[end], lx[end] = k, lki
            filled[i] += 1
        if not d[k] > SMALLEST_PIVOT:
            d[k], raised = SMALLEST_PIVOT, True
    return li, lx, d, raised


@njit(cache=True, error_model="numpy")
def solve(lp, li, lx, d, b):
    """Overwrite b (n, k) with (L D L')^-1 b."""
    n, k = b.shape
    for j in range(n):
        for p in range(lp[j], lp[j + 1]):
            for c in range(k):
                b[li[p], c] -= lx[p] * b[j, c]
    for j in range(n - 1, -1, -1):
        for c in range(k):
            b[j, c] /= d[j]
        for p in range(lp[j], lp[j + 1]):
            for c in range(k):
                b[j, c] -= lx[p] * b[li[p], c]


@njit(cache=True, error_model="numpy")
def solve_units(lp, li, lx, d, at, values):
    """Rows `at` (k, k) of (L D L')^-1 times unit vectors `at` (k,) of some values (k,), as `solve` gives them.

    Only the ancestors of `at` in the elimination tree are visited: all else is zero on the way down, and unused on
    the way up. The first entry below a column's diagonal is its parent.
    """
    n, k = len(d), len(at)
    local = np.full(n, -1)
    for c in range(k):
        j = at[c]
        while local[j] < 0:
            local[j] = 0
            if lp[j] == lp[j + 1]:
                break
            j = li[lp[j]]
    reached = np.flatnonzero(local == 0)
    for r in range(len(reached)):
        local[reached[r]] = r
    b = np.zeros((len(reached), k))
    for c in range(k):
        b[local[at[c]], c] = values[c]
    for r in range(len(reached)):
        j = reached[r]
        for p in range(lp[j], lp[j + 1]):
            i = local[li[p]]
            for c in range(k):
                b[i, c] -= lx[p] * b[r, c]
    for r in range(len(reached) - 1, -1, -1):
        j = reached[r]
        for c in range(k):
            b[r, c] /= d[j]
        for p in range(lp[j], lp[j + 1]):
            i = local[li[p]]
            for c in range(k):
                b[r, c] -= lx[p] * b[i, c]
    result = np.empty((k, k))
    for c in range(k):
        result[c] = b[local[at[c]]]
    return result


@njit(cache=True, error_model="numpy")
def selected_inverse(lp, li, lx, d):
    """Inverse on the pattern of L: values in the order of `lx`, and the diagonal.

    Source: [TAKAHASHI73].
    """
    n = len(d)
    z, diagonal = np.zeros(len(lx)), np.zeros(n)
    column, total, mark = np.zeros(n), np.zeros(n), np.full(n, -1)
    for j in range(n - 1, -1, -1):
        for p in range(lp[j], lp[j + 1]):
            mark[li[p]], column[li[p]], total[li[p]] = j, lx[p], 0.0
        for p in range(lp[j], lp[j + 1]):
            k = li[p]
            total[k] += diagonal[k] * column[k]
            for q in range(lp[k], lp[k + 1]):
                i = li[q]
                if mark[i] == j:
                    total[i] += z[q] * column[k]
                    total[k] += z[q] * column[i]
        diagonal[j] = 1.0 / d[j]
        for p in range(lp[j], lp[j + 1]):
            z[p] = -total[li[p]]
            diagonal[j] -= lx[p] * z[p]
    return z, diagonal


@njit(cache=True, error_model="numpy")
def entry(lp, li, z, diagonal, i, j):
    """Entry (i, j) of the selected inverse; nan off the pattern."""
    if i == j:
        return diagonal[i]
    row, column = max(i, j), min(i, j)
    low, high = lp[column], lp[column + 1]
    while low < high:
        middle = (low + high) // 2
        if li[middle] < row:
            low = middle + 1
        else:
            high = middle
    if low < lp[column + 1] and li[low] == row:
        return z[low]
    return np.nan


@njit(cache=True, error_model="numpy")
def products(lp, li, z, diagonal, columns, a):
    """Sum over j of Q_ij a_j for each row of columns, a (m, w).

    -1 in columns is skipped.
    """
    m, w = columns.shape
    result = np.zeros((m, w))
    for row in range(m):
        for q in range(w):
            if columns[row, q] < 0 or a[row, q] == 0.0:
                continue
            for p in range(w):
                if columns[row, p] >= 0:
                    result[row, p] += a[row, q] * entry(lp, li, z, diagonal, columns[row, p], columns[row, q])
    return result
