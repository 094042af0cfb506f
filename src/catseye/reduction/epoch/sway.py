"""Sway of a body of the telescope from shot to shot, as a variance of its shots.

A body that sways displaces each shot's ends anew: all shots between it and other bodies scatter by more than their
claim, and none stands out. Without that variance the tests would reject good shots. It is a variance component of the
shots, estimated beside air faster than the knots from the residuals of an adjustment and their covariance by the
claim. A body counts as swaying where the likelihood says so by a wide margin.

Source: restricted maximum likelihood ([PATTERSON71]; variance components in [FOERSTNER16] chapter 4). With P = C^-1 -
C^-1 A Q A' C^-1 and g = P v of an adjustment, variances D beyond C give P' = (I + P D)^-1 P and g' = (I + P D)^-1 g.
Twice the logarithm of the likelihood changes by g' D g - ln det(I + P D); its derivative by the size of a component H
of D is g' H g' - tr(H P') with the information tr(H P' H P').
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.reduction.epoch.motion.scatter import BODIES, SWAYING, ShotEnds, exposed, shot_ends
from catseye.reduction.epoch.shots import ShotGroup, ShotParts
from catseye.reduction.epoch.unknowns import CampaignNetwork

SUSPECTED = 3.0  # standard deviations of a score from which a sway is searched for,
MANY_REJECTED = 0.1  # or share of a body's shots that were rejected
DECISIVE = 16.0  # twice the logarithm of the likelihood's ratio, from which a body sways
LEAST_SWAY = 0.02 * MILLIMETRE  # below, no claim changes by more than a few per cent
LARGEST_SWAY = 3.0 * MILLIMETRE  # more is a telescope that moves, or wrong whole cycles; a strong wind makes one
FEWEST = 12  # shots that show a body's sway
MOST_SHOTS = 1500  # of a likelihood; every k-th of more
PILOT = 1.0 * MILLIMETRE  # sway of every body at first: no good shot of a smaller one is rejected
SAME = 0.1  # relative change of a sway that counts as none
ROUNDS = 8  # of the search for its size; usually three
STEPS, CONVERGED = 20, 0.02  # cap of scoring steps; relative change of a variance that ends them
UNIT_PPM, UNIT_SWAY = 0.1, 0.1 * MILLIMETRE  # of the components
MEDIAN_SQUARE = 0.4549  # of a standard normal
HEAVY = 0.4  # median square of the tests over that, below which a few wrong shots made the variance
MOST_PPM = 0.5  # of eddies in a likelihood: more is no air, but wrong shots or a sway


class FirstPass(Protocol):
    """Adjustment of a network: its groups, the rangers' first, its solution, and the shots."""

    @property
    def groups(self) -> list[ObservationGroup]: ...

    @property
    def solution(self) -> LeastSquaresSolution: ...

    @property
    def shots(self) -> list[tuple[ShotGroup, ShotParts]]: ...


PassT = TypeVar("PassT", bound=FirstPass)


def with_sway(
    network: CampaignNetwork, first: PassT, adjusted: Callable[[CampaignNetwork], PassT]
) -> tuple[CampaignNetwork, PassT]:
    """Network with the sway of bodies in its shots' claim, and its first pass; both unchanged where none sways.

    The search begins with the network's own sway or a large one, which rejects no good shot. It goes on with the sway
    that the shots show until that no longer changes.

    adjusted   first pass of a network
    """
    sway = network.allowance.sway
    if not sway:
        if not _scatter(network, first).suspected:
            return network, first
        sway = dict.fromkeys(BODIES, PILOT)
    still = replace(network, allowance=replace(network.allowance, sway={}))
    for _ in range(ROUNDS):
        before, swaying = sway, replace(network, allowance=replace(network.allowance, sway=sway))
        trial = first if sway is network.allowance.sway else adjusted(swaying)
        sway = _scatter(swaying, trial).sway()
        if not sway:
            return (still, adjusted(still)) if network.allowance.sway else (network, first)
        if sway.keys() == before.keys() and all(abs(s - before[n]) < SAME * s for n, s in sway.items()):
            break
    return swaying, trial


def _scatter(network: CampaignNetwork, adjusted: FirstPass) -> "ShotScatter":
    ends = shot_ends(network.places, [(p.name, p.target, p.distance) for _, p in adjusted.shots])
    eddies, sway = network.strength.eddies_ppm, network.allowance.sway
    return ShotScatter.of(adjusted.groups, adjusted.solution, ends, eddies_ppm=eddies, sway=sway)


@dataclass(frozen=True, eq=False)
class ShotScatter:
    """Scatter of n shots of an adjustment against their claim, by variance components beyond it.

    p            (n, n) P of the adjustment
    g            (n,) P v
    components   (n, 5) m^2, of a unit of eddies and of each of `SWAYING`
    least        (5,) smallest value of each: minus what the claim has of it
    rejected     (5,) shots of each that the adjustment left out
    """

    p: np.ndarray
    g: np.ndarray
    components: np.ndarray
    least: np.ndarray
    rejected: np.ndarray

    @staticmethod
    def of(
        groups: Sequence[ObservationGroup],
        solution: LeastSquaresSolution,
        ends: Sequence[ShotEnds],
        *,
        eddies_ppm: float,
        sway: Mapping[str, float],
    ) -> "ShotScatter":
        """Scatter of the shots of an adjustment.

        groups             as adjusted, the rangers' first
        ends               of each ranger's shots
        eddies_ppm, sway   in the claim
        """
        influence = Influence(groups, solution)
        by_ranger = [
            np.column_stack([(UNIT_PPM * PPM * e.distance) ** 2, UNIT_SWAY**2 * exposed(e.body, e.bodies)])
            for e in ends
        ]
        components = np.concatenate(by_ranger)
        on = influence.active[: len(components)]
        rows = np.flatnonzero(on)
        rows = rows[:: max(1, -(-len(rows) // MOST_SHOTS))]
        claimed = np.array([eddies_ppm / UNIT_PPM, *(sway.get(name, 0.0) / UNIT_SWAY for name in SWAYING)])
        return ShotScatter(
            p=influence.between(rows),
            g=influence.weighed[rows],
            components=components[rows],
            least=-(claimed**2),
            rejected=np.sum(components[~on] > 0.0, axis=0),
        )

    @cached_property
    def shots(self) -> np.ndarray:
        """Number (5,) of shots that each component reaches."""
        return np.sum(self.components > 0.0, axis=0)

    @property
    def suspected(self) -> bool:
        """True where shots of a body scatter more than eddies explain, or many were rejected."""
        current = self.point(np.zeros(len(self.least)))
        many = self.rejected > MANY_REJECTED * (self.shots + self.rejected)
        enough = self.shots + self.rejected >= FEWEST
        return bool(np.any((enough & (many | (current.tests > SUSPECTED)))[1:]))

    def sway(self) -> dict[str, float]:
        """Standard deviations, m, of the bodies that sway; none where no body does.

        The body that explains most first, then those that explain much beside it, without those that no longer do.
        """
        chosen: list[int] = []
        best = self._likeliest(chosen, np.zeros(len(self.least)))
        while True:
            tests = np.where(self.shots >= FEWEST, best.tests, -np.inf)
            tests[[0, *chosen]] = -np.inf
            following = int(np.argmax(tests))
            if tests[following] <= 0.0:
                break
            trial = self._likeliest([*chosen, following], best.values)
            if trial.gain - best.gain < DECISIVE:
                break
            chosen, best = [*chosen, following], trial
        for c in chosen[:-1]:
            remaining = [component for component in chosen if component != c]
            trial = self._likeliest(remaining, best.values)
            if best.gain - trial.gain < DECISIVE:
                chosen, best = remaining, trial
        variance = UNIT_SWAY**2 * np.maximum(best.values - self.least, 0.0) * self._without_wrong(best)
        sizes = np.sqrt(variance[1:])
        if sizes.max(initial=0.0) > LARGEST_SWAY:
            return {}
        return {name: float(s) for name, s in zip(SWAYING, sizes, strict=True) if s > LEAST_SWAY}

    def point(self, values: np.ndarray) -> "VariancePoint":
        """Likelihood of some values of the components."""
        d = self.components @ values
        p, g, gain = self.p, self.g, 0.0
        if np.any(d):
            factored = lu_factor(np.eye(len(d)) + p * d)
            solved = lu_solve(factored, np.column_stack([p, g]))
            gain = float((g * d) @ solved[:, -1] - np.sum(np.log(np.abs(np.diag(factored[0])))))
            p, g = solved[:, :-1], solved[:, -1]
        h = self.components
        return VariancePoint(
            values=values,
            gain=gain,
            p=p,
            g=g,
            score=0.5 * (h.T @ (g**2 - np.diag(p))),
            information=0.5 * h.T @ p**2 @ h,
        )

    def _without_wrong(self, best: "VariancePoint") -> np.ndarray:
        """Factors (5,) on the variances, below 1 where a few wrong shots made them."""
        squares = best.g**2 / np.diag(best.p) / MEDIAN_SQUARE
        median = np.array([np.median(squares[on]) if on.any() else np.inf for on in self.components.T > 0.0])
        return np.where(median < HEAVY, median, 1.0)

    def _likeliest(self, chosen: Sequence[int], start: np.ndarray) -> "VariancePoint":
        """Components where the likelihood is largest: eddies and the chosen ones, the others none."""
        among = np.isin(np.arange(len(start)), [0, *chosen])
        most = np.array([self.least[0] + (MOST_PPM / UNIT_PPM) ** 2, *(np.inf for _ in SWAYING)])
        current = self.point(np.where(among, np.clip(start, self.least, most), self.least))
        for _ in range(STEPS):
            low, high = (
                (current.values <= self.least) & (current.score <= 0.0),
                (current.values >= most) & (current.score >= 0.0),
            )
            bounded = ~among | low | high
            if bounded.all():
                break
            free = np.flatnonzero(~bounded)
            step = np.zeros(len(start))
            step[free] = np.linalg.solve(current.information[np.ix_(free, free)], current.score[free])
            candidate = self.point(np.clip(current.values + step, self.least, most))
            while candidate.gain < current.gain - 1e-6 and np.any(np.abs(step) > 1e-3 * CONVERGED):
                step = 0.5 * step
                candidate = self.point(np.clip(current.values + step, self.least, most))
            change = np.abs(candidate.values - current.values)
            current = candidate
            if np.all(change <= CONVERGED * (current.values - self.least) + 1e-4):
                break
        return current


@dataclass(frozen=True, eq=False)
class VariancePoint:
    """Likelihood of components at some values, with its derivatives.

    gain          twice the logarithm of the likelihood's ratio to that of the claim
    p, g          of an adjustment with these variances
    score         (5,) derivatives of the logarithm of the likelihood
    information   (5, 5) of it
    """

    values: np.ndarray
    gain: float
    p: np.ndarray
    g: np.ndarray
    score: np.ndarray
    information: np.ndarray

    @property
    def tests(self) -> np.ndarray:
        """Score (5,) of each component over its standard deviation, eddies as they are likeliest."""
        eddies = self.information[0, 0]
        share = self.information[:, 0] / max(eddies, 1e-300)
        spread = np.sqrt(np.maximum(np.diag(self.information) - share**2 * eddies, 1e-300))
        return np.asarray((self.score - share * self.score[0]) / spread)
