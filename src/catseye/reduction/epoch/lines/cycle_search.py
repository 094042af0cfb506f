"""Search for the whole cycles of one point's shots.

Every other end is taken as known.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array

from catseye.estimation.ambiguity.search import AmbiguityLimits, AmbiguityStatus, Located, locate
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.optics.retroreflector.prism import obliquity_slope
from catseye.reduction.epoch.shots import ShotParts, other_ends, shot_group
from catseye.reduction.epoch.unknowns import CampaignNetwork

RANGES = 8  # most shots in a search: more add little, and wrong ones
WRONG = 0.01  # share of shots with a stray reflection: in night-01 seven of seven hundred
TRIES = 3  # repetitions of a search with other shots
TURNS = 3  # searches until the result agrees with the place where dPc was taken
SETTLED = 1e-3  # m, by which it may be off: dPc changes by a thousandth of that at most


@dataclass(frozen=True, eq=False)
class CycleScene:
    """Network with parameters and covariance from the safe shots.

    parts      one of each ranger, every shot a row
    solution   of the safe shots and the records
    """

    network: CampaignNetwork
    parts: list[ShotParts]
    solution: LeastSquaresSolution


def search(scene: CycleScene, name: str, shots: set[int]) -> Located:
    """Position of a point by its shots, other ends known.

    Repeated with other shots if the first do not fit.

    scene   the network, adjusted without these shots
    name    of the point
    shots   indices into the campaign's shots
    """
    scene = replace(scene, network=scene.network.of_shots(shots))
    problem = _problem(scene, name, scene.solution.x)
    available = np.arange(len(problem.lengths))
    answers = []
    for _ in range(TRIES):
        chosen = _best_shots(problem, available)
        answers.append(_settled(scene, name, chosen, problem.located(chosen, wider=True)))
        available = np.setdiff1d(available, chosen)
        if answers[-1].status is AmbiguityStatus.FOUND or len(available) < 5:
            break
    return next((a for a in answers if a.status is AmbiguityStatus.FOUND), answers[0])


def _settled(scene: CycleScene, name: str, chosen: np.ndarray, located: Located) -> Located:
    """Search repeated until the place used for its corrections agrees.

    dPc, air and head are taken at the place that was found.
    """
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
    """Search for one point.

    Its prior place, and its shots as lengths modulo a half wavelength.

    start, prior   (3,) m and (3, 3) m^2
    stations       (r, 3) m, the other ends
    lengths        (r,) m, distance as each shot gives it with one of the possible whole cycles
    periods        (r,) m, half wavelengths in air
    covariance     (r, r) m^2: the shots' noise and the uncertainty of everything but this point
    u_glass        (r,) m, of dPc by the uncertain direction
    line           (r,) number of the line: repeats on one do not check each other
    """

    start: np.ndarray
    prior: np.ndarray
    stations: np.ndarray
    lengths: np.ndarray
    periods: np.ndarray
    covariance: np.ndarray
    u_glass: np.ndarray
    line: np.ndarray

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
    """Search for one point by the shots of the network.

    dPc, air and head are those at the parameters x.
    """
    network, solution = scene.network, scene.solution
    columns = network.layout.columns(name)
    pairs = [shot_group(network, ranger, x) for ranger in network.rangers]
    n = 1.0 + np.concatenate([part.refractivity for _, part in pairs])
    slopes = np.concatenate([full_jacobian(group, x) for group, _ in pairs]) / n[:, None]
    slopes[:, columns] = 0.0
    noise = block_diag(*(g.covariance if g.covariance.ndim == 2 else np.diag(g.covariance) for g, _ in pairs))
    covariance = noise / np.outer(n, n) + solution.q.carried(csr_array(slopes))
    misses = np.concatenate([group.observed - group.predict(x)[0] for group, _ in pairs]) / n
    stations = np.array([other_ends(g, r, int(columns[0]), x=x) for g, _ in pairs for r in range(len(g.observed))])
    distance = np.linalg.norm(stations - x[columns], axis=1)
    prior = spread(scene, name)
    u_place = float(np.sqrt(np.linalg.eigvalsh(prior)[-1]))
    turn = np.concatenate([_by_direction(network, part) for _, part in pairs])
    half = np.concatenate([network.campaign.half_wavelengths(part.electronics.shots) for _, part in pairs])
    lines = [f"{part.name} {target}" for _, part in pairs for target in part.target]
    return _Problem(
        start=solution.x[columns],
        prior=prior,
        stations=stations,
        lengths=distance + misses,
        periods=half / n,
        covariance=covariance,
        u_glass=np.abs(turn) * u_place / distance,
        line=np.unique(lines, return_inverse=True)[1],
    )


def spread(scene: CycleScene, name: str) -> np.ndarray:
    """Covariance (3, 3) m^2 of a point before its waiting shots."""
    columns = scene.network.layout.columns(name)
    covariance = scene.solution.q.within(columns)
    in_unit = any(name in t.targets for t in scene.network.campaign.triplets.values())
    return 3.0 * covariance if in_unit else covariance  # one typed position stands for three points: no averaging


def _by_direction(network: CampaignNetwork, part: ShotParts) -> np.ndarray:
    """Derivative (m,) of dPc by the incidence angle, m/rad.

    0 for other reflectors than prisms.
    """
    ranging = network.campaign.site.ranging
    ratio, bends = ranging.bk7_to_air_group_index_ratio, ranging.bk7_to_air_phase_index_ratio
    places = [network.places[target] for target in part.target]
    cosine = np.cos(np.minimum(part.incidence, 0.5 * np.pi))
    slope = obliquity_slope(np.array([p.height for p in places]), ratio, cosine, phase=bends)
    return np.where([p.normal is not None for p in places], slope, 0.0)


def _best_shots(problem: _Problem, available: np.ndarray) -> np.ndarray:
    """Up to RANGES of the available shots, one a line, greedily the most informative."""
    towards = problem.stations - problem.start
    e = towards / np.linalg.norm(towards, axis=1)[:, None]
    noise = np.diag(problem.covariance)
    covariance = np.array(problem.prior)
    chosen: list[int] = []
    candidates = [int(i) for i in available]
    while candidates and len(chosen) < RANGES:
        gain = np.array([e[i] @ covariance @ e[i] / noise[i] for i in candidates])
        best = candidates[int(np.argmax(gain))]
        reach = covariance @ e[best]
        covariance = covariance - np.outer(reach, reach) / (noise[best] + e[best] @ reach)
        chosen.append(best)
        candidates = [i for i in candidates if problem.line[i] != problem.line[best]]
    return np.array(sorted(chosen))
