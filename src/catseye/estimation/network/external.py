"""External reliability: what an error that just escapes the test does to the points that its observation names."""

import numpy as np

from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.network.model import NetworkSolution

BATCH = 50_000  # observations at a time, so that memory stays bounded


def effects_at_ends(solution: NetworkSolution) -> tuple[np.ndarray, ...]:
    """How far an error of the detectable size moves the point it moves most, of those the observation names.

    solution   with an answer; claimed uncertainties, none weighed down

    Returns one (m,) array a group, m; zero where every point named is held, nan for kinds that name none and for
    observations left out. The point need not be the one moved most of all, but mostly is.

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
    """The largest of the lengths (m,) by which points at `ends` are moved, of the products `moved` over `columns`."""
    largest = np.zeros(len(columns))
    for end in ends:
        squares = np.zeros(len(columns))
        for axis in range(3):
            here = (columns == (end + axis)[:, None]) & (end >= 0)[:, None]
            first = here & (np.cumsum(here, axis=1) == 1)  # a column that repeats holds the same product
            squares += np.sum(np.where(first, moved, 0.0), axis=1) ** 2
        largest = np.maximum(largest, squares)
    return np.sqrt(largest)
