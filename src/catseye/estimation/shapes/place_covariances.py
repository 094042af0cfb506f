"""How well two sets of places are known, and what follows for second less turned first, of thousands of points too."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError

ROWS = 300  # of a large matrix that are turned or looked at together: a few MB
SYMMETRIC = 1e-9  # of the largest entry: what a covariance may differ by from its transpose


@dataclass(frozen=True, eq=False)
class PlaceCovariances:
    """How well the n places of a group are known in two epochs.

    first    (3n, 3n) m^2, may be singular, or (n, 3, 3) of points that are independent; None: exact, as a design
    second   likewise; one of the two at least
    cross    (3n, 3n) m^2, of the first (rows) with the second (columns), if any
    """

    first: np.ndarray | None = None
    second: np.ndarray | None = None
    cross: np.ndarray | None = None

    def checked(self, count: int) -> "PlaceCovariances":
        """The same as numbers; EstimationError for another size, what is no number or not symmetric."""
        given = {"of the first set": self.first, "of the second set": self.second, "between the sets": self.cross}
        size, known = (3 * count, 3 * count), []
        for name, q in given.items():
            q = None if q is None else np.asarray(q, dtype=float)
            known.append(q)
            if q is None or (q.shape == (count, 3, 3) and name != "between the sets" and np.isfinite(q).all()):
                continue
            if q.shape != size or not np.isfinite(q).all():
                raise EstimationError(f"the covariance {name} has shape {q.shape}, expected {size}, all finite")
            if name != "between the sets" and not _symmetric(q):
                raise EstimationError(f"the covariance {name} is not symmetric")
        return PlaceCovariances(*known)

    def of(self, keep: np.ndarray) -> "PlaceCovariances":
        """Those of some points (n,) bool."""
        if keep.all():
            return self
        rows = np.flatnonzero(np.repeat(keep, 3))
        parts = (self.first, self.second, self.cross)
        return PlaceCovariances(
            *(None if q is None else q[keep] if q.ndim == 3 else q[np.ix_(rows, rows)] for q in parts)
        )

    def difference(self, matrix: np.ndarray, extra: np.ndarray | None = None) -> np.ndarray:
        """Covariance (3n, 3n) of second less turned first, a new matrix.

        matrix   (3, 3) by which the first is turned
        extra    (3n,) m^2, more variance of the second
        """
        parts = [q for q in (self.first, self.second, self.cross) if q is not None]
        size = 3 * len(parts[0]) if parts[0].ndim == 3 else len(parts[0])
        total = np.zeros((size, size))
        for q, turn in ((self.first, matrix), (self.second, None)):
            if q is None:
                continue
            if q.ndim == 3:
                own = q if turn is None else turn @ q @ turn.T
                blocks = total.reshape(len(q), 3, len(q), 3)
                at = np.arange(len(q))
                blocks[at, :, at] += own
            elif turn is None:
                total += q
            else:
                for k in range(0, size, ROWS):
                    total[k : k + ROWS] += turned_rows(q[k : k + ROWS], turn)
        if self.cross is not None:
            shared = turned_covariance(self.cross, matrix, columns=False)
            total -= shared
            total -= shared.T
        if extra is not None:
            total[np.diag_indices(size)] += extra
        return total

    def difference_times(self, matrix: np.ndarray, a: np.ndarray, extra: np.ndarray | None = None) -> np.ndarray:
        """`difference` times a (3n, k), without a matrix of its size."""
        total = np.zeros(a.shape) if extra is None else extra[:, None] * a
        turned = turned_covariance(a, matrix.T, columns=False)
        if self.first is not None:
            total += turned_covariance(_times(self.first, turned), matrix, columns=False)
        if self.second is not None:
            total += _times(self.second, a)
        if self.cross is not None:
            total -= turned_covariance(self.cross @ a, matrix, columns=False) + self.cross.T @ turned
        return total

    def pull(self, matrix: np.ndarray, a: np.ndarray) -> np.ndarray:
        """By how much weighted residuals a (3n,) move the first places, (3n,) m: (Q_x L' - C) a."""
        total = np.zeros(len(a))
        if self.first is not None:
            total += _times(self.first, turned_covariance(a[:, None], matrix.T, columns=False))[:, 0]
        if self.cross is not None:
            total -= self.cross @ a
        return total


def turned_covariance(q: np.ndarray, matrix: np.ndarray, *, columns: bool) -> np.ndarray:
    """q L' (columns) or L q (rows) for a covariance q (3n, 3m), L the matrix (3, 3) repeated along the diagonal."""
    if columns:
        return (q.reshape(len(q), -1, 3) @ matrix.T).reshape(q.shape)
    return (matrix @ q.reshape(-1, 3, q.shape[1])).reshape(q.shape)


def turned_rows(q: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """L q L' of some rows (3k, 3n) of a covariance."""
    return turned_covariance(turned_covariance(q, matrix, columns=True), matrix, columns=False)


def turn_in_place(q: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """L q L', written over q (3n, 3n) and without another matrix of its size."""
    for k in range(0, len(q), ROWS):
        q[k : k + ROWS] = turned_rows(q[k : k + ROWS], matrix)
    return q


def _times(q: np.ndarray, a: np.ndarray) -> np.ndarray:
    return (q @ a.reshape(-1, 3, a.shape[1])).reshape(a.shape) if q.ndim == 3 else q @ a


def _symmetric(q: np.ndarray) -> bool:
    parts: Sequence[slice] = [slice(k, k + ROWS) for k in range(0, len(q), ROWS)]
    largest = max((float(np.abs(q[part]).max(initial=0.0)) for part in parts), default=0.0)
    return all(float(np.abs(q[part] - q[:, part].T).max()) <= SYMMETRIC * largest for part in parts)
