"""The points common to two epochs: paired by name, and those whose distances to the others changed."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import Epochs
from catseye.estimation.network.model import NetworkSolution

MOST = 700  # points whose distances to all others are formed; of more, so many evenly chosen ones
NONE_COMMON = "the epochs have no point name in common; give the same point the same name in both"


def paired_names(first: NetworkSolution, second: NetworkSolution) -> tuple[tuple[str, ...], list[tuple[str, str]]]:
    """Names in both epochs, and pairs of other names that differ only by upper and lower case.

    Raises EstimationError where no name is common.
    """
    common = tuple(name for name in first.index if name in second.index)
    others = {name.casefold(): name for name in second.index if name not in first.index}
    alike = [
        (name, others[name.casefold()])
        for name in first.index
        if name not in second.index and name.casefold() in others
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
    """Names, each once, and how many more there are."""
    names = list(dict.fromkeys(names))
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def distance_changes(x: np.ndarray, y: np.ndarray, compared: np.ndarray) -> np.ndarray:
    """Median change of the distances from each point to others, (n,) m: no motion of all together changes it.

    x, y       (n, 3) m, first and second
    compared   (n, 3) bool; a distance is that in the coordinates that both of its points have
    """
    to = np.unique(np.linspace(0, len(x) - 1, min(len(x), MOST)).astype(int))
    result = np.zeros(len(x))
    for i in range(len(x)):
        others = to[to != i]
        both = compared[others] & compared[i]
        lengths = [np.linalg.norm(np.where(both, p[others] - p[i], 0.0), axis=1) for p in (x, y)]
        if both.any():
            result[i] = np.median(np.abs(lengths[1] - lengths[0])[both.any(axis=1)])
    return result


def far_points(epochs: Epochs, *, level: float, scaled: bool) -> list[int]:
    """Points whose distances to most others changed by more than chance explains: a start that no datum disturbs.

    epochs   see there
    level    chance that there is any if nothing moved; a point's share is level / n
    scaled   if the datums may differ by a scale: the median ratio of all distances is then taken out

    Each change has the standard uncertainty of both epochs' covariances along the line between the points. Nothing is
    decided by these; () where they are the majority.
    """
    x, y = (np.asarray(p, dtype=float) for p in (epochs.first, epochs.second))
    n = len(x)
    compared = np.ones((n, 3), dtype=bool) if epochs.compared is None else np.asarray(epochs.compared, dtype=bool)
    parts = [epochs.covariance_first, epochs.covariance_second]
    blocks = [np.reshape(q, (n, 3, n, 3)) for q in [*parts, *([] if epochs.cross is None else [epochs.cross])]]
    if scaled:
        y = y * _ratio(x, y)
    beyond = np.zeros(n)
    for i in range(n):
        both = (compared & compared[i]) & (np.arange(n) != i)[:, None]
        arms = [np.where(both, p - p[i], 0.0) for p in (x, y)]
        lengths = [np.linalg.norm(arm, axis=1) for arm in arms]
        e = [arm / np.where(size > 0.0, size, 1.0)[:, None] for arm, size in zip(arms, lengths, strict=True)]
        variance = _along(blocks[0], i, e[0], e[0]) + _along(blocks[1], i, e[1], e[1])
        if len(blocks) > 2:
            variance = variance - 2.0 * _along(blocks[2], i, e[0], e[1])
        change = np.abs(lengths[1] - lengths[0])
        shown = both.any(axis=1) & (variance > 0.0)
        if shown.any():
            beyond[i] = np.median(change[shown] / np.sqrt(variance[shown]))
    far = np.flatnonzero(beyond > np.sqrt(special.chdtri(1, level / n)))
    return far.tolist() if 2 * len(far) < n else []


def _along(q: np.ndarray, i: int, e: np.ndarray, f: np.ndarray) -> np.ndarray:
    """(n,) covariance of the separations of all points from point i, along unit vectors e (rows) and f (columns)."""
    n = len(e)
    own = q[np.arange(n), :, np.arange(n)]
    relative = own + q[i, :, i][None] - q[:, :, i] - q[i].transpose(1, 0, 2)
    return np.einsum("nj,njk,nk->n", e, relative, f)


def _ratio(x: np.ndarray, y: np.ndarray) -> float:
    """Median ratio of the distances of the first to those of the second epoch."""
    at = np.unique(np.linspace(0, len(x) - 1, min(len(x), MOST)).astype(int))
    i, j = np.triu_indices(len(at), 1)
    a, b = (np.linalg.norm(p[at[i]] - p[at[j]], axis=1) for p in (x, y))
    good = (a > 0.0) & (b > 0.0)
    return float(np.median(a[good] / b[good])) if good.any() else 1.0
