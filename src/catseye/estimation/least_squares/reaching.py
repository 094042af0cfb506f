"""Products of a border's covariance with thousands of sparse rows, in batches.

Each row depends on a few hundred border parameters: about a hundred that all rows share (rangers, air), multiplied
as a dense matrix, and its own (states in time), which stay sparse.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

SHARED = 0.1  # share of the rows that depend on a parameter, above which dense is faster
COLUMNS = 300  # of the right-hand side per batch: they stay in the cache
ROWS = 1200  # per batch: their product takes some 50 MB


@dataclass(frozen=True, eq=False)
class Reaching:
    """Rows (k, g) over a border's parameters.

    shared   (c,) parameters that many rows depend on
    dense    (k, c) entries of these
    sparse   (k, g) entries of the others
    """

    shared: np.ndarray
    dense: np.ndarray
    sparse: csr_array

    @staticmethod
    def of(rows: csr_array) -> "Reaching":
        """Split sparse rows into shared and other parameters."""
        count, size = np.bincount(rows.indices, minlength=rows.shape[1]), rows.shape[0]
        many = count > SHARED * size
        shared, unshared = np.flatnonzero(many), ~many[rows.indices]
        pointers = np.concatenate([[0], np.cumsum(unshared)])[rows.indptr]
        sparse = csr_array((rows.data[unshared], rows.indices[unshared], pointers), shape=rows.shape)
        return Reaching(shared, rows[:, shared].toarray(), sparse)

    def part(self, low: int, high: int) -> "Reaching":
        """Rows low to high, exclusive."""
        return Reaching(self.shared, self.dense[low:high], self.sparse[low:high])

    def times(self, z: np.ndarray) -> np.ndarray:
        """Product (k, m) of the rows with z (g, m)."""
        answer = self.dense @ z[self.shared]
        for k in range(0, z.shape[1], COLUMNS):
            answer[:, k : k + COLUMNS] += self.sparse @ np.ascontiguousarray(z[:, k : k + COLUMNS])
        return np.asarray(answer)

    def carried(self, z: np.ndarray, other_rows: "Reaching | None" = None) -> np.ndarray:
        """Rows times z (g, g) times the rows' transpose, (k, k).

        z is symmetric.

        other_rows   given these m rows, their transpose instead: (k, m)
        """
        size = len(self.dense)
        answer = np.empty((size, size if other_rows is None else len(other_rows.dense)))
        for low in range(0, size, ROWS):
            high = min(low + ROWS, size)
            product = self.part(low, high).times(z).T
            if other_rows is not None:
                answer[low:high] = other_rows.times(product).T
                continue
            lower = self.part(0, high).times(product)  # the other half is its transpose
            answer[:high, low:high] = lower
            answer[low:high, :high] = lower.T
        return answer
