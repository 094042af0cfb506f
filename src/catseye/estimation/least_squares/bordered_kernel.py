"""Blocks of parameters eliminated from normal equations, compiled. Imported only when a large problem needs it.

A block c has l parameters of its own, which meet those of no other block, and b of the border, which many share. Arrays
of all blocks stand one after the other: `inside` (l, l) and `reach` (l, b), row by row. The plain form that these are
tested against is numpy's dense inverse.
"""

import numpy as np
from numba import njit

SMALLEST_PIVOT = 1e-14  # of a block of unit diagonal: what falls below is not held


@njit(cache=True, error_model="numpy")
def eliminate(row_pointers, rows_of, at, values, own, own_first, border, border_first, inside_first, reach_first, size):
    """What is left of N = A' A for the border, and how each block follows from it.

    row_pointers    (m + 1,) of the rows, block by block, those without a block last
    rows_of         (c + 2,) first row of each block, of those without, and their end
    at              (e,) place of each entry: in its block's own parameters, then l + place in its part of the border;
                    in rows without a block the border's index
    values          (e,)
    own, border     l and b of each block as pointers are `own_first`, `border_first`; `border` the border's indices
    inside_first, reach_first   (c + 1,) where each block's arrays begin
    size            g of the border

    Returns inside = V^-1 and reach = V^-1 B of all blocks, S (g, g) = N_bb - B' V^-1 B, its lower triangle, and if a
    block is not held.
    """
    count = len(own)
    inside, reach = np.zeros(inside_first[count]), np.zeros(reach_first[count])
    s = np.zeros((size, size))
    loose = False
    widest, longest = 1, 1
    for c in range(count):
        widest = max(widest, own[c])
        longest = max(longest, border_first[c + 1] - border_first[c])
    v, inverse = np.empty((widest, widest)), np.empty((widest, widest))
    crossed, solved = np.empty((longest, widest)), np.empty((longest, widest))
    for c in range(count):
        n, first = own[c], border_first[c]
        b = border_first[c + 1] - first
        v[:n, :n] = 0.0
        crossed[:b, :n] = 0.0
        for row in range(rows_of[c], rows_of[c + 1]):
            for p in range(row_pointers[row], row_pointers[row + 1]):
                i, a = at[p], values[p]
                for q in range(row_pointers[row], row_pointers[row + 1]):
                    j = at[q]
                    if i < n:
                        if j < n:
                            v[i, j] += a * values[q]
                    elif j < n:
                        crossed[i - n, j] += a * values[q]
                    elif i >= j:
                        s[border[first + i - n], border[first + j - n]] += a * values[q]
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
        for i in range(b):  # L^-1 B, a row each of the border
            for k in range(n):
                value = 0.0
                for j in range(k + 1):
                    value += inverse[k, j] * crossed[i, j]
                solved[i, k] = value
        for i in range(b):
            line = s[border[first + i]]
            for j in range(i + 1):
                value = 0.0
                for k in range(n):
                    value += solved[i, k] * solved[j, k]
                line[border[first + j]] -= value
        begin = inside_first[c]
        for i in range(n):
            for j in range(n):
                value = 0.0
                for k in range(max(i, j), n):
                    value += inverse[k, i] * inverse[k, j]
                inside[begin + i * n + j] = value
        begin = reach_first[c]
        for i in range(n):
            for j in range(b):
                value = 0.0
                for k in range(i, n):
                    value += inverse[k, i] * solved[j, k]
                reach[begin + i * b + j] = value
    for row in range(rows_of[count], rows_of[count + 1]):
        for p in range(row_pointers[row], row_pointers[row + 1]):
            for q in range(row_pointers[row], row_pointers[row + 1]):
                if at[p] >= at[q]:
                    s[at[p], at[q]] += values[p] * values[q]
    return inside, reach, s, loose


@njit(cache=True, error_model="numpy")
def mirrored(s):
    """Fill the upper triangle of (g, g) from the lower, tile by tile; in place."""
    n, tile = len(s), 64
    for top in range(0, n, tile):
        for left in range(0, top + 1, tile):
            for i in range(top, min(top + tile, n)):
                for j in range(left, min(left + tile, i)):
                    s[j, i] = s[i, j]


@njit(cache=True, error_model="numpy")
def selected(own, border_first, border, inside_first, reach_first, inside, reach, z):
    """Covariance of each block with itself, and with its part of the border; arrays as `inside` and `reach`.

    z   (g, g) covariance of the border
    """
    with_itself, with_border = inside.copy(), np.empty_like(reach)
    for c in range(len(own)):
        n, first = own[c], border_first[c]
        b = border_first[c + 1] - first
        begin, at = inside_first[c], reach_first[c]
        for i in range(n):
            with_border[at + i * b : at + (i + 1) * b] = 0.0
        for k in range(b):
            line = z[border[first + k]]
            for j in range(b):
                value = line[border[first + j]]
                for i in range(n):
                    with_border[at + i * b + j] -= reach[at + i * b + k] * value
        for i in range(n):
            for j in range(n):
                value = 0.0
                for k in range(b):
                    value += with_border[at + i * b + k] * reach[at + j * b + k]
                with_itself[begin + i * n + j] -= value
    return with_itself, with_border


@njit(cache=True, error_model="numpy")
def products(block, place, a, own, border_first, border, inside_first, reach_first, with_itself, with_border, reach, z):
    """Sum over j of Q_ij a_j for each row of parameters, of one block at most beside those of the border.

    block, place   (m, w) block of each parameter (-1: border, -2: none) and its place there
    a              (m, w)
    """
    m, w = block.shape
    result = np.zeros((m, w))
    inner = np.empty(w, np.int64)
    for row in range(m):
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
                    low, high = 0, b
                    while low < high:
                        middle = (low + high) // 2
                        if border[first + middle] < place[row, i]:
                            low = middle + 1
                        else:
                            high = middle
                    inner[i] = low if low < b and border[first + low] == place[row, i] else -1
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
    return result


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
