"""Status texts of a ranging network that failed or is implausible: cause, place, remedy."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.estimation.least_squares.status import AdjustmentOutcome, Status, rank_deficient
from catseye.estimation.network.multilateration.blocks import UNCHECKED, IterationState, Problem, Statistics, linearise

TARGET = "{name} {why}{others}; add ranges from other directions, hold it or give it a prior"
MOTIONS = "the whole network floats ({motions}); hold {count} more coordinates, or mark datum points"
DATUM = "the datum does not hold {motions}; mark more coordinates as datum, or hold them"
PIECES = "the network is in {count} pieces that no observation connects: {pieces}; \
add ranges between them, or hold each one"
CONTRADICTORY = "half of the residuals exceed {median:.0f} standard uncertainties, worst at {worst}; \
a range may be grossly wrong, two points exchanged, or the starting coordinates too far off"

LISTED = 4  # names in one line
BELIEVABLE = 30.0  # median |residual| / sigma: above it the model is wrong, not only the sigmas
AXES = "xyz"


@dataclass(frozen=True)
class Names:
    """Names of stations and targets."""

    stations: Sequence[str]
    targets: Sequence[str]

    def station(self, i: int) -> str:
        """Name of station i, or its index."""
        return self.stations[i] if len(self.stations) else f"station[{i}]"

    def target(self, i: int) -> str:
        """Name of target i, or its index."""
        return self.targets[i] if len(self.targets) else f"target[{i}]"

    def parameter(self, i: int, width: int) -> str:
        """Name of parameter i of the stations."""
        s, k = divmod(i, width)
        return f"{AXES[k]} of {self.station(s)}" if k < 3 else f"{('zero', 'scale')[k - 3]} of {self.station(s)}"


def listed(names: Sequence[str]) -> str:
    """Names in one line, up to a limit.

    >>> listed(["S1", "S2", "S3", "S4", "S5", "S6"])
    'S1, S2, S3, S4 and 2 more'
    """
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def floating_targets(problem: Problem, state: IterationState, names: Names, *, floating: np.ndarray) -> Status:
    """Status of targets `floating` (indices, worst first) not determined by their stations."""
    worst = int(floating[0])
    rows = np.flatnonzero((problem.target == worst) & (problem.root > 0.0))
    stations = len(np.unique(problem.station[rows]))
    needed = int(problem.free_targets[worst].sum())
    if len(rows) < needed:
        why = f"is seen by {len(rows)} range{'s' * (len(rows) != 1)} and has {needed} free coordinates"
    elif stations < needed:
        why = f"is seen from {stations} station{'s' * (stations != 1)} only and has {needed} free coordinates"
    else:
        a = linearise(problem, state, rows, root=problem.root[rows]).a[:, problem.free_targets[worst]]
        values = np.linalg.svd(a, compute_uv=False)
        line = len(values) > 1 and values[1] < 1e-6 * values[0]
        why = f"lies on one {'line' if line else 'plane'} with all {stations} stations that see it"
    other_targets = [names.target(int(i)) for i in floating[1:]]
    others = f" (so do {listed(other_targets)})" if other_targets else ""
    return Status(AdjustmentOutcome.RANK_DEFICIENT, TARGET.format(name=names.target(worst), why=why, others=others))


def described(motions: np.ndarray, size: float) -> str:
    """Free motions (7, f) in words.

    >>> described(np.eye(7)[:, :6], 1.0)
    '3 shifts and 3 turns'
    """
    if motions.shape[1] >= 6:
        return "3 shifts and 3 turns" if motions.shape[1] == 6 else "3 shifts, 3 turns and the scale"
    words = []
    for motion in motions.T:
        scaled = motion * np.array([1.0, 1.0, 1.0] + [size] * 4)
        turn, shift = np.linalg.norm(scaled[3:6]), np.linalg.norm(scaled[:3])
        if abs(scaled[6]) > max(turn, shift):
            words.append("a change of scale")
            continue
        kind, vector = ("turn about", scaled[3:6] / turn) if turn > 0.1 * shift else ("shift along", scaled[:3] / shift)
        words.append(f"a {kind} ({', '.join(f'{c + 0.0:.2f}' for c in vector)})")
    return listed(words)


def pieces(problem: Problem, names: Names, joined: tuple[np.ndarray, np.ndarray]) -> list[str]:
    """Members of each connected part of the network (ranges and `joined` pairs of stations)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    s, t = len(problem.free_stations), len(problem.free_targets)
    used = problem.root > 0.0
    first = np.concatenate([problem.station[used], joined[0]])
    second = np.concatenate([s + problem.target[used], joined[1]])
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(s + t, s + t))
    count, label = connected_components(graph, directed=False)
    members: list[list[str]] = [[] for _ in range(count)]
    for i in range(s + t):
        members[label[i]].append(names.station(i) if i < s else names.target(i - s))
    return [f"[{listed(m)}]" for m in sorted(members, key=len)]


def floating_network(
    problem: Problem, names: Names, joined: tuple[np.ndarray, np.ndarray], *, part: np.ndarray
) -> Status:
    """Status of a singular reduced system.

    `part` (n,) is each parameter's share in the null space.
    """
    parts = pieces(problem, names, joined)
    if len(parts) > 1:
        return Status(AdjustmentOutcome.RANK_DEFICIENT, PIECES.format(count=len(parts), pieces=" and ".join(parts[:3])))
    worst = np.argsort(-np.round(part / part.max(), 6), kind="stable")  # roundoff must not change the order
    called = [names.parameter(int(i), problem.width) for i in worst if part[i] > 1e-3 * part.max()]
    return rank_deficient(listed(called))


def contradiction(
    problem: Problem, state: IterationState, names: Names, *, statistics: Statistics | None
) -> Status | None:
    """Status of implausibly large residuals overall, or None.

    Less exact without statistics.
    """
    rows = np.flatnonzero(problem.root > 0.0)
    misclosure = np.abs(linearise(problem, state, rows, root=problem.root[rows]).misclosure)
    median = float(np.median(misclosure))
    if median < BELIEVABLE:
        return None
    s = len(problem.free_stations)
    counts = np.maximum(np.bincount(problem.station[rows], minlength=s), 1)
    by_station = np.bincount(problem.station[rows], misclosure**2, s) / counts
    where = names.station(int(np.argmax(by_station)))
    if statistics is not None:
        i = rows[np.argmax(np.abs(statistics.standardised[rows]))]
        off = statistics.residual[i] / max(statistics.redundancy[i], UNCHECKED)
        ends = f"{names.station(int(problem.station[i]))} to {names.target(int(problem.target[i]))}"
        where += f" and at the range {ends} (about {off:.2g} m off)"
    return Status(AdjustmentOutcome.CONTRADICTORY, CONTRADICTORY.format(median=median, worst=where))
