"""Recipe of a design study: numbers and places searched, maps, and scatter before and after."""

from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from catseye.aliases import Array, Progress
from catseye.errors import InputError
from catseye.estimation.design.criteria import BodyPose
from catseye.estimation.design.network import DesignPrediction, predict
from catseye.estimation.design.scatter import drawn_errors
from catseye.reduction.design.aim import DesignAim
from catseye.reduction.design.maps import DesignMap, maps_of
from catseye.reduction.design.regions import Constraints, MovingUnit, moving_units
from catseye.reduction.design.scene import DesignScene
from catseye.reduction.design.search import (
    SearchPath,
    SearchSettings,
    Tell,
    improved,
    pool_of,
    with_one_less,
    with_one_more,
)
from catseye.reduction.design.vary import Variation
from catseye.verdict import Verdict

LARGEST_DEPARTURE = 4.0  # of its own u: a mean square of the scatter farther from the prediction contradicts it
LEAST_GAIN = 0.01  # of the uncertainty: less is no improvement worth a pillar
MOST_NUMBERS = 40
SMALLEST_MOVE = 1e-3  # m
MANY_RANGERS = 60  # from which linear algebra may have several threads


@dataclass(frozen=True)
class StudySettings:
    """Extent of a study.

    search   of every number's search
    limit    m: the smallest number that reaches it is chosen; None: the largest
    map_side number of places along each side of a map; 0: no map
    runs     simulated measurements of the design before and after; 0: none
    seed     of their generator
    """

    search: SearchSettings = field(default_factory=SearchSettings)
    limit: float | None = None
    map_side: int = 15
    runs: int = 1000
    seed: int = 1


@dataclass(frozen=True, eq=False)
class DesignState:
    """Design before or after, with its prediction in every posture.

    scene         rangers and targets
    aim           criterion
    predictions   of the postures
    """

    scene: DesignScene
    aim: DesignAim
    predictions: tuple[DesignPrediction, ...]

    @classmethod
    def of(cls, scene: DesignScene, aim: DesignAim) -> "DesignState":
        """State of a scene, with its prediction."""
        return cls(scene, aim, tuple(predict(scene.network(k)) for k in range(len(scene.postures))))

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Criterion of every posture, m^2."""
        return tuple(
            self.aim.criterion(self.scene, k).true_value(prediction) for k, prediction in enumerate(self.predictions)
        )

    @property
    def posture(self) -> int:
        """Posture with the largest criterion."""
        return int(np.argmax(self.values))

    @property
    def u(self) -> float:
        """Standard uncertainty, root of the worst posture's criterion, m."""
        return float(np.sqrt(max(self.values)))

    @cached_property
    def covariances(self) -> Array:
        """Covariances (k, 3, 3) m^2 of the points of interest in the worst posture, ground frame."""
        rows = [self.scene.row[name] for name in self.aim.interest]
        return np.asarray(self.predictions[self.posture].covariance[rows])

    @cached_property
    def longest(self) -> tuple[Array, Array]:
        """Longest semi-axis of each point of interest, m (k,), and its direction (k, 3), upwards."""
        values, vectors = np.linalg.eigh(self.covariances)
        axis = vectors[:, :, -1]
        return np.sqrt(values[:, -1]), np.where(axis[:, 2:] < 0.0, -axis, axis)

    @property
    def worst(self) -> tuple[str, Array]:
        """Point of interest with the longest axis, and the axis (3,)."""
        sizes, axes = self.longest
        k = int(np.argmax(sizes))
        return self.aim.interest[k], axes[k]

    @property
    def loose(self) -> tuple[str, ...]:
        """Points of interest that the ranges hardly determine: an axis is half as long as its prior, or longer."""
        u = [max(self.scene.points[self.scene.row[name]].u) for name in self.aim.interest]
        return tuple(
            name for name, size, most in zip(self.aim.interest, self.longest[0], u, strict=True) if size > 0.5 * most
        )

    @cached_property
    def pose_u(self) -> Array | None:
        """Standard uncertainties (6,) of the pose, m and rad, of the points of interest; None for another criterion."""
        criterion = self.aim.criterion(self.scene, self.posture)
        if not isinstance(criterion, BodyPose):
            return None
        return np.sqrt(np.diagonal(criterion.pose_covariance(self.predictions[self.posture])))

    @property
    def ranges(self) -> int:
        """Number of ranges, in the worst posture."""
        return len(self.predictions[self.posture].network.pairs)

    @property
    def stands(self) -> tuple[Array, ...]:
        """Places (n, 3) m in the ground frame, one array a posture."""
        return tuple(self.scene.on_ground(k) for k in range(len(self.scene.postures)))


@dataclass(frozen=True)
class ScatterCheck:
    """Scatter of simulated measurements beside the prediction.

    predicted   m, root of the criterion; in the worst posture
    u           m, root of the mean square in the runs, and
    u_u         its own standard uncertainty, m
    normalised  mean of e' Q^-1 e over the points of interest, 3 expected, and
    u_normalised   its own standard uncertainty
    runs        number
    """

    predicted: float
    u: float
    u_u: float
    normalised: float
    u_normalised: float
    runs: int

    @property
    def departure(self) -> float:
        """Larger departure of both from the prediction, in units of its own u."""
        first = (self.u - self.predicted) / self.u_u
        second = (self.normalised - 3.0) / self.u_normalised
        return max(abs(first), abs(second))


@dataclass(frozen=True)
class DesignNumber:
    """Result for one number.

    number   of units, all together
    u        m, root of the criterion
    change   unit left out or added last; "" for none
    """

    number: int
    u: float
    change: str


@dataclass(frozen=True)
class PlaceMove:
    """Move of a unit: places before and after, m, in its frame; nan where there is none."""

    unit: str
    frame: str
    before: tuple[float, float, float]
    after: tuple[float, float, float]

    @property
    def distance(self) -> float:
        """Length of the move, m; nan for a new one and one left out."""
        return float(np.linalg.norm(np.subtract(self.after, self.before)))


@dataclass(frozen=True, eq=False)
class DesignStudy:
    """Answer of a design study.

    before, after   states
    varied          what was allowed
    constraints     of rangers
    moves           of the units, the farthest first; new ones and those left out after them
    numbers         results by number, rising; empty where the number does not vary
    path            of the search
    scatter         before and after; None without runs
    maps            uncertainty against place
    settings        of the study
    seconds         of the search, s, without maps and scatter
    """

    before: DesignState
    after: DesignState
    varied: tuple[Variation, ...]
    constraints: Constraints
    moves: tuple[PlaceMove, ...]
    numbers: tuple[DesignNumber, ...]
    path: SearchPath
    scatter: tuple[ScatterCheck, ScatterCheck] | None
    maps: tuple[DesignMap, ...]
    settings: StudySettings
    seconds: float

    @property
    def aim(self) -> DesignAim:
        """Criterion and points of interest."""
        return self.after.aim

    @property
    def gain(self) -> float:
        """Relative decrease of the uncertainty."""
        return 1.0 - self.after.u / self.before.u

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict: the uncertainty became smaller, and the scatter agrees with both predictions."""
        return _verdict(self)


def _verdict(study: DesignStudy) -> Verdict:
    limit, loose = study.settings.limit, study.after.loose
    if loose:
        named = f"{loose[0]} and {len(loose) - 1} more are" if len(loose) > 1 else f"{loose[0]} is"
        return Verdict("doubtful", f"{named} hardly determined by any range; see what is visible, or leave it out")
    if limit is not None and study.after.u > limit:
        return Verdict("doubtful", f"the limit of {limit * 1e3:.3g} mm is not reached: {study.after.u * 1e3:.3g} mm")
    if study.scatter is not None:
        worst = max(check.departure for check in study.scatter)
        if worst > LARGEST_DEPARTURE:
            return Verdict("doubtful", f"the scatter departs from the prediction by {worst:.1f} of its own u")
    if study.gain < LEAST_GAIN and not study.numbers:
        return Verdict("doubtful", f"no better places were found: the uncertainty falls by {100 * study.gain:.2g} %")
    if study.scatter is None:
        return Verdict("doubtful", "the prediction was not confirmed by scatter, as there were no runs")
    if study.numbers and study.gain < LEAST_GAIN:
        return Verdict("good", "the scatter of simulated measurements agrees with both predictions")
    return Verdict(
        "good", f"the uncertainty falls by {100 * study.gain:.1f} %, and the scatter agrees with both predictions"
    )


def design_study(
    scene: DesignScene,
    aim: DesignAim,
    varied: tuple[Variation, ...],
    constraints: Constraints,
    settings: StudySettings | None = None,
    *,
    progress: Progress | None = None,
) -> DesignStudy:
    """Design study: search, maps, and scatter.

    scene         before
    aim           criterion and points of interest
    varied        what may change
    constraints   of rangers
    progress      called with (what, done, of how many)

    Raises InputError for variations that do not fit the scene.
    """
    settings = settings or StudySettings()

    def tell(what: str) -> None:
        if progress is not None:
            progress(what, 0, 0)

    few = 1 if len(scene.rangers) < MANY_RANGERS else None
    with threadpool_limits(limits=few, user_api="blas"):  # spinning pools make small matrices many times slower
        before = DesignState.of(scene, aim)
        path, start = SearchPath(), perf_counter()
        designed, numbers = _numbered(scene, aim, varied, constraints, settings=settings, path=path, tell=tell)
        if not numbers:
            designed = improved(scene, aim, varied, constraints, settings=settings.search, path=path, tell=tell)
        seconds = perf_counter() - start
        after = DesignState.of(designed, aim)
        moves = _moves(scene, designed)
        shown = _shown(moving_units(scene, varied), moves, designed)
        maps = maps_of(designed, aim, constraints, unit=shown, side=settings.map_side, progress=progress)
        checks = None
        if settings.runs:
            first = scatter_check(before, settings, "scatter before", progress)
            checks = first, scatter_check(after, settings, "scatter after", progress)
    return DesignStudy(
        before=before,
        after=after,
        varied=varied,
        constraints=constraints,
        moves=moves,
        numbers=numbers,
        path=path,
        scatter=checks,
        maps=maps,
        settings=settings,
        seconds=seconds,
    )


def _shown(units: tuple[MovingUnit, ...], moves: tuple[PlaceMove, ...], designed: DesignScene) -> MovingUnit | None:
    """Ranger on the ground that moved farthest and is still there, else the first that could move."""
    order = {move.unit: k for k, move in enumerate(moves)}
    level = [unit for unit in units if unit.ranger and unit.level and unit.name in designed.row]
    return min(level, key=lambda unit: order.get(unit.name, len(order)), default=None)


def _numbered(
    scene: DesignScene,
    aim: DesignAim,
    varied: tuple[Variation, ...],
    constraints: Constraints,
    *,
    settings: StudySettings,
    path: SearchPath,
    tell: Tell,
) -> tuple[DesignScene, tuple[DesignNumber, ...]]:
    """Scene of the chosen number, and the results of all numbers; none where no number varies."""
    counted = [variation for variation in varied if variation.number is not None]
    if not counted:
        return scene, ()
    variation = counted[0]
    if len(counted) > 1 or variation.number is None:
        raise InputError(f"vary {counted[1].text!r}: a second number (expected one variation with a number)")
    low, high = variation.number
    if high - low >= MOST_NUMBERS:
        raise InputError(f"vary {variation.text!r}: {high - low + 1} numbers (expected at most {MOST_NUMBERS})")
    present = len({p.unit for p in scene.points if variation.selects(p.name, p.role, not p.body)})
    held = present - len(pool_of(scene, aim, variation))
    if low < max(held, 1):
        raise InputError(f"vary {variation.text!r}: {held} of {present} are of interest (expected from {max(held, 1)})")
    scenes, changes = {present: scene}, {present: ""}
    for number in range(present - 1, low - 1, -1):
        tell(f"number {number}")
        scenes[number], changes[number] = with_one_less(scenes[number + 1], aim, variation)
    for number in range(present + 1, high + 1):
        tell(f"number {number}")
        scenes[number] = with_one_more(scenes[number - 1], aim, variation, constraints, number)
        changes[number] = scenes[number].points[-1].name
    results = []
    for number in range(low, high + 1):
        tell(f"places of {number}")
        scenes[number] = improved(
            scenes[number], aim, varied, constraints, settings=settings.search, path=path, tell=tell
        )
        results.append(DesignNumber(number, DesignState.of(scenes[number], aim).u, changes[number]))
    enough = [r.number for r in results if settings.limit is not None and r.u <= settings.limit]
    return scenes[min(enough, default=high)], tuple(results)


def _moves(before: DesignScene, after: DesignScene) -> tuple[PlaceMove, ...]:
    """Moves of the units, the farthest first, then new ones and those left out."""
    frames = {p.unit: p.frame for p in (*after.points, *before.points)}
    first, last = _middles(before), _middles(after)
    none = (float("nan"),) * 3
    moves = [PlaceMove(unit, frames[unit], first.get(unit, none), last.get(unit, none)) for unit in {**first, **last}]
    moved = [move for move in moves if not move.distance < SMALLEST_MOVE]
    return tuple(sorted(moved, key=lambda move: -move.distance if move.distance > 0.0 else 0.0))


def _middles(scene: DesignScene) -> dict[str, tuple[float, float, float]]:
    """Middle of each unit, m, in its frame."""
    rows: dict[str, list[int]] = {}
    for i, point in enumerate(scene.points):
        rows.setdefault(point.unit, []).append(i)
    middles = {unit: scene.places[each].mean(axis=0) for unit, each in rows.items()}
    return {unit: (float(x), float(y), float(z)) for unit, (x, y, z) in middles.items()}


def scatter_check(
    state: DesignState, settings: StudySettings, what: str, progress: Progress | None = None
) -> ScatterCheck:
    """Scatter of simulated measurements in the worst posture."""

    def done(runs: int) -> None:
        if progress is not None:
            progress(what, runs, settings.runs)

    prediction = state.predictions[state.posture]
    errors = drawn_errors(prediction, settings.runs, seed=settings.seed, progress=done)
    squares = state.aim.criterion(state.scene, state.posture).squares(prediction, errors)
    rows = [state.scene.row[name] for name in state.aim.interest]
    each = errors[:, rows]
    normalised = np.einsum("rki,kij,rkj->rk", each, np.linalg.inv(state.covariances), each).mean(axis=1)
    u = float(np.sqrt(squares.mean()))
    root = np.sqrt(settings.runs)
    return ScatterCheck(
        predicted=state.u,
        u=u,
        u_u=float(squares.std(ddof=1) / root / (2.0 * u)),
        normalised=float(normalised.mean()),
        u_normalised=float(normalised.std(ddof=1) / root),
        runs=settings.runs,
    )
