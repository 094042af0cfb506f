"""Products of a border's covariance with thousands of rows that reach it, some at a time.

Each row has a few hundred of the border's parameters: most of them a hundred that all share (rangers, air), which are
multiplied as a dense matrix, the others its own (states in time), which stay sparse.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

SHARED = 0.1  # of the rows that must have a parameter, for it to be quicker as dense
COLUMNS = 300  # of what they are multiplied with, taken together: these stay in a cache
ROWS = 1200  # that are carried together: their product takes some 50 MB


@dataclass(frozen=True, eq=False)
class Reaching:
    """Rows (k, g) of a border's parameters.

    shared   (c,) parameters that many rows have
    dense    (k, c) of these
    rest     (k, g) sparse, of the others
    """

    shared: np.ndarray
    dense: np.ndarray
    rest: csr_array

    @staticmethod
    def of(rows: csr_array) -> "Reaching":
        """Sparse rows taken apart by what many share."""
        count, size = np.bincount(rows.indices, minlength=rows.shape[1]), rows.shape[0]
        many = count > SHARED * size
        shared, own = np.flatnonzero(many), ~many[rows.indices]
        pointers = np.concatenate([[0], np.cumsum(own)])[rows.indptr]
        rest = csr_array((rows.data[own], rows.indices[own], pointers), shape=rows.shape)
        return Reaching(shared, rows[:, shared].toarray(), rest)

    def part(self, low: int, high: int) -> "Reaching":
        """Rows from one to before another."""
        return Reaching(self.shared, self.dense[low:high], self.rest[low:high])

    def times(self, z: np.ndarray) -> np.ndarray:
        """(k, m) rows times z (g, m)."""
        answer = self.dense @ z[self.shared]
        for k in range(0, z.shape[1], COLUMNS):
            answer[:, k : k + COLUMNS] += self.rest @ np.ascontiguousarray(z[:, k : k + COLUMNS])
        return np.asarray(answer)

    def carried(self, z: np.ndarray, others: "Reaching | None" = None) -> np.ndarray:
        """(k, k) rows times z (g, g) times the rows' transpose, or (k, m) times that of others; z is symmetric."""
        size = len(self.dense)
        answer = np.empty((size, size if others is None else len(others.dense)))
        for low in range(0, size, ROWS):
            high = min(low + ROWS, size)
            seen = self.part(low, high).times(z).T
            if others is not None:
                answer[low:high] = others.times(seen).T
                continue
            lower = self.part(0, high).times(seen)  # the other half is its transpose
            answer[:high, low:high] = lower
            answer[low:high, :high] = lower.T
        return answer
