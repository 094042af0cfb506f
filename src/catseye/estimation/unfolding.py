"""Figures from ranges alone: stations and targets both unknown, found up to a rigid motion and a mirror image.

With s_i about the stations' mean and t_j about the targets' mean, the squared ranges freed of their row and column
means are -2 s_i . t_j: a matrix of rank 3 (2 where the stations or the targets lie in one plane). Its factors are the
figure up to an affine map; the row and column means then fix the map, because they hold |s_i|^2 and |t_j|^2.

Least numbers: ranges S T >= 3 (S + T) - 6 with S, T >= 4 (4 x 6, 5 x 5), where several figures may fit and the status
says so; linear, thus without a search, from 10 stations or 10 targets on. Stations in one plane: at least 6, and no
range shows on which side a target lies; all in one plane: S T >= 2 (S + T) - 3. A constant zero of the rangers is not
estimated here: it must be known to a few standard uncertainties, or the ranges do not fit one figure.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import ValidityError

UNFOLDED = "unfolded"
TOO_FEW = "not unfolded, too few ranges: {m} between {s} stations and {t} targets leave no complete part with 4 of \
each and as many ranges as unknowns; measure more pairs"
IN_LINE = "not unfolded: the stations or the targets lie on one line, about which the others may turn; add some off it"
PLANE_TOO_FEW = "not unfolded: {s} stations or {t} targets lie in one plane, where at least 6 are needed; add more, or \
some off it"
NO_FIT = "not unfolded: the best figure leaves {rms:.2g} m where {sigma:.2g} m is expected; a zero or scale of the \
rangers is wrong, or some ranges are"
LOOSE = "not unfolded: the ranges between {s} stations and {t} targets let the figure bend by a thirtieth of its size; \
points in one plane may lie on one circle or other conic: add a station off it"
AMBIGUOUS = "not unfolded: different figures fit {s} stations and {t} targets equally well; measure more pairs"

FIT = 3.0  # rms residual in standard uncertainties up to which a figure fits, degrees of freedom accounted for
NOISE = 3.0  # a singular value below this many times that of noise alone counts as none
ENOUGH = 120  # stations or targets that begin the figure; the rest follows from them
BLOCK = 20_000  # ranges at a time, so that memory stays bounded
FLAT = 1e-10  # least over largest eigenvalue of a scatter of points: their extent across is 1e-5 of that along


@dataclass(frozen=True, eq=False)
class Unfolding:
    """A figure from ranges, in its own axes.

    Origin at the stations' mean; x along their largest extent, positive towards the first station found; z along their
    least, positive towards the mean of the targets; of the two mirror images that in which the first three stations
    found, seen from the targets' side, run counter-clockwise.

    stations       (S, 3) m, nan where not found
    targets        (T, 3) m, nan where not found
    side_assumed   (S + T,) bool, stations first: points that fit as well on the other side of the plane of those that
                   see them; they are put on the side of the others
    rms            m, of the residuals, over the degrees of freedom
    status         "unfolded", or one line that says what is wrong and what to do
    """

    stations: np.ndarray
    targets: np.ndarray
    side_assumed: np.ndarray
    rms: float
    status: str


def unfold(ranges: np.ndarray, sigma: float, *, seed: int = 0) -> Unfolding:
    """Stations and targets from the ranges between them, nothing else known.

    ranges   (S, T) m between station and target, nan where not measured
    sigma    m, standard uncertainty of a range
    seed     of the search that small networks need

    Source: [CROCCO12], the factors of the squared ranges and the small matrix that mixes them; [POLLEFEYS08], linear
    from ten of a kind on; [KUANG13], least numbers. The search and the least squares of all ranges are ours.

    >>> at = np.random.default_rng(1).uniform(-10, 10, (18, 3))
    >>> ranges = np.linalg.norm(at[:6, None] - at[6:], axis=2)
    >>> found = unfold(ranges, 1e-3)
    >>> found.status, bool(np.allclose(np.linalg.norm(found.targets[3] - found.targets[7]),
    ...                                np.linalg.norm(at[9] - at[13])))
    ('unfolded', True)
    """
    if not sigma > 0.0 or np.any(ranges <= 0.0):
        raise ValidityError(f"ranges from {np.nanmin(ranges):.6g} m on with sigma {sigma:g} m: both must be positive")
    (s, t), m = ranges.shape, int(np.isfinite(ranges).sum())
    rows, columns = _core(np.isfinite(ranges))
    if not len(rows):
        return _none(s, t, TOO_FEW.format(s=s, t=t, m=m))
    rows, columns = (k[np.linspace(0, len(k) - 1, min(len(k), ENOUGH)).astype(int)] for k in (rows, columns))
    part = ranges[np.ix_(rows, columns)]
    size = float(np.sqrt(np.mean(part**2)))
    figure, status = _core_figure(part / size, sigma / size, np.random.default_rng(seed))
    if figure is None:
        whole = status == TOO_FEW
        return _none(s, t, status.format(s=s if whole else len(rows), t=t if whole else len(columns), m=m))
    stations, targets = np.full((s, 3), np.nan), np.full((t, 3), np.nan)
    stations[rows], targets[columns] = figure[0] * size, figure[1] * size
    _extend(stations, targets, ranges, sigma)
    at, to = np.flatnonzero(np.isfinite(stations[:, 0])), np.flatnonzero(np.isfinite(targets[:, 0]))
    seen, assumed = ranges[np.ix_(at, to)], np.zeros(s + t, dtype=bool)
    fit = _flattest(stations[at], targets[to], seen, sigma)
    if fit.stations.shape[1] == 3:
        stations[at], targets[to] = fit.stations, fit.targets
        assumed[s + to] = _settle_sides(stations[at], targets, to, seen.T, sigma=sigma)
        assumed[at] = _settle_sides(targets[to], stations, at, seen, sigma=sigma)
        fit = _least_squares(stations[at], targets[to], seen)
    if fit.rms > FIT * sigma:
        return _none(s, t, NO_FIT.format(rms=fit.rms, sigma=sigma))
    if _loose(fit, seen, sigma):
        return _none(s, t, LOOSE.format(s=len(at), t=len(to)))
    stations[at], targets[to] = _raised(fit.stations), _raised(fit.targets)
    stations, targets = _oriented(stations, targets)
    return Unfolding(stations, targets, assumed, fit.rms, UNFOLDED)


def classical_scaling(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points from all distances between them, up to a rigid motion and a mirror image, and the eigenvalues.

    distances   (n, n) m, symmetric, complete, n >= 4

    Returns xyz (n, 3) m about the mean, along principal axes by falling extent, and the (n,) eigenvalues (m^2) by
    falling size: from the fourth on they are zero but for errors; a third that is as small tells of a plane.

    Source: [TORGERSON52], eigenvectors of the doubly centred squares.

    >>> xyz, values = classical_scaling(np.ones((4, 4)) - np.eye(4))
    >>> values.round(6)
    array([0.5, 0.5, 0.5, 0. ])
    """
    squares = np.asarray(distances, dtype=float) ** 2
    inner = -0.5 * _without_means(squares)
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    values, vectors = values[::-1], vectors[:, ::-1]
    return vectors[:, :3] * np.sqrt(np.maximum(values[:3], 0.0)), np.where(np.abs(values) < 1e-14, 0.0, values)


def locate(anchors: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points from ranges to known points: both minima of the sum of squares, the better first.

    anchors   (s, 3) m
    ranges    (t, s) m, nan where not measured

    Returns xyz (t, 2, 3) m and the root mean squares (t, 2) m of their residuals; nan where fewer than three ranges
    or all anchors in line. Anchors in one plane give mirror images of equal rms; where only one minimum exists
    both are equal. The start is linear: along the principal axes of the anchors seen, about their mean, the equations
    separate, and the height above their plane follows from the mean of the squares.

    >>> anchors = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    >>> locate(anchors, np.linalg.norm(anchors - [1.0, 2.0, 2.0], axis=1)[None])[0][0, :, 2].round(6)
    array([ 2., -2.])
    """
    if len(ranges) > 1 and ranges.size > BLOCK:
        cuts = range(max(BLOCK // ranges.shape[1], 1), len(ranges), max(BLOCK // ranges.shape[1], 1))
        blocks = [locate(anchors, block) for block in np.split(ranges, cuts)]
        return np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])
    seen = np.isfinite(ranges)
    enough = np.flatnonzero(seen.sum(axis=1) >= 3)
    xyz, rms = np.full((len(ranges), 2, 3), np.nan), np.full((len(ranges), 2), np.nan)
    if not len(enough):
        return xyz, rms
    weight = seen[enough].astype(float)
    square = np.where(seen, ranges, 0.0)[enough] ** 2
    number = weight.sum(axis=1, keepdims=True)
    mean = weight @ anchors / number
    about = (anchors - mean[:, None]) * weight[:, :, None]
    values, axes = np.linalg.eigh(np.swapaxes(about, 1, 2) @ about)
    level = np.sum(about**2, axis=2)
    plain = (level - square) / 2
    right = np.einsum("tsi,ts->ti", about, plain - plain.sum(axis=1, keepdims=True) / number)
    flat = values[:, 1] > FLAT * values[:, 2]
    local = np.einsum("tji,tj->ti", axes, right) / np.where(flat[:, None], np.maximum(values, 1e-300), 1.0)
    height2 = (square - level).sum(axis=1) / number[:, 0] - local[:, 1] ** 2 - local[:, 2] ** 2
    height = np.sqrt(np.maximum(height2, 1e-4 * square.max(axis=1)))  # in the plane itself Newton would not leave it
    start = np.stack([local, local], axis=1)
    start[:, 0, 0], start[:, 1, 0] = height, -height
    start = mean[:, None] + np.einsum("tij,tkj->tki", axes, start)
    twice = (np.repeat(a, 2, axis=0) for a in (np.sqrt(square), weight))
    moved, left = _descend(start.reshape(-1, 3), anchors, *twice)
    places, size = moved.reshape(-1, 2, 3), left.reshape(-1, 2)
    order = np.argsort(size, axis=1, kind="stable")
    places, size = np.take_along_axis(places, order[:, :, None], axis=1), np.take_along_axis(size, order, axis=1)
    xyz[enough], rms[enough] = np.where(flat[:, None, None], places, np.nan), np.where(flat[:, None], size, np.nan)
    return xyz, rms


def _descend(
    x: np.ndarray, anchors: np.ndarray, ranges: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Levenberg's descent of many points (n, 3) at once; the points and the rms of their residuals (n,).

    ranges, weight   (n, s) m and 0 or 1
    """

    def residuals(x: np.ndarray, on: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        along = x[:, None] - anchors
        distance = np.sqrt(np.einsum("tsi,tsi->ts", along, along))
        return (ranges[on] - distance) * weight[on], along * (weight[on] / np.maximum(distance, 1e-300))[..., None]

    x, on = x.copy(), np.arange(len(x))  # those that still move
    number, reach = weight.sum(axis=1), 1e-9 * ranges.max(axis=1)
    v, unit = residuals(x, on)
    cost, damping = np.sum(v**2, axis=1), np.full(len(x), 1e-6)
    for _ in range(30):
        normal = np.swapaxes(unit, 1, 2) @ unit + (damping * number)[on][:, None, None] * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("tsi,ts->ti", unit, v)[..., None])[..., 0]
        trial_v, trial_unit = residuals(x[on] + step, on)
        trial = np.sum(trial_v**2, axis=1)
        better = trial <= cost[on]
        x[on[better]] += step[better]
        cost[on[better]] = trial[better]
        damping[on] = np.clip(damping[on] * np.where(better, 0.1, 10.0), 1e-12, 1e6)
        v, unit = np.where(better[:, None], trial_v, v), np.where(better[:, None, None], trial_unit, unit)
        moving = np.abs(step).max(axis=1) > reach[on]
        if not moving.any():
            break
        on, v, unit = on[moving], v[moving], unit[moving]
    return x, np.sqrt(cost / number)


def _none(s: int, t: int, status: str) -> Unfolding:
    return Unfolding(
        np.full((s, 3), np.nan), np.full((t, 3), np.nan), np.zeros(s + t, dtype=bool), float("nan"), status
    )


def _without_means(a: np.ndarray) -> np.ndarray:
    """A matrix freed of the means of its rows and columns."""
    return a - a.mean(axis=0) - a.mean(axis=1)[:, None] + a.mean()


def _core(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of a complete part with the most ranges to spare; stations are dropped one at a time."""
    best: tuple[int, np.ndarray, np.ndarray] = (-1, np.zeros(0, int), np.zeros(0, int))
    for turned in (False, True):
        table = seen.T if turned else seen
        rows = np.arange(len(table))
        while len(rows) >= 3:
            full = np.flatnonzero(table[rows].all(axis=0))
            k, n = len(rows), len(full)
            spare = k * n - 3 * (k + n) + 6
            if (min(k, n) >= 4 and spare > best[0]) or (min(k, n) >= 3 and best[0] < 0 and k * n > 2 * (k + n) - 3):
                best = (spare, full, rows) if turned else (spare, rows, full)
            gaps = (~table[rows]).sum(axis=0)
            lone = gaps == 1  # columns that one row alone leaves incomplete
            gain = (~table[rows][:, lone]).sum(axis=1) + 1e-6 * (~table[rows]).sum(axis=1)
            rows = np.delete(rows, int(np.argmax(gain)))
    return best[1], best[2]


Figure = tuple[np.ndarray, np.ndarray]


def _core_figure(ranges: np.ndarray, sigma: float, rng: np.random.Generator) -> tuple[Figure | None, str]:
    """Figure of a complete part of size about 1, or None and the status."""
    s, t = ranges.shape
    squares = ranges**2
    left, values, right = np.linalg.svd(-0.5 * _without_means(squares), full_matrices=False)
    floor = NOISE * sigma * (np.sqrt(s) + np.sqrt(t)) + 1e-13 * values[0]
    rank = int(np.sum(values[:3] > floor))
    if rank < 2:
        return None, IN_LINE
    spare = s * t - 3 * (s + t) + 6
    dimensions = [3] * (rank == 3 and min(s, t) >= 4 and spare >= 0) + [2] * (rank == 2)
    fits: list[_Fit] = []
    for search in (0, 60, 400):  # random starts only where the linear ones found nothing
        starts: list[Figure] = []
        for d in dimensions:
            u, v = left[:, :d] * np.sqrt(s), (right[:d].T * values[:d]) / np.sqrt(s)
            starts += _upgraded(squares, u, v, search=search, rng=rng)
        if not search and min(s, t) >= 4:
            starts += _in_plane(squares) + [(b, a) for a, b in _in_plane(squares.T)]
        fits = sorted([*fits, *(_least_squares(at, to, ranges) for at, to in starts)], key=lambda fit: fit.rms)
        if fits and fits[0].rms <= FIT * sigma and (max(s, t) >= 10 or (search and spare > 2) or rank == 2):
            break
    if not fits or (min(s, t) < 4 and fits[0].rms > FIT * sigma):
        return None, TOO_FEW
    if rank == 2 and max(s, t) < 6 and fits[0].rms > FIT * sigma:
        return None, PLANE_TOO_FEW
    fitting = [fit for fit in fits if fit.rms <= FIT * sigma]
    if rank == 3 and any(_differ(fits[0], fit, sigma) for fit in fitting[1:]):
        return None, AMBIGUOUS
    return (_raised(fits[0].stations), _raised(fits[0].targets)), UNFOLDED


def _raised(points: np.ndarray) -> np.ndarray:
    """(n, 2) as (n, 3) with z = 0; (n, 3) as it is."""
    return np.hstack([points, np.zeros((len(points), 3 - points.shape[1]))])


def _differ(a: "_Fit", b: "_Fit", sigma: float) -> bool:
    """Whether two figures of size about 1 have different stations or targets, beyond what noise can do."""
    return any(
        np.max(np.abs(np.linalg.norm(p[:, None] - p, axis=2) - np.linalg.norm(q[:, None] - q, axis=2)))
        > 0.02 + 100 * sigma
        for p, q in ((a.stations, b.stations), (a.targets, b.targets))
    )


def _metric(points: np.ndarray, means: np.ndarray) -> np.ndarray | None:
    """Symmetric M of the quadric u' M u + linear terms = means; None where the points do not determine it."""
    d = points.shape[1]
    i, j = np.triu_indices(d)
    squares = points[:, i] * points[:, j] * np.where(i == j, 1.0, 2.0)
    table = np.hstack([squares, points, np.ones((len(points), 1))])
    solution, _, rank, _ = np.linalg.lstsq(table, means, rcond=1e-9)
    if rank < table.shape[1]:
        return None
    m = np.zeros((d, d))
    m[i, j] = m[j, i] = solution[: len(i)]
    return m


def _root(m: np.ndarray) -> np.ndarray:
    """A with A' A = M; eigenvalues that errors made negative are raised."""
    size, axes = np.linalg.eigh(m)
    return (axes * np.sqrt(np.clip(size, 1e-3 * abs(size).max(), None))).T


def _offset(a: np.ndarray, u: np.ndarray, v: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """b that fits the means best for given maps A (k, d, d)."""
    inverse = np.linalg.inv(a)
    at, to = u @ np.swapaxes(a, 1, 2), v @ inverse
    design = np.concatenate([-2 * at, 2 * to], axis=1)
    right = np.concatenate([row - np.sum(at**2, axis=2), column - np.sum(to**2, axis=2)], axis=1)
    right[:, : len(u)] -= right[:, : len(u)].mean(axis=1, keepdims=True)
    right[:, len(u) :] -= right[:, len(u) :].mean(axis=1, keepdims=True)
    return (np.linalg.pinv(design) @ right[..., None])[..., 0]


def _upgraded(squares: np.ndarray, u: np.ndarray, v: np.ndarray, search: int, rng: np.random.Generator) -> list[Figure]:
    """Figures A u_i and b + A^-T v_j whose row and column means are nearest to those of the squares, best first.

    The quadrics through ten stations or ten targets (six in a plane) give A; without them, `search` random maps do.
    """
    d = u.shape[1]
    additive = squares + 2 * u @ v.T
    row, column = additive.mean(axis=1), additive.mean(axis=0)
    maps = []
    if search:
        maps = list(np.exp(rng.uniform(-3.0, 0.5, (search, d, 1))) * rng.normal(size=(search, d, d)))
    elif (m := _metric(u, row)) is not None:
        maps.append(_root(m))
    if not search and (m := _metric(v, column)) is not None:
        maps.append(np.linalg.inv(_root(m)).T)
    if not maps:
        return []
    a = np.linalg.qr(np.array(maps))[1]  # a turn of the whole figure is free
    a, b, cost = _match_means(a, _offset(a, u, v, row, column), (u, v, row, column))
    order = [k for k in np.argsort(cost) if np.isfinite(cost[k])][: 12 if search else 2]
    return [(u @ a[k].T, b[k] + v @ np.linalg.inv(a[k])) for k in order]


def _match_means(
    a: np.ndarray, b: np.ndarray, means: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Levenberg's descent of maps A (k, d, d), upper triangular, and b (k, d) to given means; with the costs (k,).

    Row mean i less its part |A u_i - b|^2, column mean j less |b + A^-T v_j|^2 - |b|^2; each of these is compared
    after the other's mean is taken off.
    """
    u, v, row, column = means
    k, d = b.shape
    i, j = np.triu_indices(d)
    weight = np.concatenate([np.full(len(u), len(v) ** 0.5), np.full(len(v), len(u) ** 0.5)])

    def linear(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inverse = np.linalg.inv(a)
        at, to = u @ np.swapaxes(a, 1, 2) - b[:, None], v @ inverse
        f, g = np.sum(at**2, axis=2), np.sum(to * (to + 2 * b[:, None]), axis=2)
        back = (to + b[:, None]) @ np.swapaxes(inverse, 1, 2)  # rows A^-1 (b + A^-T v_j)
        df = np.concatenate([2 * at[:, :, i] * u[:, j], -2 * at], axis=2)
        dg = np.concatenate([-2 * back[:, :, j] * to[:, :, i], 2 * to], axis=2)
        v0 = np.concatenate([row - f - g.mean(axis=1)[:, None], column - g - f.mean(axis=1)[:, None]], axis=1)
        jacobian = np.concatenate([df + dg.mean(axis=1)[:, None], dg + df.mean(axis=1)[:, None]], axis=1)
        return v0 * weight, jacobian * weight[:, None]

    residual, jacobian = linear(a, b)
    cost, damping = np.sum(residual**2, axis=1), np.full(k, 1e-3)
    for _ in range(100):
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian
        scale = np.einsum("kii->ki", normal) + 1e-12 * np.einsum("kii->k", normal)[:, None]
        normal = normal + np.eye(len(i) + d) * (damping[:, None] * scale)[:, None]
        step = np.linalg.solve(normal, (np.swapaxes(jacobian, 1, 2) @ residual[..., None]))[..., 0]
        trial_a, trial_b = a.copy(), b + step[:, len(i) :]
        trial_a[:, i, j] += step[:, : len(i)]
        size = np.abs(np.einsum("kii->ki", trial_a))
        alive = size.min(axis=1) > 1e-6 * size.max(axis=1)  # a map that folds the figure has no inverse
        trial_a = np.where(alive[:, None, None], trial_a, a)
        trial_residual, trial_jacobian = linear(trial_a, trial_b)
        trial = np.sum(trial_residual**2, axis=1)
        better = alive & (trial < cost)
        a, b = np.where(better[:, None, None], trial_a, a), np.where(better[:, None], trial_b, b)
        residual = np.where(better[:, None], trial_residual, residual)
        jacobian = np.where(better[:, None, None], trial_jacobian, jacobian)
        done = np.abs(trial - cost) <= 1e-9 * cost
        cost = np.where(better, trial, cost)
        damping = np.clip(damping * np.where(better, 0.2, 5.0), 1e-12, 1e8)
        if np.all(done & better | (damping >= 1e6)):
            break
    return a, b, cost


def _in_plane(squares: np.ndarray) -> list[Figure]:
    """The figure with its stations in one plane and all targets on one side of it; empty where they are too few.

    The stations' quadric alone gives the map; what is left of a target's squares is its height.
    """
    left, values, right = np.linalg.svd(-0.5 * _without_means(squares), full_matrices=False)
    s = len(left)
    u, v = left[:, :2] * np.sqrt(s), (right[:2].T * values[:2]) / np.sqrt(s)
    row = (squares + 2 * u @ v.T).mean(axis=1)
    if s < 6 or (m := _metric(u, row)) is None:
        return []
    a = _root(m)
    at = u @ a.T
    left_over = row - np.sum(at**2, axis=1)
    b = np.linalg.lstsq(-2 * at, left_over - left_over.mean(), rcond=None)[0]
    to = b + v @ np.linalg.inv(a)
    height2 = np.mean(squares - np.sum((at[:, None] - to) ** 2, axis=2), axis=0)
    height = np.sqrt(np.maximum(height2, 1e-4))  # of a size 1: off the plane, where the ranges can move it
    return [(_raised(at), np.hstack([to, height[:, None]]))]


@dataclass(frozen=True, eq=False)
class _Fit:
    """A figure (s, d), (t, d) that fits its ranges best, and the rms over the degrees of freedom."""

    stations: np.ndarray
    targets: np.ndarray
    rms: float


def _flattest(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray, sigma: float) -> _Fit:
    """The figure that fits best; one in a plane where it fits as well."""
    fit = _least_squares(stations, targets, ranges)
    everything = np.vstack([fit.stations, fit.targets])
    mean = everything.mean(axis=0)
    _, extent, axes = np.linalg.svd(everything - mean, full_matrices=False)
    if extent[2] > 0.1 * extent[1]:
        return fit
    plane = _least_squares((stations - mean) @ axes[:2].T, (targets - mean) @ axes[:2].T, ranges)
    return plane if plane.rms <= max(1.3 * fit.rms, 2 * sigma) else fit


def _flattened(points: np.ndarray, table: np.ndarray, sigma: float) -> np.ndarray | None:
    """Points in their best plane if the ranges (t, s) to others, found anew, allow that; else None."""
    mean = points.mean(axis=0)
    _, extent, axes = np.linalg.svd(points - mean, full_matrices=False)
    if extent[-1] > 0.02 * extent[1]:
        return None
    flat = points - np.outer((points - mean) @ axes[-1], axes[-1])
    rms, number = locate(flat, table)[1][:, 0], np.isfinite(table).sum(axis=1)
    return flat if np.nansum(number * rms**2) <= (FIT * sigma) ** 2 * number.sum() else None


def _loose(fit: _Fit, ranges: np.ndarray, sigma: float) -> bool:
    """Whether more than the rigid motions is uncertain by a thirtieth of the figure's size.

    Stations and targets that may lie in a plane are judged there: the height that noise gives them holds nothing.
    """
    d = fit.stations.shape[1]
    size = float(np.linalg.norm(np.ptp(np.vstack([fit.stations, fit.targets]), axis=0)))
    figures = [(fit.stations, fit.targets)]
    if d == 3:
        if (flat := _flattened(fit.stations, ranges.T, sigma)) is not None:
            figures.append((flat, fit.targets))
        if (flat := _flattened(fit.targets, ranges, sigma)) is not None:
            figures.append((fit.stations, flat))
    for at, to in figures:
        normal = _reduced(*_linear(at, to, ranges), 1e-12)[0]
        if np.sum(np.linalg.eigvalsh(normal) < (30 * sigma / size) ** 2) > d * (d + 1) // 2:
            return True
    return False


def _linear(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (t, s) and unit vectors from stations to targets (t, s, d), zero where not measured."""
    along = targets[:, None] - stations
    distance = np.linalg.norm(along, axis=2)
    seen = np.isfinite(ranges).T
    residual = np.where(seen, np.nan_to_num(ranges.T) - distance, 0.0)
    return residual, along * (seen / np.maximum(distance, 1e-300))[..., None]


def _reduced(v: np.ndarray, unit: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The stations' normal matrix with the targets eliminated, and the steps of stations and targets."""
    t, s, d = unit.shape
    right = np.einsum("tsi,ts->ti", unit, v)
    normal = np.swapaxes(unit, 1, 2) @ unit + damping * np.eye(d)
    cross = -(unit[..., :, None] * unit[..., None, :]).transpose(0, 2, 1, 3).reshape(t, d, d * s)
    whole = np.zeros((s, d, s, d))
    whole[np.arange(s), :, np.arange(s)] = np.einsum("tsi,tsj->sij", unit, unit) + damping * np.eye(d)
    spread = np.linalg.solve(normal, np.concatenate([cross, right[..., None]], axis=2))
    flat = cross.reshape(d * t, d * s)
    reduced = whole.reshape(d * s, d * s) - flat.T @ spread[..., :-1].reshape(d * t, d * s)
    pull = -np.einsum("tsi,ts->si", unit, v).ravel() - flat.T @ spread[..., -1].ravel()
    step = np.linalg.solve(reduced, pull)
    return reduced, step.reshape(s, d), spread[..., -1] - spread[..., :-1] @ step


def _least_squares(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray) -> _Fit:
    """The figure (s, d), (t, d), d = 3 or 2, that fits all ranges (s, t) best from a start.

    Levenberg's damping holds the free motions; targets are eliminated one by one.
    """
    (s, t), d = ranges.shape, stations.shape[1]
    spare = max(int(np.isfinite(ranges).sum()) - d * (s + t) + d * (d + 1) // 2, 1)
    v, unit = _linear(stations, targets, ranges)
    cost, damping = float(np.sum(v**2)), 1e-3
    nothing = 1e-26 * float(np.nansum(ranges**2))
    for _ in range(200):
        _, step_s, step_t = _reduced(v, unit, damping)
        trial_v, trial_unit = _linear(stations + step_s, targets + step_t, ranges)
        trial = float(np.sum(trial_v**2))
        if trial < cost:
            done = cost - trial <= 1e-8 * cost and damping <= 1e-9
            stations, targets, v, unit, cost = stations + step_s, targets + step_t, trial_v, trial_unit, trial
            damping = max(damping * 0.1, 1e-12)
        else:
            done, damping = cost < nothing or damping > 1e6, damping * 10.0
        if done:
            break
    return _Fit(stations, targets, (cost / spare) ** 0.5)


def _undecided(places: np.ndarray, rms: np.ndarray, number: np.ndarray, sigma: float) -> np.ndarray:
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


def _extend(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray, sigma: float) -> None:
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
            undecided = _undecided(places, rms, number, sigma)
            extent = np.linalg.svd(known[at] - known[at].mean(axis=0), compute_uv=False)
            if extent[2] < 0.02 * extent[1]:
                good = number >= 3
                places[:, 0] = np.where(undecided[:, None], _one_side(known[at], places, wanted), places[:, 0])
            else:
                good = (number >= 4) & ~undecided
            good &= np.isfinite(places[:, 0, 0])
            wanted[to[good]] = places[good, 0]
            changed |= bool(good.any())
        if not changed:
            break


def _settle_sides(
    known: np.ndarray, wanted: np.ndarray, to: np.ndarray, table: np.ndarray, *, sigma: float
) -> np.ndarray:
    """Puts each point, in place, on the side that fits clearly better, and those that fit both on that of the others.

    Returns (len(to),) bool: which fit both. Known points that may lie in one plane decide nothing: they were fitted
    with the others on the sides where they are.
    """
    flat = _flattened(known, table, sigma)
    known = known if flat is None else flat
    places, rms = locate(known, table)
    undecided = _undecided(places, rms, np.isfinite(table).sum(axis=1), sigma)
    found = np.isfinite(places[:, 0, 0])
    better = np.where(undecided[:, None], _one_side(known, places, wanted[to]), places[:, 0])
    wanted[to[found]] = better[found]
    return undecided


def _oriented(stations: np.ndarray, targets: np.ndarray) -> Figure:
    """The figure in its own axes, as `Unfolding` states them."""
    found = stations[np.isfinite(stations[:, 0])]
    mean = found.mean(axis=0)
    axes = np.linalg.svd(found - mean)[2]
    axes[2] *= np.sign((np.nanmean(targets, axis=0) - mean) @ axes[2]) or 1.0
    stations, targets = (stations - mean) @ axes.T, (targets - mean) @ axes.T
    if stations[np.isfinite(stations[:, 0])][0, 0] < 0.0:
        stations, targets = stations * (-1.0, -1.0, 1.0), targets * (-1.0, -1.0, 1.0)
    a, b, c = stations[np.isfinite(stations[:, 0])][:3, :2]
    if (b - a)[0] * (c - a)[1] < (b - a)[1] * (c - a)[0]:
        stations[:, 1] *= -1.0
        targets[:, 1] *= -1.0
    return stations, targets
