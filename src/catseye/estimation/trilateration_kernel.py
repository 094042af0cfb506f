"""The compiled fast lane of `trilateration.positions`: whole blocks of targets at once, one array a quantity.

It takes undamped Gauss-Newton steps from a start close to the answer and vouches only for what went smoothly; every
other target is left to the plain form in `trilateration`, which is also its test. Import it only when a problem is
large: loading numba takes longer than a hundred thousand positions.
"""

import math

import numpy as np
from numba import njit

LANES = 32  # targets a block: what fits the registers' width several times and the first cache with all its ranges
CAP = 8  # evaluations; from the closed form one or two are usual
ROUNDING, NOTHING = 1.0 + 1e-12, 1e-6  # of a sum of squares: a growth below these is no step uphill

_compiled = njit(cache=True, error_model="numpy", fastmath={"contract"}, nogil=True)
_inlined = njit(error_model="numpy", fastmath={"contract"})  # kept with their caller


@_inlined
def _load(block, table, first, lanes):
    """Rows of a table turned into one array a station; the last row fills what a short block leaves over."""
    for j in range(LANES):
        row = first + min(j, lanes - 1)
        for i in range(table.shape[1]):
            block[i, j] = table[row, i]


@_inlined
def _closed_start(d, sigma, half_square, rows, frame, side, first, lanes, significance, x, clear):
    """The closed form of `trilateration._starts`, for stations that all see; frame as in `locate`."""
    z = np.zeros((6, LANES))
    for i in range(d.shape[0]):
        g0, g1, g2, half = rows[0, i], rows[1, i], rows[2, i], half_square[i]
        for j in range(LANES):
            y = half - 0.5 * d[i, j] * d[i, j]
            e = g2 * d[i, j] * sigma[i, j]
            z[0, j] += g0 * y
            z[1, j] += g1 * y
            z[2, j] += g2 * y
            z[3, j] += y
            z[4, j] += e * e
            z[5, j] = min(z[5, j], d[i, j])
    for j in range(LANES):
        square = -2.0 * z[3, j] / d.shape[0] - z[0, j] * z[0, j] - z[1, j] * z[1, j]
        told = z[2, j] * z[2, j] > significance * significance * z[4, j]
        sign = math.copysign(1.0, z[2, j]) if told else side[first + min(j, lanes - 1)]
        lateral, own = z[0, j] * z[0, j] * frame[4, 0] + z[1, j] * z[1, j] * frame[4, 1], z[2, j] * z[2, j]
        spread = told and (square < 0.25 * own or own * frame[4, 2] < 1.0 / d.shape[0] + lateral)
        h = sign * (abs(z[2, j]) if spread else math.sqrt(max(square, 0.0)))
        clear[j] = h != 0.0 and z[5, j] >= 0.0
        for c in range(3):
            x[c, j] = frame[0, c] + z[0, j] * frame[1, c] + z[1, j] * frame[2, c] + h * frame[3, c]


@_inlined
def _evaluate(d, root, stations, x, a):
    """Normal matrix (a[0:6], upper rows), right side (6:9), cost (9) and squared curvature (10) of a block."""
    a[:] = 0.0
    for i in range(d.shape[0]):
        sx, sy, sz = stations[i, 0], stations[i, 1], stations[i, 2]
        for j in range(LANES):
            ux, uy, uz = x[0, j] - sx, x[1, j] - sy, x[2, j] - sz
            square = ux * ux + uy * uy + uz * uz
            f = root[i, j] / math.sqrt(square)
            v = root[i, j] * d[i, j] - square * f
            ux *= f
            uy *= f
            uz *= f
            a[0, j] += ux * ux
            a[1, j] += ux * uy
            a[2, j] += ux * uz
            a[3, j] += uy * uy
            a[4, j] += uy * uz
            a[5, j] += uz * uz
            a[6, j] += ux * v
            a[7, j] += uy * v
            a[8, j] += uz * v
            a[9, j] += v * v
            a[10, j] += f * f


@_inlined
def _step(a, x, cost, q, tally, floor, smooth):
    """One Gauss-Newton step of a block; tally: what foresees the next step, pvv after this one, bend; squares."""
    for j in range(LANES):
        n0, n1, n2, n3, n4, n5 = a[0, j], a[1, j], a[2, j], a[3, j], a[4, j], a[5, j]
        q0, q1, q2 = n3 * n5 - n4 * n4, n2 * n4 - n1 * n5, n1 * n4 - n2 * n3
        q3, q4, q5 = n0 * n5 - n2 * n2, n1 * n2 - n0 * n4, n0 * n3 - n1 * n1
        det = n0 * q0 + n1 * q1 + n2 * q2
        trace = n0 + n3 + n5
        smooth[j] = smooth[j] and det > floor * trace * trace * trace and a[9, j] <= cost[j] * ROUNDING + NOTHING
        scale = 1.0 / det
        q[0, j], q[1, j], q[2, j] = q0 * scale, q1 * scale, q2 * scale
        q[3, j], q[4, j], q[5, j] = q3 * scale, q4 * scale, q5 * scale
        ex = q[0, j] * a[6, j] + q[1, j] * a[7, j] + q[2, j] * a[8, j]
        ey = q[1, j] * a[6, j] + q[3, j] * a[7, j] + q[4, j] * a[8, j]
        ez = q[2, j] * a[6, j] + q[4, j] * a[7, j] + q[5, j] * a[8, j]
        x[0, j] += ex
        x[1, j] += ey
        x[2, j] += ez
        cost[j] = a[9, j]
        square = ex * ex + ey * ey + ez * ez
        spread = q[0, j] + q[3, j] + q[5, j]
        tally[0, j] = a[10, j] * square * (0.5 * square + 2.0 * cost[j] * spread)
        tally[1, j] = max(cost[j] - (ex * a[6, j] + ey * a[7, j] + ez * a[8, j]), 0.0)
        tally[2, j] = 0.25 * a[10, j] * spread * spread


@_compiled
def locate(
    d,
    sigma,
    stations,
    closed,
    half_square,
    rows,
    frame,
    side,
    limits,
    most,
    origin,
    x,
    covariance,
    pvv,
    iterations,
    good,
):
    """Positions of the targets of one chunk, written into x, covariance, pvv, iterations and good.

    d            (k, s) m; closed: nan where missing, which is not vouched for; else 0 there
    sigma        (1, s) or (k, s) m, infinite where missing
    stations     (s, 3) m
    closed       True starts from the closed form (every station sees); else x holds the starts
    half_square, rows   (s,), (3, s): of the stations' own plane, see `trilateration._Planes`
    frame        (5, 3) its centre, three axes, inverse
    side         (k,) sign of the image to take where the ranges do not tell it, 0 for unknown
    limits       SIGNIFICANT, ENOUGH, SINGULAR, BENT of `trilateration`
    most         (k,) pvv above which a target is left to be judged
    origin       (3,) m, added to the answer: stations, starts and frame are relative to it
    good         (k,) bool: True where the answer is vouched for
    """
    k, s = d.shape
    significance, enough, floor, bent = limits
    ranges, spread, root = np.empty((s, LANES)), np.empty((s, LANES)), np.empty((s, LANES))
    at, a, q, tally = np.empty((3, LANES)), np.empty((11, LANES)), np.empty((6, LANES)), np.empty((3, LANES))
    cost, smooth = np.empty(LANES), np.empty(LANES, dtype=np.bool_)
    shared = sigma.shape[0] == 1 and k != 1
    for first in range(0, k, LANES):
        lanes = min(LANES, k - first)
        _load(ranges, d, first, lanes)
        if not shared or first == 0:
            _load(spread, sigma, 0 if shared else first, 1 if shared else lanes)
            for i in range(s):
                for j in range(LANES):
                    root[i, j] = 1.0 / spread[i, j]
        if closed:
            _closed_start(ranges, spread, half_square, rows, frame, side, first, lanes, significance, at, smooth)
        else:
            _load(at, x, first, lanes)
            smooth[:] = True
        cost[:] = np.inf
        for j in range(lanes):
            good[first + j] = False
        waiting, taken = True, 0
        while waiting and taken < CAP:
            taken += 1
            _evaluate(ranges, root, stations, at, a)
            _step(a, at, cost, q, tally, floor, smooth)
            waiting = False
            for j in range(lanes):
                t = first + j
                if not smooth[j]:
                    continue
                if not tally[0, j] < enough * enough:
                    waiting = True
                    continue
                x[t, 0], x[t, 1], x[t, 2] = at[0, j] + origin[0], at[1, j] + origin[1], at[2, j] + origin[2]
                covariance[t, 0, 0], covariance[t, 1, 1], covariance[t, 2, 2] = q[0, j], q[3, j], q[5, j]
                covariance[t, 0, 1] = covariance[t, 1, 0] = q[1, j]
                covariance[t, 0, 2] = covariance[t, 2, 0] = q[2, j]
                covariance[t, 1, 2] = covariance[t, 2, 1] = q[4, j]
                pvv[t], iterations[t] = tally[1, j], taken
                good[t] = tally[2, j] < bent * bent and tally[1, j] <= most[t]
                smooth[j] = False  # it has its answer: what more its block needs does not move it
