"""Extension of a figure by further points, on the side of a plane that fits or is assumed."""

import numpy as np

from catseye.estimation.network.unfolding.fit import FLAT, flattened
from catseye.estimation.network.unfolding.location import locate


def extend(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray, *, sigma: float) -> None:
    """Add points with at least four ranges to found points, in place.

    If all found points are coplanar three are enough: both sides fit, and the side of the others is taken.
    """
    for _ in range(len(stations) + len(targets)):
        changed = False
        for source, sought, table in ((stations, targets, ranges.T), (targets, stations, ranges)):
            at, to = np.flatnonzero(np.isfinite(source[:, 0])), np.flatnonzero(np.isnan(sought[:, 0]))
            if not len(to):
                continue
            places, rms = locate(source[at], table[np.ix_(to, at)])
            number = np.isfinite(table[np.ix_(to, at)]).sum(axis=1)
            either = _either_side(places, rms, number, sigma=sigma)
            extent = np.linalg.svd(source[at] - source[at].mean(axis=0), compute_uv=False)
            if extent[2] < FLAT * extent[1]:
                good = number >= 3
                places[:, 0] = np.where(either[:, None], _one_side(source[at], places, sought), places[:, 0])
            else:
                good = (number >= 4) & ~either
            good &= np.isfinite(places[:, 0, 0])
            sought[to[good]] = places[good, 0]
            changed |= bool(good.any())
        if not changed:
            break


def settle_sides(
    source: np.ndarray, sought: np.ndarray, to: np.ndarray, *, table: np.ndarray, sigma: float
) -> np.ndarray:
    """Move points to the clearly better side, in place.

    Returns the mask of points that fit both sides.

    Points that fit both sides are put on the side of the others. Returns (len(to),) bool. Possibly coplanar known
    points are flattened first, as they were fitted with the others on their present sides.
    """
    flat = flattened(source, table, sigma)
    source = source if flat is None else flat
    places, rms = locate(source, table)
    either = _either_side(places, rms, np.isfinite(table).sum(axis=1), sigma=sigma)
    placed = np.isfinite(places[:, 0, 0])
    better = np.where(either[:, None], _one_side(source, places, sought[to]), places[:, 0])
    sought[to[placed]] = better[placed]
    return either


def _either_side(places: np.ndarray, rms: np.ndarray, number: np.ndarray, *, sigma: float) -> np.ndarray:
    """True if both solutions of `locate` fit, and differ more than by noise in the plane."""
    apart2 = np.sum((places[:, 0] - places[:, 1]) ** 2, axis=1)
    reach = np.linalg.norm(places, axis=2).max(axis=1) + 1.0
    with np.errstate(invalid="ignore"):
        return (number * (rms[:, 1] ** 2 - rms[:, 0] ** 2) < (5 * sigma) ** 2) & (apart2 > 40 * reach * sigma)


def _one_side(anchors: np.ndarray, places: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Solutions (t, 3), of both (t, 2, 3), on the side of the anchors' plane with the mean of the others."""
    mean = anchors.mean(axis=0)
    normal = np.linalg.svd(anchors - mean)[2][2]
    up = np.sign((np.nanmean(reference, axis=0) - mean) @ normal) or 1.0
    first = (places[:, 0] - places[:, 1]) @ normal * up > 0.0
    return np.where(first[:, None], places[:, 0], places[:, 1])
