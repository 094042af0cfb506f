"""Points from ranges to known points, in blocks, with both minima of the sum of squares.

`positions.trilateration` gives one position, its covariance and status; here the second position is needed too,
however well it fits, and sigma is not known yet.
"""

import numpy as np

BLOCK = 20_000  # ranges per batch, to bound memory
FLAT = 1e-10  # smallest over largest eigenvalue of the scatter of points: extents differ by 1e-5


def locate(anchors: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points from ranges to known points: both minima of the sum of squares, the better first.

    anchors   (s, 3) m
    ranges    (t, s) m, nan where not measured

    Returns xyz (t, 2, 3) m and the root mean squares (t, 2) m of their residuals; nan for fewer than three ranges or
    collinear anchors. Coplanar anchors give mirror images of equal rms; if only one minimum exists both are equal. The
    start is linear: along the principal axes of the anchors seen, about their mean, the equations separate, and the
    height above their plane follows from the mean of the squares.

    >>> anchors = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    >>> locate(anchors, np.linalg.norm(anchors - [1.0, 2.0, 2.0], axis=1)[None])[0][0, :, 2].round(6)
    array([ 2., -2.])
    """
    if len(ranges) > 1 and ranges.size > BLOCK:
        cuts = range(max(BLOCK // ranges.shape[1], 1), len(ranges), max(BLOCK // ranges.shape[1], 1))
        blocks = [locate(anchors, block) for block in np.split(ranges, cuts)]
        return np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])
    measured = np.isfinite(ranges)
    enough = np.flatnonzero(measured.sum(axis=1) >= 3)
    xyz, rms = np.full((len(ranges), 2, 3), np.nan), np.full((len(ranges), 2), np.nan)
    if not len(enough):
        return xyz, rms
    square = np.where(measured, ranges, 0.0)[enough] ** 2
    start, spread = _both_sides(anchors, square, measured[enough].astype(float))
    twice, weight = (np.repeat(a, 2, axis=0) for a in (np.sqrt(square), measured[enough].astype(float)))
    moved, remaining_rms = _descend(start.reshape(-1, 3), anchors, twice, weight=weight)
    places, size = moved.reshape(-1, 2, 3), remaining_rms.reshape(-1, 2)
    order = np.argsort(size, axis=1, kind="stable")
    places, size = np.take_along_axis(places, order[:, :, None], axis=1), np.take_along_axis(size, order, axis=1)
    xyz[enough], rms[enough] = np.where(spread[:, None, None], places, np.nan), np.where(spread[:, None], size, np.nan)
    return xyz, rms


def _both_sides(anchors: np.ndarray, square: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts (t, 2, 3) above and below the plane of the anchors, and mask (t,) of non-collinear anchors.

    square, weight   (t, s) squared ranges, m^2, and 1 where measured, else both 0
    """
    number = weight.sum(axis=1, keepdims=True)
    mean = weight @ anchors / number
    about = (anchors - mean[:, None]) * weight[:, :, None]
    values, axes = np.linalg.eigh(np.swapaxes(about, 1, 2) @ about)
    level = np.sum(about**2, axis=2)
    plain = (level - square) / 2
    right = np.einsum("tsi,ts->ti", about, plain - plain.sum(axis=1, keepdims=True) / number)
    spread = values[:, 1] > FLAT * values[:, 2]
    local = np.einsum("tji,tj->ti", axes, right) / np.where(spread[:, None], np.maximum(values, 1e-300), 1.0)
    height2 = (square - level).sum(axis=1) / number[:, 0] - local[:, 1] ** 2 - local[:, 2] ** 2
    height = np.sqrt(np.maximum(height2, 1e-4 * square.max(axis=1)))  # not zero: Newton would stay in the plane
    sides = np.stack([local, local], axis=1)
    sides[:, 0, 0], sides[:, 1, 0] = height, -height
    return mean[:, None] + np.einsum("tij,tkj->tki", axes, sides), spread


def _descend(
    x: np.ndarray, anchors: np.ndarray, ranges: np.ndarray, *, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Levenberg descent of many points (n, 3), and rms (n,) of their residuals.

    ranges, weight   (n, s) m and 0 or 1
    """

    def residuals(x: np.ndarray, on: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        along = x[:, None] - anchors
        distance = np.sqrt(np.einsum("tsi,tsi->ts", along, along))
        return (ranges[on] - distance) * weight[on], along * (weight[on] / np.maximum(distance, 1e-300))[..., None]

    x, on = x.copy(), np.arange(len(x))  # those that still move
    number, reach = weight.sum(axis=1), 1e-9 * ranges.max(axis=1)
    v, unit = residuals(x, on)
    cost, damping = np.sum(v**2, axis=1), np.full(len(x), 1e-6)
    for _ in range(30):
        normal = np.swapaxes(unit, 1, 2) @ unit + (damping * number)[on][:, None, None] * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("tsi,ts->ti", unit, v)[..., None])[..., 0]
        trial_v, trial_unit = residuals(x[on] + step, on)
        trial = np.sum(trial_v**2, axis=1)
        better = trial <= cost[on]
        x[on[better]] += step[better]
        cost[on[better]] = trial[better]
        damping[on] = np.clip(damping[on] * np.where(better, 0.1, 10.0), 1e-12, 1e6)
        v, unit = np.where(better[:, None], trial_v, v), np.where(better[:, None, None], trial_unit, unit)
        moving = np.abs(step).max(axis=1) > reach[on]
        if not moving.any():
            break
        on, v, unit = on[moving], v[moving], unit[moving]
    return x, np.sqrt(cost / number)
