"""Compiled form of `pointing.counts`: every station to every point.

Blocks of points fit the first-level cache.

Arctangents are a polynomial without branches, so that a whole vector register of points goes through at once; the plain
form in `pointing` is its test. Import it only when a problem is large.

atan(t) = t Q(t^2) for |t| <= tan(pi/8), where the larger part of (x, y) divides; beyond, atan(a/b) = pi/4 +
atan((a - b)/(a + b)). Q interpolates atan(sqrt(s))/sqrt(s) at the Chebyshev points of [0, tan^2(pi/8)] (mpmath's
chebyfit, 50 digits); it is good to 1e-15. Both quotients share one division.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

LANES = 128  # points a block
MOST_THREADS = 4
EIGHTH = math.tan(math.pi / 8.0)
EIGHTH_TURN, QUARTER_TURN, HALF_TURN = math.pi / 4.0, math.pi / 2.0, math.pi
AZIMUTH, ELEVATION = 1e5 / (2.0 * math.pi), 1e5 / (4.0 * math.pi)  # counts a radian of Theta and of Phi
Q = (
    0.999999999999999,
    -0.3333333333322143,
    0.19999999978392663,
    -0.14285712661684793,
    0.11111048853751296,
    -0.09089529956562307,
    0.07673535428183285,
    -0.0650598296717084,
    0.05024762118940128,
    -0.025316479573776477,
)
Q0, Q1, Q2, Q3, Q4, Q5, Q6, Q7, Q8, Q9 = Q

_compiled = njit(cache=True, error_model="numpy", fastmath={"contract"}, nogil=True)
_inlined = njit(error_model="numpy", fastmath={"contract"})


@_inlined
def _eighth(s):
    """Value atan(t)/t of s = t^2, |t| <= tan(pi/8)."""
    q = Q9
    q = q * s + Q8
    q = q * s + Q7
    q = q * s + Q6
    q = q * s + Q5
    q = q * s + Q4
    q = q * s + Q3
    q = q * s + Q2
    q = q * s + Q1
    return q * s + Q0


@_compiled
def _fill(matrix, origin, zeros, points, counts):
    x, y, z = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    azimuth, elevation = np.empty(LANES), np.empty(LANES)
    for first in range(0, points.shape[0], LANES):
        lanes = min(LANES, points.shape[0] - first)
        for j in range(LANES):
            row = first + min(j, lanes - 1)
            x[j], y[j], z[j] = points[row, 0], points[row, 1], points[row, 2]
        for i in range(matrix.shape[0]):
            m00, m01, m02 = matrix[i, 0, 0], matrix[i, 0, 1], matrix[i, 0, 2]
            m10, m11, m12 = matrix[i, 1, 0], matrix[i, 1, 1], matrix[i, 1, 2]
            m20, m21, m22 = matrix[i, 2, 0], matrix[i, 2, 1], matrix[i, 2, 2]
            o0, o1, o2 = origin[i, 0], origin[i, 1], origin[i, 2]
            na0, ne0 = zeros[i, 0], zeros[i, 1]
            for j in range(LANES):
                dx, dy, dz = x[j] - o0, y[j] - o1, z[j] - o2
                u = m00 * dx + m01 * dy + m02 * dz
                v = m10 * dx + m11 * dy + m12 * dz
                w = m20 * dx + m21 * dy + m22 * dz
                side, front, across, along = abs(v), abs(u), math.sqrt(u * u + v * v), abs(w)
                low1, high1, low2, high2 = min(side, front), max(side, front), min(across, along), max(across, along)
                far1, far2 = low1 > EIGHTH * high1, low2 > EIGHTH * high2
                top1, top2 = low1 - high1 if far1 else low1, low2 - high2 if far2 else low2
                base1, base2 = low1 + high1 if far1 else high1, low2 + high2 if far2 else high2
                base1 = base1 if base1 > 0.0 else 1.0  # on the azimuth axis Theta is 0; in the scan point all is NaN
                over = 1.0 / (base1 * base2)
                t1, t2 = top1 * base2 * over, top2 * base1 * over
                theta = t1 * _eighth(t1 * t1) + (EIGHTH_TURN if far1 else 0.0)
                phi = t2 * _eighth(t2 * t2) + (EIGHTH_TURN if far2 else 0.0)
                theta = QUARTER_TURN - theta if side > front else theta
                phi = QUARTER_TURN - phi if across > along else phi
                theta = -theta if v < 0.0 else theta
                theta = HALF_TURN - theta if u < 0.0 else theta  # already in [-pi/2, 3 pi/2)
                phi = HALF_TURN - phi if w < 0.0 else phi
                azimuth[j] = theta * AZIMUTH + na0
                elevation[j] = phi * ELEVATION + ne0
            for j in range(lanes):
                counts[i, first + j, 0] = azimuth[j]
                counts[i, first + j, 1] = elevation[j]


def stations_by_points(
    matrix: np.ndarray, origin: np.ndarray, zeros: np.ndarray, points: np.ndarray, counts: np.ndarray
) -> None:
    """Fill counts (s, n, 2), azimuth and elevation, for s stations, n points.

    points    (n, 3), m, ground
    matrix    (s, 3, 3), ground to mirror axes
    origin    (s, 3), m, the scan points
    zeros     (s, 2), counts: na0, ne0

    Source: [PARKER04] eq. 2.12 to 2.22. Equal to `pointing.aim` within 1e-9 counts, but for points within a milliradian
    of the azimuth axis, where Theta amplifies the rounding of both. At most four threads, one a processor.
    """
    parts = np.array_split(np.arange(len(points)), min(os.cpu_count() or 1, MOST_THREADS))
    with ThreadPoolExecutor(len(parts)) as pool:  # the kernel holds no lock
        jobs = [
            pool.submit(_fill, matrix, origin, zeros, points[part[0] : part[-1] + 1], counts[:, part[0] : part[-1] + 1])
            for part in parts
            if len(part)
        ]
        for job in jobs:
            job.result()
