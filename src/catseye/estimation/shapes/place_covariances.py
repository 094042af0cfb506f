"""Covariances of two sets of points and of their difference, second less rotated first."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import JointPoints

ROWS = 300  # of a large matrix per batch: a few MB
SYMMETRIC = 1e-9  # of the largest entry: tolerance of a covariance's asymmetry


@dataclass(frozen=True, eq=False)
class RotatedPoints:
    """Covariance (3n, 3n) of some points in rotated axes, without a matrix of its own.

    points   n of them
    turn     (3, 3) rotation to the other axes
    """

    points: JointPoints
    turn: np.ndarray

    def rows(self, low: int, high: int) -> np.ndarray:
        """Rows (3k, 3n) of some points with all, a new matrix."""
        indices = np.arange(len(self.points.columns))
        return turned_rows(self.points.between(indices[low:high], indices), self.turn)

    def times(self, a: np.ndarray) -> np.ndarray:
        """Product of the covariance with a (3n, k)."""
        inside = rotated_covariance(a, self.turn.T, columns=False)
        return rotated_covariance(self.points.times(inside), self.turn, columns=False)


Known = np.ndarray | RotatedPoints


@dataclass(frozen=True, eq=False)
class PlaceCovariances:
    """Covariances of the n points of a group in two epochs.

    first    (3n, 3n) m^2, may be singular, or (n, 3, 3) of points that are independent; None: exact, as a design
    second   likewise; one of the two at least
    cross    (3n, 3n) m^2, of the first (rows) with the second (columns), if any
    """

    first: Known | None = None
    second: Known | None = None
    cross: np.ndarray | None = None

    def checked(self, count: int) -> "PlaceCovariances":
        """Validated float arrays; EstimationError for wrong size, non-finite or asymmetric ones."""
        inputs = {"of the first set": self.first, "of the second set": self.second, "between the sets": self.cross}
        size = (3 * count, 3 * count)
        validated: list[Any] = []
        for name, item in inputs.items():
            if isinstance(item, RotatedPoints):
                item.points.check_size()
                validated.append(replace(item, points=item.points.held()))
                continue
            q = None if item is None else np.asarray(item, dtype=float)
            validated.append(q)
            if q is None or (q.shape == (count, 3, 3) and name != "between the sets" and np.isfinite(q).all()):
                continue
            if q.shape != size or not np.isfinite(q).all():
                raise EstimationError(f"the covariance {name} has shape {q.shape}, expected {size}, all finite")
            if name != "between the sets" and not _symmetric(q):
                raise EstimationError(f"the covariance {name} is not symmetric")
        return PlaceCovariances(*validated)

    def of(self, mask: np.ndarray) -> "PlaceCovariances":
        """Covariances of selected points (n,) bool."""
        if mask.all():
            return self
        parts: list[Any] = [_of(q, mask) for q in (self.first, self.second, self.cross)]
        return PlaceCovariances(*parts)

    def difference(self, count: int, matrix: np.ndarray, extra: np.ndarray | None = None) -> np.ndarray:
        """Covariance (3n, 3n) of second less rotated first, a new matrix.

        count    n
        matrix   (3, 3) that rotates the first
        extra    (3n,) m^2, additional variance of the second
        """
        size = 3 * count
        total = np.zeros((size, size))
        for q, turn in ((self.first, matrix), (self.second, None)):
            if isinstance(q, np.ndarray) and q.ndim == 3:
                at, blocks = np.arange(count), total.reshape(count, 3, count, 3)
                blocks[at, :, at] += q if turn is None else turn @ q @ turn.T
            elif q is not None:
                for k in range(0, size, ROWS):
                    rows = q[k : k + ROWS] if isinstance(q, np.ndarray) else q.rows(k // 3, k // 3 + ROWS // 3)
                    total[k : k + ROWS] += rows if turn is None else turned_rows(rows, turn)
        if self.cross is not None:
            shared = rotated_covariance(self.cross, matrix, columns=False)
            total -= shared
            total -= shared.T
        if extra is not None:
            total[np.diag_indices(size)] += extra
        return total

    def blocks(self, count: int, matrix: np.ndarray) -> np.ndarray:
        """Diagonal blocks (n, 3, 3) of `difference`."""
        first, second, cross = (_blocks(q, count) for q in (self.first, self.second, self.cross))
        shared = matrix @ cross
        return np.asarray(second + matrix @ first @ matrix.T - shared - shared.transpose(0, 2, 1))

    def difference_times(self, matrix: np.ndarray, a: np.ndarray, extra: np.ndarray | None = None) -> np.ndarray:
        """Product of `difference` with a (3n, k), without a matrix of its size."""
        total = np.zeros(a.shape) if extra is None else extra[:, None] * a
        turned = rotated_covariance(a, matrix.T, columns=False)
        if self.first is not None:
            total += rotated_covariance(_times(self.first, turned), matrix, columns=False)
        if self.second is not None:
            total += _times(self.second, a)
        if self.cross is not None:
            total -= rotated_covariance(self.cross @ a, matrix, columns=False) + self.cross.T @ turned
        return total

    def pull(self, matrix: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Shift (3n,) m of the first places by weighted residuals a (3n,): (Q_x L' - C) a."""
        total = np.zeros(len(a))
        if self.first is not None:
            total += _times(self.first, rotated_covariance(a[:, None], matrix.T, columns=False))[:, 0]
        if self.cross is not None:
            total -= self.cross @ a
        return total


def rotated_covariance(q: np.ndarray, matrix: np.ndarray, *, columns: bool) -> np.ndarray:
    """q L' (columns) or L q (rows) of a covariance q (3n, 3m), L block-diagonal of the matrix (3, 3)."""
    if columns:
        return (q.reshape(len(q), -1, 3) @ matrix.T).reshape(q.shape)
    return (matrix @ q.reshape(-1, 3, q.shape[1])).reshape(q.shape)


def turned_rows(q: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Rows L q L' (3k, 3n) of a rotated covariance."""
    return rotated_covariance(rotated_covariance(q, matrix, columns=True), matrix, columns=False)


def rotate_in_place(q: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Rotated covariance L q L', overwriting q (3n, 3n) without a temporary of its size."""
    for k in range(0, len(q), ROWS):
        q[k : k + ROWS] = turned_rows(q[k : k + ROWS], matrix)
    return q


def _blocks(q: Known | None, count: int) -> np.ndarray:
    if q is None:
        return np.zeros((count, 3, 3))
    if isinstance(q, RotatedPoints):
        return np.asarray(q.turn @ q.points.blocks @ q.turn.T)
    at = np.arange(count)
    return q if q.ndim == 3 else q.reshape(count, 3, count, 3)[at, :, at]


def _of(q: Known | None, mask: np.ndarray) -> Known | None:
    if q is None:
        return None
    if isinstance(q, RotatedPoints):
        return replace(q, points=q.points.of_points(np.flatnonzero(mask)))
    if q.ndim == 3:
        return q[mask]
    rows = np.flatnonzero(np.repeat(mask, 3))
    return q[np.ix_(rows, rows)]


def _times(q: Known, a: np.ndarray) -> np.ndarray:
    if isinstance(q, RotatedPoints):
        return q.times(a)
    return (q @ a.reshape(-1, 3, a.shape[1])).reshape(a.shape) if q.ndim == 3 else q @ a


def _symmetric(q: np.ndarray) -> bool:
    firsts = range(0, len(q), ROWS)
    largest = max((float(np.abs(q[k : k + ROWS]).max()) for k in firsts), default=0.0)
    apart = (np.abs(q[k : k + ROWS, k:] - q[k:, k : k + ROWS].T).max() for k in firsts)
    return all(float(difference) <= SYMMETRIC * largest for difference in apart)
