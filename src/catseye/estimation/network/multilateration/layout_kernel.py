"""Compiled layout of a network's ranges by station and target, for `kernel`.

Targets are stored in blocks of `lanes`; a slot is one station, or its repetition, over the lanes of a block. The number
of lanes is an argument because the cache of compiled code does not notice changes of constants in other files.
"""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def by_target(station, target, targets):
    """Rows sorted by target, then station: `first` (t + 1,), `rows` (m,), and a hash of stations per target."""
    first, pattern = np.zeros(targets + 1, np.int64), np.zeros(targets, np.uint64)
    rows, ordered = np.empty(len(target), np.int32), True
    for i in range(len(target)):
        t, s = target[i], station[i]
        first[t + 1] += 1
        pattern[t] |= np.uint64(1) << np.uint64(s % 64)
        rows[i] = i
        if i > 0 and (target[i - 1] > t or (target[i - 1] == t and station[i - 1] > s)):
            ordered = False
    for t in range(targets):
        first[t + 1] += first[t]
    if ordered:
        return first, rows, pattern
    at = first[:-1].copy()
    for i in range(len(target)):
        t, s = target[i], station[i]
        j = at[t]
        at[t] += 1
        while j > first[t] and station[rows[j - 1]] > s:
            rows[j] = rows[j - 1]
            j -= 1
        rows[j] = i
    return first, rows, pattern


@njit(cache=True, error_model="numpy")
def _repeats(station, rows, low, high, most):
    """Raise most[s] to the number of ranges from station s to the target of rows[low:high]."""
    count = 0
    for j in range(low, high):
        s = station[rows[j]]
        count = count + 1 if j > low and station[rows[j - 1]] == s else 1
        most[s] = max(most[s], count)


@njit(cache=True, error_model="numpy")
def slots_of(station, first, rows, order, stations, lanes):
    """Station of every slot, and end of the slots of each block."""
    blocks = (len(order) + lanes - 1) // lanes
    ends = np.zeros(blocks + 1, np.int64)
    slots = np.empty(len(rows) + 1, np.int32)  # never more slots than ranges
    most, n = np.zeros(stations, np.int64), 0
    for b in range(blocks):
        most[:] = 0
        for t in order[b * lanes : (b + 1) * lanes]:
            _repeats(station, rows, first[t], first[t + 1], most)
        for s in range(stations):
            for _ in range(most[s]):
                slots[n] = s
                n += 1
        ends[b + 1] = n
    return slots[:n].copy(), ends


@njit(cache=True, error_model="numpy")
def fill(ranges, first, rows, order, ends, slots, lanes):
    """Distance, root weight and row of every slot and lane: (slots, lanes).

    0, 0 and -1 if empty.

    `ranges` are station, distance, sigma and inflation, (m,) each.
    """
    station, distance, sigma, inflation = ranges
    shape = (len(slots), lanes)
    observed, weight, index = np.zeros(shape), np.zeros(shape), np.full(shape, -1, np.int32)
    for b in range(len(ends) - 1):
        for lane in range(min(lanes, len(order) - b * lanes)):
            t = order[b * lanes + lane]
            k = ends[b]
            for j in range(first[t], first[t + 1]):
                i = rows[j]
                while slots[k] != station[i]:
                    k += 1
                observed[k, lane], index[k, lane] = distance[i], i
                weight[k, lane] = 1.0 / (sigma[i] * inflation[i] if len(inflation) else sigma[i])
                k += 1
    return observed, weight, index


@njit(cache=True, error_model="numpy")
def gather(values, index):
    """values[index], zero if the index is -1."""
    out = np.zeros(index.shape)
    for k in range(index.shape[0]):
        for lane in range(index.shape[1]):
            if index[k, lane] >= 0:
                out[k, lane] = values[index[k, lane]]
    return out
