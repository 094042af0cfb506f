"""Recipe for positions: many targets, each from its own ranges to known stations."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special

from catseye.errors import InputError
from catseye.estimation.network.positions.dispatch import Positions, positions
from catseye.estimation.network.positions.start import patterns_of, planes_of
from catseye.estimation.network.positions.status import PositionStatus
from catseye.estimation.network.positions.trilateration import (
    AveragedIteration,
    trilaterate,
    trilaterate_by_averaging,
    trilateration_covariance,
)
from catseye.names import counted
from catseye.verdict import Verdict

METHODS = ("least_squares", "averaging")  # the second is the iteration of the notes
SAME = 1e-9  # of the distance between two solutions over the stations' extent: below it they are one


@dataclass(frozen=True, eq=False)
class LocatedTargets:
    """Positions of m targets from n stations.

    positions   coordinates, covariances and statuses; nan where there is none
    stations    (n, 3) m
    ranges      (m, n) m, nan where missing
    sigma       (m, n) m, standard uncertainties of the ranges, those of the stations along them included
    other       second solutions, mirror images of the first; nan where the ranges exclude one; None: not asked for
    iteration   steps of the notes' iteration, for all targets; None: least squares
    names       of the stations and of the targets; None: their numbers
    level       significance level of the tests of all targets together
    """

    positions: Positions
    stations: np.ndarray
    ranges: np.ndarray
    sigma: np.ndarray
    other: Positions | None = None
    iteration: AveragedIteration | None = None
    names: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    level: float = 0.05

    @cached_property
    def found(self) -> np.ndarray:
        """Mask (m,) of targets with a position that its ranges confirm."""
        return np.asarray(self.positions.status == PositionStatus.FOUND)

    @cached_property
    def words(self) -> np.ndarray:
        """Status (m,) of each target: "found", or the problem and its remedy."""
        return np.array([self._word(k) if not good else "found" for k, good in enumerate(self.found)])

    def _word(self, k: int) -> str:
        """Problem of a target, and by how much three ranges miss each other."""
        short = np.flatnonzero(np.isfinite(self.too_short[k]))
        if not len(short):
            return self.positions.text(k)
        lengths = ", ".join(f"{self.station_names[i]} {1e3 * self.too_short[k, i]:.3f}" for i in short)
        return f"{self.positions.text(k)}; to meet, its ranges are too short by, mm: {lengths}"

    @cached_property
    def too_short(self) -> np.ndarray:
        """Lengths (m, n) m by which three ranges are too short to meet where they come nearest to it; else nan."""
        lengths = np.full(self.ranges.shape, np.nan)
        rows = np.flatnonzero(~self.found & (self.positions.ranges == 3))
        if len(rows):
            three = np.argsort(np.isnan(self.ranges[rows]), axis=1, kind="stable")[:, :3]
            closed = trilaterate(self.stations[three], np.take_along_axis(self.ranges[rows], three, axis=1))
            short = np.where((closed.status == PositionStatus.DISJOINT)[:, None], closed.misclosure, np.nan)
            lengths[rows[:, None], three] = short
        return lengths

    @cached_property
    def station_names(self) -> tuple[str, ...]:
        return tuple(map(str, range(len(self.stations)))) if self.names is None else self.names[0]

    @cached_property
    def target_names(self) -> tuple[str, ...]:
        return tuple(map(str, range(len(self.ranges)))) if self.names is None else self.names[1]

    @cached_property
    def p(self) -> np.ndarray:
        """Probability (m,) of residuals as large by chance, chi-square; nan where nothing is redundant."""
        freedom = self.positions.degrees_of_freedom
        checked = self.found & (freedom > 0)
        chance = special.chdtrc(np.maximum(freedom, 1), np.where(checked, self.positions.pvv, 0.0))
        return np.where(checked, chance, np.nan)

    @cached_property
    def contradicting(self) -> np.ndarray:
        """Mask (m,) of targets whose ranges do not agree within their claims, at the level of all tests together."""
        tests = max(int(np.isfinite(self.p).sum()), 1)
        return np.asarray(np.nan_to_num(self.p, nan=1.0) * tests < self.level)

    @cached_property
    def residual(self) -> np.ndarray:
        """Residuals (m, n) m, measured less computed; nan without range or position."""
        return np.asarray(self.ranges - np.linalg.norm(self.positions.x[:, None] - self.stations, axis=2))

    @cached_property
    def redundancy(self) -> np.ndarray:
        """Share (m, n) of an error of each range that shows in its residual: 1 - e'Qe / sigma^2."""
        arm = self.positions.x[:, None] - self.stations
        e = arm / np.linalg.norm(arm, axis=2, keepdims=True)
        share = np.einsum("msi,mij,msj->ms", e, self.positions.covariance, e) / self.sigma**2
        return np.where(np.isfinite(self.ranges), np.clip(1.0 - share, 0.0, 1.0), np.nan)

    @cached_property
    def closure(self) -> tuple[np.ndarray, np.ndarray]:
        """Each range less its prediction from the others' point, and its standard uncertainty, (m, n) m.

        To first order residual / redundancy and sigma / sqrt(redundancy); nan where the others determine no point.
        Source: [FOERSTNER16] chapter 4 (residual and redundancy number of one observation).
        """
        share = np.where(self.redundancy > 1e-6, self.redundancy, np.nan)
        return self.residual / share, self.sigma / np.sqrt(share)

    @cached_property
    def variance_factor(self) -> float:
        """Sum of squared residuals in sigmas over all degrees of freedom; nan without any."""
        freedom = np.maximum(self.positions.degrees_of_freedom, 0)
        total = int(freedom[self.found].sum())
        return float(self.positions.pvv[self.found].sum() / total) if total else float("nan")

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the positions: good where all were found and checked."""
        found, words = self.found, self.words
        rows = np.flatnonzero(~found)
        if not found.any():
            return Verdict(
                "failed",
                f"no target was found; target {self.target_names[0]}: {words[0]}"
                if len(words)
                else "there is no target",
            )
        if len(rows):
            name = self.target_names[rows[0]]
            return Verdict(
                "doubtful", f"{len(rows)} of {len(found)} targets were not found; target {name}: {words[rows[0]]}"
            )
        if self.contradicting.any():
            return Verdict("doubtful", self._contradiction)
        if not (self.positions.degrees_of_freedom > 0).all():
            return Verdict("doubtful", "some targets have three ranges only, which nothing checks")
        return Verdict("good", "every target was found, and its ranges agree with each other")

    @property
    def _contradiction(self) -> str:
        k = int(np.nanargmin(self.p))
        closure, u = (row[k] for row in self.closure)
        closure_mm = 1e3 * closure
        ratio = np.nan_to_num(np.abs(closure / u))
        worst = int(np.argmax(ratio))
        count = int(self.contradicting.sum())
        return (
            f"the ranges of {counted(count, 'target')} do not agree within their claims; {self.target_names[k]}: "
            f"p = {self.p[k]:.2g}, and {self.station_names[worst]}'s range is {closure_mm[worst]:+.3f} mm from where "
            f"the others put it ({ratio[worst]:.1f} times its u)"
        )


def located(
    stations: np.ndarray,
    ranges: np.ndarray,
    sigma: np.ndarray,
    *,
    near: np.ndarray | None = None,
    both: bool = False,
    averaging: bool = False,
    u_stations: np.ndarray | None = None,
    names: tuple[tuple[str, ...], tuple[str, ...]] | None = None,
) -> LocatedTargets:
    """Targets located by least squares, or by the notes' iteration.

    stations     (n, 3) m
    ranges       (m, n) m, nan where missing
    sigma        m, standard uncertainties: a number, (n,) or (m, n)
    near         (3,) or (m, 3) m, on the target's side of the stations' plane; where the iteration begins
    both         True: the mirror image in the plane of its stations, too, where the ranges do not exclude it
    averaging    True: the notes' iteration, for targets of three ranges; it begins at `near`
    u_stations   m, standard uncertainties of the stations' coordinates: a number, (n,) or (n, 3)
    names        of the stations and of the targets; None: their numbers

    A station's error moves each of its ranges by e.ds: for one target the same as errors of the ranges, u^2 = sigma^2
    + e'Ue, which weights, covariance and test then hold. Between targets it is common, which is not told here.

    Raises InputError for shapes that do not join and for stations that are not finite.
    """
    each = np.full(ranges.shape[1], float(sigma)) if sigma.ndim == 0 else sigma
    if u_stations is not None:
        first = positions(stations, ranges, each, near=near)
        each = _with_stations(stations, first.x, np.broadcast_to(each, ranges.shape), u_stations)
    sides = None if near is None else np.asarray(near, dtype=float)
    if averaging:
        assert sides is not None
        return _averaged(stations, ranges, np.broadcast_to(each, ranges.shape), near=sides, both=both, names=names)
    if not both:
        answer = positions(stations, ranges, each, near=sides)
        return LocatedTargets(answer, stations, ranges, np.broadcast_to(each, ranges.shape), names=names)
    centre, normal = _planes(stations, ranges)
    above = centre + _sign(normal, None if sides is None else sides - centre)[:, None] * normal
    answer, other = (positions(stations, ranges, each, near=side) for side in (above, 2.0 * centre - above))
    apart = np.linalg.norm(answer.x - other.x, axis=1)
    size = np.ptp(stations, axis=0).max()
    second = replace(other, x=np.where((apart > SAME * size)[:, None], other.x, np.nan))
    second = replace(second, covariance=np.where(np.isfinite(second.x)[:, :, None], other.covariance, np.nan))
    return LocatedTargets(answer, stations, ranges, np.broadcast_to(each, ranges.shape), other=second, names=names)


def _with_stations(stations: np.ndarray, x: np.ndarray, sigma: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Standard uncertainties (m, n) m of ranges with those of the stations along them."""
    u = np.asarray(u, dtype=float)
    n = len(stations)
    if u.shape not in ((), (n,), (n, 3)) or not (np.isfinite(u).all() and (u >= 0.0).all()):
        raise InputError(f"u_stations has the shape {u.shape} (expected a number, ({n},) or ({n}, 3), 0 or above)")
    square = np.broadcast_to(u[:, None] if u.ndim == 1 else u, (n, 3)) ** 2
    arm = x[:, None] - stations
    with np.errstate(invalid="ignore"):
        e = arm / np.linalg.norm(arm, axis=2, keepdims=True)
    along = np.where(np.isfinite(e).all(axis=2), np.sum(e**2 * square, axis=2), square.max(axis=1))
    return np.asarray(np.sqrt(sigma**2 + along))


def _planes(stations: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (m, 3) and upward normal (m, 3) of the stations' plane of each target."""
    origin = stations.mean(axis=0)
    patterns, which = patterns_of(np.isfinite(ranges))
    planes = planes_of(stations - origin, patterns)
    normal = planes.axes[which, 2]
    first = np.take_along_axis(normal, np.argmax(np.abs(normal) > 1e-6, axis=1)[:, None], axis=1)[:, 0]
    upward = np.where(np.abs(normal[:, 2]) > 1e-6, normal[:, 2], first)
    return planes.centre[which] + origin, normal * np.where(upward < 0.0, -1.0, 1.0)[:, None]


def _sign(normal: np.ndarray, arm: np.ndarray | None) -> np.ndarray:
    """Side (m,) of the first solution: that of a point near it, else above."""
    if arm is None:
        return np.ones(len(normal))
    return np.where(np.sum(normal * arm, axis=1) < 0.0, -1.0, 1.0)


def _averaged(
    stations: np.ndarray,
    ranges: np.ndarray,
    sigma: np.ndarray,
    *,
    near: np.ndarray,
    both: bool,
    names: tuple[tuple[str, ...], tuple[str, ...]] | None,
) -> LocatedTargets:
    """Targets of three ranges, by the notes' iteration from a point near each."""
    measured = np.isfinite(ranges)
    many = np.flatnonzero(measured.sum(axis=1) > 3)
    if len(many):
        count, target = int(measured[many[0]].sum()), str(many[0]) if names is None else names[1][many[0]]
        raise InputError(
            f"method averaging: target {target} has {count} ranges (expected 3: eq. 3.7 takes no more; "
            "least_squares takes all)"
        )
    near = np.broadcast_to(near, (len(ranges), 3))
    answer, iteration = _averaged_side(stations, ranges, sigma, near)
    other = None
    if both:
        centre, normal = _planes(stations, ranges)
        mirrored = near - 2.0 * np.sum((near - centre) * normal, axis=1)[:, None] * normal
        other, _ = _averaged_side(stations, ranges, sigma, mirrored)
    return LocatedTargets(answer, stations, ranges, sigma, other=other, iteration=iteration, names=names)


def _averaged_side(
    stations: np.ndarray, ranges: np.ndarray, sigma: np.ndarray, start: np.ndarray
) -> tuple[Positions, AveragedIteration]:
    measured = np.isfinite(ranges)
    complete = measured.sum(axis=1) == 3
    of = (
        np.argsort(~measured, axis=1, kind="stable")[:, :3] if ranges.shape[1] >= 3 else np.zeros((len(ranges), 3), int)
    )
    d, u = (np.take_along_axis(array, of, axis=1) for array in (ranges, sigma))
    d = np.where(complete[:, None], d, np.nan)
    iteration = trilaterate_by_averaging(stations[of], d, start)
    status = np.where(complete, iteration.status, PositionStatus.TOO_FEW).astype(np.int8)
    good = status == PositionStatus.FOUND
    x = np.where(good[:, None], iteration.x, np.nan)
    residual = (d - np.linalg.norm(iteration.x[:, None] - stations[of], axis=2)) / u
    answer = Positions(
        x=x,
        covariance=trilateration_covariance(stations[of], x, u_distances=u),
        status=status,
        ranges=measured.sum(axis=1),
        iterations=np.asarray(iteration.iterations),
        pvv=np.sum(residual**2, axis=1),
    )
    return answer, iteration
