"""Fastest verified path of a mirror round the zones.

1. The straight slew, to the direct and to the prime pointing (eq. 2.25, 2.26), on any turn that the stops allow.
2. Where it is refused: a grid of counts between the stops. A node is open where its beam keeps out of the zones, the
   Sun's cone widened by the Sun's motion during the whole path. Neighbours are joined where the slew between them
   is free: far from the zones by that distance, near them by `first_entry`. Dijkstra's shortest path in time.
3. The path is shortened: of all slews between any two of its nodes, with the axes' real profiles from the time when
each
   would begin, the free ones form the fastest path.

If a path exists at the grid's resolution, one is found. The two ends need not be on the grid: they are joined to open
nodes near them, by slews verified at their own times.
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
THINNED = (50, 150)  # nodes of a path tried first when it is shortened


class RouteStatus(StrEnum):
    """Status of a path search."""

    DIRECT = "one slew"
    AROUND = "a way round the zones"
    STARTS_INSIDE = "the mirror stands in a zone or beyond its stops: close the shutter and move it by hand"
    TARGET_INSIDE = "no pointing of the target is allowed"
    BLOCKED = "no way leads there at the grid's resolution"


@dataclass(frozen=True)
class Route:
    """Path in time.

    status      of the search
    waypoints   (n, 2), counts, the start first; empty without a path
    duration    s, with a halt at each waypoint; NaN without a path
    prime       True if it ends in the prime pointing
    """

    status: RouteStatus
    waypoints: NDArray[np.float64]
    duration: float
    prime: bool = False

    @property
    def found(self) -> bool:
        """True if a path was found."""
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
    """Fastest verified path of a mirror to counts (2,), round the zones.

    guard     of the ranger; its `route` allows the returned path
    mjd       UTC of its start
    start     counts of the mirror
    target    counts of the pointing, direct or prime
    step      counts between nodes of the grid, azimuth and elevation
    either    also accept the other setting with the same pointing, and other turns of azimuth

    Without a path the status gives the reason. Raises ValidityError for steps that are not above 0, and for counts that
    are not two finite numbers.

    Source: [DIJKSTRA59] for the shortest path; verified by conservative advancement,
    `geometry.clearance.keep_out.first_entry`.
    """
    if not (len(step) == 2 and step[0] > 0.0 and step[1] > 0.0):
        raise ValidityError(f"step {step} is not two numbers of counts above 0")
    start_counts, target_counts = np.asarray(start, dtype=float), np.asarray(target, dtype=float)
    if target_counts.shape != (2,) or not np.isfinite(target_counts).all():
        raise ValidityError(f"target {target_counts.tolist()} is not two finite numbers (azimuth, elevation, counts)")
    no_waypoints = np.zeros((0, 2))
    if not guard.pointing(mjd, start_counts).allowed:
        return Route(RouteStatus.STARTS_INSIDE, no_waypoints, np.nan)
    goals, prime = _goals(guard, target_counts, either)
    slack = _longest(guard) * SUN_RATE
    open_ = np.min(guard.clearance(mjd, goals), axis=-1) > TOUCH if len(goals) else np.zeros(0, dtype=bool)
    goals, prime = goals[open_], prime[open_]
    if len(goals) == 0:
        return Route(RouteStatus.TARGET_INSIDE, no_waypoints, np.nan)
    moves = trapezoid(start_counts, goals, guard.pace)
    time = np.where(guard.entries(mjd, moves).status == 0, moves.total, np.inf)
    best = int(np.argmin(time))
    soonest: Route | None = None
    if np.isfinite(time[best]):
        soonest = Route(RouteStatus.DIRECT, np.stack([start_counts, goals[best]]), float(time[best]), bool(prime[best]))
        if time[best] <= np.min(moves.total):  # nothing is faster
            return soonest
    ways = _Grid.between(guard, mjd, slack, step, start_counts, goals).ways(start_counts, goals)
    for path, last in ways:
        shortened = _shortened(guard, mjd, path)
        if shortened is not None and (soonest is None or shortened[1] < soonest.duration):
            soonest = Route(RouteStatus.AROUND, shortened[0], shortened[1], bool(prime[last]))
    return soonest or Route(RouteStatus.BLOCKED, no_waypoints, np.nan)


def _goals(guard: Guard, target: NDArray, either: bool) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Counts (k, 2) between the stops with the target's pointing.

    And which of them are prime.
    """
    ne0 = float(guard.station.zeros[1])
    settings = [target]
    if either:
        prime = np.array(prime_counts(target[0], target[1], ne0))
        turns = COUNTS_PER_TURN * np.arange(-2, 3)
        settings = [np.array([n[0] + turn, n[1]]) for n in (target, prime) for turn in turns]
    low, high = guard.azimuth_limits
    reachable = [n for n in settings if low <= n[0] <= high]
    return np.array(reachable).reshape(-1, 2), np.array([n[1] < ne0 for n in reachable], dtype=bool)


def _longest(guard: Guard) -> float:
    """Upper limit of a sensible path's duration, s.

    Three times the whole range of each axis.
    """
    low, high = guard.azimuth_limits
    across = trapezoid([low, -ELEVATION_REACH], [high, ELEVATION_REACH], guard.pace)
    return 3.0 * float(np.sum(across.duration))


@dataclass(frozen=True)
class _Grid:
    """Open nodes of a grid of counts, with free slews between neighbours.

    slack   rad, added to the Sun's cone
    nodes   (n, 2), counts, of a grid with these `sides`
    room    (n,), rad, clearance at a node; above zero it is open
    """

    guard: Guard
    mjd: float
    slack: float
    nodes: NDArray[np.float64]
    sides: tuple[int, int]
    room: NDArray[np.float64]

    @classmethod
    def between(
        cls, guard: Guard, mjd: float, slack: float, step: tuple[float, float], start: NDArray, goals: NDArray
    ) -> "_Grid":
        """Grid between the azimuth stops, over all useful elevations.

        And those of start and goals.
        """
        ne0 = float(guard.station.zeros[1])
        elevations = np.concatenate([start[1:], goals[:, 1]])
        low, high = min(ne0 - ELEVATION_REACH, elevations.min()), max(ne0 + ELEVATION_REACH, elevations.max())
        azimuth = np.linspace(*guard.azimuth_limits, 1 + int(np.ceil(np.ptp(guard.azimuth_limits) / step[0])))
        elevation = np.linspace(low, high, 1 + int(np.ceil((high - low) / step[1])))
        nodes = np.stack(np.meshgrid(azimuth, elevation, indexing="ij"), axis=-1)
        gap = guard.clearance(mjd, nodes, exact_below=4.0 * float(np.sum(np.array(step) * BEAM_PER_COUNT)))
        gap[..., 0] -= slack
        return cls(
            guard=guard,
            mjd=mjd,
            slack=slack,
            nodes=nodes.reshape(-1, 2),
            sides=nodes.shape[:2],
            room=np.min(gap, axis=-1).ravel() - TOUCH,
        )

    def ways(self, start: NDArray, goals: NDArray) -> list[tuple[NDArray[np.float64], int]]:
        """Fastest path (n, 2) to each reachable goal, with its number.

        By top speeds alone.
        """
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        n = len(self.nodes)
        a, b = self._edges()
        first = self._near(start, np.full(n, self.mjd), outward=True)
        rows, columns = np.r_[a, b, np.full(len(first), n)], np.r_[b, a, first]
        weights = np.r_[np.tile(self._time(self.nodes[a], self.nodes[b]), 2), self._time(start, self.nodes[first])]
        graph = csr_array((np.maximum(weights, 1e-9), (rows, columns)), shape=(n + 1, n + 1))
        arrival, before = dijkstra(graph, indices=n, return_predecessors=True)
        ways = []
        for last, goal in enumerate(goals):
            at = self._near(goal, self.mjd + arrival[:n] / SECONDS_PER_DAY, outward=False)
            if len(at) == 0:
                continue
            node = int(at[np.argmin(arrival[at] + self._time(self.nodes[at], goal))])
            nodes = [goal]
            while node != n:
                nodes.append(self.nodes[node])
                node = int(before[node])
            ways.append((np.array([start, *nodes[::-1]]), last))
        return ways

    def _edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pairs of neighbours with a free slew between them."""
        index = np.arange(len(self.nodes)).reshape(self.sides)
        pairs = []
        for i, j in NEIGHBOURS:
            a = index[: self.sides[0] - i, max(0, -j) : self.sides[1] - max(0, j)]
            b = index[i:, max(0, j) : self.sides[1] + min(0, j)]
            pairs.append(np.stack([a.ravel(), b.ravel()]))
        a, b = np.concatenate(pairs, axis=-1)
        open_both = (self.room[a] > 0.0) & (self.room[b] > 0.0)
        a, b = a[open_both], b[open_both]
        # Half of the sum of both axes' paths is the largest distance of a slew from its nearer end.
        half = 0.5 * np.sum(np.abs(self.nodes[b] - self.nodes[a]) * BEAM_PER_COUNT, axis=-1)
        sure = np.minimum(self.room[a], self.room[b]) > half
        free = sure.copy()
        ask = np.flatnonzero(~sure)
        for one, second in ((a, b), (b, a)):
            moves = trapezoid(self.nodes[one[ask]], self.nodes[second[ask]], self.guard.pace)
            status = self.guard.entries(self.mjd, moves, widened=self.slack, compiled=True).status
            ask = ask[status == 0]
        free[ask] = True
        return a[free], b[free]

    def _near(self, point: NDArray, begun_mjd: NDArray, *, outward: bool) -> NDArray[np.int64]:
        """Open nodes near a point with a free slew to it.

        Or from it; begun at a time (n,) for each node.
        """
        open_ = np.flatnonzero((self.room > 0.0) & np.isfinite(begun_mjd))
        travel = np.sum(np.abs(self.nodes[open_] - point) * BEAM_PER_COUNT, axis=-1)
        nearest = open_[np.argsort(travel, kind="stable")[:JOINED]]
        begin, end = (point, self.nodes[nearest]) if outward else (self.nodes[nearest], point)
        moves = trapezoid(begin, end, self.guard.pace)
        return nearest[self.guard.entries(begun_mjd[nearest], moves, compiled=True).status == 0]

    def _time(self, a: NDArray, b: NDArray) -> NDArray[np.float64]:
        """Time, s, of moves at top speeds."""
        return np.max(np.abs(b - a) / np.array(self.guard.pace.velocity), axis=-1)


def _shortened(guard: Guard, mjd: float, path: NDArray[np.float64]) -> tuple[NDArray[np.float64], float] | None:
    """Fastest path through some of the nodes (n, 2).

    First a few of them, more where those do not join.
    """
    for most in (*THINNED, len(path)):
        tried = np.unique(np.linspace(0, len(path) - 1, min(most, len(path))).astype(int))
        soonest = _soonest(guard, mjd, path[tried])
        if soonest is not None:
            return soonest
    return None


def _soonest(guard: Guard, mjd: float, path: NDArray[np.float64]) -> tuple[NDArray[np.float64], float] | None:
    """Fastest path through some of the nodes (n, 2) in their order.

    Each slew is free when it begins.
    """
    n = len(path)
    arrival, before = np.full(n, np.inf), np.zeros(n, dtype=int)
    arrival[0] = 0.0
    for i in range(n - 1):
        if not np.isfinite(arrival[i]):
            continue
        moves = trapezoid(path[i], path[i + 1 :], guard.pace)
        arrival_there = arrival[i] + moves.total
        sooner = np.flatnonzero(arrival_there < arrival[i + 1 :])
        free = guard.entries(mjd + arrival[i] / SECONDS_PER_DAY, moves[sooner], compiled=True).status == 0
        arrival[i + 1 + sooner[free]], before[i + 1 + sooner[free]] = arrival_there[sooner[free]], i
    if not np.isfinite(arrival[-1]):
        return None
    nodes = [n - 1]
    while nodes[-1] != 0:
        nodes.append(int(before[nodes[-1]]))
    return path[nodes[::-1]], float(arrival[-1])
