"""One point's shots as a search for its whole cycles, every other end being known."""

from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import SPEED_OF_LIGHT
from catseye.estimation.ambiguity.search import AmbiguityLimits, AmbiguityStatus, Located, locate
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.optics.retroreflector.prism import obliquity_slope
from catseye.reduction.epoch.shots import ShotGroup, ShotParts, other_ends, shot_group
from catseye.reduction.epoch.unknowns import CampaignNetwork

RANGES = 8  # shots a search takes part with at most: more say little new, and bring wrong ones
WRONG = 0.01  # share of shots with light from elsewhere in their return: in night-01 seven of seven hundred
TRIES = 3  # other shots a search may be repeated with
TURNS = 3  # searches until the point is found where dPc was taken
SETTLED = 1e-3  # m, by which it may be off: dPc changes by a thousandth of that at most


@dataclass(frozen=True, eq=False)
class CycleScene:
    """The whole network, its parameters and covariance from the safe shots, and every shot as a row.

    groups, parts   one of each ranger
    solution        of the safe shots and the records
    """

    network: CampaignNetwork
    groups: list[ShotGroup]
    parts: list[ShotParts]
    solution: LeastSquaresSolution


def search(scene: CycleScene, name: str, shots: set[int]) -> Located:
    """Where a point is by its shots, each other end being known; repeated with other shots if the first do not fit.

    scene   the network, adjusted without these shots
    name    of the point
    shots   indices into the campaign's shots
    """
    rows = [(i, r) for i, p in enumerate(scene.parts) for r, k in enumerate(p.electronics.shots) if int(k) in shots]
    problem = _problem(scene, name, rows)
    left = np.arange(len(rows))
    answers = []
    for _ in range(TRIES):
        chosen = _best_shots(problem, left)
        answers.append(_settled(scene, name, rows, chosen, problem.located(chosen, wider=True)))
        left = np.setdiff1d(left, chosen)
        if answers[-1].status is AmbiguityStatus.FOUND or len(left) < 5:
            break
    return next((a for a in answers if a.status is AmbiguityStatus.FOUND), answers[0])


def _settled(
    scene: CycleScene, name: str, rows: list[tuple[int, int]], chosen: np.ndarray, located: Located
) -> Located:
    """The search again with dPc, air and head as they are where the point was found, until it is found there."""
    for _ in range(TURNS):
        if not np.isfinite(located.x).all():
            return located
        x = scene.solution.x.copy()
        x[scene.network.layout.columns(name)] = located.x
        pairs = [shot_group(scene.network, n, x) for n in scene.network.rangers]
        there = replace(scene, groups=[g for g, _ in pairs], parts=[p for _, p in pairs])
        before, located = located, _problem(there, name, rows, x).located(chosen, wider=False)
        if np.linalg.norm(located.x - before.x) < SETTLED:
            return located
    return (
        located if located.status is not AmbiguityStatus.FOUND else replace(located, status=AmbiguityStatus.AMBIGUOUS)
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """The search for one point: where it may be, and its shots as lengths modulo a half wavelength.

    start, prior   (3,) m and (3, 3) m^2
    stations       (r, 3) m, the other ends
    lengths        (r,) m, distance as each shot gives it with one of the possible whole cycles
    periods        (r,) m, half wavelengths in air
    covariance     (r, r) m^2: the shots' noise and what is uncertain of everything but this point
    u_glass        (r,) m, by how much dPc may be that of another direction
    """

    start: np.ndarray
    prior: np.ndarray
    stations: np.ndarray
    lengths: np.ndarray
    periods: np.ndarray
    covariance: np.ndarray
    u_glass: np.ndarray

    def located(self, chosen: np.ndarray, *, wider: bool) -> Located:
        covariance = self.covariance + (np.diag(self.u_glass**2) if wider else 0.0)
        return locate(
            self.start,
            self.prior,
            self.stations[chosen],
            lengths=self.lengths[chosen],
            period=self.periods[chosen],
            covariance=covariance[np.ix_(chosen, chosen)],
            limits=AmbiguityLimits(wrong=0.0 if wider else WRONG),
        )


def _problem(scene: CycleScene, name: str, rows: list[tuple[int, int]], x: np.ndarray | None = None) -> _Problem:
    """The search for one point; x are the parameters at which dPc and air were taken, the solution's if None."""
    network, solution = scene.network, scene.solution
    own = network.layout.columns(name)
    x = solution.x if x is None else x
    groups = sorted({i for i, _ in rows})
    at = {i: np.array([r for j, r in rows if j == i]) for i in groups}
    order = [(i, int(r)) for i in groups for r in at[i]]
    n = np.concatenate([1.0 + scene.parts[i].refractivity[at[i]] for i in groups])
    slopes = np.concatenate([full_jacobian(scene.groups[i], x)[at[i]] for i in groups]) / n[:, None]
    slopes[:, own] = 0.0
    noise = np.zeros((len(order), len(order)))
    start = 0
    for i in groups:
        end = start + len(at[i])
        given = scene.groups[i].covariance
        noise[start:end, start:end] = given[np.ix_(at[i], at[i])] if given.ndim == 2 else np.diag(given[at[i]])
        start = end
    covariance = noise / np.outer(n, n) + slopes @ solution.q.solve(slopes.T)
    misses = np.concatenate([(scene.groups[i].observed - scene.groups[i].predict(x)[0])[at[i]] for i in groups]) / n
    stations = np.array([other_ends(scene.groups[i], r, int(own[0]), x=x) for i, r in order])
    distance = np.linalg.norm(stations - x[own], axis=1)
    prior = spread(scene, name)
    u_place = float(np.sqrt(np.linalg.eigvalsh(prior)[-1]))
    turn = np.array([_by_direction(scene, i, r) for i, r in order])
    half = 0.5 * SPEED_OF_LIGHT / network.campaign.site.ranging.modulation_hz
    return _Problem(
        solution.x[own], prior, stations, distance + misses, half / n, covariance, np.abs(turn) * u_place / distance
    )


def spread(scene: CycleScene, name: str) -> np.ndarray:
    """Covariance (3, 3) m^2 of a point before its waiting shots."""
    own = scene.network.layout.columns(name)
    covariance = scene.solution.q.within(own)
    in_unit = any(name in t.targets for t in scene.network.campaign.triplets.values())
    return 3.0 * covariance if in_unit else covariance  # one typed position stands for three points: no averaging


def _by_direction(scene: CycleScene, group: int, row: int) -> float:
    """Derivative of a shot's dPc by its angle of incidence, m/rad; 0 for what is no prism."""
    part = scene.parts[group]
    place = scene.network.places[part.target[row]]
    if place.normal is None:
        return 0.0
    ranging = scene.network.campaign.site.ranging
    ratio, bends = ranging.bk7_to_air_group_index_ratio, ranging.bk7_to_air_phase_index_ratio
    cosine = np.cos(min(float(part.incidence[row]), 0.5 * np.pi))
    return float(obliquity_slope(place.height, ratio, cosine, phase=bends))


def _best_shots(problem: _Problem, left: np.ndarray) -> np.ndarray:
    """Up to RANGES of the shots that are left, each the one that adds most to those before it."""
    towards = problem.stations - problem.start
    e = towards / np.linalg.norm(towards, axis=1)[:, None]
    noise = np.diag(problem.covariance)
    covariance = np.array(problem.prior)
    chosen: list[int] = []
    rest = [int(i) for i in left]
    while rest and len(chosen) < RANGES:
        gain = np.array([e[i] @ covariance @ e[i] / noise[i] for i in rest])
        best = rest.pop(int(np.argmax(gain)))
        reach = covariance @ e[best]
        covariance = covariance - np.outer(reach, reach) / (noise[best] + e[best] @ reach)
        chosen.append(best)
    return np.array(sorted(chosen))
