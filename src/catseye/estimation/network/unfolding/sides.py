"""Points added to a figure from the ranges to its found points, each on the side of a plane where it fits or is put."""

import numpy as np

from catseye.estimation.network.unfolding.fit import FLAT, flattened
from catseye.estimation.network.unfolding.location import locate


def extend(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray, *, sigma: float) -> None:
    """Fills in, in place, what at least four found points see and decide.

    Where all found lie in a plane three are enough: both sides fit, and the side of the others is taken.
    """
    for _ in range(len(stations) + len(targets)):
        changed = False
        for known, wanted, table in ((stations, targets, ranges.T), (targets, stations, ranges)):
            at, to = np.flatnonzero(np.isfinite(known[:, 0])), np.flatnonzero(np.isnan(wanted[:, 0]))
            if not len(to):
                continue
            places, rms = locate(known[at], table[np.ix_(to, at)])
            number = np.isfinite(table[np.ix_(to, at)]).sum(axis=1)
            either = _either_side(places, rms, number, sigma=sigma)
            extent = np.linalg.svd(known[at] - known[at].mean(axis=0), compute_uv=False)
            if extent[2] < FLAT * extent[1]:
                good = number >= 3
                places[:, 0] = np.where(either[:, None], _one_side(known[at], places, wanted), places[:, 0])
            else:
                good = (number >= 4) & ~either
            good &= np.isfinite(places[:, 0, 0])
            wanted[to[good]] = places[good, 0]
            changed |= bool(good.any())
        if not changed:
            break


def settle_sides(
    known: np.ndarray, wanted: np.ndarray, to: np.ndarray, *, table: np.ndarray, sigma: float
) -> np.ndarray:
    """Puts each point, in place, on the side that fits clearly better, and those that fit both on that of the others.

    Returns (len(to),) bool: which fit both. Known points that may lie in one plane decide nothing: they were fitted
    with the others on the sides where they are.
    """
    flat = flattened(known, table, sigma)
    known = known if flat is None else flat
    places, rms = locate(known, table)
    either = _either_side(places, rms, np.isfinite(table).sum(axis=1), sigma=sigma)
    placed = np.isfinite(places[:, 0, 0])
    better = np.where(either[:, None], _one_side(known, places, wanted[to]), places[:, 0])
    wanted[to[placed]] = better[placed]
    return either


def _either_side(places: np.ndarray, rms: np.ndarray, number: np.ndarray, *, sigma: float) -> np.ndarray:
    """Whether both solutions of `locate` fit, and are further apart than noise puts those of a point in the plane."""
    apart2 = np.sum((places[:, 0] - places[:, 1]) ** 2, axis=1)
    reach = np.linalg.norm(places, axis=2).max(axis=1) + 1.0
    with np.errstate(invalid="ignore"):
        return (number * (rms[:, 1] ** 2 - rms[:, 0] ** 2) < (5 * sigma) ** 2) & (apart2 > 40 * reach * sigma)


def _one_side(anchors: np.ndarray, places: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Of both solutions (t, 2, 3) those (t, 3) on the side of the anchors' plane where the mean of the others lies."""
    mean = anchors.mean(axis=0)
    normal = np.linalg.svd(anchors - mean)[2][2]
    up = np.sign((np.nanmean(others, axis=0) - mean) @ normal) or 1.0
    first = (places[:, 0] - places[:, 1]) @ normal * up > 0.0
    return np.where(first[:, None], places[:, 0], places[:, 1])
