"""Floating motions of a network, and the datum conditions that fix them.

A motion moves all points together and may include other parameters: a rotation about the vertical changes the
orientations of direction sets, a change of scale the scales of rangers. It floats if no observation depends on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import Covariance, Transformed
from catseye.estimation.least_squares.normal import FLOATS
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.shapes.motions import MOTIONS, figure_size, motions

DATUMS = ("free", "fixed")
SETTLED = 1e-7  # of the network's size: limit of a last motion, negligible to second order,
UNDONE = 1e-6  # or one whose error is below this share of the median standard uncertainty
UNHELD = 1e-7  # share of a unit motion in the datum's coordinates, below which they do not fix it


def with_datum(network: ObservationNetwork, datum: str | None) -> ObservationNetwork:
    """Network with the requested datum.

    datum   None: as marked. "fixed": hold all coordinates marked fixed or datum. "free": hold none, inner constraints
            on the points marked fixed or datum; if there are none, on all with given coordinates; else on all
    """
    if datum is None:
        return network
    if datum not in DATUMS:
        raise EstimationError(f"unknown datum {datum!r} (expected one of {', '.join(DATUMS)})")
    points = network.points
    marked = points.fixed | points.datum
    unmarked = np.zeros_like(marked)
    if datum == "fixed":
        if not marked.any():
            raise EstimationError("datum 'fixed': no point of the network is marked fixed or datum; mark some")
        return replace(network, points=replace(points, fixed=marked, datum=unmarked))
    chosen = marked if marked.any() else np.isfinite(points.xyz)
    if not chosen.any():
        chosen = points.existing
    return replace(network, points=replace(points, fixed=unmarked, datum=chosen))


def with_reference(network: ObservationNetwork) -> ObservationNetwork:
    """Network with approximate coordinates as reference, if none are given.

    The inner constraints then refer to these; the position of such a network is a convention.
    """
    points = network.points
    if np.isfinite(points.xyz).any() or not points.datum.any():
        return network
    from catseye.estimation.network.approximate.start import approximate

    return replace(network, points=replace(points, xyz=approximate(network).xyz))


@dataclass(frozen=True, eq=False)
class Floating:
    """Floating motions of a network at some x.

    motions   (n, d) over all parameters, scaled to a largest displacement of 1 m
    kinds     (7, d) their components, in the order of MOTIONS
    centre    (3,) m, of the rotations
    size      m, divisor of rotations and scale
    """

    motions: np.ndarray
    kinds: np.ndarray
    centre: np.ndarray
    size: float

    def words(self, which: np.ndarray | None = None) -> str:
        """Names of the motions, or of combinations (d, k) of them."""
        kinds = self.kinds if which is None else self.kinds @ which
        if not kinds.size:
            return "nothing"
        _, singular, turned = np.linalg.svd(kinds[3:])
        turning = int(np.sum(singular > 1e-6 * np.linalg.norm(kinds)))
        names = [*_largest(kinds[:3] @ turned[turning:].T, 0), *_largest(kinds[3:] @ turned[:turning].T, 3)]
        return ", ".join(names)


def _largest(kinds: np.ndarray, first: int) -> list[str]:
    """Names of the dominant motions, one per column of kinds (k, d)."""
    count = kinds.shape[1]
    if not count:
        return []
    share = np.sum(np.linalg.svd(kinds, full_matrices=False)[0] ** 2, axis=1)
    return [MOTIONS[first + i] for i in sorted(np.argsort(-share, kind="stable")[:count])]


def floating_motions(
    rows: Sequence[ActiveRows], x: np.ndarray, xyz: np.ndarray, *, free: np.ndarray, absent: np.ndarray | None = None
) -> Floating:
    """Motions of the network that no observation, prior or fixed coordinate determines.

    rows     groups of observations, priors among them
    x        (n,) parameters: 3 k coordinates of k points, then others
    xyz      (k, 3) coordinates in x
    free     (n,) bool: False if held or absent
    absent   (k, 3) bool: coordinates that do not exist, which neither move nor fix a motion; none if None

    A motion floats when |A v|^2 < FLOATS |v|^2, columns of A scaled to unit length.
    """
    n, coordinates = len(x), 3 * len(xyz)
    linear = [(r, *_row_form(r, x)) for r in rows]
    norms = sum((np.bincount(at.ravel(), (j**2).ravel(), n) for _, at, j in linear), np.zeros(n))
    missing = np.zeros(xyz.shape, dtype=bool) if absent is None else absent
    centre = np.sum(np.where(missing, 0.0, xyz), axis=0) / np.maximum(np.sum(~missing, axis=0), 1)
    xyz = np.where(missing, centre, xyz)  # no arm about the centre
    size = figure_size(xyz - centre)
    h, allowed = np.where(missing.ravel()[:, None], 0.0, motions(xyz, centre, size)), np.eye(7)
    still = ~free[:coordinates] & ~missing.ravel()
    if still.any():  # a fixed coordinate must not move
        _, singular, turned = np.linalg.svd(h[still], full_matrices=True)
        allowed = turned[int(np.sum(singular > 1e-9 * np.sqrt(len(xyz)))) :].T
    _, singular, turned = np.linalg.svd(h @ allowed, full_matrices=False)
    allowed = allowed @ turned[singular > 1e-9 * np.sqrt(len(xyz))].T  # collinear points do not rotate about their line
    other_columns = coordinates + np.flatnonzero(free[coordinates:] & (norms[coordinates:] > 0.0))
    if not (allowed.size and norms[:coordinates].any()):
        return Floating(np.zeros((n, 0)), np.zeros((7, 0)), centre, size)
    k = allowed.shape[1]
    basis = np.zeros((n, k + len(other_columns)))
    basis[:coordinates, :k] = h @ allowed
    basis[other_columns, k + np.arange(len(other_columns))] = 1.0
    triangle = np.linalg.qr(np.sqrt(norms)[:, None] * basis, mode="r")
    back = np.linalg.inv(triangle)
    image = np.concatenate([np.einsum("mw,mwd->md", j, basis[at]) for _, at, j in linear]) @ back
    _, singular, turned = np.linalg.svd(np.linalg.qr(image, mode="r"), full_matrices=True)
    squares = np.zeros(len(triangle))
    squares[: len(singular)] = singular**2
    combination = back @ turned[squares < FLOATS].T
    moving = np.linalg.norm(combination[:k], axis=0) > 1e-9 * np.linalg.norm(combination, axis=0)
    floating = basis @ combination[:, moving]
    largest = np.abs(floating[:coordinates]).max(axis=0, initial=0.0)
    return Floating(floating / largest, allowed @ combination[:k, moving] / largest, centre, size)


def _row_form(rows: ActiveRows, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns (m, w) of each row and its whitened Jacobian.

    Zero for absent columns.
    """
    _, j = rows.linear(x)
    at = rows.row_columns()
    return np.maximum(at, 0), np.where(at < 0, 0.0, j)


def datum_conditions(floating: Floating, datum: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Datum conditions G (d, n) against floating motions, and combinations (d, k) not fixed by them.

    datum       (k, 3) bool over the coordinates at the head of the parameters
    reference   (k, 3) m, of the datum coordinates; any value elsewhere

    G (x - reference) = 0 minimises the sum of squares of the datum coordinates' departures from their reference over
    all floating motions: the inner constraint on a subset. At the minimum the motions formed at x are orthogonal to the
    departures; for rotations this equals motions formed at the reference, because x cross (x - r) = r cross (x - r),
    and only these are the derivatives of the condition by x.
    """
    g = np.zeros((floating.kinds.shape[1], len(floating.motions)))
    at = np.where(datum, reference, floating.centre)
    moved = motions(at, floating.centre, floating.size) @ floating.kinds
    g[:, : datum.size] = np.where(datum.ravel()[:, None], moved, 0.0).T
    _, singular, turned = np.linalg.svd(g.T, full_matrices=False)
    loose = singular < UNHELD * np.sqrt(max(1, int(datum.sum())))
    return g, turned[loose].T


def minimal_coordinates(conditions: np.ndarray) -> np.ndarray:
    """Indices (d,) of coordinates that, when fixed, replace the conditions (d, n) best."""
    if not len(conditions):
        return np.zeros(0, dtype=int)
    return qr(conditions, mode="r", pivoting=True)[1][: len(conditions)]


def to_datum(
    x: np.ndarray, reference: np.ndarray, floating: np.ndarray, *, conditions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Floating motion (n,) that moves x to G (x - reference) = 0, to first order, and T = H (G H)^-1.

    x            (n,) parameters
    reference    (c,) of the coordinates at their head; nan if there is none
    floating     (n, d) motions H
    conditions   (d, n) G

    T is (n, d). Source: [BAARDA73], S-transformation.
    """
    t = np.linalg.solve((conditions @ floating).T, floating.T).T
    off = np.zeros(len(x))
    off[: len(reference)] = np.where(np.isfinite(reference), x[: len(reference)] - reference, 0.0)
    return -t @ (conditions @ off), t


def transformed(q: Covariance, t: np.ndarray, conditions: np.ndarray) -> Covariance:
    """Covariance in the datum of the conditions G (d, n): S Q S' with S = 1 - T G."""
    used = np.flatnonzero(np.any(conditions != 0.0, axis=0))
    b = q.across(used) @ conditions[:, used].T
    return Transformed(q, t, b, conditions @ b)


def motion_limit(points: np.ndarray, existing: np.ndarray, u: np.ndarray) -> float:
    """Largest datum motion of a last pass, for points (n, 3) m with u (k,) m, empty if unknown.

    The error of a motion s is s^2 / size: negligible against the standard uncertainties.
    """
    low, high = np.where(existing, points, np.inf).min(axis=0), np.where(existing, points, -np.inf).max(axis=0)
    size = float(np.max(high - low, where=existing.any(axis=0), initial=0.0))
    return max(SETTLED * size, float(np.sqrt(UNDONE * np.median(u) * size)) if len(u) else 0.0)
