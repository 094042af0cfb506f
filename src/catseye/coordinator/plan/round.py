"""Plan a round of some seconds for all rangers at once.

In order: the reference when it is due, a benchmark now and then, then the shots with the largest gain of information
about the points that matter per second, then, on the feed arm, the next stretch of the dish. Rangers take turns: the
one that is free first chooses first, knowing the others' choices. A point whose covariance is long in one direction
attracts the ranger that looks along it: so every point gets rangers all round if there are any.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.coordinator.parts import PlannedShot, Round, SiteState
from catseye.coordinator.plan.candidates import ShotCandidates, candidates
from catseye.coordinator.plan.places import ChosenTarget, Places
from catseye.coordinator.plan.raster import DishRaster
from catseye.coordinator.plan.value import SIGMA, Knowledge
from catseye.coordinator.visibility.sights import VisibleSights
from catseye.coordinator.visibility.surroundings import FREE, PERHAPS, KeepClear, Surroundings, instants, later
from catseye.coordinator.visibility.vantage import SeenRetroreflector, Vantage, retros_of, vantages_of
from catseye.errors import InputError
from catseye.geometry.clearance.keep_out import servo_margin
from catseye.ranger.sun_watch import LARGEST_STEP
from catseye.records.night.live import TICK_SECONDS
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.records.site.solids import Solids

HOUR_TICKS = 100_000_000 // 24
RANGERS_GRID = servo_margin([0.5 * LARGEST_STEP] * 2)  # rad by which a ranger's own check of the Sun may be too strict


@dataclass(frozen=True)
class RoundSettings:
    """Settings of rounds; s, m.

    period            of a round
    lead              from now to the first move
    settle            from the end of a move to the buffer
    transfer          from the end of a buffer to the next move: reply and samples
    duration          of a buffer
    reference_every   and benchmark_every: longest intervals
    dish_share        share of a feed-arm ranger's round for the dish
    interval          shortest time between the starts of two buffers of a ranger
    sigma             of a range
    drift             process noise of points, per square root of a second
    """

    period: float = 10.0
    lead: float = 0.3
    settle: float = 0.15
    transfer: float = 0.02
    duration: float = 0.128
    reference_every: float = 60.0
    benchmark_every: float = 120.0
    dish_share: float = 0.5
    sigma: float = SIGMA
    drift: float = 30e-6
    interval: float = 0.05


@dataclass(eq=False)
class _Turn:
    """One ranger's round under construction.

    points, variance   of the table's rows: index of the point (-1: none), and variance of a range to it, m^2
    until              s, end of the time for shots chosen by value
    counted, open_     rows chosen by value, and those of them not yet shot in this pass
    factor             of the worth of a shot on each row
    row, at            present row of the mirror, and since when, s
    """

    vantage: Vantage
    around: Surroundings
    table: ShotCandidates
    points: NDArray[np.int64]
    variance: Array
    until: float
    counted: NDArray[np.bool_]
    open_: NDArray[np.bool_]
    factor: Array
    row: int = 0
    at: float = 0.0
    chosen: list[ChosenTarget] = field(default_factory=list)


class RoundPlanner:
    """Planner of rounds; the same sequence of states gives the same rounds.

    site         its records
    targets      that matter to rangers on the ground; structure and triplets' balls if None
    keep_clear   Sun and boxes; the site's Sun without boxes if None
    solids       obstacles
    settings     of rounds

    `scan_list` has the names that are measured besides ZRG and benchmarks, None: all; `priorities` the factors of the
    worth of shots, by name.
    """

    def __init__(
        self,
        site: SiteFolder,
        *,
        targets: Iterable[str] | None = None,
        keep_clear: KeepClear | None = None,
        solids: Solids | None = None,
        settings: RoundSettings | None = None,
    ):
        self.site, self.settings = site, settings or RoundSettings()
        self.keep_clear = keep_clear or KeepClear(site)
        self.vantages, self.retros = vantages_of(site), retros_of(site)
        selection = None if targets is None else frozenset(targets)
        dish = tuple(r for r in self.retros.values() if r.part == "dish")
        ground = {n: r for n, r in self.retros.items() if _matters(r, selection)}
        arm = {n: r for n, r in self.retros.items() if r.part not in ("benchmark", "underside")}
        self._sights = VisibleSights(site, self.vantages, ground=ground, arm=arm, solids=solids)
        self._benchmarks = {b.ranger: b.target for b in site.benchmarks}
        self._benchmarked: dict[str, int] = {}
        visible = self._sights.at(Places.nominal(site)).targets
        riders = [v for v in self.vantages.values() if v.frame == "reflector"]
        in_dish = {r.name for r in dish}
        self.rasters = {
            v.name: DishRaster(v, tuple(self.retros[n] for n in visible.get(v.name, ()) if n in in_dish))
            for v in riders
        }
        self._in_dish, self._started = in_dish, False
        self._visited: set[str] = set()
        self.scan_list: frozenset[str] | None = None
        self.priorities: dict[str, float] = {}

    def round(self, state: SiteState) -> Round:
        """Next round, from `state.now_ticks` plus the lead.

        Raises InputError for a ranger that the site does not have.
        """
        s = self.settings
        begin, end = later(state.now_ticks, s.lead), later(state.now_ticks, s.lead + s.period)
        self._start_tours(begin, state.ready)
        places = Places(self.site, self.vantages, self.retros, state, instants(begin, end))
        suns = self.keep_clear.sun(places.ticks)
        visible, unseen = self._sights.at(state.posture), {}
        rangers = [self._vantage(name) for name in sorted(state.ready)]
        options = {v.name: self._options(v, visible.targets.get(v.name, ()), state) for v in rangers}
        know = self._knowledge(sorted({n for names in options.values() for n in names if n in self.retros}), state)
        turns = {}
        for v in rangers:
            around = self.keep_clear.around(v, begin, end, posture=state.posture, suns=suns, wider=RANGERS_GRID)
            turn, why = self._turn(v, around, options[v.name], places, know, state)
            turns[v.name] = turn
            unseen.update({(v.name, target): text for target, text in why.items()})
            unseen.update({pair: text for pair, text in visible.unseen.items() if pair[0] == v.name})
            unseen.update({(r, t): "suspended after failures" for r, t in state.suspended if r == v.name})
            self._due(turn, state, begin)
        self._by_worth(turns, know)
        for turn in turns.values():
            if turn.vantage.name in self.rasters:
                unseen.update(self._dish(turn, places, state))
        shots: dict[str, tuple[PlannedShot, ...]] = {
            name: places.shots(turn.vantage, turn.chosen, s.duration) for name, turn in turns.items()
        }
        return Round(begin, end, shots, unseen)

    def _vantage(self, name: str) -> Vantage:
        if name not in self.vantages:
            raise InputError(
                f"ranger {name!r} is unknown at the site (expected one of {len(self.vantages)} of its records)"
            )
        return self.vantages[name]

    def _start_tours(self, ticks: int, ready: tuple[str, ...]) -> None:
        """Spread the rasters' starts over the dish, and by the hour.

        So restarts do not begin at the same prism. A new lap begins when all prisms visible to the available rangers
        are visited.
        """
        at_hand = [raster for name, raster in self.rasters.items() if name in ready]
        if self._visited.issuperset(n for raster in at_hand for n in raster.names if self._listed(n)):
            self._visited.clear()
        if self._started:
            return
        for k, raster in enumerate(self.rasters.values()):
            raster.begin((k / len(self.rasters) + (ticks % HOUR_TICKS) / HOUR_TICKS) % 1.0)
        self._started = True

    def _options(self, vantage: Vantage, visible: tuple[str, ...], state: SiteState) -> tuple[str, ...]:
        """Possible shots of a ranger besides the dish.

        ZRG first, its benchmark, then what it sees.
        """
        bench = self._benchmarks.get(vantage.name)
        others = (n for n in visible if n not in self._in_dish and self._listed(n))
        names = [REFERENCE, *([bench] if bench else []), *others]
        return tuple(n for n in names if (vantage.name, n) not in state.suspended)

    def _listed(self, target: str) -> bool:
        """True for a target of the scan list."""
        return self.scan_list is None or target in self.scan_list

    def _knowledge(self, names: list[str], state: SiteState) -> Knowledge:
        """Covariances of points before the round.

        The last ones plus process noise, or those of the records.
        """
        forgotten = self.settings.drift**2 * self.settings.period * np.eye(3)
        table = [state.u[n] + forgotten if n in state.u else self.retros[n].u ** 2 * np.eye(3) for n in names]
        return Knowledge(tuple(names), np.array(table))

    def _turn(
        self,
        vantage: Vantage,
        around: Surroundings,
        names: tuple[str, ...],
        places: Places,
        know: Knowledge,
        state: SiteState,
    ) -> tuple[_Turn, dict[str, str]]:
        s = self.settings
        looks, units = places.looks(vantage, names)
        start = state.counts.get(vantage.name, vantage.reference)
        table, why = candidates(names, looks, units, start=start, around=around)
        points = np.array([know.at.get(n, -1) for n in table.names])
        covariance = state.u.get(vantage.name)
        variance = np.full(len(points), s.sigma**2)
        if covariance is not None:
            variance = variance + np.einsum("mi,ij,mj->m", table.units, covariance, table.units)
        share = 1.0 - s.dish_share if vantage.name in self.rasters and self.rasters[vantage.name].names else 1.0
        counted = np.array([n in self.retros and self.retros[n].part != "benchmark" for n in table.names])
        return _Turn(
            vantage=vantage,
            around=around,
            table=table,
            points=points,
            variance=variance,
            until=share * s.period,
            counted=counted,
            open_=counted.copy(),
            factor=np.array([self.priorities.get(n, 1.0) for n in table.names]),
        ), why

    def _due(self, turn: _Turn, state: SiteState, begin: int) -> None:
        """Choose reference and benchmark, if due by the end of the round."""
        s, name = self.settings, turn.vantage.name
        if state.since_reference.get(name, np.inf) + s.period > s.reference_every:
            self._go(turn, REFERENCE, "reference: due")
        bench = self._benchmarks.get(name)
        last = self._benchmarked.get(name)
        due = last is None or (begin - last) * TICK_SECONDS + s.period > s.benchmark_every
        if bench and due and self._go(turn, bench, "benchmark: index of air along a certified path"):
            self._benchmarked[name] = begin

    def _go(self, turn: _Turn, target: str, reason: str) -> bool:
        if target not in turn.table.names:
            return False
        row = turn.table.names.index(target)
        if turn.table.may(turn.row, row, turn.around) is not None:
            return False
        self._take(turn, row, reason)
        return True

    def _take(self, turn: _Turn, row: int, reason: str) -> None:
        begin = turn.at + float(turn.table.moving[turn.row, row]) + self.settings.settle
        turn.open_[row] = False
        turn.chosen.append(ChosenTarget(turn.table.names[row], begin, reason, turn.table.via(turn.row, row)))
        turn.row, turn.at = row, begin + self._after

    @property
    def _after(self) -> float:
        """s from the start of a buffer to the next move."""
        s = self.settings
        return max(s.duration + s.transfer, s.interval - s.settle)

    @property
    def _a_shot(self) -> float:
        """s that a shot takes besides its move."""
        return self.settings.settle + self._after

    def _by_worth(self, turns: dict[str, _Turn], know: Knowledge) -> None:
        queue = [(turn.at, name) for name, turn in turns.items()]
        heapify(queue)
        while queue:
            _, name = heappop(queue)
            if self._best(turns[name], know):
                heappush(queue, (turns[name].at, name))

    def _best(self, turn: _Turn, know: Knowledge) -> bool:
        """Choose what is worth most a second, of what was not shot in this pass; False when nothing fits any more."""
        for _ in range(2):
            while len(rows := self._open(turn)):
                cost = turn.table.moving[turn.row, rows] + self._a_shot
                worth = know.worth(turn.points[rows], turn.table.units[rows], turn.variance[rows])
                best = int(np.argmax(worth.gain * turn.factor[rows] / cost))
                row = int(rows[best])
                if turn.table.may(turn.row, row, turn.around) is None:
                    before, after = know.learn(int(turn.points[row]), worth.across[best], float(worth.total[best]))
                    reason = f"u of {turn.table.names[row]} from {1e3 * before:.4f} to {1e3 * after:.4f} mm"
                    self._take(turn, row, reason)
                    return True
            turn.open_ = turn.counted.copy()  # another pass over all
            turn.open_[turn.row] = False
        return False

    def _open(self, turn: _Turn) -> NDArray[np.int64]:
        """Rows that fit into the remaining round.

        Those surely free, or else those possibly free. Beside what is not yet shot in this pass, what has a higher
        priority than some of that competes again by its worth: a pass alone would give every target its shot.
        """
        code = turn.table.code[turn.row]
        in_time = turn.at + turn.table.moving[turn.row] + self._a_shot <= turn.until
        fits = turn.open_ & in_time
        if not fits.any():
            return np.flatnonzero(fits)
        again = turn.counted & in_time & (turn.factor > turn.factor[fits].min())
        again[turn.row] = False
        fits |= again
        for category in (FREE, PERHAPS):
            rows = np.flatnonzero(fits & (code == category))
            if len(rows):
                return rows
        return rows

    def _dish(self, turn: _Turn, places: Places, state: SiteState) -> dict[tuple[str, str], str]:
        """Add the next stretch of the dish after the other shots."""
        s, name = self.settings, turn.vantage.name
        suspended = frozenset(t for r, t in state.suspended if r == name)
        position = turn.table.middle[turn.row]
        raster = self.rasters[name]
        unlisted = {n for n in raster.names if not self._listed(n)}
        chosen, why = raster.stretch(
            position,
            s.period - turn.at,
            turn.around,
            shot_seconds=self._a_shot,
            shift=places.shift(turn.vantage),
            left_alone=suspended,
            visited=self._visited | unlisted,
        )
        self._visited.update(raster.names[i] for i, _ in chosen)
        turn.chosen += [ChosenTarget(raster.names[i], turn.at + moved + s.settle, "dish raster") for i, moved in chosen]
        return {(name, target): text for target, text in why.items()}


def _matters(retro: SeenRetroreflector, selection: frozenset[str] | None) -> bool:
    """True for targets of ground rangers."""
    if selection is not None:
        return retro.name in selection
    return retro.part in ("structure", "underside")
