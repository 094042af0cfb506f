"""External reliability: effect of an undetected error on the points of its observation."""

import numpy as np

from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.network.model import NetworkSolution

BATCH = 50_000  # observations per batch, to bound memory


def effects_at_ends(solution: NetworkSolution) -> tuple[np.ndarray, ...]:
    """Largest movement of a named point by an error of the detectable size, one (m,) array a group, m.

    solution   with covariance; a-priori weights, no inflation

    Zero if all named points are fixed, nan for kinds that name none and for observations left out. Usually the named
    point is the one that moves most in the network, but not always.

    Source: [BAARDA68] (external reliability): dx = Q A' P e_i times the detectable error.
    """
    x, answered = solution.state, solution.answered
    result = []
    for group, fit in zip(solution.network.groups, solution.fits, strict=True):
        ends = getattr(group, "ends", ())
        if not ends or not answered:
            result.append(np.full(len(group.observed), np.nan))
            continue
        rows = ActiveRows.of(group, fit.active)
        design = np.where(fit.active[:, None], rows.spread(group.predict(x)[1]), 0.0)
        weighted, columns = rows.weigh(design), rows.row_columns()
        largest = np.zeros(len(columns))
        step = BATCH if rows.columns.ndim == 2 else max(1, len(columns))
        for low in range(0, len(columns), step):
            part = np.arange(low, min(low + step, len(columns)))
            moved = rows.products(solution.q, weighted[part], part)
            largest[part] = _largest(moved, columns[part], [end[part] for end in ends])
        result.append(np.where(fit.active, largest * fit.detectable_error, np.nan))
    return tuple(result)


def _largest(moved: np.ndarray, columns: np.ndarray, ends: list[np.ndarray]) -> np.ndarray:
    """Largest movement (m,) of the points at `ends`, from products `moved` over `columns`."""
    largest = np.zeros(len(columns))
    for end in ends:
        squares = np.zeros(len(columns))
        for axis in range(3):
            matches = (columns == (end + axis)[:, None]) & (end >= 0)[:, None]
            first = matches & (np.cumsum(matches, axis=1) == 1)  # a repeated column holds the same product
            squares += np.sum(np.where(first, moved, 0.0), axis=1) ** 2
        largest = np.maximum(largest, squares)
    return np.sqrt(largest)
