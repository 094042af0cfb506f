"""Compiled fast path of `positions`: blocks of targets, one array per quantity.

It takes undamped Gauss-Newton steps from the closed-form start and returns only results that converged smoothly; all
other targets are left to the plain form in `start` and `descent`, which is also its test. Import it only for large
problems: loading numba takes longer than a hundred thousand positions.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

LANES = 32  # targets per block: several register widths, and all ranges fit the first-level cache
SWEEPS = 4  # of Jacobi rotations; three usually suffice
DIAGONAL = 1e-11  # of the trace: limit of off-diagonal elements; the start is then accurate to a nanometre

_compiled = njit(cache=True, error_model="numpy", fastmath={"contract"}, nogil=True)
_inlined = njit(error_model="numpy", fastmath={"contract"})  # cached with their caller


class MeasuredRanges(NamedTuple):
    """Input of k targets: ranges d (k, s) m, nan if missing.

    sigma (1 or k, s) m; near (1 or k, 3) m.
    """

    d: np.ndarray
    sigma: np.ndarray
    near: np.ndarray


class StationPlane(NamedTuple):
    """Stations (s, 3) m and their principal plane, relative to `origin` (3,) m.

    `half_square` (s,), `rows` (3, s), and `frame` (5, 3): centre, three axes and inverse extents, see `start.Planes`.
    """

    stations: np.ndarray
    half_square: np.ndarray
    rows: np.ndarray
    frame: np.ndarray
    origin: np.ndarray


class PositionLimits(NamedTuple):
    """Thresholds of the same names in `start` and `descent`."""

    flat: float
    significant: float
    enough: float
    singular: float
    bent: float
    contradiction: float
    cap: int


class Answers(NamedTuple):
    """Output arrays as in `Positions`, and `good` (k,) bool, True for reliable results."""

    x: np.ndarray
    covariance: np.ndarray
    ranges: np.ndarray
    iterations: np.ndarray
    pvv: np.ndarray
    good: np.ndarray


@_inlined
def _load(block, table, first, lanes):
    """Rows of a table as one array per station.

    The last row fills a short block.
    """
    for j in range(LANES):
        row = first + min(j, lanes - 1)
        for i in range(table.shape[1]):
            block[i, j] = table[row, i]


@_inlined
def _complete(ranges, count, clear):
    """True if a block has all ranges.

    `clear` marks lanes without negative or infinite ones.
    """
    total, low = np.zeros(LANES), np.zeros(LANES)
    for i in range(ranges.shape[0]):
        for j in range(LANES):
            total[j] += ranges[i, j]
            low[j] = min(low[j], ranges[i, j])
    complete = True
    for j in range(LANES):
        count[j] = ranges.shape[0]
        clear[j] = low[j] >= 0.0 and total[j] < np.inf
        complete = complete and total[j] == total[j]
    return complete


@_inlined
def _weigh(ranges, spread, root, count, clear):
    """Reciprocal sigmas of a block.

    A missing range gets 0 and weight 0.

    `clear` marks lanes whose ranges are all valid.
    """
    unfit = np.zeros(LANES)
    count[:] = 0.0
    for i in range(ranges.shape[0]):
        for j in range(LANES):
            d, u = ranges[i, j], spread[i, j]
            present = d == d
            fit = (d >= 0.0) & (d < np.inf) & (u > 0.0) & (u < np.inf)
            unfit[j] += 1.0 if present & (not fit) else 0.0
            count[j] += 1.0 if present else 0.0
            root[i, j] = 1.0 / u if present & fit else 0.0
            ranges[i, j] = d if present & fit else 0.0
            spread[i, j] = u if present & fit else 0.0
    for j in range(LANES):
        clear[j] = unfit[j] == 0.0


@_inlined
def _common_figure(ranges, spread, site, figure, z):
    """Common frame of targets seen by all stations, and coordinates along it, see `_height`."""
    z[:] = 0.0
    figure[:] = site.frame.reshape(5, 3, 1)
    for i in range(ranges.shape[0]):
        g0, g1, g2, half = site.rows[0, i], site.rows[1, i], site.rows[2, i], site.half_square[i]
        for j in range(LANES):
            y = half - 0.5 * ranges[i, j] * ranges[i, j]
            e = g2 * ranges[i, j] * spread[i, j]
            z[0, j] += g0 * y
            z[1, j] += g1 * y
            z[2, j] += g2 * y
            z[3, j] += y
            z[4, j] += e * e


@_inlined
def _moments(ranges, root, stations, count, figure, m):
    """Centre of the visible stations, into figure[0].

    m gets the sums of q q (xx, yy, zz, yz, xz, xy), q y and y.
    """
    figure[0], m[:] = 0.0, 0.0
    for i in range(ranges.shape[0]):
        sx, sy, sz = stations[i, 0], stations[i, 1], stations[i, 2]
        for j in range(LANES):
            w = 1.0 / max(count[j], 1.0) if root[i, j] > 0.0 else 0.0
            figure[0, 0, j] += w * sx
            figure[0, 1, j] += w * sy
            figure[0, 2, j] += w * sz
    for i in range(ranges.shape[0]):
        sx, sy, sz = stations[i, 0], stations[i, 1], stations[i, 2]
        for j in range(LANES):
            w = 1.0 if root[i, j] > 0.0 else 0.0
            qx, qy, qz = w * (sx - figure[0, 0, j]), w * (sy - figure[0, 1, j]), w * (sz - figure[0, 2, j])
            y = 0.5 * (qx * qx + qy * qy + qz * qz - ranges[i, j] * ranges[i, j])
            m[0, j] += qx * qx
            m[1, j] += qy * qy
            m[2, j] += qz * qz
            m[3, j] += qy * qz
            m[4, j] += qx * qz
            m[5, j] += qx * qy
            m[6, j] += qx * y
            m[7, j] += qy * y
            m[8, j] += qz * y
            m[9, j] += y


@_inlined
def _rotation(p, q, off):
    """Tangent, cosine, sine of the smaller rotation that diagonalises (p, off; off, q)."""
    gap = q - p
    t = math.copysign(2.0, gap) * off / (abs(gap) + math.sqrt(gap * gap + 4.0 * off * off) + 1e-300)
    c = 1.0 / math.sqrt(1.0 + t * t)
    return t, c, t * c


@_inlined
def _turned(c, s, p, q):
    """Two axes after that rotation."""
    return (
        (c * p[0] - s * q[0], c * p[1] - s * q[1], c * p[2] - s * q[2]),
        (s * p[0] + c * q[0], s * p[1] + c * q[1], s * p[2] + c * q[2]),
    )


@_inlined
def _principal_axes(m, figure):
    """Axes of each lane's moments by Jacobi rotations, into figure[1:4].

    Extents into m[0:3].
    """
    figure[1:4] = np.eye(3).reshape(3, 3, 1)
    for _ in range(SWEEPS):
        for j in range(LANES):
            xx, yy, zz, yz, xz, xy = m[0, j], m[1, j], m[2, j], m[3, j], m[4, j], m[5, j]
            u = (figure[1, 0, j], figure[1, 1, j], figure[1, 2, j])
            v = (figure[2, 0, j], figure[2, 1, j], figure[2, 2, j])
            w = (figure[3, 0, j], figure[3, 1, j], figure[3, 2, j])
            t, c, s = _rotation(xx, yy, xy)
            xx, yy, xy, xz, yz = xx - t * xy, yy + t * xy, 0.0, c * xz - s * yz, s * xz + c * yz
            u, v = _turned(c, s, u, v)
            t, c, s = _rotation(xx, zz, xz)
            xx, zz, xz, xy, yz = xx - t * xz, zz + t * xz, 0.0, -s * yz, c * yz
            u, w = _turned(c, s, u, w)
            t, c, s = _rotation(yy, zz, yz)
            yy, zz, yz, xy, xz = yy - t * yz, zz + t * yz, 0.0, c * xy - s * xz, s * xy + c * xz
            v, w = _turned(c, s, v, w)
            m[0, j], m[1, j], m[2, j], m[3, j], m[4, j], m[5, j] = xx, yy, zz, yz, xz, xy
            figure[1, 0, j], figure[1, 1, j], figure[1, 2, j] = u
            figure[2, 0, j], figure[2, 1, j], figure[2, 2, j] = v
            figure[3, 0, j], figure[3, 1, j], figure[3, 2, j] = w


@_inlined
def _normal_last(m, figure):
    """Exchange axes so that the one of smallest extent is the third."""
    for k in range(2):
        for j in range(LANES):
            swap = m[k, j] < m[2, j]
            m[k, j], m[2, j] = (m[2, j], m[k, j]) if swap else (m[k, j], m[2, j])
            for c in range(3):
                p, q = figure[k + 1, c, j], figure[3, c, j]
                figure[k + 1, c, j], figure[3, c, j] = (q, p) if swap else (p, q)


@_inlined
def _visible_figure(block, stations, count, flat, figure, m, z, clear):
    """Frame of the visible stations per target.

    A lane is not clear if they are collinear or too few.

    `block` are ranges, their spread and the roots of their weights.
    """
    ranges, spread, root = block
    _moments(ranges, root, stations, count, figure, m)
    _principal_axes(m, figure)
    _normal_last(m, figure)
    z[4] = 0.0
    for j in range(LANES):
        longest, least = max(m[0, j], m[1, j]), min(m[0, j], m[1, j])
        off = abs(m[3, j]) + abs(m[4, j]) + abs(m[5, j])
        clear[j] = clear[j] and count[j] >= 3.0 and least > flat * longest and off <= DIAGONAL * longest
        for c in range(3):
            inverse = 1.0 / m[c, j] if m[c, j] > flat * longest else 0.0
            along = figure[c + 1, 0, j] * m[6, j] + figure[c + 1, 1, j] * m[7, j] + figure[c + 1, 2, j] * m[8, j]
            figure[4, c, j], z[c, j] = inverse, along * inverse
        z[3, j] = m[9, j]
    for i in range(ranges.shape[0]):
        sx, sy, sz = stations[i, 0], stations[i, 1], stations[i, 2]
        for j in range(LANES):
            g = (sx - figure[0, 0, j]) * figure[3, 0, j] + (sy - figure[0, 1, j]) * figure[3, 1, j]
            g += (sz - figure[0, 2, j]) * figure[3, 2, j]
            e = g * figure[4, 2, j] * ranges[i, j] * spread[i, j]
            z[4, j] += e * e


@_inlined
def _closed_start(figure, z, count, near, significant, x, clear):
    """Closed-form start as in `start.starts`.

    z: coordinates along the axes, sum of y, variance of the third, which the height then replaces.
    """
    for j in range(LANES):
        square = -2.0 * z[3, j] / count[j] - z[0, j] * z[0, j] - z[1, j] * z[1, j]
        significant_side = z[2, j] * z[2, j] > significant * significant * z[4, j]
        side = (near[0, j] - figure[0, 0, j]) * figure[3, 0, j] + (near[1, j] - figure[0, 1, j]) * figure[3, 1, j]
        side += (near[2, j] - figure[0, 2, j]) * figure[3, 2, j]
        sign = math.copysign(1.0, z[2, j] if significant_side else side)
        lateral = z[0, j] * z[0, j] * figure[4, 0, j] + z[1, j] * z[1, j] * figure[4, 1, j]
        normal_square = z[2, j] * z[2, j]
        spread = significant_side and (
            square < 0.25 * normal_square or normal_square * figure[4, 2, j] < 1.0 / count[j] + lateral
        )
        h = sign * (abs(z[2, j]) if spread else math.sqrt(max(square, 0.0)))
        clear[j] = clear[j] and h != 0.0 and (significant_side or abs(side) > 0.0)
        z[4, j] = h
        for c in range(3):
            x[c, j] = figure[0, c, j] + z[0, j] * figure[1, c, j] + z[1, j] * figure[2, c, j] + h * figure[3, c, j]


@_inlined
def _evaluate(ranges, root, stations, x, a):
    """Normal matrix (a[0:6]), right-hand side (6:9), cost (9) and squared curvature (10) of a block."""
    a[:] = 0.0
    for i in range(ranges.shape[0]):
        sx, sy, sz = stations[i, 0], stations[i, 1], stations[i, 2]
        for j in range(LANES):
            ux, uy, uz = x[0, j] - sx, x[1, j] - sy, x[2, j] - sz
            square = ux * ux + uy * uy + uz * uz
            f = root[i, j] / math.sqrt(square)
            v = root[i, j] * ranges[i, j] - square * f
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
def _step(a, x, q, tally, singular, clear):
    """One Gauss-Newton step of a block.

    tally: predicted next step, pvv after this one, bend; squares.
    """
    for j in range(LANES):
        n0, n1, n2, n3, n4, n5 = a[0, j], a[1, j], a[2, j], a[3, j], a[4, j], a[5, j]
        q0, q1, q2 = n3 * n5 - n4 * n4, n2 * n4 - n1 * n5, n1 * n4 - n2 * n3
        q3, q4, q5 = n0 * n5 - n2 * n2, n1 * n2 - n0 * n4, n0 * n3 - n1 * n1
        det = n0 * q0 + n1 * q1 + n2 * q2
        trace = n0 + n3 + n5
        clear[j] = clear[j] and det > singular * trace * trace * trace
        scale = 1.0 / det
        q[0, j], q[1, j], q[2, j] = q0 * scale, q1 * scale, q2 * scale
        q[3, j], q[4, j], q[5, j] = q3 * scale, q4 * scale, q5 * scale
        ex = q[0, j] * a[6, j] + q[1, j] * a[7, j] + q[2, j] * a[8, j]
        ey = q[1, j] * a[6, j] + q[3, j] * a[7, j] + q[4, j] * a[8, j]
        ez = q[2, j] * a[6, j] + q[4, j] * a[7, j] + q[5, j] * a[8, j]
        x[0, j] += ex
        x[1, j] += ey
        x[2, j] += ez
        square = ex * ex + ey * ey + ez * ez
        spread = q[0, j] + q[3, j] + q[5, j]
        tally[0, j] = a[10, j] * square * (0.5 * square + 2.0 * a[9, j] * spread)
        tally[1, j] = max(a[9, j] - (ex * a[6, j] + ey * a[7, j] + ez * a[8, j]), 0.0)
        tally[2, j] = 0.25 * a[10, j] * spread * spread


@_inlined
def _same_side(x, figure, height, j):
    """True if lane j is still on the side of the stations' plane where it started."""
    over = 0.0
    for c in range(3):
        over += (x[c, j] - figure[0, c, j]) * figure[3, c, j]
    return over * height > 0.0


@_inlined
def _leave(answers, t, j, at, q, origin):
    """Store lane j of a block as the result of target t."""
    x, c = answers.x, answers.covariance
    x[t, 0], x[t, 1], x[t, 2] = at[0, j] + origin[0], at[1, j] + origin[1], at[2, j] + origin[2]
    c[t, 0, 0], c[t, 1, 1], c[t, 2, 2] = q[0, j], q[3, j], q[5, j]
    c[t, 0, 1] = c[t, 1, 0] = q[1, j]
    c[t, 0, 2] = c[t, 2, 0] = q[2, j]
    c[t, 1, 2] = c[t, 2, 1] = q[4, j]


@_compiled
def locate(measured, site, limits, answers):
    """Positions of the targets of one chunk, written into the output arrays."""
    k, s = measured.d.shape
    ranges, spread, root = np.empty((s, LANES)), np.empty((s, LANES)), np.empty((s, LANES))
    figure, m, z, near = np.empty((5, 3, LANES)), np.empty((10, LANES)), np.empty((5, LANES)), np.empty((3, LANES))
    at, a, q, tally = np.empty((3, LANES)), np.empty((11, LANES)), np.empty((6, LANES)), np.empty((3, LANES))
    count, clear = np.empty(LANES), np.empty(LANES, dtype=np.bool_)
    shared, ready = measured.sigma.shape[0] == 1, False
    for first in range(0, k, LANES):
        lanes = min(LANES, k - first)
        _load(ranges, measured.d, first, lanes)
        complete = _complete(ranges, count, clear)
        if not (complete and ready):
            _load(spread, measured.sigma, 0 if shared else first, 1 if shared else lanes)
            _weigh(ranges, spread, root, count, clear)
            ready = complete and shared  # shared sigmas need not be computed again
        if measured.near.shape[0] > 1 or first == 0:
            _load(near, measured.near, first, min(lanes, measured.near.shape[0]))
        if complete:
            _common_figure(ranges, spread, site, figure, z)
        else:
            _visible_figure((ranges, spread, root), site.stations, count, limits.flat, figure, m, z, clear)
        _closed_start(figure, z, count, near, limits.significant, at, clear)
        for j in range(lanes):
            answers.good[first + j], answers.ranges[first + j] = False, int(count[j])
        waiting, steps = True, 0
        while waiting and steps < limits.cap:
            steps += 1
            _evaluate(ranges, root, site.stations, at, a)
            _step(a, at, q, tally, limits.singular, clear)
            waiting = False
            for j in range(lanes):
                if not clear[j]:
                    continue
                if not tally[0, j] < limits.enough * limits.enough:
                    waiting = True
                    continue
                _leave(answers, first + j, j, at, q, site.origin)
                answers.pvv[first + j], answers.iterations[first + j] = tally[1, j], steps
                most = limits.contradiction**2 * (count[j] - 3.0) if count[j] > 3.0 else 1.0
                reliable = tally[2, j] < limits.bent * limits.bent and tally[1, j] <= most
                answers.good[first + j] = reliable and _same_side(at, figure, z[4, j], j)
                clear[j] = False  # finished: further steps of its block do not change it
