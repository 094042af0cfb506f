"""Which motions of a whole network nothing holds, and how conditions on its coordinates hold them.

A motion carries every point at once and may carry other parameters with it: a turn about the vertical takes the
orientations of direction sets along, a change of scale the scales of rangers. It floats when no observation sees it.
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
SETTLED = 1e-7  # of the network's size: a last motion below it changes nothing to second order,
UNDONE = 1e-6  # nor does one that leaves less than this share of the usual standard uncertainty undone
UNHELD = 1e-7  # share of a unit motion in the datum's coordinates, below which they do not hold it


def with_datum(network: ObservationNetwork, datum: str | None) -> ObservationNetwork:
    """The network with its datum as asked.

    datum   None: as the file marks it. "fixed": what is marked either way is held. "free": nothing is held, inner
            constraints on the points marked fixed or datum; where none is, on all with given coordinates; where
            nothing is given, on all
    """
    if datum is None:
        return network
    if datum not in DATUMS:
        raise EstimationError(f"datum {datum!r} is not known (expected one of {', '.join(DATUMS)})")
    points = network.points
    marked = points.fixed | points.datum
    nothing = np.zeros_like(marked)
    if datum == "fixed":
        if not marked.any():
            raise EstimationError("datum 'fixed': no point of the network is marked fixed or datum; mark some")
        return replace(network, points=replace(points, fixed=marked, datum=nothing))
    chosen = marked if marked.any() else np.isfinite(points.xyz)
    if not chosen.any():
        chosen = points.existing
    return replace(network, points=replace(points, fixed=nothing, datum=chosen))


def with_reference(network: ObservationNetwork) -> ObservationNetwork:
    """The network, with the places found for its points as their coordinates where not one is given.

    The inner constraints then refer to these; where the network lies is a convention in any case.
    """
    points = network.points
    if np.isfinite(points.xyz).any() or not points.datum.any():
        return network
    from catseye.estimation.network.approximate.start import approximate

    return replace(network, points=replace(points, xyz=approximate(network).xyz))


@dataclass(frozen=True, eq=False)
class Floating:
    """Motions that no observation holds, at some x.

    motions   (n, d) over all parameters, a unit of the largest displacement 1 m
    kinds     (7, d) what each is made of, in the order of MOTIONS
    centre    (3,) m, about which they turn
    size      m, by which turns and scale are divided
    """

    motions: np.ndarray
    kinds: np.ndarray
    centre: np.ndarray
    size: float

    def words(self, which: np.ndarray | None = None) -> str:
        """Names of the motions among (some combinations (d, k) of) these."""
        kinds = self.kinds if which is None else self.kinds @ which
        if not kinds.size:
            return "nothing"
        _, singular, turned = np.linalg.svd(kinds[3:])
        turning = int(np.sum(singular > 1e-6 * np.linalg.norm(kinds)))
        names = [*_largest(kinds[:3] @ turned[turning:].T, 0), *_largest(kinds[3:] @ turned[:turning].T, 3)]
        return ", ".join(names)


def _largest(kinds: np.ndarray, first: int) -> list[str]:
    """As many motions as kinds (k, d) has columns: those that have most part in the space they span."""
    count = kinds.shape[1]
    if not count:
        return []
    share = np.sum(np.linalg.svd(kinds, full_matrices=False)[0] ** 2, axis=1)
    return [MOTIONS[first + i] for i in sorted(np.argsort(-share, kind="stable")[:count])]


def floating_motions(
    rows: Sequence[ActiveRows], x: np.ndarray, xyz: np.ndarray, *, free: np.ndarray, absent: np.ndarray | None = None
) -> Floating:
    """The motions of the network that no observation, prior or held coordinate holds.

    rows     groups of observations, priors among them
    x        (n,) parameters: 3 k coordinates of k points, then others
    xyz      (k, 3) coordinates in x
    free     (n,) bool: False where held or absent
    absent   (k, 3) bool: coordinates that do not exist, which neither move nor hold a motion; none if None

    A motion floats when |A v|^2 < FLOATS |v|^2, columns of A scaled to unit length.
    """
    n, coordinates = len(x), 3 * len(xyz)
    linear = [(r, *_row_form(r, x)) for r in rows]
    norms = sum((np.bincount(at.ravel(), (j**2).ravel(), n) for _, at, j in linear), np.zeros(n))
    gone = np.zeros(xyz.shape, dtype=bool) if absent is None else absent
    centre = np.sum(np.where(gone, 0.0, xyz), axis=0) / np.maximum(np.sum(~gone, axis=0), 1)
    xyz = np.where(gone, centre, xyz)  # without an arm about the centre
    size = figure_size(xyz - centre)
    h, allowed = np.where(gone.ravel()[:, None], 0.0, motions(xyz, centre, size)), np.eye(7)
    still = ~free[:coordinates] & ~gone.ravel()
    if still.any():  # a held coordinate must not move
        _, singular, turned = np.linalg.svd(h[still], full_matrices=True)
        allowed = turned[int(np.sum(singular > 1e-9 * np.sqrt(len(xyz)))) :].T
    _, singular, turned = np.linalg.svd(h @ allowed, full_matrices=False)
    allowed = allowed @ turned[singular > 1e-9 * np.sqrt(len(xyz))].T  # points on a line do not turn about it
    others = coordinates + np.flatnonzero(free[coordinates:] & (norms[coordinates:] > 0.0))
    if not (allowed.size and norms[:coordinates].any()):
        return Floating(np.zeros((n, 0)), np.zeros((7, 0)), centre, size)
    k = allowed.shape[1]
    basis = np.zeros((n, k + len(others)))
    basis[:coordinates, :k] = h @ allowed
    basis[others, k + np.arange(len(others))] = 1.0
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
    """Columns (m, w) of each row and the whitened Jacobian there; zero where there is none."""
    _, j = rows.linear(x)
    at = rows.row_columns()
    return np.maximum(at, 0), np.where(at < 0, 0.0, j)


def datum_conditions(floating: Floating, datum: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Conditions G (d, n) by which coordinates hold floating motions, and the combinations (d, k) they do not hold.

    datum       (k, 3) bool over the coordinates at the head of the parameters
    reference   (k, 3) m, where the datum coordinates should be; anything elsewhere

    G (x - reference) = 0 makes the sum of squares of the datum coordinates' departures from their reference least
    against every floating motion: the inner constraint on a subset. That least is where the motions formed at x meet
    the departures at right angles; for turns this is the same as with motions formed at the reference, because
    x cross (x - r) = r cross (x - r), and only these are the derivatives of the condition by x.
    """
    g = np.zeros((floating.kinds.shape[1], len(floating.motions)))
    at = np.where(datum, reference, floating.centre)
    moved = motions(at, floating.centre, floating.size) @ floating.kinds
    g[:, : datum.size] = np.where(datum.ravel()[:, None], moved, 0.0).T
    _, singular, turned = np.linalg.svd(g.T, full_matrices=False)
    loose = singular < UNHELD * np.sqrt(max(1, int(datum.sum())))
    return g, turned[loose].T


def minimal_coordinates(conditions: np.ndarray) -> np.ndarray:
    """As many coordinates as there are conditions (d, n) that hold the same motions best, when held: (d,) indices."""
    if not len(conditions):
        return np.zeros(0, dtype=int)
    return qr(conditions, mode="r", pivoting=True)[1][: len(conditions)]


def to_datum(
    x: np.ndarray, reference: np.ndarray, floating: np.ndarray, *, conditions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The floating motion (n,) that carries x where G (x - reference) = 0, to first order, and T = H (G H)^-1 (n, d).

    x            (n,) parameters
    reference    (c,) of the coordinates at their head; nan where there is none
    floating     (n, d) motions H
    conditions   (d, n) G

    Source: [BAARDA73], S-transformation.
    """
    t = np.linalg.solve((conditions @ floating).T, floating.T).T
    off = np.zeros(len(x))
    off[: len(reference)] = np.where(np.isfinite(reference), x[: len(reference)] - reference, 0.0)
    return -t @ (conditions @ off), t


def transformed(q: Covariance, t: np.ndarray, conditions: np.ndarray) -> Covariance:
    """The covariance in the datum of the conditions G (d, n): S Q S' with S = 1 - T G."""
    used = np.flatnonzero(np.any(conditions != 0.0, axis=0))
    b = q.across(used) @ conditions[:, used].T
    return Transformed(q, t, b, conditions @ b)


def motion_limit(points: np.ndarray, existing: np.ndarray, u: np.ndarray) -> float:
    """Motion of the datum that points (n, 3) m may make in a last pass; u (k,) m of coordinates, empty if not known.

    What a motion s leaves undone is s^2 / size: nothing beside the standard uncertainties.
    """
    low, high = np.where(existing, points, np.inf).min(axis=0), np.where(existing, points, -np.inf).max(axis=0)
    size = float(np.max(high - low, where=existing.any(axis=0), initial=0.0))
    return max(SETTLED * size, float(np.sqrt(UNDONE * np.median(u) * size)) if len(u) else 0.0)
