"""A way round the zones: waypoints from where a mirror stands to a pointing, every move verified, the soonest found.

1. The straight slew, to the direct and to the prime pointing (eq. 2.25, 2.26), on any turn that the stops allow.
2. Where it is refused: a grid of counts between the stops. A node is open where its beam keeps out of the zones, the
   Sun's cone widened by what the Sun can move during the whole way. Neighbours are joined where the slew between them
   is free: far from the zones by that distance, near them by `first_entry`. Dijkstra's shortest way in time.
3. The way is shortened: of all slews between any two of its nodes, with the axes' real profiles from the time when each
   would begin, those that are free make the soonest way.

A way exists at the grid's resolution if its nodes can be joined; then one is found. The two ends need not be on the
grid: they are joined to open nodes near them, by slews verified at their own times.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import SECONDS_PER_DAY
from catseye.errors import ValidityError
from catseye.geometry.clearance.keep_out import TOUCH
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT, COUNTS_PER_TURN, prime_counts
from catseye.geometry.mirror.slew import trapezoid
from catseye.geometry.sky.sun import SUN_RATE
from catseye.reduction.steering.guard import Guard

STEP = (300.0, 150.0)  # counts between nodes: the beam turns by 1.1 degrees in each
ELEVATION_REACH = 25_000.0  # counts either side of ne0: every direction, direct and prime
NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1))
JOINED = 400  # open nodes tried from each end
THINNED = (50, 150)  # nodes of a way that are tried first when it is shortened


class RouteStatus(StrEnum):
    """What the search for a way came to."""

    DIRECT = "one slew"
    AROUND = "a way round the zones"
    STARTS_INSIDE = "the mirror stands in a zone or beyond its stops: close the shutter and move it by hand"
    TARGET_INSIDE = "no pointing of the target is allowed"
    BLOCKED = "no way leads there at the grid's resolution"


@dataclass(frozen=True)
class Route:
    """A way in time.

    status      what was found
    waypoints   (n, 2), counts, the start first; empty without a way
    duration    s, with a halt at each waypoint; NaN without a way
    prime       whether it ends in the prime pointing
    """

    status: RouteStatus
    waypoints: NDArray[np.float64]
    duration: float
    prime: bool = False

    @property
    def found(self) -> bool:
        """Whether a way was found."""
        return self.status in (RouteStatus.DIRECT, RouteStatus.AROUND)


def route(
    guard: Guard,
    mjd: float,
    start: ArrayLike,
    target: ArrayLike,
    *,
    step: tuple[float, float] = STEP,
    either: bool = True,
) -> Route:
    """The soonest verified way of a mirror from counts to counts (2,), round the guard's zones.

    guard     of the ranger; its `route` allows the way that comes back
    mjd       UTC, when it would begin
    start     counts where the mirror stands
    target    counts of the pointing, direct or prime
    step      counts between nodes of the grid, azimuth and elevation
    either    the other setting that points the same, and other turns of azimuth, serve as well

    Without a way the status says why. Raises ValidityError for steps that are not above 0, and for counts that are not
    two finite numbers.

    Source: [DIJKSTRA59] for the shortest way; verified by conservative advancement,
    `geometry.clearance.keep_out.first_entry`.
    """
    if not (len(step) == 2 and step[0] > 0.0 and step[1] > 0.0):
        raise ValidityError(f"step {step} is not two numbers of counts above 0")
    here, there = np.asarray(start, dtype=float), np.asarray(target, dtype=float)
    if there.shape != (2,) or not np.isfinite(there).all():
        raise ValidityError(f"target {there.tolist()} is not two finite numbers (azimuth, elevation, counts)")
    none = np.zeros((0, 2))
    if not guard.pointing(mjd, here).allowed:
        return Route(RouteStatus.STARTS_INSIDE, none, np.nan)
    goals, prime = _goals(guard, there, either)
    slack = _longest(guard) * SUN_RATE
    open_ = np.min(guard.clearance(mjd, goals), axis=-1) > TOUCH if len(goals) else np.zeros(0, dtype=bool)
    goals, prime = goals[open_], prime[open_]
    if len(goals) == 0:
        return Route(RouteStatus.TARGET_INSIDE, none, np.nan)
    moves = trapezoid(here, goals, guard.pace)
    time = np.where(guard.entries(mjd, moves).status == 0, moves.total, np.inf)
    best = int(np.argmin(time))
    soonest: Route | None = None
    if np.isfinite(time[best]):
        soonest = Route(RouteStatus.DIRECT, np.stack([here, goals[best]]), float(time[best]), bool(prime[best]))
        if time[best] <= np.min(moves.total):  # nothing could be sooner
            return soonest
    ways = _Grid.between(guard, mjd, slack, step, here, goals).ways(here, goals)
    for way, last in ways:
        shortened = _shortened(guard, mjd, way)
        if shortened is not None and (soonest is None or shortened[1] < soonest.duration):
            soonest = Route(RouteStatus.AROUND, shortened[0], shortened[1], bool(prime[last]))
    return soonest or Route(RouteStatus.BLOCKED, none, np.nan)


def _goals(guard: Guard, target: NDArray, either: bool) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Counts (k, 2) between the stops that point as the target does, and which of them are prime."""
    ne0 = float(guard.station.zeros[1])
    settings = [target]
    if either:
        other = np.array(prime_counts(target[0], target[1], ne0))
        turns = COUNTS_PER_TURN * np.arange(-2, 3)
        settings = [np.array([n[0] + turn, n[1]]) for n in (target, other) for turn in turns]
    low, high = guard.azimuth_limits
    kept = [n for n in settings if low <= n[0] <= high]
    return np.array(kept).reshape(-1, 2), np.array([n[1] < ne0 for n in kept], dtype=bool)


def _longest(guard: Guard) -> float:
    """A time, s, in which any sensible way is done: three times across the whole range of each axis."""
    low, high = guard.azimuth_limits
    across = trapezoid([low, -ELEVATION_REACH], [high, ELEVATION_REACH], guard.pace)
    return 3.0 * float(np.sum(across.duration))


@dataclass(frozen=True)
class _Grid:
    """Open nodes of a grid of counts and the free slews between neighbours.

    slack   rad, by which the Sun's cone is widened
    nodes   (n, 2), counts, of a grid with these `sides`
    room    (n,), rad, left at a node; above zero it is open
    """

    guard: Guard
    mjd: float
    slack: float
    nodes: NDArray[np.float64]
    sides: tuple[int, int]
    room: NDArray[np.float64]

    @classmethod
    def between(
        cls, guard: Guard, mjd: float, slack: float, step: tuple[float, float], here: NDArray, goals: NDArray
    ) -> "_Grid":
        """Between the azimuth stops, and over all elevations that make sense or are asked for."""
        ne0 = float(guard.station.zeros[1])
        asked = np.concatenate([here[1:], goals[:, 1]])
        low, high = min(ne0 - ELEVATION_REACH, asked.min()), max(ne0 + ELEVATION_REACH, asked.max())
        azimuth = np.linspace(*guard.azimuth_limits, 1 + int(np.ceil(np.ptp(guard.azimuth_limits) / step[0])))
        elevation = np.linspace(low, high, 1 + int(np.ceil((high - low) / step[1])))
        nodes = np.stack(np.meshgrid(azimuth, elevation, indexing="ij"), axis=-1)
        gap = guard.clearance(mjd, nodes, exact_below=4.0 * float(np.sum(np.array(step) * BEAM_PER_COUNT)))
        gap[..., 0] -= slack
        return cls(guard, mjd, slack, nodes.reshape(-1, 2), nodes.shape[:2], np.min(gap, axis=-1).ravel() - TOUCH)

    def ways(self, here: NDArray, goals: NDArray) -> list[tuple[NDArray[np.float64], int]]:
        """The soonest way (n, 2) to each goal that can be reached, with the goal's number, by top speeds alone."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        n = len(self.nodes)
        a, b = self._edges()
        first = self._near(here, np.full(n, self.mjd), outward=True)
        rows, columns = np.r_[a, b, np.full(len(first), n)], np.r_[b, a, first]
        weights = np.r_[np.tile(self._time(self.nodes[a], self.nodes[b]), 2), self._time(here, self.nodes[first])]
        graph = csr_array((np.maximum(weights, 1e-9), (rows, columns)), shape=(n + 1, n + 1))
        arrival, before = dijkstra(graph, indices=n, return_predecessors=True)
        ways = []
        for last, goal in enumerate(goals):
            at = self._near(goal, self.mjd + arrival[:n] / SECONDS_PER_DAY, outward=False)
            if len(at) == 0:
                continue
            node = int(at[np.argmin(arrival[at] + self._time(self.nodes[at], goal))])
            way = [goal]
            while node != n:
                way.append(self.nodes[node])
                node = int(before[node])
            ways.append((np.array([here, *way[::-1]]), last))
        return ways

    def _edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pairs of neighbours between which a slew is free."""
        index = np.arange(len(self.nodes)).reshape(self.sides)
        pairs = []
        for i, j in NEIGHBOURS:
            a = index[: self.sides[0] - i, max(0, -j) : self.sides[1] - max(0, j)]
            b = index[i:, max(0, j) : self.sides[1] + min(0, j)]
            pairs.append(np.stack([a.ravel(), b.ravel()]))
        a, b = np.concatenate(pairs, axis=-1)
        both = (self.room[a] > 0.0) & (self.room[b] > 0.0)
        a, b = a[both], b[both]
        # Half of the way by both axes together is as far as a slew comes from the nearer of its ends.
        half = 0.5 * np.sum(np.abs(self.nodes[b] - self.nodes[a]) * BEAM_PER_COUNT, axis=-1)
        sure = np.minimum(self.room[a], self.room[b]) > half
        free = sure.copy()
        ask = np.flatnonzero(~sure)
        for one, other in ((a, b), (b, a)):
            moves = trapezoid(self.nodes[one[ask]], self.nodes[other[ask]], self.guard.pace)
            status = self.guard.entries(self.mjd, moves, widened=self.slack, compiled=True).status
            ask = ask[status == 0]
        free[ask] = True
        return a[free], b[free]

    def _near(self, point: NDArray, begun_mjd: NDArray, *, outward: bool) -> NDArray[np.int64]:
        """Open nodes near a point to which (else from which) a slew is free, begun at a time (n,) for each node."""
        open_ = np.flatnonzero((self.room > 0.0) & np.isfinite(begun_mjd))
        way = np.sum(np.abs(self.nodes[open_] - point) * BEAM_PER_COUNT, axis=-1)
        nearest = open_[np.argsort(way, kind="stable")[:JOINED]]
        begin, end = (point, self.nodes[nearest]) if outward else (self.nodes[nearest], point)
        moves = trapezoid(begin, end, self.guard.pace)
        return nearest[self.guard.entries(begun_mjd[nearest], moves, compiled=True).status == 0]

    def _time(self, a: NDArray, b: NDArray) -> NDArray[np.float64]:
        """Time, s, of moves at top speeds."""
        return np.max(np.abs(b - a) / np.array(self.guard.pace.velocity), axis=-1)


def _shortened(guard: Guard, mjd: float, way: NDArray[np.float64]) -> tuple[NDArray[np.float64], float] | None:
    """The soonest way through some of the nodes (n, 2): first a few of them, more where those do not join."""
    for most in (*THINNED, len(way)):
        kept = np.unique(np.linspace(0, len(way) - 1, min(most, len(way))).astype(int))
        soonest = _soonest(guard, mjd, way[kept])
        if soonest is not None:
            return soonest
    return None


def _soonest(guard: Guard, mjd: float, way: NDArray[np.float64]) -> tuple[NDArray[np.float64], float] | None:
    """The soonest of the ways through some of the nodes (n, 2) in their order, each slew free when it begins."""
    n = len(way)
    arrival, before = np.full(n, np.inf), np.zeros(n, dtype=int)
    arrival[0] = 0.0
    for i in range(n - 1):
        if not np.isfinite(arrival[i]):
            continue
        moves = trapezoid(way[i], way[i + 1 :], guard.pace)
        there = arrival[i] + moves.total
        sooner = np.flatnonzero(there < arrival[i + 1 :])
        free = guard.entries(mjd + arrival[i] / SECONDS_PER_DAY, moves[sooner], compiled=True).status == 0
        arrival[i + 1 + sooner[free]], before[i + 1 + sooner[free]] = there[sooner[free]], i
    if not np.isfinite(arrival[-1]):
        return None
    nodes = [n - 1]
    while nodes[-1] != 0:
        nodes.append(int(before[nodes[-1]]))
    return way[nodes[::-1]], float(arrival[-1])
