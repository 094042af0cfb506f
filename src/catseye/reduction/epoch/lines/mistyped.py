"""Points typed wrong by more than they claim, so that their shots got the whole cycles of another place.

Such a point comes out as wrong as it was typed, with some of its lines rejected as stray reflections. Two explanations
are compared: its typed position is as good as claimed and these lines are wrong; or the position is wrong and the lines
are right. Each wrong line and each wrong position has its price, twice the logarithm of the odds against it.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT
from catseye.estimation.ambiguity.search import SURE_OF_ALL, AmbiguityStatus, Located
from catseye.estimation.least_squares.adjustment import GroupFit, SolverSettings, adjust
from catseye.estimation.least_squares.robust import DECISIVE
from catseye.estimation.least_squares.status import CONVERGED
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.lines.cycle_search import WRONG, CycleScene, search
from catseye.reduction.epoch.lines.cycles import Resolved, next_candidate
from catseye.reduction.epoch.prior_names import APPROXIMATE
from catseye.reduction.epoch.settling import SettledNetwork, first_adjustment
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import CampaignNetwork, rebuilt

FARTHER = 0.04  # m, standard uncertainty of each coordinate of a typed position that is wrong: found up to 0.2 m away
MISTYPED = 0.01  # share of typed positions that are wrong
FEWEST_LINES = 5  # that can tell a wrong position from a wrong line: three place a point, one checks, one may be wrong
PLACE = 3  # lines that place a point
SAFE_LINES = 6  # used lines that agree by chance on a wrong place less than once in a thousand times
DEPARTED = 16.3  # squared departure from the typed position, in its u: one in a thousand, three coordinates
CYCLES = 0.005  # m, residual of a line that has the cycles of another place, whatever claim a sway has widened
SAME_PLACE = 0.01  # m; another set of whole cycles puts a point farther away
ROUNDS = 3  # of searches: wrong rangers first, then the targets that they misplaced


@dataclass(frozen=True, eq=False)
class _Suspect:
    """Typed point whose lines contradict each other, or its position.

    lost       lines without a used shot that fits; at most all but three, which place a point anywhere: of lines that
               contradict each other more may be left out than are wrong
    departed   squared departure from the typed position, in its claimed u
    """

    name: str
    lost: int
    departed: float


def with_mistyped_found(
    settled: SettledNetwork, resolved: Resolved, progress: Progress | None = None
) -> tuple[SettledNetwork, Resolved]:
    """Adjustment with mistyped points where their lines put them, and the cycles resolved with these.

    Unchanged where no typed position is suspect, or each is likelier than the errors of lines that it implies.
    """
    moved: dict[str, Located] = {}
    doubtful: set[str] = set()
    for _ in range(ROUNDS):
        network, doubtful = settled.network, set()
        suspects = _suspects(settled, exclude=moved)
        if not suspects:
            break
        scene, waiting = _scene_without(settled, [s.name for s in suspects])
        if scene.solution.status != CONVERGED:
            break
        relocated, doubtful = _judged(settled, scene, suspects, waiting)
        if not relocated:
            break
        starts = {name: settled.solution.x[network.layout.columns(name)] for name in network.places}
        starts |= _starts(network, relocated)
        wide = rebuilt(replace(network, campaign=with_uncertain_positions(network.campaign, set(relocated))))
        renewed = first_adjustment(wide, starts, progress)
        if _count_fitting(renewed) <= _count_fitting(settled):  # it explains no shot more
            doubtful |= relocated.keys()
            break
        settled, moved = renewed, moved | relocated
    units = [t.targets for t in settled.network.campaign.triplets.values()]
    notes = [*resolved.notes, *(_note(settled.network, name, one) for name, one in sorted(moved.items()))]
    notes += [
        f"{name}: its typed position may be wrong by whole half wavelengths, and its lines do not decide: it is "
        "unchecked; range it from more stations, or survey it better"
        for name in sorted(doubtful)
    ]
    listed = doubtful.union(*(unit for unit in units if doubtful.intersection(unit)))
    return settled, replace(resolved, notes=tuple(notes), doubtful=frozenset(listed))


def with_uncertain_positions(campaign: ObservedSite, names: Collection[str]) -> ObservedSite:
    """Campaign whose typed positions of some points are uncertain by FARTHER; triplets as wholes."""
    wide = {"u_position_mm": FARTHER / MILLIMETRE}
    targets = {n: t.model_copy(update=wide) if n in names else t for n, t in campaign.targets.items()}
    triplets = {
        n: t.model_copy(update=wide) if set(t.targets) & set(names) else t for n, t in campaign.triplets.items()
    }
    rangers = tuple(r.model_copy(update=wide) if r.name in names else r for r in campaign.feedarm.ranger)
    feedarm = campaign.feedarm.model_copy(update={"ranger": rangers})
    return replace(campaign, targets=targets, triplets=triplets, feedarm=feedarm)


def _suspects(settled: SettledNetwork, *, exclude: Collection[str]) -> list[_Suspect]:
    """Points with some lines that do not fit, or far from their typed position, and too few lines that agree.

    A ranger that loses most of its lines is first alone: its targets lose lines by its fault.
    """
    network, solution, shots = settled
    used: Counter[str] = Counter()
    lines: Counter[str] = Counter()
    for (_, part), fit in zip(shots, solution.fits, strict=False):
        right = {t for t, on in zip(part.target, _fitting(network, fit), strict=True) if on}
        for target in set(part.target):
            lines.update((part.name, target))
            used.update((part.name, target) if target in right else ())
    departed = _departures(settled)
    possible = [
        _Suspect(name, min(lines[name] - used[name], lines[name] - PLACE), departed[name])
        for name in sorted(departed)
        if lines[name] >= FEWEST_LINES and name not in exclude
    ]
    rangers = [s for s in possible if s.name in network.rangers and s.lost > used[s.name]]
    targets = [
        s
        for s in possible
        if s.name not in network.rangers and ((s.lost and used[s.name] < SAFE_LINES) or s.departed > DEPARTED)
    ]
    return rangers or targets


def _fitting(network: CampaignNetwork, fit: GroupFit) -> np.ndarray:
    """Used shots (m,) bool that fit the adjusted points."""
    within = np.abs(fit.standardised) <= network.settings.critical
    return np.asarray(fit.active & within & (np.abs(fit.residual) < CYCLES))


def _count_fitting(settled: SettledNetwork) -> int:
    fits = settled.solution.fits[: len(settled.shots)]
    return sum(int(np.count_nonzero(_fitting(settled.network, fit))) for fit in fits)


def _departures(settled: SettledNetwork) -> dict[str, float]:
    """Squared departure of each typed point from its position, in the u that this claims; those that claim less."""
    network, solution, _ = settled
    at = {network.layout.points[name]: name for name in network.places}
    relocated: dict[str, float] = {}
    for prior, fit in zip(network.priors, solution.fits[-len(network.priors) :], strict=True):
        if fit.name == APPROXIMATE:
            columns = prior.columns if prior.columns.ndim == 1 else prior.columns[:, 0]
            square = np.sum((fit.residual / fit.sigma).reshape(-1, 3) ** 2, axis=1)
            rows = zip(columns[::3].tolist(), square.tolist(), fit.sigma[::3].tolist(), strict=True)
            relocated |= {at[column]: value for column, value, u in rows if column in at and u < FARTHER}
    return relocated


def _scene_without(settled: SettledNetwork, names: Collection[str]) -> tuple[CycleScene, set[int]]:
    """Network adjusted without the shots on some points, whose typed positions are uncertain; and these shots."""
    network = settled.network
    units = [set(t.targets) for t in network.campaign.triplets.values()]
    without = set(names).union(*(unit for unit in units if unit & set(names)))
    wide = rebuilt(replace(network, campaign=with_uncertain_positions(network.campaign, names)))
    ends = {int(k): {p.name, t} for _, p in settled.shots for k, t in zip(p.electronics.shots, p.target, strict=True)}
    waiting = {k for k, pair in ends.items() if pair & without}
    if network.allowance.sway:  # perhaps of the mistyped points alone; and it hides other wrong shots
        starts = {name: settled.solution.x[network.layout.columns(name)] for name in network.places}
        settled = first_adjustment(wide.of_shots(ends.keys() - waiting), starts)
        wide = replace(wide.with_strength(settled.network.strength), allowance=settled.network.allowance)
    fits = zip(settled.solution.fits, settled.shots, strict=False)
    used = {k for fit, (_, part) in fits for k in part.electronics.shots[fit.active].tolist()} - waiting
    x = settled.solution.x
    groups = [*(shot_group(wide, name, x)[0] for name in wide.rangers), *wide.priors]
    active = [np.isin(wide.electronics[name].shots, sorted(used)) for name in wide.rangers]
    active += [np.ones(len(prior.observed), dtype=bool) for prior in wide.priors]
    free, solver = np.array(wide.layout.free), SolverSettings(border=wide.border)
    solution = adjust(x, groups, free=free, active=active, names=wide.layout.names, solver=solver)
    return CycleScene(wide, [shot_group(wide, name, solution.x)[1] for name in wide.rangers], solution), waiting


def _judged(
    settled: SettledNetwork, scene: CycleScene, suspects: Collection[_Suspect], waiting: Collection[int]
) -> tuple[dict[str, Located], set[str]]:
    """Suspects that their lines put elsewhere, and those for which that is about as likely."""
    network, targets = scene.network, scene.network.campaign.shots.target
    names = {suspect.name for suspect in suspects}
    ends = {int(k): {p.name, targets[k]} for p in scene.parts for k in p.electronics.shots if int(k) in waiting}
    relocated: dict[str, Located] = {}
    doubtful = set()
    for suspect in suspects:
        mine = {k for k, pair in ends.items() if suspect.name in pair and not (pair - {suspect.name}) & names}
        if not mine:
            continue
        located = search(scene, suspect.name, mine)
        place = settled.solution.x[network.layout.columns(suspect.name)]
        line = _price_of_line(scene, mine)
        price_typed = suspect.departed + line * suspect.lost
        price_relocated = _rival(located, place, line) + _price_of_position(settled.network, suspect.name)
        fits = located.status in (AmbiguityStatus.FOUND, AmbiguityStatus.AMBIGUOUS)
        sure = fits and located.probability > 1.0 - SURE_OF_ALL
        if sure and price_relocated + DECISIVE < price_typed and np.linalg.norm(located.x - place) > SAME_PLACE:
            relocated[suspect.name] = located
        elif price_relocated < price_typed + DECISIVE or (suspect.departed > DEPARTED and not sure):
            doubtful.add(suspect.name)
    return relocated, doubtful


def _rival(located: Located, place: np.ndarray, line: float) -> float:
    """Cost of the best place that the search found elsewhere; infinite without one."""
    best = located.chi_square + line * (located.left_out >= 0)
    places = ((located.x, best), (located.next_x, best + located.discrimination))
    return min((cost for x, cost in places if np.linalg.norm(x - place) > SAME_PLACE), default=np.inf)


def _price_of_line(scene: CycleScene, shots: Collection[int]) -> float:
    """Price of a line that is wrong by any length of a half wavelength, as `estimation.ambiguity.search` has it."""
    half = 0.5 * SPEED_OF_LIGHT / scene.network.campaign.site.ranging.modulation_hz
    mine = [part.variance[np.isin(part.electronics.shots, sorted(shots))] for part in scene.parts]
    u = float(np.sqrt(np.concatenate(mine).mean()))
    return float(2.0 * np.log((1.0 - WRONG) / WRONG * half / (np.sqrt(2.0 * np.pi) * u)))


def _price_of_position(network: CampaignNetwork, name: str) -> float:
    """Price of a typed position that is wrong: the odds against it, and its wider density."""
    u = network.places[name].u_typed(network.settings.u_position)
    return float(2.0 * np.log((1.0 - MISTYPED) / MISTYPED) + 6.0 * np.log(FARTHER / u))


def _starts(network: CampaignNetwork, relocated: Mapping[str, Located]) -> dict[str, np.ndarray]:
    """Starts of points where they were found; the others of a triplet follow those of it."""
    starts = {name: located.x for name, located in relocated.items()}
    for triplet in network.campaign.triplets.values():
        shifts = [starts[n] - network.places[n].start for n in triplet.targets if n in relocated]
        if shifts:
            partners = [n for n in triplet.targets if n not in relocated and n in network.places]
            starts |= {n: network.places[n].start + np.mean(shifts, axis=0) for n in partners}
    return starts


def _note(network: CampaignNetwork, name: str, located: Located) -> str:
    off = float(np.linalg.norm(located.x - network.places[name].start))
    return (
        f"{name}: its typed position is {off / MILLIMETRE:.0f} mm off; whole cycles found jointly from "
        f"{len(located.cycles)} lines{', one of them left out' * (located.left_out >= 0)}, {next_candidate(located)}"
    )
