"""Figures from ranges alone: stations and targets up to a rigid motion and a mirror image.

The figure follows from the factors of the squared ranges (`factors`). From a complete part it is extended to the other
points (`sides`), fitted to all ranges and checked (`fit`).

Least numbers: ranges S T >= 3 (S + T) - 6 with S, T >= 4 (4 x 6, 5 x 5), where several figures may fit and the status
says so; linear, thus without a search, from 10 stations or 10 targets on. Stations in one plane: at least 6, and no
range shows on which side a target lies; all in one plane: S T >= 2 (S + T) - 3. A constant zero of the rangers is not
estimated here: it must be known to a few standard uncertainties, or the ranges do not fit one figure.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from catseye.errors import ValidityError
from catseye.estimation.network.unfolding.factors import Figure, factors, in_plane, in_space, upgraded
from catseye.estimation.network.unfolding.fit import FIT, FigureFit, flattest, least_squares, loose
from catseye.estimation.network.unfolding.sides import extend, settle_sides


class FigureOutcome(Enum):
    """Outcome of an unfolding; the value is the text of its status."""

    UNFOLDED = "unfolded"
    TOO_FEW = (
        "not unfolded, too few ranges: {m} between {s} stations and {t} targets leave no complete part with 4 of each "
        "and as many ranges as unknowns; measure more pairs"
    )
    IN_LINE = (
        "not unfolded: the stations or the targets lie on one line, about which the others may turn; add some off it"
    )
    PLANE_TOO_FEW = (
        "not unfolded: {s} stations or {t} targets lie in one plane, where at least 6 are needed; add more, or some "
        "off it"
    )
    NO_FIT = (
        "not unfolded: the best figure leaves {rms:.2g} m where {sigma:.2g} m is expected: the ranges do not fit one "
        "figure"
    )
    LOOSE = (
        "not unfolded: the ranges between {s} stations and {t} targets let the figure bend by a thirtieth of its size; "
        "points in one plane may lie on one circle or other conic: add a station off it"
    )
    AMBIGUOUS = "not unfolded: different figures fit {s} stations and {t} targets equally well; measure more pairs"


NOISE = 3.0  # a singular value below this multiple of the noise's is zero
ENOUGH = 120  # stations or targets in the initial figure; the others follow


@dataclass(frozen=True, eq=False)
class Unfolding:
    """Figure from ranges, in its own axes.

    Origin at the stations' mean; x along their largest extent, positive towards the first station found; z along their
    least, positive towards the mean of the targets; of the two mirror images that in which the first three stations
    found, seen from the targets' side, are counter-clockwise.

    stations       (S, 3) m, nan if not found
    targets        (T, 3) m, nan if not found
    side_assumed   (S + T,) bool, stations first: points that fit as well on the other side of the plane of their
                   partners; they are put on the side of the others
    rms            m, of the residuals, over the degrees of freedom
    outcome        of the search
    status         its text: "unfolded", or one line with problem and remedy
    """

    stations: np.ndarray
    targets: np.ndarray
    side_assumed: np.ndarray
    rms: float
    outcome: FigureOutcome
    status: str


def unfold(ranges: np.ndarray, sigma: float, *, seed: int = 0) -> Unfolding:
    """Stations and targets from the ranges between them only.

    ranges   (S, T) m between station and target, nan if not measured
    sigma    m, standard uncertainty of a range
    seed     of the search that small networks need

    Source: [CROCCO12], the factors of the squared ranges and the small matrix that mixes them; [POLLEFEYS08], linear
    from ten of a kind on; [KUANG13], least numbers. The search and the least squares of all ranges are ours.

    >>> at = np.random.default_rng(1).uniform(-10, 10, (18, 3))
    >>> ranges = np.linalg.norm(at[:6, None] - at[6:], axis=2)
    >>> figure = unfold(ranges, 1e-3)
    >>> figure.status, bool(np.allclose(np.linalg.norm(figure.targets[3] - figure.targets[7]),
    ...                                np.linalg.norm(at[9] - at[13])))
    ('unfolded', True)
    """
    if not sigma > 0.0 or np.any(ranges <= 0.0):
        raise ValidityError(f"ranges from {np.nanmin(ranges):.6g} m on with sigma {sigma:g} m: both must be positive")
    (s, t), m = ranges.shape, int(np.isfinite(ranges).sum())
    rows, columns = _complete_part(np.isfinite(ranges))
    if not len(rows):
        return _failed(s, t, FigureOutcome.TOO_FEW, s=s, t=t, m=m)
    rows, columns = (k[np.linspace(0, len(k) - 1, min(len(k), ENOUGH)).astype(int)] for k in (rows, columns))
    part = ranges[np.ix_(rows, columns)]
    size = float(np.sqrt(np.mean(part**2)))
    figure, outcome = _part_figure(part / size, sigma / size, np.random.default_rng(seed))
    if figure is None:
        counted = (s, t) if outcome is FigureOutcome.TOO_FEW else (len(rows), len(columns))
        return _failed(s, t, outcome, s=counted[0], t=counted[1], m=m)
    stations, targets = np.full((s, 3), np.nan), np.full((t, 3), np.nan)
    stations[rows], targets[columns] = figure[0] * size, figure[1] * size
    extend(stations, targets, ranges, sigma=sigma)
    return _fitted(stations, targets, ranges, sigma=sigma)


def _fitted(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray, *, sigma: float) -> Unfolding:
    """Figure fitted to all ranges, sides settled, in its own axes.

    Returns the reason if it fails.
    """
    s, t = ranges.shape
    at, to = np.flatnonzero(np.isfinite(stations[:, 0])), np.flatnonzero(np.isfinite(targets[:, 0]))
    table, assumed = ranges[np.ix_(at, to)], np.zeros(s + t, dtype=bool)
    fit = flattest(stations[at], targets[to], table, sigma=sigma)
    if fit.stations.shape[1] == 3:
        stations[at], targets[to] = fit.stations, fit.targets
        assumed[s + to] = settle_sides(stations[at], targets, to, table=table.T, sigma=sigma)
        assumed[at] = settle_sides(targets[to], stations, at, table=table, sigma=sigma)
        fit = least_squares(stations[at], targets[to], table)
    if fit.rms > FIT * sigma:
        return _failed(s, t, FigureOutcome.NO_FIT, rms=fit.rms, sigma=sigma)
    if loose(fit, table, sigma):
        return _failed(s, t, FigureOutcome.LOOSE, s=len(at), t=len(to))
    stations[at], targets[to] = in_space(fit.stations), in_space(fit.targets)
    stations, targets = _oriented(stations, targets)
    return Unfolding(
        stations=stations,
        targets=targets,
        side_assumed=assumed,
        rms=fit.rms,
        outcome=FigureOutcome.UNFOLDED,
        status=FigureOutcome.UNFOLDED.value,
    )


def _failed(count: int, targets: int, outcome: FigureOutcome, **numbers: float) -> Unfolding:
    """Result without a figure of `count` stations and `targets`, with the numbers that its text names."""
    return Unfolding(
        stations=np.full((count, 3), np.nan),
        targets=np.full((targets, 3), np.nan),
        side_assumed=np.zeros(count + targets, dtype=bool),
        rms=float("nan"),
        outcome=outcome,
        status=outcome.value.format(**numbers),
    )


def _complete_part(measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of a complete part with the most redundant ranges.

    Drops stations one by one.
    """
    best: tuple[int, np.ndarray, np.ndarray] = (-1, np.zeros(0, int), np.zeros(0, int))
    for turned in (False, True):
        table = measured.T if turned else measured
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


def _part_figure(ranges: np.ndarray, sigma: float, rng: np.random.Generator) -> tuple[Figure | None, FigureOutcome]:
    """Figure of a complete part of size about 1, or None, and the outcome."""
    s, t = ranges.shape
    squares = ranges**2
    u, v, values = factors(squares)
    floor = NOISE * sigma * (np.sqrt(s) + np.sqrt(t)) + 1e-13 * values[0]
    rank = int(np.sum(values[:3] > floor))
    if rank < 2:
        return None, FigureOutcome.IN_LINE
    spare = s * t - 3 * (s + t) + 6
    dimensions = [3] * (rank == 3 and min(s, t) >= 4 and spare >= 0) + [2] * (rank == 2)
    fits: list[FigureFit] = []
    for search in (0, 60, 400):  # random starts only where the linear ones found nothing
        starts: list[Figure] = []
        for d in dimensions:
            starts += upgraded(squares, u[:, :d], v[:, :d], search=search, rng=rng)
        if not search and min(s, t) >= 4:
            starts += in_plane(squares) + [(b, a) for a, b in in_plane(squares.T)]
        fits = sorted([*fits, *(least_squares(at, to, ranges) for at, to in starts)], key=lambda fit: fit.rms)
        if fits and fits[0].rms <= FIT * sigma and (max(s, t) >= 10 or (search and spare > 2) or rank == 2):
            break
    if not fits or (min(s, t) < 4 and fits[0].rms > FIT * sigma):
        return None, FigureOutcome.TOO_FEW
    if rank == 2 and max(s, t) < 6 and fits[0].rms > FIT * sigma:
        return None, FigureOutcome.PLANE_TOO_FEW
    fitting = [fit for fit in fits if fit.rms <= FIT * sigma]
    if rank == 3 and any(_differ(fits[0], fit, sigma) for fit in fitting[1:]):
        return None, FigureOutcome.AMBIGUOUS
    return (in_space(fits[0].stations), in_space(fits[0].targets)), FigureOutcome.UNFOLDED


def _differ(a: FigureFit, b: FigureFit, sigma: float) -> bool:
    """True if two figures of size about 1 differ beyond noise."""
    return any(
        np.max(np.abs(np.linalg.norm(p[:, None] - p, axis=2) - np.linalg.norm(q[:, None] - q, axis=2)))
        > 0.02 + 100 * sigma
        for p, q in ((a.stations, b.stations), (a.targets, b.targets))
    )


def _oriented(stations: np.ndarray, targets: np.ndarray) -> Figure:
    """Figure in its own axes, as described in `Unfolding`."""
    placed = stations[np.isfinite(stations[:, 0])]
    mean = placed.mean(axis=0)
    axes = np.linalg.svd(placed - mean)[2]
    axes[2] *= np.sign((np.nanmean(targets, axis=0) - mean) @ axes[2]) or 1.0
    stations, targets = (stations - mean) @ axes.T, (targets - mean) @ axes.T
    if stations[np.isfinite(stations[:, 0])][0, 0] < 0.0:
        stations, targets = stations * (-1.0, -1.0, 1.0), targets * (-1.0, -1.0, 1.0)
    a, b, c = stations[np.isfinite(stations[:, 0])][:3, :2]
    if (b - a)[0] * (c - a)[1] < (b - a)[1] * (c - a)[0]:
        stations[:, 1] *= -1.0
        targets[:, 1] *= -1.0
    return stations, targets
