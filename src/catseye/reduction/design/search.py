"""Search for places and numbers: descent by the exact derivative, exchange among candidates, one added or left out."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.estimation.design.descent import descend
from catseye.reduction.design.aim import DesignAim
from catseye.reduction.design.candidates import with_ranger_at
from catseye.reduction.design.objective import DesignObjective
from catseye.reduction.design.regions import Constraints, MovingUnit, moving_units
from catseye.reduction.design.scene import GROUND, DesignPoint, DesignScene
from catseye.reduction.design.vary import Variation

STAGES = {"worst": (2, 3, 5)}  # squarings of the smooth worst axis, from round to sharp
PLACES = 24  # candidate places of a unit in an exchange
MOST_EXCHANGED = 40  # units of a round of exchange
ADDED_PLACES = 120  # candidate places of a new ranger
MOST_POOL = 200  # units to choose from, as each step tries all of them
WORTHWHILE = 1e-4  # of the criterion, relative: a smaller gain is no exchange

Tell = Callable[[str], None]


@dataclass(frozen=True)
class SearchSettings:
    """Extent of a search.

    steps       of each descent, at most
    exchanges   rounds of exchange among candidates, each followed by a descent, at most
    """

    steps: int = 60
    exchanges: int = 2


@dataclass
class SearchPath:
    """Progress of a search.

    values        root of the criterion, m, after every accepted step
    starts        index in it at which each stage began, and its name
    evaluations   of the criterion, with or without derivative
    """

    values: list[float] = field(default_factory=list)
    starts: list[tuple[int, str]] = field(default_factory=list)
    evaluations: int = 0

    def begin(self, stage: str) -> None:
        """Begin a stage of the search."""
        self.starts.append((len(self.values), stage))

    def add(self, variance: float) -> None:
        """Append the criterion of an accepted step, m^2."""
        self.values.append(float(np.sqrt(variance)))


def improved(
    scene: DesignScene,
    aim: DesignAim,
    varied: tuple[Variation, ...],
    constraints: Constraints,
    *,
    settings: SearchSettings,
    path: SearchPath,
    tell: Tell,
) -> DesignScene:
    """Scene with the best places found; the present one if none is better.

    varied    what may move
    path      is extended
    tell      called with what is being done
    """
    units = moving_units(scene, varied)
    if not units:
        return scene
    objective = DesignObjective(scene, aim, units, constraints)
    near = objective.too_near(objective.places)
    if len(near):
        raise InputError(
            f"{units[near[0]].name} stands within {constraints.apart:g} m of another ranger (expected less apart)"
        )
    blocked = objective.blocked(objective.places)
    if len(blocked):
        raise InputError(
            f"{units[blocked[0]].name} stands in an obstacle or within {constraints.clearance:g} m of one "
            "(expected less clearance, or another place to begin with)"
        )
    places, value = objective.places, objective.value(scene)
    reach = 0.25 * min(unit.reach for unit in units)
    for turn in range(settings.exchanges + 1):
        tried = places
        for squarings in STAGES.get(aim.name, (objective.squarings,)):
            tell("descent")
            objective.squarings = squarings
            path.begin("descent")
            descent = descend(
                objective,
                objective.restrict,
                tried,
                reach=reach,
                steps=settings.steps,
                accepted=lambda: path.add(objective.largest),
            )
            tried = descent.x
        reached = objective.value(objective.at(tried))
        if reached < value - WORTHWHILE:
            places, value = tried, reached
        if turn == settings.exchanges:
            break
        exchanged, reached = _exchanged(objective, places, value, tell)
        if reached >= value - WORTHWHILE:
            break
        places, value = exchanged, reached
        path.begin("exchange")
        objective.value(objective.at(places))
        path.add(objective.largest)
    path.evaluations += objective.evaluations
    return objective.at(places)


def _exchanged(objective: DesignObjective, places: Array, value: float, tell: Tell) -> tuple[Array, float]:
    """Places and value after units were tried all over their regions, those with the steepest criterion first."""
    slopes = np.linalg.norm(objective(places)[1], axis=1)
    for k in np.argsort(-slopes)[:MOST_EXCHANGED]:
        unit = objective.units[k]
        tell(f"exchange of {unit.name}")
        candidates = unit.candidates(PLACES)
        if unit.ranger and unit.level:
            candidates = _best_place(objective, places, int(k), candidates)
        for candidate in candidates:
            trial = places.copy()
            trial[k] = candidate
            reached = objective.value(objective.at(trial))
            if reached < value - WORTHWHILE:
                places, value = trial, reached
    return places, value


def _best_place(objective: DesignObjective, places: Array, k: int, candidates: Array) -> Array:
    """Best of a ground ranger's candidate places, by low-rank updates, as an array (1, 3) or (0, 3)."""
    tried = np.repeat(places[None], len(candidates), axis=0)
    tried[:, k] = candidates
    stands = objective.constraints.free_of_solids(objective.scene, candidates)
    stands &= np.array([k not in objective.too_near(each) for each in tried], dtype=bool)
    candidates = candidates[stands]
    if not len(candidates):
        return candidates
    scene = objective.at(places)
    point = scene.points[objective.units[k].rows[0]]
    if point.name in objective.aim.interest:
        return candidates
    u = with_ranger_at(scene.without([point.name]), objective.aim, point, candidates)
    return np.asarray(candidates[[int(np.argmin(u))]])


def with_one_more(
    scene: DesignScene, aim: DesignAim, variation: Variation, constraints: Constraints, number: int
) -> DesignScene:
    """Scene with a new ranger at the best of candidate places.

    number   of the new one, for its name
    """
    if variation.role != "ranger" or variation.between is None or variation.pattern:
        raise InputError(
            f"vary {variation.text!r}: more than there are (expected 'rangers from A to B between C and D m', which "
            "says where new ones may stand)"
        )
    template = new_ranger(scene, f"NEW{number:02d}")
    unit = MovingUnit(
        name=template.name,
        rows=np.zeros(1, dtype=int),
        home=np.array(template.place),
        level=True,
        within=None,
        between=variation.between,
        ranger=True,
    )
    places = unit.candidates(ADDED_PLACES)
    free = constraints.free_of_solids(scene, places)
    ground = scene.places[[i for i in scene.rangers if scene.points[i].frame == GROUND]]
    free &= np.linalg.norm(places[:, None] - ground, axis=2).min(axis=1) >= constraints.apart
    if not free.any():
        raise InputError(f"vary {variation.text!r}: no free place for one more (expected a larger region)")
    u = with_ranger_at(scene, aim, template, places[free])
    x, y, z = places[free][int(np.argmin(u))]
    return scene.with_point(replace(template, place=(float(x), float(y), float(z))))


def new_ranger(scene: DesignScene, name: str) -> DesignPoint:
    """Ranger like those on the ground: median height and priors of theirs."""
    ground = [scene.points[i] for i in scene.rangers if scene.points[i].frame == GROUND]
    if not ground:
        raise InputError(f"{scene.name} has no ranger on the ground (expected one, as a pattern for new ones)")
    x, y, z = np.median([p.place for p in ground], axis=0)
    u = np.median([p.u for p in ground], axis=0)
    return DesignPoint(
        name=name,
        role="ranger",
        place=(float(x), float(y), float(z)),
        frame=GROUND,
        kind=None,
        axis=None,
        u=(float(u[0]), float(u[1]), float(u[2])),
        u_zero=float(np.median([p.u_zero for p in ground])),
        body="",
        unit=name,
    )


def with_one_less(scene: DesignScene, aim: DesignAim, variation: Variation) -> tuple[DesignScene, str]:
    """Scene without the unit whose loss costs least, and its name."""
    pool = pool_of(scene, aim, variation)
    if len(pool) < 2:
        raise InputError(
            f"vary {variation.text!r}: no {variation.role} can be spared (expected points not of interest)"
        )
    best, spared = np.inf, ""
    for unit in pool:
        objective = DesignObjective(_less(scene, unit), aim, (), Constraints(0.0, 0.0, scene.solids))
        value = objective.value(objective.scene)
        if value < best:
            best, spared = value, unit
    return _less(scene, spared), spared


def pool_of(scene: DesignScene, aim: DesignAim, variation: Variation) -> list[str]:
    """Units that a variation's number counts and that may be left out: no point of interest is in one."""
    interest = set(aim.interest)
    units: dict[str, bool] = {}
    for point in scene.points:
        if variation.selects(point.name, point.role, not point.body):
            units[point.unit] = units.get(point.unit, True)
        if point.name in interest and point.unit in units:
            units[point.unit] = False
    if len(units) > MOST_POOL:
        raise InputError(f"vary {variation.text!r}: {len(units)} to choose from (expected at most {MOST_POOL})")
    return [unit for unit, free in units.items() if free]


def _less(scene: DesignScene, unit: str) -> DesignScene:
    return scene.without([point.name for point in scene.points if point.unit == unit])
