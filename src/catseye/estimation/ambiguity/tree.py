"""Search tree of all sets of whole cycles that a prior position allows, for `search`."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

SIGMAS = 6.0  # of the prior and of each prediction: exceeded by one position in ten million
STEPS = 6  # of Gauss-Newton per branch: four suffice from metres to below a micrometre
ROOM = 200_000  # branches per batch
MOST_COMPARED = 40  # limit of ranges for the search of the best triple
WORSE = 50.0**2  # chi-square above which a branch is dropped


@dataclass(frozen=True, eq=False)
class Ranged:
    """Point with a prior and ranges modulo a period.

    start         (3,) m
    prior_root    (3, 3) m, Cholesky factor of the prior covariance
    stations      (r, 3) m
    lengths       (r,) m, up to whole periods
    periods       (r,) m
    root          (r, r) m, Cholesky factor of the ranges' covariance
    """

    start: np.ndarray
    prior_root: np.ndarray
    stations: np.ndarray
    lengths: np.ndarray
    periods: np.ndarray
    root: np.ndarray

    def ordered(self, rows: np.ndarray) -> "Ranged":
        """Selected ranges in a given order."""
        covariance = self.root @ self.root.T
        root = np.linalg.cholesky(covariance[np.ix_(rows, rows)])
        return Ranged(
            start=self.start,
            prior_root=self.prior_root,
            stations=self.stations[rows],
            lengths=self.lengths[rows],
            periods=self.periods[rows],
            root=root,
        )


@dataclass(frozen=True, eq=False)
class Trunk:
    """Points allowed by the prior and the first ranges.

    Base of several searches.

    rows          (q,) ranges used, three if available
    cycles        (c, q)
    x             (c, 3) m
    information   (c, 3, 3) m^-2
    chi_square    (c,) of the prior and these ranges
    """

    rows: np.ndarray
    cycles: np.ndarray
    x: np.ndarray
    information: np.ndarray
    chi_square: np.ndarray


@dataclass(frozen=True, eq=False)
class CycleCandidates:
    """Candidates of the search.

    x            (c, 3) m, one per set of whole cycles
    cycles       (c, r); the nearest for a range not used
    chi_square   (c,) of the prior and the ranges used
    covariance   (3, 3) m^2 of the best one
    floor        lower limit of the chi-square of all unlisted sets, within SIGMAS of the prior
    tried        number of sets examined
    """

    x: np.ndarray
    cycles: np.ndarray
    chi_square: np.ndarray
    covariance: np.ndarray
    floor: float
    tried: int


def trunk(ranged: Ranged, rows: np.ndarray, most: int) -> Trunk | None:
    """First ranges' whole cycles allowed by the prior.

    None if more than `most`.

    ranged   the problem
    rows     usable ranges
    most     limit of sets

    The three ranges of the best figure come first. Their integers are enumerated over the prior's ellipsoid, and each
    set's point follows by Gauss-Newton with the prior.
    """
    first = _best_figure(ranged, rows)
    ordered = ranged.ordered(first)
    cycles = _first_cycles(ordered, len(first), most)
    if cycles is None:
        return None
    x, information, square = _points(ordered, cycles, ordered.start + np.zeros((len(cycles), 3)))
    inside = square <= SIGMAS**2
    return Trunk(first, cycles[inside], x[inside], information[inside], square[inside])


def expanded(ranged: Ranged, rows: np.ndarray, base: Trunk, *, most: int) -> CycleCandidates | None:
    """All sets of whole cycles of some ranges that extend a trunk.

    None if more than `most`.

    ranged   the problem
    rows     the ranges used, including those of the trunk
    base     from `trunk`
    most     limit of sets

    Each further range is predicted: its nearest integer is followed, and others that the prediction does not exclude by
    SIGMAS. The smallest possible chi-square of the dropped ones is recorded, so that the second best is known even if
    it was not followed.
    """
    further = np.setdiff1d(rows, base.rows)
    noise = np.linalg.norm(ranged.root, axis=1)
    order = np.concatenate([base.rows, further[np.argsort(noise[further], kind="stable")]])
    ordered = ranged.ordered(order)
    cycles, x, information, square = base.cycles, base.x, base.information, base.chi_square
    tried, floor = len(cycles), np.inf
    for k in range(len(base.rows), len(order)):
        cycles, x, spared = _next_cycles(ordered, k, cycles, x, information, square)
        floor = min(floor, spared)
        tried = max(tried, len(cycles))
        if len(cycles) > most:
            return None
        x, information, square = _points(ordered, cycles, x)
    distance = np.linalg.norm(x[:, None] - ranged.stations, axis=2)
    nearest_cycles = np.rint((distance - ranged.lengths) / ranged.periods)
    nearest_cycles[:, order] = cycles
    covariance = np.linalg.inv(information[np.argmin(square)]) if len(square) else np.full((3, 3), np.nan)
    return CycleCandidates(
        x=x, cycles=nearest_cycles.astype(np.int64), chi_square=square, covariance=covariance, floor=floor, tried=tried
    )


def _best_figure(ranged: Ranged, rows: np.ndarray) -> np.ndarray:
    """Three ranges that determine a point best, or all if fewer."""
    if len(rows) < 3:
        return rows
    noise = np.linalg.norm(ranged.root, axis=1)
    towards = ranged.start - ranged.stations
    e = towards / np.linalg.norm(towards, axis=1)[:, None]
    some = rows if len(rows) <= MOST_COMPARED else rows[np.linspace(0, len(rows) - 1, MOST_COMPARED).astype(int)]
    triples = np.array(list(combinations(some, 3)))
    volume = np.abs(np.linalg.det(e[triples])) / np.prod(noise[triples], axis=1)
    return triples[int(np.argmax(volume))]


def _first_cycles(ranged: Ranged, first: int, most: int) -> np.ndarray | None:
    """Whole cycles (c, first) of the first ranges allowed by the prior, with a small margin.

    With z = root^-1 (x - start) the prior is the unit ball times SIGMAS; a distance changes in it by |root' e| SIGMAS
    and, being curved, by t^2 / 2 D at most, t the prior's largest extent.
    """
    towards = ranged.start - ranged.stations[:first]
    distance = np.linalg.norm(towards, axis=1)
    e = towards / distance[:, None]
    extent = SIGMAS * float(np.linalg.norm(ranged.prior_root, 2))
    bend = np.minimum(extent**2 / (2.0 * np.maximum(distance - extent, 0.1 * distance)), 2.0 * extent)
    slope = e @ ranged.prior_root
    u = np.hypot(np.linalg.norm(slope, axis=1), np.linalg.norm(ranged.root[:first], axis=1))
    reach = SIGMAS * u + bend
    low = np.ceil((distance - reach - ranged.lengths[:first]) / ranged.periods[:first])
    high = np.floor((distance + reach - ranged.lengths[:first]) / ranged.periods[:first])
    counts = high - low + 1
    if np.prod(counts) > 20.0 * most:
        return None
    grid_rows = np.zeros((1, 0))
    covariance = slope @ slope.T + (ranged.root @ ranged.root.T)[:first, :first]
    for k in range(first):  # one range after the other, to avoid the corners of the box
        integers = np.arange(low[k], high[k] + 1)
        grid = np.concatenate(
            [np.repeat(grid_rows, len(integers), axis=0), np.tile(integers, len(grid_rows))[:, None]], axis=1
        )
        size = k + 1
        off = ranged.lengths[:size] + grid * ranged.periods[:size] - distance[:size]
        # the largest effect of the curvature is subtracted first, so that exclusions are safe
        inverse = np.linalg.inv(np.linalg.cholesky(covariance[:size, :size]))
        far = np.linalg.norm(off @ inverse.T, axis=1) - np.linalg.norm(np.abs(inverse) @ bend[:size])
        grid_rows = grid[far <= SIGMAS]
    return grid_rows if len(grid_rows) <= most else None


def _points(ranged: Ranged, cycles: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best-fit points (c, 3) of the prior and the first ranges, with information and chi-square."""
    parts = [_converged(ranged, cycles[i : i + ROOM], x[i : i + ROOM]) for i in range(0, max(len(cycles), 1), ROOM)]
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return joined[0], joined[1], joined[2]


def _converged(ranged: Ranged, cycles: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    k = cycles.shape[1]
    whiten = np.linalg.inv(ranged.root[:k, :k])
    prior = np.linalg.inv(ranged.prior_root)
    prior_information = prior.T @ prior
    reached = ranged.lengths[:k] + cycles * ranged.periods[:k]

    def misses(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        towards = at[:, None] - ranged.stations[:k]
        distance = np.linalg.norm(towards, axis=2)
        slope = np.einsum("ij,cja->cia", whiten, towards / distance[..., None])
        return (reached - distance) @ whiten.T, slope

    for _ in range(STEPS):
        v, slope = misses(x)
        information = prior_information + np.einsum("cia,cib->cab", slope, slope)
        gradient = np.einsum("cia,ci->ca", slope, v) + (ranged.start - x) @ prior_information
        step = np.linalg.solve(information, gradient[..., None])[..., 0]
        x = x + step
        if not len(x) or np.max(np.abs(step)) < 1e-9:
            break
    v, slope = misses(x)
    information = prior_information + np.einsum("cia,cib->cab", slope, slope)
    square = np.sum(v**2, axis=1) + np.sum(((x - ranged.start) @ prior.T) ** 2, axis=1)
    return x, information, square


def _next_cycles(
    ranged: Ranged, k: int, cycles: np.ndarray, x: np.ndarray, information: np.ndarray, square: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Branches extended by range k: nearest integer, and others within SIGMAS of the prediction.

    The third value is the smallest possible chi-square of the dropped integers.
    """
    if not len(cycles):
        return np.zeros((0, k + 1)), x, np.inf
    row, noise_root = ranged.root[k, :k], float(ranged.root[k, k])
    whiten = np.linalg.inv(ranged.root[:k, :k])
    towards = x[:, None] - ranged.stations[: k + 1]
    distance = np.linalg.norm(towards, axis=2)
    e = towards / distance[..., None]
    noise = (ranged.lengths[:k] + cycles * ranged.periods[:k] - distance[:, :k]) @ whiten.T  # of the previous ranges
    slope = e[:, k] - np.einsum("j,cja->ca", row @ whiten, e[:, :k])
    variance = noise_root**2 + np.sum(slope * np.linalg.solve(information, slope[..., None])[..., 0], axis=1)
    u = np.sqrt(variance)
    period = float(ranged.periods[k])
    exact = (distance[:, k] + noise @ row - ranged.lengths[k]) / period
    nearest = np.rint(exact)
    reach = SIGMAS * u / period
    low, high = np.minimum(np.ceil(exact - reach), nearest), np.maximum(np.floor(exact + reach), nearest)
    passed = np.minimum(exact - (low - 1.0), (high + 1.0) - exact) * period / u
    floor = float(np.min(square + passed**2))
    counts = (high - low + 1).astype(int)
    parent = np.repeat(np.arange(len(cycles)), counts)
    within = np.arange(len(parent)) - np.repeat(np.cumsum(counts) - counts, counts)
    integers = np.repeat(low, counts) + within
    cost = square[parent] + ((integers - exact[parent]) / u[parent] * period) ** 2
    if len(cost) > 2:  # the second best is kept, for its position
        hopeless = cost > max(WORSE, float(np.partition(cost, 1)[1]))
        floor = min(floor, float(np.min(cost[hopeless], initial=np.inf)))
        parent, integers = parent[~hopeless], integers[~hopeless]
    return np.concatenate([cycles[parent], integers[:, None]], axis=1), x[parent], floor
