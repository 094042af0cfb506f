"""Compiled form of `surface_series`: Gauss-Newton per epoch, one pass over its points per step.

Tested against its plain form, `fit_paraboloid` per epoch.
"""

import numpy as np
from numba import njit

from catseye.estimation.shapes.paraboloid import ParaboloidStatus

ITERATIONS = 30
CONVERGED_STEP = 1e-10  # m and rad
LEAST_PIVOT = 1e-13  # of a normal matrix of unit diagonal
TOO_FEW, UNDETERMINED, UNSETTLED = (
    int(status) for status in (ParaboloidStatus.TOO_FEW, ParaboloidStatus.UNDETERMINED, ParaboloidStatus.UNSETTLED)
)


@njit(cache=True, error_model="numpy")
def _turned(a, b):
    """Rotation matrix of the rotation vector (a, b, 0): Rodrigues' formula."""
    angle2 = a * a + b * b
    if angle2 < 1e-16:
        s, c = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = np.sqrt(angle2)
        s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2
    r = np.empty((3, 3))
    r[0, 0], r[0, 1], r[0, 2] = 1.0 - c * b * b, c * a * b, s * b
    r[1, 0], r[1, 1], r[1, 2] = c * a * b, 1.0 - c * a * a, -s * a
    r[2, 0], r[2, 1], r[2, 2] = -s * b, s * a, 1.0 - c * angle2
    return r


@njit(cache=True, error_model="numpy")
def _factor(matrix, p):
    """Cholesky factor in place of the matrix.

    False if a pivot is too small.
    """
    for i in range(p):
        for j in range(i + 1):
            total = matrix[i, j]
            for q in range(j):
                total -= matrix[i, q] * matrix[j, q]
            if i == j:
                if not total > LEAST_PIVOT:
                    return False
                matrix[i, i] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return True


@njit(cache=True, error_model="numpy")
def _solve(factor, right, p):
    """Replace the right-hand side by the solution."""
    for i in range(p):
        for q in range(i):
            right[i] -= factor[i, q] * right[q]
        right[i] /= factor[i, i]
    for i in range(p - 1, -1, -1):
        for q in range(i + 1, p):
            right[i] -= factor[q, i] * right[q]
        right[i] /= factor[i, i]


@njit(cache=True, error_model="numpy")
def _pass(local, weights, variance, six, settings, what, deviation, sums):
    """Deviations and right-hand side of a step.

    `what` 1: and the normal matrix, 2: and the noise's.

    `settings` are columns, focal and squared of `series`; `sums` the normal matrix, that of the noise and the right
    side. Returns the number of points used.
    """
    columns, focal, squared = settings
    normal, spread, right = sums
    p, count = len(columns), 0
    f = focal + six[5]
    r = _turned(six[3], six[4])
    half, quarter = 0.5 / f, 0.25 / f
    row = np.empty(6)
    chosen = np.empty(p)
    right[:] = 0.0
    if what > 0:
        normal[:] = 0.0
        spread[:] = 0.0
    for i in range(len(local)):
        ax, ay, az = local[i, 0] - six[0], local[i, 1] - six[1], local[i, 2] - six[2]
        x = r[0, 0] * ax + r[1, 0] * ay + r[2, 0] * az
        y = r[0, 1] * ax + r[1, 1] * ay + r[2, 1] * az
        z = r[0, 2] * ax + r[1, 2] * ay + r[2, 2] * az
        r2 = x * x + y * y
        if not np.isfinite(r2 + z):
            deviation[i] = np.nan
            continue
        lean = r2 * quarter / f
        cos = 1.0 / np.sqrt(1.0 + lean)
        d = (z - r2 * quarter) * cos
        deviation[i] = d
        w = weights[i]
        if w == 0.0:
            continue
        count += 1
        gx, gy = -x * half * cos, -y * half * cos
        nx = r[0, 0] * gx + r[0, 1] * gy + r[0, 2] * cos
        ny = r[1, 0] * gx + r[1, 1] * gy + r[1, 2] * cos
        nz = r[2, 0] * gx + r[2, 1] * gy + r[2, 2] * cos
        row[0], row[1], row[2] = nx, ny, nz
        row[3], row[4] = ay * nz - az * ny, az * nx - ax * nz
        row[5] = -lean * cos
        scaled = w * cos * cos if squared else w
        for a in range(p):
            chosen[a] = row[columns[a]]
            right[a] += scaled * chosen[a] * d
        if what > 0:
            for a in range(p):
                for b in range(a + 1):
                    normal[a, b] += scaled * chosen[a] * chosen[b]
        if what > 1:
            noise = scaled * scaled * variance[i]
            for a in range(p):
                for b in range(a + 1):
                    spread[a, b] += noise * chosen[a] * chosen[b]
    return count


@njit(cache=True, error_model="numpy")
def series(local, variance, weights, columns, focal, squared):
    """Fit every epoch.

    local      (T, k, 3) m, nominal paraboloid's frame; nan if missing
    variance   (T, k) m^2 along the normals
    weights    (k,)
    columns    (p,) of 0..5: indices of the free parameters
    focal      m
    squared    True: half-path errors are squared; False: normal deviations

    Returns parameters (T, p), covariance (T, p, p), deviations (T, k), number of points and status (T,).
    """
    epochs, k, p = local.shape[0], local.shape[1], len(columns)
    parameters, covariance = np.full((epochs, p), np.nan), np.full((epochs, p, p), np.nan)
    deviation = np.full((epochs, k), np.nan)
    points, status = np.zeros(epochs, dtype=np.int64), np.full(epochs, UNSETTLED, dtype=np.int64)
    normal, spread, right = np.empty((p, p)), np.empty((p, p)), np.empty(p)
    size, column = np.empty(p), np.empty(p)
    settings, sums = (columns, focal, squared), (normal, spread, right)
    for t in range(epochs):
        six = np.zeros(6)
        epoch_points, noise, off = local[t], variance[t], deviation[t]
        for turn in range(ITERATIONS):
            # the normal matrix of the first step is reused: the right-hand sides determine the solution
            points[t] = _pass(epoch_points, weights, noise, six, settings, 1 if turn == 0 else 0, off, sums)
            if points[t] < p:
                status[t] = TOO_FEW
                break
            if turn == 0 and not _scaled(normal, size, p):
                status[t] = UNDETERMINED
                break
            for a in range(p):
                right[a] /= size[a]
            _solve(normal, right, p)
            step = 0.0
            for a in range(p):
                change = right[a] / size[a]
                six[columns[a]] += change
                step = max(step, abs(change))
            if step < CONVERGED_STEP:
                status[t] = 0
                break
        if status[t]:
            off[:] = np.nan
            continue
        for a in range(p):
            parameters[t, a] = six[columns[a]]
        _pass(epoch_points, weights, noise, six, settings, 2, off, sums)
        if not _scaled(normal, size, p):
            status[t] = UNDETERMINED
            continue
        _noise(normal, spread, size, covariance[t], column, p)
    return parameters, covariance, deviation, points, status


@njit(cache=True, error_model="numpy")
def _scaled(normal, size, p):
    """Scale the normal matrix to unit diagonal and factor it in place.

    Diagonal roots in `size`.
    """
    for a in range(p):
        size[a] = np.sqrt(normal[a, a])
    for a in range(p):
        for b in range(a + 1):
            normal[a, b] /= size[a] * size[b]
    return _factor(normal, p)


@njit(cache=True, error_model="numpy")
def _noise(factor, spread, size, covariance, column, p):
    """Inverse normal matrix times the noise's spread times that inverse, in the parameters' units."""
    for a in range(p):
        for b in range(a):
            spread[b, a] = spread[a, b]
    half = np.empty((p, p))
    for a in range(p):
        for b in range(p):
            column[b] = spread[b, a] / (size[b] * size[a])
        _solve(factor, column, p)
        for b in range(p):
            half[b, a] = column[b]
    for a in range(p):
        for b in range(p):
            column[b] = half[a, b]
        _solve(factor, column, p)
        for b in range(p):
            covariance[a, b] = column[b] / (size[a] * size[b])
