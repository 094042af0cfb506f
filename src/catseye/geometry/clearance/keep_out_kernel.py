"""Compiled form of `keep_out.first_entry` for many moves.

Import it only when a problem is large.

The plain form is its test. One move after the other, all its checks while it is in registers: a tenth of the time.
"""

import numpy as np
from numba import njit

_compiled = njit(cache=True, error_model="numpy", nogil=True)
_inlined = njit(error_model="numpy")


@_inlined
def _count(time, start, end, ramp, duration, speed):
    """Count of one axis, as `MirrorSlew.position`."""
    t = min(max(time, 0.0), duration)
    remaining = duration - t
    if t < remaining:
        return start + speed * (0.5 * t * t / ramp if t < ramp else t - 0.5 * ramp)
    return end - speed * (0.5 * remaining * remaining / ramp if remaining < ramp else remaining - 0.5 * ramp)


@_inlined
def _slowed(time, ramp, duration):
    """Bound of an axis's speed from a time on, as a share of top speed.

    As in `MirrorSlew.beam_rate`.
    """
    remaining = max(duration - time, 0.0)
    if remaining < ramp:
        return remaining / ramp
    return 1.0 if remaining > 0.0 else 0.0


@_inlined
def _angle(ax, ay, az, b):
    square = (ax - b[0]) ** 2 + (ay - b[1]) ** 2 + (az - b[2]) ** 2
    return 2.0 * np.arcsin(min(0.5 * np.sqrt(square), 1.0))


@_inlined
def _dot(ax, ay, az, b):
    return ax * b[0] + ay * b[1] + az * b[2]


@_inlined
def _hits(at, d, half, length):
    """True if a step enters a zone, as `keep_out._hits`."""
    first, last = -np.inf, np.inf
    for k in range(3):
        if d[k] == 0.0:
            if abs(at[k]) > half[k]:
                return False
            continue
        low, high = (-half[k] - at[k]) / d[k], (half[k] - at[k]) / d[k]
        first, last = max(first, min(low, high)), min(last, max(low, high))
    return first <= last and last >= 0.0 and first <= length


@_inlined
def _rim(at, d, half, length, axis):
    """Rim angle as `keep_out._angle_to_rim`."""
    height = abs(at[axis]) - half[axis]
    if not 0.0 < height < length:
        return np.inf
    i, j = (axis + 1) % 3, (axis + 2) % 3
    radius = np.arccos(height / length)
    across = np.hypot(d[i], d[j])
    reach = length * np.sin(radius) / (across if across > 0.0 else 1.0)
    if abs(at[i] + reach * d[i]) <= half[i] and abs(at[j] + reach * d[j]) <= half[j]:
        return abs(np.arctan2(across, -np.sign(at[axis]) * d[axis]) - radius)
    return np.inf


@_inlined
def _outline(x, y, z, exact_below, box, d):
    """Clearance as `Outline.clearance`, box as in `first_entries`.

    Limits are length, near, radius; d (3,) is scratch.
    """
    at, half, to_box, limits, corners, edges, counts, middle = box
    if limits[1] == 0.0:
        return 0.0
    if limits[1] > limits[0]:
        return np.inf
    for k in range(3):
        d[k] = _dot(x, y, z, to_box[k])
    sphere = _angle(d[0], d[1], d[2], middle) - limits[2]
    if not sphere < exact_below:
        return sphere
    if _hits(at, d, half, limits[0]):
        return 0.0
    least = np.inf
    for k in range(counts[0]):
        least = min(least, _angle(d[0], d[1], d[2], corners[k]))
    for k in range(counts[1]):
        if _dot(d[0], d[1], d[2], edges[1, k]) > 0.0 and _dot(d[0], d[1], d[2], edges[2, k]) > 0.0:
            least = min(least, np.arcsin(min(abs(_dot(d[0], d[1], d[2], edges[0, k])), 1.0)))
    if np.isfinite(limits[0]):
        for axis in range(3):
            least = min(least, _rim(at, d, half, limits[0], axis))
    return least


@_compiled
def first_entries(moves, pointing, cones, boxes, settings, out):
    """Status, time, zone and checks of moves (n,) into `out`.

    moves     start, end, ramp, duration, top speed, (n, 2) each
    pointing  counts at zero (2,), rad a count (2,), mirror from ground (3, 3)
    cones     directions (c, n, 3) at the start and at the end, half angles (c, n), rates (c, n)
    boxes     at, half (b, 3), to_box (b, 3, 3), limits (b, 3), corners (b, 24, 3), edges (b, 3, 12, 3), counts (b, 2),
              middle (b, 3), place (zones,): the number of each cone, then of each box, among the zones
    settings  margin, least clearance, clearance below which a box is computed exactly
    """
    start, end, ramp, duration, speed = moves
    zeros, per_count, matrix = pointing
    first, later, half_angle, drift = cones
    at, half, to_box, limits, corners, edges, counts, middle, place = boxes
    margin, touch, exact_below = settings
    status, entry, zone, looks = out
    d = np.empty(3)
    for i in range(len(start)):
        total = max(duration[i, 0], duration[i, 1])
        instant = 0.0
        while True:
            theta = (
                _count(instant, start[i, 0], end[i, 0], ramp[i, 0], duration[i, 0], speed[i, 0]) - zeros[0]
            ) * per_count[0]
            phi = (
                _count(instant, start[i, 1], end[i, 1], ramp[i, 1], duration[i, 1], speed[i, 1]) - zeros[1]
            ) * per_count[1]
            u, v, w = np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)
            x = u * matrix[0, 0] + v * matrix[1, 0] + w * matrix[2, 0]
            y = u * matrix[0, 1] + v * matrix[1, 1] + w * matrix[2, 1]
            z = u * matrix[0, 2] + v * matrix[1, 2] + w * matrix[2, 2]
            rate = np.hypot(
                speed[i, 0] * _slowed(instant, ramp[i, 0], duration[i, 0]) * per_count[0],
                speed[i, 1] * _slowed(instant, ramp[i, 1], duration[i, 1]) * per_count[1],
            )
            share = instant / total if total > 0.0 else 0.0
            gap, step, nearest = np.inf, np.inf, -1
            for c in range(len(first)):
                for k in range(3):
                    d[k] = (1.0 - share) * first[c, i, k] + share * later[c, i, k]
                size = np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
                d /= size
                one = _angle(x, y, z, d) - half_angle[c, i] - margin
                turning = rate + drift[c, i]
                if turning > 0.0:
                    step = min(step, one / turning)
                if not one >= gap:
                    gap, nearest = one, place[c]
            for b in range(len(at)):
                box = (at[b], half[b], to_box[b], limits[b], corners[b], edges[b], counts[b], middle[b])
                one = _outline(x, y, z, exact_below, box, d) - margin
                if rate > 0.0:
                    step = min(step, one / rate)
                if not one >= gap:
                    gap, nearest = one, place[len(first) + b]
            looks[i] += 1
            if not gap > touch:
                status[i] = 1 if instant > 0.0 else 2
                entry[i], zone[i] = instant, nearest
                break
            instant += step
            if not instant < total:
                break
