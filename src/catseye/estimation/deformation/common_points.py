"""Points common to two epochs: pairing by name, and changes of distances between them."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import Epochs
from catseye.estimation.network.model import NetworkSolution

MOST = 700  # limit of points for all mutual distances; above it an even selection
NONE_COMMON = "the epochs have no point name in common; give the same point the same name in both"


def paired_names(first: NetworkSolution, second: NetworkSolution) -> tuple[tuple[str, ...], list[tuple[str, str]]]:
    """Names common to both epochs, and pairs that differ only by case.

    Raises EstimationError if no name is common.
    """
    common = tuple(name for name in first.index if name in second.index)
    unmatched = {name.casefold(): name for name in second.index if name not in first.index}
    alike = [
        (name, unmatched[name.casefold()])
        for name in first.index
        if name not in second.index and name.casefold() in unmatched
    ]
    if common:
        return common, alike
    if alike:
        text = listed([f"{a} and {b}" for a, b in alike])
        raise EstimationError(
            f"the epochs have no point name in common, but names that differ only by upper and lower case: {text}; "
            "give the same point the same name in both"
        )
    raise EstimationError(f"{NONE_COMMON} (first: {listed(list(first.index))}; second: {listed(list(second.index))})")


def listed(names: Sequence[str], most: int = 6) -> str:
    """Distinct names, up to a limit, and how many more there are."""
    names = list(dict.fromkeys(names))
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def distance_changes(x: np.ndarray, y: np.ndarray, compared: np.ndarray) -> np.ndarray:
    """Median change (n,) m of the distances from each point to the others.

    It is invariant to a common motion of all points.

    x, y       (n, 3) m, first and second
    compared   (n, 3) bool; a distance uses the coordinates that both points have
    """
    to = np.unique(np.linspace(0, len(x) - 1, min(len(x), MOST)).astype(int))
    result = np.zeros(len(x))
    for i in range(len(x)):
        neighbours = to[to != i]
        common = compared[neighbours] & compared[i]
        lengths = [np.linalg.norm(np.where(common, p[neighbours] - p[i], 0.0), axis=1) for p in (x, y)]
        if common.any():
            result[i] = np.median(np.abs(lengths[1] - lengths[0])[common.any(axis=1)])
    return result


def far_points(epochs: Epochs, *, level: float, scaled: bool) -> list[int]:
    """Points whose distances to most others changed significantly: a datum-free start.

    epochs   see `Epochs`
    level    family-wise false-alarm probability; a point's share is level / n
    scaled   True if the datums may differ by a scale: the median ratio of all distances is then removed

    Each change has the standard uncertainty of both epochs' covariances along the line between the points. They only
    start a search; empty if they are the majority.
    """
    x, y = (np.asarray(p, dtype=float) for p in (epochs.first, epochs.second))
    n = len(x)
    compared = np.ones((n, 3), dtype=bool) if epochs.compared is None else np.asarray(epochs.compared, dtype=bool)
    parts = [epochs.covariance_first, epochs.covariance_second]
    blocks = [np.reshape(q, (n, 3, n, 3)) for q in [*parts, *([] if epochs.cross is None else [epochs.cross])]]
    if scaled:
        y = y * _ratio(x, y)
    statistic = np.zeros(n)
    for i in range(n):
        common = (compared & compared[i]) & (np.arange(n) != i)[:, None]
        arms = [np.where(common, p - p[i], 0.0) for p in (x, y)]
        lengths = [np.linalg.norm(arm, axis=1) for arm in arms]
        e = [arm / np.where(size > 0.0, size, 1.0)[:, None] for arm, size in zip(arms, lengths, strict=True)]
        variance = _along(blocks[0], i, e[0], e[0]) + _along(blocks[1], i, e[1], e[1])
        if len(blocks) > 2:
            variance = variance - 2.0 * _along(blocks[2], i, e[0], e[1])
        change = np.abs(lengths[1] - lengths[0])
        usable = common.any(axis=1) & (variance > 0.0)
        if usable.any():
            statistic[i] = np.median(change[usable] / np.sqrt(variance[usable]))
    far = np.flatnonzero(statistic > np.sqrt(special.chdtri(1, level / n)))
    return far.tolist() if 2 * len(far) < n else []


def _along(q: np.ndarray, i: int, e: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Covariance (n,) of the separations from point i, along unit vectors e (rows) and f (columns)."""
    n = len(e)
    diagonal = q[np.arange(n), :, np.arange(n)]
    relative = diagonal + q[i, :, i][None] - q[:, :, i] - q[i].transpose(1, 0, 2)
    return np.einsum("nj,njk,nk->n", e, relative, f)


def _ratio(x: np.ndarray, y: np.ndarray) -> float:
    """Median ratio of distances, first epoch over second."""
    at = np.unique(np.linspace(0, len(x) - 1, min(len(x), MOST)).astype(int))
    i, j = np.triu_indices(len(at), 1)
    a, b = (np.linalg.norm(p[at[i]] - p[at[j]], axis=1) for p in (x, y))
    good = (a > 0.0) & (b > 0.0)
    return float(np.median(a[good] / b[good])) if good.any() else 1.0
