"""Compiled elimination of targets from a ranging network.

Plain form in `blocks`.

Targets are stored in blocks of LANES, one lane each; a slot is one station (or its repetition) over the lanes of a
block, so that every inner loop runs over lanes and fills the vector unit. A lane without a range has root weight zero.
Per slot and lane: a = root (1 + scale) u, u from station to target; the whitened derivative by the target is a, that by
the station's parameters g = (-a, root, root D). With V = sum a a' and c_rs = a_r' V^-1 a_s the reduced normal matrix is
the sum of (delta_rs - c_rs) g_r g_s': 15 multiply-adds per pair of stations and target.

For the statistics a and g are whitened with the claimed sigma, and phi is the root weight in the solution over that of
the claim. With E_rs = g_r' Q_rs g_s, F_r = sum_s E_rs phi_s^2 a_s, M = sum_r phi_r^2 a_r F_r' and p = V^-1 a the
target's covariance is V^-1 + V^-1 M V^-1, and the variance of a predicted range, in units of its claimed variance,
E_rr - 2 F_r.p_r + a_r.p_r + p_r' M p_r: also of a left-out range (phi = 0).

All code is in one file because the cache of compiled code does not notice changes in other files. Views are taken by
row and fixed offset: an index that might be negative prevents vectorisation.
Source: [FOERSTNER16] chapter 15, elimination of points from the normal equations of a bundle.
"""

from dataclasses import replace

import numpy as np
from numba import njit

from catseye.estimation.network.multilateration.blocks import (
    NONCENTRALITY,
    UNCHECKED,
    IterationState,
    Problem,
    Reduced,
    Statistics,
)
from catseye.estimation.network.multilateration.layout_kernel import by_target, fill, gather, slots_of

LANES = 128
ROWS = 7  # of a slot's scratch: a (3), derivatives by zero and scale (2), misclosure, phi^2
ASSOCIATIVE = {"reassoc", "contract", "nsz"}  # sums over lanes may be reordered; nan and infinity are preserved
SMALLEST = 1e-300  # keeps the direction between coinciding points finite; they are detected by their distance


class KernelBlocks:
    """Compiled form of `NumpyBlocks`: same constructor, methods and results."""

    def __init__(self, problem: Problem):
        self.problem = problem
        self._priors = np.zeros((0, 3, 3)), np.zeros((0, 3))
        if problem.target_weight is not None and problem.target_value is not None:
            self._priors = problem.target_weight, problem.target_value
        self._free = problem.free_targets.astype(float)
        stations, t = len(problem.free_stations), len(problem.free_targets)
        first, rows, pattern = by_target(problem.station, problem.target, t)
        order = np.arange(t) if np.all(pattern == pattern[0]) else np.argsort(pattern, kind="stable")
        if stations < 64 and len(rows) == stations * t and np.all(pattern == np.uint64(2**stations - 1)):
            blocks = -(-t // LANES)  # every target sees every station once
            slots, ends = np.tile(np.arange(stations, dtype=np.int32), blocks), np.arange(blocks + 1) * stations
        else:
            slots, ends = slots_of(problem.station, first, rows, order, stations, LANES)
        inflation = np.zeros(0) if problem.inflation is None else problem.inflation
        ranges = problem.station, problem.distance, problem.sigma, inflation
        observed, root, self._index = fill(ranges, first, rows, order, ends, slots, LANES)
        self._packed = slots, ends, order, observed, root

    def reduce(self, state: IterationState) -> Reduced:
        """Elimination, as `NumpyBlocks.reduce`."""
        p, n = self.problem.width, len(self.problem.free_stations) * self.problem.width
        t = len(self._free)
        normal, before, right = np.zeros((n, n)), np.zeros(n), np.zeros(n)
        inverse, target_step, condition = np.empty((t, 3, 3)), np.empty((t, 3)), np.empty(t)
        cost, gain, moment = _reduce(
            self._packed,
            (state.stations, state.targets, state.zero, state.scale),
            self._free,
            *self._priors,
            p,
            (normal, before, right),
            (inverse, target_step, condition),
        )
        return Reduced(
            normal=normal,
            before=before,
            right=right,
            inverse=inverse,
            target_step=target_step,
            condition=condition,
            cost=cost,
            gain=gain,
            moment=moment,
        )

    def follow(self, state: IterationState, old: Reduced) -> Reduced:
        """Right-hand side, as `NumpyBlocks.follow`."""
        right, target_step = np.zeros_like(old.right), np.empty_like(old.target_step)
        points = (state.stations, state.targets, state.zero, state.scale)
        cost, gain, moment = _follow(
            self._packed, points, *self._priors, old.inverse, self.problem.width, right, target_step
        )
        return replace(old, right=right, target_step=target_step, cost=cost, gain=gain, moment=moment)

    def back(self, state: IterationState, reduced: Reduced, step: np.ndarray) -> np.ndarray:
        """Back-substitution, as `NumpyBlocks.back`."""
        moved = np.empty((len(self._free), 3))
        points = (state.stations, state.targets, state.zero, state.scale)
        _back(self._packed, points, reduced.inverse, reduced.target_step, step, self.problem.width, moved)
        return moved

    def felt(self, at: IterationState, target_steps: np.ndarray) -> np.ndarray:
        """Effect on the stations, as `NumpyBlocks.felt`."""
        out = np.zeros((target_steps.shape[2], self.problem.free_stations.size))
        points = (at.stations, at.targets, at.zero, at.scale)
        _felt(self._packed, points, np.ascontiguousarray(target_steps.transpose(2, 0, 1)), self.problem.width, out)
        return out.T

    def statistics(self, at: IterationState, answer: IterationState, inverse: np.ndarray, q: np.ndarray) -> Statistics:
        """Covariances and tests, as `NumpyBlocks.statistics`."""
        m = len(self.problem.distance)
        covariance, out = np.empty((len(self._free), 3, 3)), (np.empty(m), np.empty(m), np.empty(m), np.empty(m))
        points = (at.stations, at.targets, at.zero, at.scale)
        ends = (answer.stations, answer.targets, answer.zero, answer.scale)
        inflated = self.problem.inflation is not None
        claimed = gather(1.0 / self.problem.sigma, self._index) if inflated else self._packed[-1]
        tests = (NONCENTRALITY, UNCHECKED)
        claims = (claimed, self._index, self.problem.width)
        _statistics(self._packed, claims, (points, ends), inverse, q, tests, covariance, out)
        return Statistics(covariance, *out)


@njit(cache=True, error_model="numpy")
def _place(order, b, xyz, x):
    """Coordinates of the targets of block b into x, by lane.

    Lanes past the end repeat the last target.
    """
    for lane in range(LANES):
        t = order[min(b * LANES + lane, len(order) - 1)]
        for i in range(3):
            x[i * LANES + lane] = xyz[t, i]


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _directions(x, at, zero, scale, distance, root, row):
    """Fill a slot's row: a, root, root D and misclosure.

    Returns its cost, sum of (root D)^2, and coincident weight.
    """
    sx, sy, sz = at[0], at[1], at[2]
    cost = moment = coincident = 0.0
    for lane in range(LANES):
        dx, dy, dz, w = x[lane] - sx, x[LANES + lane] - sy, x[2 * LANES + lane] - sz, root[lane]
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        f = w * (1.0 + scale) / max(d, SMALLEST)
        e = w * (distance[lane] - (1.0 + scale) * d - zero)
        row[lane], row[LANES + lane], row[2 * LANES + lane] = f * dx, f * dy, f * dz
        row[3 * LANES + lane], row[4 * LANES + lane], row[5 * LANES + lane] = w, w * d, e
        cost += e * e
        moment += w * d * w * d
        coincident += w if d == 0.0 else 0.0
    return cost, moment, coincident


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _misclose(x, at, zero, scale, distance, root, row):
    """Replace a slot's misclosure by that at other coordinates."""
    sx, sy, sz = at[0], at[1], at[2]
    for lane in range(LANES):
        dx, dy, dz = x[lane] - sx, x[LANES + lane] - sy, x[2 * LANES + lane] - sz
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        row[5 * LANES + lane] = root[lane] * (distance[lane] - (1.0 + scale) * d - zero)


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _gather_target(row, v):
    """Add one slot to V (rows 0 to 5: xx xy xz yy yz zz) and its right-hand side (rows 6 to 8)."""
    for lane in range(LANES):
        x, y, z, e = row[lane], row[LANES + lane], row[2 * LANES + lane], row[5 * LANES + lane]
        v[lane] += x * x
        v[LANES + lane] += x * y
        v[2 * LANES + lane] += x * z
        v[3 * LANES + lane] += y * y
        v[4 * LANES + lane] += y * z
        v[5 * LANES + lane] += z * z
        v[6 * LANES + lane] += x * e
        v[7 * LANES + lane] += y * e
        v[8 * LANES + lane] += z * e


@njit(cache=True, error_model="numpy")
def _add_priors(order, b, xyz, weight, value, v):
    for lane in range(min(LANES, len(order) - b * LANES)):
        t, k = order[b * LANES + lane], 0
        for i in range(3):
            for j in range(i, 3):
                v[k * LANES + lane] += weight[t, i, j]
                k += 1
            for j in range(3):
                v[(6 + i) * LANES + lane] += weight[t, i, j] * (value[t, j] - xyz[t, j])


@njit(cache=True, error_model="numpy")
def _invert(v, free, out):
    """Inverse of one V over its free coordinates, as xx xy xz yy yz zz.

    Zero elsewhere. Returns 1 / (tr V tr V^-1).
    """
    fx, fy, fz = free[0], free[1], free[2]
    a, b, c = v[0] * fx + (1.0 - fx), v[1] * fx * fy, v[2] * fx * fz
    d, e, f = v[3] * fy + (1.0 - fy), v[4] * fy * fz, v[5] * fz + (1.0 - fz)
    l1, l2 = b / a, c / a
    d1 = d - l1 * b
    m = e - l1 * c
    l3 = m / d1
    d2 = f - l2 * c - l3 * m
    zz = 1.0 / d2
    yz = -l3 * zz
    xz = -l1 * yz - l2 * zz
    yy = 1.0 / d1 - l3 * yz
    xy = -l1 * yy - l2 * yz
    xx = 1.0 / a - l1 * xy - l2 * xz
    out[0], out[1], out[2], out[3], out[4], out[5] = xx * fx, xy, xz, yy * fy, yz, zz * fz
    return 1.0 / ((v[0] * fx + v[3] * fy + v[5] * fz) * (out[0] + out[3] + out[5]))


@njit(cache=True, error_model="numpy")
def _solve_targets(order, b, v, free, inverse, target_step, condition, local):
    """Invert V and solve for the targets' steps of a block.

    Returns b' V^-1 b.

    V^-1 goes into `inverse` and rows 0 to 5 of `local`, V^-1 b into `target_step` and rows 6 to 8.
    """
    one, q, gain = np.empty(6), np.empty(6), 0.0
    local[:] = 0.0
    for lane in range(min(LANES, len(order) - b * LANES)):
        t = order[b * LANES + lane]
        for i in range(6):
            one[i] = v[i * LANES + lane]
        condition[t] = _invert(one, free[t], q)
        full = inverse[t]
        full[0, 0], full[1, 1], full[2, 2] = q[0], q[3], q[5]
        full[0, 1], full[0, 2], full[1, 2] = q[1], q[2], q[4]
        full[1, 0], full[2, 0], full[2, 1] = q[1], q[2], q[4]
        for i in range(6):
            local[i * LANES + lane] = q[i]
        for i in range(3):
            y = 0.0
            for j in range(3):
                y += full[i, j] * v[(6 + j) * LANES + lane]
            target_step[t, i] = y
            local[(6 + i) * LANES + lane] = y
            gain += y * v[(6 + i) * LANES + lane]
    return gain


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _times(local, row, out):
    """Product V^-1 a of one slot's block."""
    for lane in range(LANES):
        x, y, z = row[lane], row[LANES + lane], row[2 * LANES + lane]
        xx, xy, xz = local[lane], local[LANES + lane], local[2 * LANES + lane]
        yy, yz, zz = local[3 * LANES + lane], local[4 * LANES + lane], local[5 * LANES + lane]
        out[lane] = xx * x + xy * y + xz * z
        out[LANES + lane] = xy * x + yy * y + yz * z
        out[2 * LANES + lane] = xz * x + yz * y + zz * z


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _reduced_weights(row, p, local, remaining_weight, shortfall):
    """Reduced weights 1 - c_rr, and shortfalls e - a' V^-1 b, of one slot."""
    for lane in range(LANES):
        x, y, z = row[lane], row[LANES + lane], row[2 * LANES + lane]
        remaining_weight[lane] = 1.0 - (x * p[lane] + y * p[LANES + lane] + z * p[2 * LANES + lane])
        predicted = x * local[6 * LANES + lane] + y * local[7 * LANES + lane] + z * local[8 * LANES + lane]
        shortfall[lane] = row[5 * LANES + lane] - predicted


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _station(row, remaining_weight, shortfall, at, sums):
    """Add one slot to its station's diagonal block, its diagonal before elimination and right-hand side."""
    normal, before, right = sums
    xx = yx = yy = zx = zy = zz = bx = by = bz = rx = ry = rz = 0.0
    for lane in range(LANES):
        x, y, z, w = row[lane], row[LANES + lane], row[2 * LANES + lane], shortfall[lane]
        bx += x * x
        by += y * y
        bz += z * z
        rx += x * w
        ry += y * w
        rz += z * w
        u, v, w = remaining_weight[lane] * x, remaining_weight[lane] * y, remaining_weight[lane] * z
        xx += u * x
        yx += v * x
        yy += v * y
        zx += w * x
        zy += w * y
        zz += w * z
    for i, (d, r) in enumerate(((bx, rx), (by, ry), (bz, rz))):
        before[at + i] += d
        right[at + i] -= r
    normal[at, at] += xx
    normal[at + 1, at] += yx
    normal[at + 1, at + 1] += yy
    normal[at + 2, at] += zx
    normal[at + 2, at + 1] += zy
    normal[at + 2, at + 2] += zz


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _station_extra(row, remaining_weight, shortfall, at, sums):
    """Add one slot's zero and scale, as `_station`."""
    normal, before, right = sums
    for i in range(3, 5):
        g, total, gain = row[i * LANES : (i + 1) * LANES], 0.0, 0.0
        for lane in range(LANES):
            total += g[lane] * g[lane]
            gain += g[lane] * shortfall[lane]
        before[at + i] += total
        right[at + i] += gain
        for j in range(i + 1):
            h, total = row[j * LANES : (j + 1) * LANES], 0.0
            for lane in range(LANES):
                total += remaining_weight[lane] * g[lane] * h[lane]
            normal[at + i, at + j] += -total if j < 3 else total


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _pair(p, r, s, block):
    """Subtract the sum over lanes of c a_r a_s', c = p . a_s, from rows and columns 0 to 2 of block."""
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for lane in range(LANES):
        x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
        c = p[lane] * x + p[LANES + lane] * y + p[2 * LANES + lane] * z
        x, y, z = c * x, c * y, c * z
        u, v, w = r[lane], r[LANES + lane], r[2 * LANES + lane]
        xx += u * x
        xy += u * y
        xz += u * z
        yx += v * x
        yy += v * y
        yz += v * z
        zx += w * x
        zy += w * y
        zz += w * z
    block[0, 0] -= xx
    block[0, 1] -= xy
    block[0, 2] -= xz
    block[1, 0] -= yx
    block[1, 1] -= yy
    block[1, 2] -= yz
    block[2, 0] -= zx
    block[2, 1] -= zy
    block[2, 2] -= zz


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _pair_extra(p, r, s, block):
    """Subtract the terms of zero and scale: rows and columns 3 and 4 of block (5, 5)."""
    t33 = t34 = t43 = t44 = 0.0
    ax = ay = az = bx = by = bz = cx = cy = cz = dx = dy = dz = 0.0
    for lane in range(LANES):
        x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
        c = p[lane] * x + p[LANES + lane] * y + p[2 * LANES + lane] * z
        x, y, z = c * x, c * y, c * z
        r3, r4, s3, s4 = r[3 * LANES + lane], r[4 * LANES + lane], c * s[3 * LANES + lane], c * s[4 * LANES + lane]
        u, v, w = r[lane], r[LANES + lane], r[2 * LANES + lane]
        t33 += r3 * s3
        t34 += r3 * s4
        t43 += r4 * s3
        t44 += r4 * s4
        ax += r3 * x
        ay += r3 * y
        az += r3 * z
        bx += r4 * x
        by += r4 * y
        bz += r4 * z
        cx += u * s3
        cy += v * s3
        cz += w * s3
        dx += u * s4
        dy += v * s4
        dz += w * s4
    block[3, 3] -= t33
    block[3, 4] -= t34
    block[4, 3] -= t43
    block[4, 4] -= t44
    for i, (a, b, c, d) in enumerate(((ax, bx, cx, dx), (ay, by, cy, dy), (az, bz, cz, dz))):
        block[3, i] += a  # g = (-a, root, root D): the mixed terms change sign
        block[4, i] += b
        block[i, 3] += c
        block[i, 4] += d


@njit(cache=True, error_model="numpy")
def _pairs(slots, low, count, rows, local, width, sums):
    """Add all slots of a block to the reduced normal equations, lower triangle."""
    normal = sums[0]
    p, remaining_weight, shortfall, square = np.empty(3 * LANES), np.empty(LANES), np.empty(LANES), np.empty((5, 5))
    for r in range(count):
        at = width * slots[low + r]
        _times(local, rows[r], p)
        _reduced_weights(rows[r], p, local, remaining_weight, shortfall)
        _station(rows[r], remaining_weight, shortfall, at, sums)
        if width > 3:
            _station_extra(rows[r], remaining_weight, shortfall, at, sums)
        for s in range(r):
            to = width * slots[low + s]
            if width == 3 and at != to:
                _pair(p, rows[r], rows[s], normal[at : at + 3, to : to + 3])
                continue
            square[:] = 0.0
            _pair(p, rows[r], rows[s], square)
            if width > 3:
                _pair_extra(p, rows[r], rows[s], square)
            for i in range(width):
                for j in range(width):
                    normal[at + i, to + j] += square[i, j]
                    if at == to:  # two ranges of one station: the pair stands for its mirror image too
                        normal[at + j, to + i] += square[i, j]


@njit(cache=True, error_model="numpy")
def _reduce(packed, points, free, prior_weight, prior_value, width, sums, solved):
    """Fill the sums (normal, before, right) and the targets' solution.

    Returns cost, b' V^-1 b, and sum of (root D)^2.
    """
    slots, ends, order, distance, root = packed
    stations, targets, zero, scale = points
    inverse, target_step, condition = solved
    rows = np.empty((np.max(ends[1:] - ends[:-1]), ROWS * LANES))
    x, v, local = np.empty(3 * LANES), np.empty(9 * LANES), np.empty(9 * LANES)
    cost = gain = moment = coincident = 0.0
    for b in range(len(ends) - 1):
        low, count = ends[b], ends[b + 1] - ends[b]
        _place(order, b, targets, x)
        v[:] = 0.0
        for k in range(count):
            s = slots[low + k]
            one = _directions(x, stations[s], zero[s], scale[s], distance[low + k], root[low + k], rows[k])
            cost, moment, coincident = cost + one[0], moment + one[1], coincident + one[2]
            _gather_target(rows[k], v)
        if len(prior_weight):
            _add_priors(order, b, targets, prior_weight, prior_value, v)
        gain += _solve_targets(order, b, v, free, inverse, target_step, condition, local)
        _pairs(slots, low, count, rows, local, width, sums)
    for i in range(len(sums[1])):
        for j in range(i):
            sums[0][j, i] = sums[0][i, j]
    return (np.nan if coincident > 0.0 else cost), gain, moment


@njit(cache=True, error_model="numpy")
def _target_steps(order, b, v, inverse, target_step, y):
    """Targets' steps V^-1 b of a block, from rows 6 to 8 of v.

    Returns b' V^-1 b.

    They go into `target_step`, and by lane into y.
    """
    gain = 0.0
    y[:] = 0.0
    for lane in range(min(LANES, len(order) - b * LANES)):
        t = order[b * LANES + lane]
        for i in range(3):
            step = 0.0
            for j in range(3):
                step += inverse[t, i, j] * v[(6 + j) * LANES + lane]
            target_step[t, i] = y[i * LANES + lane] = step
            gain += step * v[(6 + i) * LANES + lane]
    return gain


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _short(row, y, at, width, right):
    """Add the sum over lanes of g (e - a' y) of one slot to its station's right side."""
    rx = ry = rz = r3 = r4 = 0.0
    for lane in range(LANES):
        u, v, w = row[lane], row[LANES + lane], row[2 * LANES + lane]
        e = row[5 * LANES + lane] - (u * y[lane] + v * y[LANES + lane] + w * y[2 * LANES + lane])
        rx += u * e
        ry += v * e
        rz += w * e
        r3 += row[3 * LANES + lane] * e
        r4 += row[4 * LANES + lane] * e
    right[at] -= rx
    right[at + 1] -= ry
    right[at + 2] -= rz
    if width > 3:
        right[at + 3] += r3
        right[at + 4] += r4


@njit(cache=True, error_model="numpy")
def _follow(packed, points, prior_weight, prior_value, inverse, width, right, target_step):
    """Fill right (n,) and target_step (t, 3) with V^-1 as it was.

    Returns cost, b' V^-1 b, and sum of (root D)^2.
    """
    slots, ends, order, distance, root = packed
    stations, targets, zero, scale = points
    rows = np.empty((np.max(ends[1:] - ends[:-1]), ROWS * LANES))
    x, y, v = np.empty(3 * LANES), np.empty(3 * LANES), np.empty(9 * LANES)
    cost = gain = moment = 0.0
    for b in range(len(ends) - 1):
        low, count = ends[b], ends[b + 1] - ends[b]
        _place(order, b, targets, x)
        v[:] = 0.0
        for k in range(count):
            s = slots[low + k]
            one = _directions(x, stations[s], zero[s], scale[s], distance[low + k], root[low + k], rows[k])
            cost, moment = cost + one[0], moment + one[1]
            _gather_target(rows[k], v)
        if len(prior_weight):
            _add_priors(order, b, targets, prior_weight, prior_value, v)
        gain += _target_steps(order, b, v, inverse, target_step, y)
        for k in range(count):
            _short(rows[k], y, width * slots[low + k], width, right)
    return cost, gain, moment


@njit(cache=True, error_model="numpy")
def _felt(packed, points, target_steps, width, out):
    """Fill out (f, n) with minus the sums of g a' target_steps, target_steps (f, t, 3)."""
    slots, ends, order, distance, root = packed
    stations, targets, zero, scale = points
    rows = np.empty((np.max(ends[1:] - ends[:-1]), ROWS * LANES))
    x, y = np.empty(3 * LANES), np.empty(3 * LANES)
    for b in range(len(ends) - 1):
        low, count = ends[b], ends[b + 1] - ends[b]
        _place(order, b, targets, x)
        for k in range(count):
            s = slots[low + k]
            _directions(x, stations[s], zero[s], scale[s], distance[low + k], root[low + k], rows[k])
            rows[k, 5 * LANES : 6 * LANES] = 0.0  # no misclosure: only a' target_steps remains
        for f in range(len(target_steps)):
            _place(order, b, target_steps[f], y)
            for k in range(count):
                _short(rows[k], y, width * slots[low + k], width, out[f])


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _add_along(row, step, width, total):
    """Add a (g . step) of one slot to the sums of its targets."""
    sx, sy, sz = -step[0], -step[1], -step[2]
    s3, s4 = (step[3], step[4]) if width > 3 else (0.0, 0.0)
    for lane in range(LANES):
        x, y, z = row[lane], row[LANES + lane], row[2 * LANES + lane]
        g = sx * x + sy * y + sz * z + s3 * row[3 * LANES + lane] + s4 * row[4 * LANES + lane]
        total[lane] += g * x
        total[LANES + lane] += g * y
        total[2 * LANES + lane] += g * z


@njit(cache=True, error_model="numpy")
def _back(packed, points, inverse, target_step, step, width, moved):
    """Targets' step V^-1 (b - W' step): `moved` (t, 3)."""
    slots, ends, order, distance, root = packed
    stations, targets, zero, scale = points
    row, x, total = np.empty(ROWS * LANES), np.empty(3 * LANES), np.empty(3 * LANES)
    for b in range(len(ends) - 1):
        _place(order, b, targets, x)
        total[:] = 0.0
        for k in range(ends[b], ends[b + 1]):
            s = slots[k]
            _directions(x, stations[s], zero[s], scale[s], distance[k], root[k], row)
            _add_along(row, step[s * width : (s + 1) * width], width, total)
        for lane in range(min(LANES, len(order) - b * LANES)):
            t = order[b * LANES + lane]
            for i in range(3):
                y = 0.0
                for j in range(3):
                    y += inverse[t, i, j] * total[j * LANES + lane]
                moved[t, i] = target_step[t, i] - y


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _share(root, claimed, row):
    """Weighted square phi^2 of one slot."""
    for lane in range(LANES):
        phi = root[lane] / claimed[lane] if claimed[lane] > 0.0 else 0.0
        row[6 * LANES + lane] = phi * phi


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _coupled(q, r, s, fr, fs):
    """E_rs by lane for coordinates alone, q (3, 3).

    F_r gains E phi_s^2 a_s, F_s gains E phi_r^2 a_r.
    """
    xx, xy, xz = q[0, 0], q[0, 1], q[0, 2]
    yx, yy, yz = q[1, 0], q[1, 1], q[1, 2]
    zx, zy, zz = q[2, 0], q[2, 1], q[2, 2]
    for lane in range(LANES):
        x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
        u, v, w = r[lane], r[LANES + lane], r[2 * LANES + lane]
        e = u * (xx * x + xy * y + xz * z) + v * (yx * x + yy * y + yz * z) + w * (zx * x + zy * y + zz * z)
        g = e * s[6 * LANES + lane]
        fr[lane] += g * x
        fr[LANES + lane] += g * y
        fr[2 * LANES + lane] += g * z
        g = e * r[6 * LANES + lane]
        fs[lane] += g * u
        fs[LANES + lane] += g * v
        fs[2 * LANES + lane] += g * w


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _coupled_extra(q, r, s, fr, fs):
    """E_rs by lane with zero and scale, q (5, 5), g = (-a, root, root D), as `_coupled`."""
    for lane in range(LANES):
        x, y, z, b, d = s[lane], s[LANES + lane], s[2 * LANES + lane], s[3 * LANES + lane], s[4 * LANES + lane]
        u, v, w = r[lane], r[LANES + lane], r[2 * LANES + lane]
        e = u * (q[0, 0] * x + q[0, 1] * y + q[0, 2] * z - q[0, 3] * b - q[0, 4] * d)
        e += v * (q[1, 0] * x + q[1, 1] * y + q[1, 2] * z - q[1, 3] * b - q[1, 4] * d)
        e += w * (q[2, 0] * x + q[2, 1] * y + q[2, 2] * z - q[2, 3] * b - q[2, 4] * d)
        e -= r[3 * LANES + lane] * (q[3, 0] * x + q[3, 1] * y + q[3, 2] * z - q[3, 3] * b - q[3, 4] * d)
        e -= r[4 * LANES + lane] * (q[4, 0] * x + q[4, 1] * y + q[4, 2] * z - q[4, 3] * b - q[4, 4] * d)
        g = e * s[6 * LANES + lane]
        fr[lane] += g * x
        fr[LANES + lane] += g * y
        fr[2 * LANES + lane] += g * z
        g = e * r[6 * LANES + lane]
        fs[lane] += g * u
        fs[LANES + lane] += g * v
        fs[2 * LANES + lane] += g * w


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _single(q, row, f, diagonal, width):
    """E_rr by lane into `diagonal`; F_r gains E_rr phi_r^2 a_r."""
    xx, yy, zz, xy, xz, yz = q[0, 0], q[1, 1], q[2, 2], 2.0 * q[0, 1], 2.0 * q[0, 2], 2.0 * q[1, 2]
    for lane in range(LANES):
        x, y, z = row[lane], row[LANES + lane], row[2 * LANES + lane]
        diagonal[lane] = x * (xx * x + xy * y + xz * z) + y * (yy * y + yz * z) + zz * z * z
    for i in range(3, width):
        g = row[i * LANES : (i + 1) * LANES]
        x0, y0, z0, b0, d0 = 2.0 * q[i, 0], 2.0 * q[i, 1], 2.0 * q[i, 2], q[i, 3], q[i, 4]
        for lane in range(LANES):
            e = b0 * row[3 * LANES + lane] + d0 * row[4 * LANES + lane]
            e -= x0 * row[lane] + y0 * row[LANES + lane] + z0 * row[2 * LANES + lane]
            diagonal[lane] += g[lane] * e
    for lane in range(LANES):
        e = diagonal[lane] * row[6 * LANES + lane]
        f[lane] += e * row[lane]
        f[LANES + lane] += e * row[LANES + lane]
        f[2 * LANES + lane] += e * row[2 * LANES + lane]


@njit(cache=True, error_model="numpy")
def _couple(slots, low, count, q, width, rows, f, diagonal):
    """E and F of all slots of a block."""
    f[:] = 0.0
    for r in range(count):
        at = width * slots[low + r]
        _single(q[at : at + width, at : at + width], rows[r], f[r], diagonal[r], width)
        for s in range(r):
            to = width * slots[low + s]
            if width == 3:
                _coupled(q[at : at + 3, to : to + 3], rows[r], rows[s], f[r], f[s])
            else:
                _coupled_extra(q[at : at + 5, to : to + 5], rows[r], rows[s], f[r], f[s])


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _spread(row, f, m):
    """Add phi^2 a f' to M, symmetric: xx xy xz yy yz zz."""
    for lane in range(LANES):
        square = row[6 * LANES + lane]
        x, y, z = square * row[lane], square * row[LANES + lane], square * row[2 * LANES + lane]
        u, v, w = f[lane], f[LANES + lane], f[2 * LANES + lane]
        m[lane] += x * u
        m[LANES + lane] += 0.5 * (x * v + y * u)
        m[2 * LANES + lane] += 0.5 * (x * w + z * u)
        m[3 * LANES + lane] += y * v
        m[4 * LANES + lane] += 0.5 * (y * w + z * v)
        m[5 * LANES + lane] += z * w


@njit(cache=True, error_model="numpy")
def _finish_targets(order, b, inverse, m, local, covariance):
    """V^-1 of a block by lane into `local`, and covariance = V^-1 + V^-1 M V^-1."""
    full, half = np.empty((3, 3)), np.empty((3, 3))
    local[:] = 0.0
    for lane in range(min(LANES, len(order) - b * LANES)):
        t, k = order[b * LANES + lane], 0
        v = inverse[t]
        for i in range(3):
            for j in range(i, 3):
                local[k * LANES + lane] = v[i, j]
                full[i, j] = full[j, i] = m[k * LANES + lane]
                k += 1
        for i in range(3):
            for j in range(3):
                half[i, j] = v[i, 0] * full[0, j] + v[i, 1] * full[1, j] + v[i, 2] * full[2, j]
        for i in range(3):
            for j in range(i, 3):
                value = half[i, 0] * v[0, j] + half[i, 1] * v[1, j] + half[i, 2] * v[2, j]
                covariance[t, i, j] = covariance[t, j, i] = v[i, j] + value


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _predicted(row, f, p, mp, diagonal):
    """Variance of the predicted ranges of one slot, over the claimed one, added to E_rr in `diagonal`."""
    for lane in range(LANES):
        h = p[lane] * (mp[lane] + row[lane] - 2.0 * f[lane])
        h += p[LANES + lane] * (mp[LANES + lane] + row[LANES + lane] - 2.0 * f[LANES + lane])
        h += p[2 * LANES + lane] * (mp[2 * LANES + lane] + row[2 * LANES + lane] - 2.0 * f[2 * LANES + lane])
        diagonal[lane] += h


@njit(cache=True, error_model="numpy", fastmath=ASSOCIATIVE)
def _judge(row, h, claimed, tests, values):
    """Residual, redundancy, standardised residual and detectable error of one slot by lane.

    See `judged`.
    """
    noncentrality, unchecked = tests
    for lane in range(LANES):
        square, e, sigma = row[6 * LANES + lane], row[5 * LANES + lane], 1.0 / max(claimed[lane], SMALLEST)
        active = square > 0.0
        redundancy = 1.0 - square * h[lane]
        spread = np.sqrt(max(redundancy, unchecked) / square if active else 1.0 + h[lane])
        values[0, lane] = e * sigma
        values[1, lane] = redundancy
        values[2, lane] = e / spread
        values[3, lane] = noncentrality * sigma * (1.0 / (square * spread) if active else spread)


@njit(cache=True, error_model="numpy")
def _scatter(index, values, out):
    """Copy the rows of values to their ranges."""
    residual, redundancy, standardised, detectable = out
    for lane in range(LANES):
        i = index[lane]
        if i >= 0:
            residual[i], redundancy[i] = values[0, lane], values[1, lane]
            standardised[i], detectable[i] = values[2, lane], values[3, lane]


@njit(cache=True, error_model="numpy")
def _statistics(packed, claims, states, inverse, q, tests, covariance, out):
    """Fill the targets' covariance (t, 3, 3) and the four statistics of the ranges, each (m,).

    `claims` are root weights as claimed, the ranges' rows and the width; `states` where directions are, and the answer.
    """
    slots, ends, order, distance, root = packed
    claimed, index, width = claims
    (stations, targets, zero, scale), answer = states
    most = np.max(ends[1:] - ends[:-1])
    rows, f, diagonal = np.empty((most, ROWS * LANES)), np.empty((most, 3 * LANES)), np.empty((most, LANES))
    x, y, m, local = np.empty(3 * LANES), np.empty(3 * LANES), np.empty(6 * LANES), np.empty(6 * LANES)
    p, mp, values = np.empty(3 * LANES), np.empty(3 * LANES), np.empty((4, LANES))
    for b in range(len(ends) - 1):
        low, count = ends[b], ends[b + 1] - ends[b]
        _place(order, b, targets, x)
        _place(order, b, answer[1], y)
        for k in range(count):
            s = slots[low + k]
            _directions(x, stations[s], zero[s], scale[s], distance[low + k], claimed[low + k], rows[k])
            _misclose(y, answer[0][s], answer[2][s], answer[3][s], distance[low + k], claimed[low + k], rows[k])
            _share(root[low + k], claimed[low + k], rows[k])
        _couple(slots, low, count, q, width, rows, f, diagonal)
        m[:] = 0.0
        for k in range(count):
            _spread(rows[k], f[k], m)
        _finish_targets(order, b, inverse, m, local, covariance)
        for k in range(count):
            _times(local, rows[k], p)
            _times(m, p, mp)
            _predicted(rows[k], f[k], p, mp, diagonal[k])
            _judge(rows[k], diagonal[k], claimed[low + k], tests, values)
            _scatter(index[low + k], values, out)
