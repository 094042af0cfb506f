"""One point's shots as a search for its whole cycles, every other end being known."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array

from catseye.constants import SPEED_OF_LIGHT
from catseye.estimation.ambiguity.search import AmbiguityLimits, AmbiguityStatus, Located, locate
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.optics.retroreflector.prism import obliquity_slope
from catseye.reduction.epoch.shots import ShotParts, other_ends, shot_group
from catseye.reduction.epoch.unknowns import CampaignNetwork

RANGES = 8  # shots a search takes part with at most: more say little new, and bring wrong ones
WRONG = 0.01  # share of shots with light from elsewhere in their return: in night-01 seven of seven hundred
TRIES = 3  # other shots a search may be repeated with
TURNS = 3  # searches until the point is found where dPc was taken
SETTLED = 1e-3  # m, by which it may be off: dPc changes by a thousandth of that at most


@dataclass(frozen=True, eq=False)
class CycleScene:
    """The whole network, and its parameters and covariance from the safe shots.

    parts      one of each ranger, every shot a row
    solution   of the safe shots and the records
    """

    network: CampaignNetwork
    parts: list[ShotParts]
    solution: LeastSquaresSolution


def search(scene: CycleScene, name: str, shots: set[int]) -> Located:
    """Where a point is by its shots, each other end being known; repeated with other shots if the first do not fit.

    scene   the network, adjusted without these shots
    name    of the point
    shots   indices into the campaign's shots
    """
    scene = replace(scene, network=scene.network.of_shots(shots))
    problem = _problem(scene, name, scene.solution.x)
    left = np.arange(len(problem.lengths))
    answers = []
    for _ in range(TRIES):
        chosen = _best_shots(problem, left)
        answers.append(_settled(scene, name, chosen, problem.located(chosen, wider=True)))
        left = np.setdiff1d(left, chosen)
        if answers[-1].status is AmbiguityStatus.FOUND or len(left) < 5:
            break
    return next((a for a in answers if a.status is AmbiguityStatus.FOUND), answers[0])


def _settled(scene: CycleScene, name: str, chosen: np.ndarray, located: Located) -> Located:
    """The search again with dPc, air and head as they are where the point was found, until it is found there."""
    for _ in range(TURNS):
        if not np.isfinite(located.x).all():
            return located
        x = scene.solution.x.copy()
        x[scene.network.layout.columns(name)] = located.x
        before, located = located, _problem(scene, name, x).located(chosen, wider=False)
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


def _problem(scene: CycleScene, name: str, x: np.ndarray) -> _Problem:
    """The search for one point by the shots of the network, dPc, air and head being those at the parameters x."""
    network, solution = scene.network, scene.solution
    own = network.layout.columns(name)
    pairs = [shot_group(network, ranger, x) for ranger in network.rangers]
    n = 1.0 + np.concatenate([part.refractivity for _, part in pairs])
    slopes = np.concatenate([full_jacobian(group, x) for group, _ in pairs]) / n[:, None]
    slopes[:, own] = 0.0
    noise = block_diag(*(g.covariance if g.covariance.ndim == 2 else np.diag(g.covariance) for g, _ in pairs))
    covariance = noise / np.outer(n, n) + solution.q.carried(csr_array(slopes))
    misses = np.concatenate([group.observed - group.predict(x)[0] for group, _ in pairs]) / n
    stations = np.array([other_ends(g, r, int(own[0]), x=x) for g, _ in pairs for r in range(len(g.observed))])
    distance = np.linalg.norm(stations - x[own], axis=1)
    prior = spread(scene, name)
    u_place = float(np.sqrt(np.linalg.eigvalsh(prior)[-1]))
    turn = np.concatenate([_by_direction(network, part) for _, part in pairs])
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


def _by_direction(network: CampaignNetwork, part: ShotParts) -> np.ndarray:
    """(m,) derivative of each shot's dPc by its angle of incidence, m/rad; 0 for what is no prism."""
    ranging = network.campaign.site.ranging
    ratio, bends = ranging.bk7_to_air_group_index_ratio, ranging.bk7_to_air_phase_index_ratio
    places = [network.places[target] for target in part.target]
    cosine = np.cos(np.minimum(part.incidence, 0.5 * np.pi))
    slope = obliquity_slope(np.array([p.height for p in places]), ratio, cosine, phase=bends)
    return np.where([p.normal is not None for p in places], slope, 0.0)


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
