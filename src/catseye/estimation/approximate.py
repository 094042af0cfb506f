"""Approximate coordinates and orientations, found for whatever a network does not give.

Each point is placed by least squares of all that ties it to points already placed: ranges, directions of oriented sets,
zenith angles, height differences, vectors, and the directions of its own set, whose orientation is eliminated. One
routine thus does what surveyors call polar points, trilateration, intersection, resection and free stationing; starts
all around decide whether a second position fits as well. Where that ends, a local network is built about a station
that sees enough, level but turned anyhow, and attached to the placed points by a Helmert transformation; from ranges
alone it is unfolded. Coordinates that are given count as known, good or poor: what is placed from points that are
metres off is metres off too, and serves as a start.

Where nothing (or too little) is given, the first local network keeps its own axes: z up if it has angles, those of
`Unfolding`, mirror image and side included, if it has ranges alone.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, NamedTuple, cast

import numpy as np

from catseye.estimation.network import Network
from catseye.estimation.observations import (
    Angles,
    Azimuths,
    Coordinates,
    Directions,
    Distances,
    FixedDistances,
    FramePoints,
    HeightDifferences,
    HorizontalDistances,
    Inclinations,
    Joint,
    LevelPlanes,
    Observations,
    RigidBodies,
    Vectors,
    ZenithAngles,
)
from catseye.estimation.observations.kind import value
from catseye.estimation.observations.reading import reading_columns
from catseye.estimation.rigid_body import closed_form
from catseye.estimation.rows import variances
from catseye.estimation.unfolding import NO_FIT, TOO_FEW, UNFOLDED, classical_scaling, locate, unfold
from catseye.geometry.rotation import to_vector

RANGE, LEVEL, BEARING, ZENITH, DIFFERENCE, COORDINATE = range(6)
WORDS = ("range", "horizontal distance", "direction", "zenith angle", "coordinate difference", "coordinate")
GROUND = -1  # the "set" of a direction whose orientation is known: an azimuth

STRICT, LENIENT = 1e-3, 1e-7  # least over largest eigenvalue of a point's normal matrix: good geometry; any at all
FLOOR = 1e-3  # m: no sigma counts as smaller, for the points that are given may be poor
DECIDED = 4.0  # a second position must fit this many times worse, in squares ...
BY_NOISE = 25.0  # ... and by more than five standard uncertainties
BLOCK = 20_000  # ranges at a time, so that memory stays bounded
RADII = (0.25, 1.0, 3.0)  # of the starts about the known points, in half their extent


class Approximation(NamedTuple):
    """Where the adjustment begins.

    xyz          (n, 3) m; nan where nothing was found
    parameters   (p,) values of the other parameters
    found        names of the points that had no coordinates, or not all, and now have
    missing      name -> why it has none
    """

    xyz: np.ndarray
    parameters: np.ndarray
    found: tuple[str, ...]
    missing: dict[str, str]


def approximate(network: Network) -> Approximation:
    """Start values of all points and of the orientations, level heights and poses among the parameters.

    network   points may have nan coordinates; every other point counts as known

    Directions, angles, azimuths, zenith angles, inclinations, ranges, horizontal distances, height differences, level
    planes, vectors, observed coordinates and rigid bodies serve; other kinds hold too little by themselves. Parameters
    of other sorts, and those held or with a prior, begin at their own start. Refraction and ranger zeros that are not
    in the start values are neglected.

    Source: [FOERSTNER16] chapter 4, the least squares of each point; the order of placing is ours.

    >>> from catseye.estimation.network import Points
    >>> points = Points(("A", "P"), np.array([[1.0, 2.0, 3.0], [np.nan] * 3]), *np.zeros((2, 2, 3), dtype=bool))
    >>> leg = Vectors("leg", np.array([10.0, 0.0, 1.0]), np.full(3, 1e-6), np.array([0]), np.array([3]))
    >>> approximate(Network(points, (), (leg,))).xyz[1]
    array([11.,  2.,  4.])
    """
    points = network.points
    n = len(points.names)
    values = np.array([p.start for p in network.parameters], dtype=float)
    unknown = ~np.isfinite(points.xyz).all(axis=1)
    bodies = [(point, local) for point, local, _, _ in _bodies(network, values)]
    rows = _read(network if unknown.any() else _directions_of(network))
    search = _Search(rows, points.xyz.astype(float), _given_orientations(network), bodies)
    if unknown.any():
        search.place_all()
    search.orient_sets()
    free = {3 * n + k for k, p in enumerate(network.parameters) if np.isinf(p.sigma)}
    beside = [_levels(network, search.xyz), _poses(network, search.xyz, values)]
    for column, start in chain(search.orientations.items(), *beside):
        if column in free:
            values[column - 3 * n] = start
    placed = np.isfinite(search.xyz).all(axis=1)
    found = tuple(points.names[p] for p in np.flatnonzero(unknown & placed))
    missing = {points.names[p]: search.reason(p) for p in np.flatnonzero(~placed).tolist()}
    return Approximation(search.xyz, values, found, missing)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Every observation between two points (or of one) that can place a point, in one table of m rows.

    code       RANGE ... COORDINATE
    origin     (m,) index of the point measured from; of a coordinate, the point
    target     (m,) index of the point measured to; -1 for a coordinate
    observed   (m,) m or rad; an inclination as a zenith angle, a range without scale and zero
    shift      (m, 3) m added to target minus origin
    sigma      (m,) m or rad
    which      (m,) set of a direction (GROUND: an azimuth), axis of a difference or coordinate; else 0
    """

    code: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    observed: np.ndarray
    shift: np.ndarray
    sigma: np.ndarray
    which: np.ndarray

    def only(self, chosen: np.ndarray) -> "_Rows":
        """The rows where `chosen` (m,) is True, or at these indices."""
        return _Rows(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def __len__(self) -> int:
        return len(self.code)


def _parts(network: Network) -> Iterator[tuple[Observations, np.ndarray]]:
    """Groups with their variances; a joint group part by part."""
    for group in network.groups:
        if not isinstance(group, Joint):
            yield group, variances(group)
            continue
        cut = 0
        for part in group.parts:
            m = len(part.observed)
            yield replace(cast(Any, part), observed=group.observed[cut : cut + m]), variances(group)[cut : cut + m]
            cut += m


def _directions_of(network: Network) -> Network:
    """The network with directions alone: all that a network wants whose points are given."""
    return replace(network, groups=tuple(g for g in network.groups if isinstance(g, Directions | Joint)))


def _read(network: Network) -> _Rows:
    """The table of a network's observations."""
    n = len(network.points.names)
    start = np.concatenate([np.zeros(3 * n), [p.start for p in network.parameters]])
    tables: list[_Rows] = []
    sets = len(start)  # angles make sets of their own, after those whose orientation is a parameter

    def add(code: int, ends: tuple, observed: np.ndarray, variance: np.ndarray, **more: np.ndarray | None) -> None:
        m, shift = len(observed), more.get("shift")
        wide = np.broadcast_to(np.zeros(3) if shift is None else shift, (m, 3))
        origin, target = (np.broadcast_to(np.asarray(end) // 3, (m,)) for end in ends)
        which = np.broadcast_to(np.asarray(more.get("which", 0)), (m,))
        tables.append(_Rows(np.full(m, code), origin, target, observed, wide, np.sqrt(variance), which))

    for group, variance in _parts(network):
        match group:
            case Distances():
                add(RANGE, group.ends, _length(group, start), variance, shift=group.shift)
            case FixedDistances():
                add(RANGE, group.ends, group.observed, variance, shift=group.shift)
            case HorizontalDistances():
                add(LEVEL, group.ends, _length(group, start), variance, shift=group.shift)
            case Directions():
                add(BEARING, group.ends, group.observed, variance, shift=group.shift, which=group.orientation)
            case Azimuths():
                add(BEARING, group.ends, group.observed, variance, shift=group.shift, which=np.array(GROUND))
            case Angles():
                for at, target, reading, row, circle in _circles(group):
                    shift = group.foresight_shift if target == group.foresight[row] else group.backsight_shift
                    one = None if shift is None else np.broadcast_to(shift, (len(variance), 3))[[row]]
                    which = np.array([sets + circle])
                    add(BEARING, (at, target), np.array([reading]), variance[[row]], shift=one, which=which)
                sets += 2 * len(group.observed)
            case ZenithAngles():
                add(ZENITH, group.ends, group.observed, variance, shift=group.shift)
            case Inclinations():
                zenith = np.pi / 2 - group.observed + value(start, group.columns[:, 6])
                add(ZENITH, group.ends, zenith, variance, shift=group.shift)
            case HeightDifferences():
                add(DIFFERENCE, group.ends, group.observed, variance, shift=group.shift, which=np.array(2))
            case Vectors():
                wide = np.broadcast_to(np.zeros(3) if group.shift is None else group.shift, (len(group.origin), 3))
                axis = np.tile(np.arange(3), len(group.origin))
                add(DIFFERENCE, group.ends, group.observed, variance, shift=np.repeat(wide, 3, axis=0), which=axis)
            case Coordinates():
                add(COORDINATE, (group.point, -1), group.observed, variance, which=group.axis)
            case LevelPlanes():
                height = group.observed - group.height
                for level in np.unique(group.columns[:, 1]):
                    same = np.flatnonzero(group.columns[:, 1] == level)
                    point, up, v = group.point[same], height[same], variance[same]
                    if level < 0:
                        add(COORDINATE, (point, -1), up, v, which=np.array(2))
                    else:
                        add(DIFFERENCE, (point[0], point[1:]), up[1:] - up[0], v[1:] + v[0], which=np.array(2))
    if not tables:
        return _Rows(*(np.zeros(0, int),) * 3, np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0, int))
    return _Rows(*(np.concatenate([getattr(t, name) for t in tables]) for name in _Rows.__dataclass_fields__))


def _length(group: Distances | HorizontalDistances, start: np.ndarray) -> np.ndarray:
    """Observed lengths (m,) freed of offset and scale, as far as the start values know them."""
    nuisance, scaling = reading_columns(group)
    offset = group.offset + np.sum(np.where(nuisance < 0, 0.0, group.coefficient) * value(start, nuisance), axis=1)
    factor = np.sum(np.where(scaling < 0, 0.0, group.scaling_coefficient) * value(start, scaling), axis=1)
    return (group.observed - offset) / (group.scale + factor)


def _circles(group: Angles) -> Iterator[tuple[int, int, float, int, int]]:
    """Angles as readings of circles, one for those that share sights: (at, target, reading, row, circle)."""
    ties: dict[tuple[int, int], list[tuple[int, float, int]]] = defaultdict(list)
    for row, (at, back, fore) in enumerate(zip(group.at, group.backsight, group.foresight, strict=True)):
        ties[at, back].append((fore, group.observed[row], row))
        ties[at, fore].append((back, -group.observed[row], row))
    done: set[tuple[int, int]] = set()
    for circle, first in enumerate(ties):
        waiting = [(first[1], 0.0, ties[first][0][2])]
        while waiting:
            target, reading, row = waiting.pop()
            if (first[0], target) not in done:
                done.add((first[0], target))
                yield first[0], target, reading, row, circle
                waiting += [(other, reading + angle, k) for other, angle, k in ties[first[0], target]]


def _given_orientations(network: Network) -> dict[int, float]:
    """Column -> orientation, of those held or with a prior."""
    n = 3 * len(network.points.names)
    return {n + k: p.start for k, p in enumerate(network.parameters) if np.isfinite(p.sigma)} | {GROUND: 0.0}


def _levels(network: Network, xyz: np.ndarray) -> Iterator[tuple[int, float]]:
    """Column and height of each level plane, from its placed points."""
    for group, _ in _parts(network):
        if isinstance(group, LevelPlanes):
            height = xyz[group.point // 3, 2] + group.height - group.observed
            for column in np.unique(group.columns[:, 1]):
                known = height[(group.columns[:, 1] == column) & np.isfinite(height)]
                if column >= 0 and len(known):
                    yield int(column), float(np.median(known))


def _bodies(network: Network, values: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Points (k,), their coordinates in the body (k, 3), pose columns (6,) and R0 of each body or frame."""
    whole = np.concatenate([np.zeros(3 * len(network.points.names)), values])
    for group, _ in _parts(network):
        if not isinstance(group, RigidBodies | FramePoints):
            continue
        k = len(group.point)
        local = np.asarray(group.observed).reshape(k, 3)
        if isinstance(group, FramePoints):
            own = np.where(group.frame_point[:, None] < 0, -1, group.frame_point[:, None] + np.arange(3))
            local = local + value(whole, own)
        pose, start = np.broadcast_to(group.pose, (k, 6)), np.broadcast_to(group.start, (k, 3, 3))
        for columns in np.unique(pose, axis=0):
            at = np.flatnonzero((pose == columns).all(axis=1))
            yield group.point[at] // 3, local[at], columns, start[at[0]]


def _poses(network: Network, xyz: np.ndarray, values: np.ndarray) -> Iterator[tuple[int, float]]:
    """Column and start of each pose whose six parameters are unknown, from at least three placed points off a line."""
    for point, local, columns, start in _bodies(network, values):
        motion = _motion(local, xyz[point])
        if motion is not None and np.all(columns >= 0):
            turn, shift = motion
            yield from zip(columns.tolist(), [*shift, *to_vector(turn @ start.T)], strict=True)


def _motion(local: np.ndarray, ground: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """R and T with ground = T + R local, from the rows known in both; None if fewer than three or in line."""
    known = np.isfinite(ground).all(axis=1) & np.isfinite(local).all(axis=1)
    if known.sum() < 3 or np.linalg.matrix_rank(local[known] - local[known].mean(axis=0), tol=1e-3) < 2:
        return None
    turn = closed_form(local[known], ground[known])[0]
    return turn, ground[known].mean(axis=0) - turn @ local[known].mean(axis=0)


class _Search:
    """Points placed so far, orientations found so far, and how to go on."""

    def __init__(
        self,
        rows: _Rows,
        xyz: np.ndarray,
        orientations: dict[int, float],
        bodies: list[tuple[np.ndarray, np.ndarray]],
    ) -> None:
        self.rows, self.xyz, self.bodies = rows, xyz, bodies
        self.given, self.orientations = frozenset(orientations), dict(orientations)
        ends = np.concatenate([rows.origin, rows.target])
        self._order = np.argsort(ends, kind="stable")
        self._first = np.searchsorted(ends[self._order], np.arange(len(xyz) + 1))
        self._tried: dict[int, tuple[float, float, int]] = {}
        self.why: dict[int, str] = {}
        self.unfolding: dict[int, str] = {}

    def touching(self, p: int) -> np.ndarray:
        """Indices of the rows at a point."""
        return self._order[self._first[p] : self._first[p + 1]] % len(self.rows)

    @property
    def unplaced(self) -> np.ndarray:
        return np.flatnonzero(~np.isfinite(self.xyz).all(axis=1))

    def place_all(self) -> None:
        """Places what can be placed: from placed points, by local networks, and last where one of two fits better."""
        self.spread()
        while len(self.unplaced) and (_attach_level(self) or _attach_ranges(self)):
            self.spread()
        while self._sweep(LENIENT, 1.5):
            self.spread()

    def spread(self) -> None:
        """Places points from placed ones, those with good geometry first."""
        while self._sweep(STRICT, DECIDED) or self._sweep(LENIENT, DECIDED):
            pass

    def _sweep(self, strictness: float, decided: float) -> bool:
        """Tries every point once; whether a coordinate was found."""
        before = int(np.isfinite(self.xyz).sum())
        self.orient_sets()
        self._place_by_ranges()
        for point, local in self.bodies:
            motion = _motion(local, self.xyz[point])
            if motion is not None:
                lost = ~np.isfinite(self.xyz[point]).all(axis=1) & np.isfinite(local).all(axis=1)
                self.xyz[point[lost]] = motion[1] + local[lost] @ motion[0].T
        for p in self.unplaced:
            usable = self._usable(p)
            attempt = (strictness, decided, len(usable))
            if len(usable) and self._tried.get(p) != attempt:
                self._tried[p] = attempt
                self._place(p, self.rows.only(usable), strictness, decided)
        return int(np.isfinite(self.xyz).sum()) > before

    def _usable(self, p: int) -> np.ndarray:
        """Rows at a point whose other end, and whose orientation, are known; or whose set is the point's own."""
        touching = self.touching(p)
        r = self.rows.only(touching)
        other = np.where(r.origin == p, r.target, r.origin)
        known = np.isfinite(self.xyz[other])
        oriented = np.array([w in self.orientations for w in r.which.tolist()], dtype=bool)
        one = known[np.arange(len(r)), np.where(r.code == DIFFERENCE, r.which, 0)]
        level = known[:, :2].all(axis=1)
        fit = [known.all(axis=1), level, level & (oriented | (r.origin == p)), known.all(axis=1), one, True]
        return touching[np.choose(r.code, np.broadcast_arrays(*fit))]

    def _place(self, p: int, rows: _Rows, strictness: float, decided: float) -> None:
        """Places a point if one position fits clearly better than others; else its plan, and its height, alone."""
        ties = _Ties.of(p, rows, self.xyz, self.orientations)
        if self._take(p, ties, slice(3), strictness, decided):
            return
        level = (ties.code == LEVEL) | (ties.code == BEARING) | ((ties.code == COORDINATE) & (ties.axis < 2))
        self._take(p, ties.in_plan(level), slice(2), strictness, decided)
        up = (ties.code == COORDINATE) & (ties.axis == 2)
        if np.isnan(self.xyz[p, 2]) and up.any():
            self.xyz[p, 2] = np.average(ties.observed[up], weights=ties.weight[up] ** 2)

    def _take(self, p: int, ties: "_Ties", part: slice, strictness: float, decided: float) -> bool:
        """Takes x, y, z or x, y of the one position that fits; whether they are known then."""
        if np.isfinite(self.xyz[p, part]).all():
            return True
        x, cost, held = ties.solved(strictness)
        if not held[part].all():
            return False
        apart = np.linalg.norm((x - x[0])[:, part], axis=1) > 0.01 * ties.size
        if np.any(apart & (cost < decided * cost[0] + BY_NOISE)):
            self.why[p] = " and two positions fit"
            return False
        self.xyz[p, part] = np.where(np.isfinite(self.xyz[p, part]), self.xyz[p, part], x[0, part])
        return True

    def _place_by_ranges(self) -> None:
        """Places, many at once, the points that four or more ranges decide; others wait for other sightings."""
        r = self.rows
        plain = (r.code == RANGE) & ~r.shift.any(axis=1)
        known = np.isfinite(self.xyz).all(axis=1)
        for origin, target in ((r.origin, r.target), (r.target, r.origin)):
            chosen = np.flatnonzero(plain & known[origin] & ~known[target])
            if not len(chosen):
                continue
            order = chosen[np.argsort(target[chosen], kind="stable")]
            cuts = np.arange(BLOCK, len(order), BLOCK)
            cuts = np.unique(np.searchsorted(target[order], target[order][cuts]))  # a point's ranges stay together
            for part in np.split(order, cuts):
                self._place_block(origin[part], target[part], r.observed[part], r.sigma[part])

    def _place_block(self, origin: np.ndarray, target: np.ndarray, observed: np.ndarray, sigma: np.ndarray) -> None:
        """Places the targets of some ranges from placed origins where four or more decide."""
        points, at = np.unique(target, return_inverse=True)
        anchors, by = np.unique(origin, return_inverse=True)
        ranges = np.full((len(points), len(anchors)), np.nan)
        ranges[at, by] = observed
        ranges, points = ranges[(enough := np.isfinite(ranges).sum(axis=1) >= 4)], points[enough]
        if not len(points):
            return
        xyz, rms = locate(self.xyz[anchors], ranges)
        noise = (np.median(sigma) ** 2 + FLOOR**2) / np.isfinite(ranges).sum(axis=1)
        with np.errstate(invalid="ignore"):
            clear = rms[:, 1] ** 2 > DECIDED * rms[:, 0] ** 2 + BY_NOISE * noise
        self.xyz[points[clear]] = xyz[clear, 0]

    def orient_sets(self) -> None:
        """The orientation of every set with a placed station and target: the median over its longer sights."""
        r = self.rows
        known = np.isfinite(self.xyz[:, :2]).all(axis=1)
        seen = np.flatnonzero((r.code == BEARING) & known[r.origin] & known[r.target])
        along = self.xyz[r.target[seen]] - self.xyz[r.origin[seen]] + r.shift[seen]
        turn = np.arctan2(along[:, 0], along[:, 1]) - r.observed[seen]
        if not len(seen):
            return
        far = np.hypot(along[:, 0], along[:, 1])
        order = np.argsort(r.which[seen], kind="stable")
        sets, first = np.unique(r.which[seen][order], return_index=True)
        for which, part in zip(sets.tolist(), np.split(order, first[1:]), strict=True):
            if which not in self.given and len(part):
                part = part[far[part] >= 0.3 * far[part].max()]
                zero = turn[part[np.argmax(far[part])]]
                self.orientations[which] = float(_wrapped(zero + np.median(_wrapped(turn[part] - zero))))

    def reason(self, p: int) -> str:
        """Why a point has no coordinates."""
        touching, usable = self.touching(p), self._usable(p)
        if not len(touching):
            return "no observation holds it"
        text = f"seen by {_counted(self.rows.code[touching])}"
        if len(usable) < len(touching):
            text += f", of which {_counted(self.rows.code[usable])} from placed points"
        else:
            text += " only"
        held = [name for name, known in zip("xyz", np.isfinite(self.xyz[p]), strict=True) if known]
        text += f" ({', '.join(held)} found)" if held else ""
        return text + self.unfolding.get(p, self.why.get(p, ""))


def _counted(codes: np.ndarray) -> str:
    """Codes in words: "2 ranges, 1 direction"."""
    many = Counter(codes.tolist())
    return ", ".join(f"{k} {WORDS[code]}{'s' if k > 1 else ''}" for code, k in sorted(many.items())) or "none"


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@dataclass(frozen=True, eq=False)
class _Ties:
    """What ties one point to placed ones; m rows, residuals in metres over their standard uncertainties.

    code       (m,) RANGE ... COORDINATE; differences have become coordinates
    anchor     (m, 3) m, where the sight begins or ends, heights of instrument and target applied
    sense      (m,) 1 where the point is the target, -1 where it is the origin
    observed   (m,) m or rad; oriented where the orientation is known
    arm        (m,) m, what turns radians into metres: the measured distance, else the size
    weight     (m,) 1/m
    own        (m,) the point's own unoriented set, numbered from 0; -1 for others
    axis       (m,) of a coordinate
    size       m, of the surroundings
    """

    code: np.ndarray
    anchor: np.ndarray
    sense: np.ndarray
    observed: np.ndarray
    arm: np.ndarray
    weight: np.ndarray
    own: np.ndarray
    axis: np.ndarray
    size: float

    @classmethod
    def of(cls, p: int, r: _Rows, xyz: np.ndarray, orientations: dict[int, float]) -> "_Ties":
        """Ties of point p by usable rows; coordinates of p that are known tie it too."""
        sense = np.where(r.origin == p, -1.0, 1.0)
        other = np.where(r.origin == p, r.target, r.origin)
        anchor = xyz[other] - sense[:, None] * r.shift
        oriented = np.array([w in orientations for w in r.which.tolist()], dtype=bool)
        observed = r.observed + np.where(r.code == BEARING, [orientations.get(w, 0.0) for w in r.which.tolist()], 0.0)
        step = r.code == DIFFERENCE
        observed[step] = anchor[step, r.which[step]] + sense[step] * r.observed[step]
        code = np.where(step, COORDINATE, r.code)
        own = np.full(len(r), -1)
        free = (code == BEARING) & ~oriented
        own[free] = np.unique(r.which[free], return_inverse=True)[1]
        lengths = (code == RANGE) | (code == LEVEL)
        about = anchor[code != COORDINATE, :2]
        size = float(max([*np.ptp(about, axis=0)] if len(about) else [0.0])) or 0.0
        size = max([size, *observed[lengths]]) or 1.0
        measured = dict(zip(other[lengths].tolist(), observed[lengths].tolist(), strict=True))
        arm = np.array([measured.get(k, size) for k in other.tolist()])
        angular = (code == BEARING) | (code == ZENITH)
        weight = 1.0 / np.hypot(np.where(angular, arm, 1.0) * r.sigma, FLOOR)
        ties = cls(code, anchor, sense, observed, arm, weight, own, r.which, size)
        return ties._with_known(xyz[p])

    def _with_known(self, at: np.ndarray) -> "_Ties":
        """With a coordinate for each of the point's own that is known."""
        axis = np.flatnonzero(np.isfinite(at))
        if not len(axis):
            return self
        k, zero = len(axis), np.zeros((len(axis), 3))
        more = (np.full(k, COORDINATE), zero, np.ones(k), at[axis], np.ones(k), np.full(k, 1e6), np.full(k, -1), axis)
        names = list(self.__dataclass_fields__)[:-1]
        joined = {n: np.concatenate([getattr(self, n), m]) for n, m in zip(names, more, strict=True)}
        return replace(self, **cast(Any, joined))

    def in_plan(self, level: np.ndarray) -> "_Ties":
        """Those of the ties (m,) that do not depend on height, in the plane z = 0."""
        names = list(self.__dataclass_fields__)[:-1]
        flat = replace(self, **cast(Any, {n: getattr(self, n)[level] for n in names}))
        return flat._with_known(np.array([np.nan, np.nan, 0.0]))

    def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residuals (b, m) and their derivatives (b, m, 3), of the predicted value, at b positions."""
        along = np.nan_to_num(x[:, None] - self.anchor)
        tiny = 1e-9 * self.size
        far = np.maximum(np.hypot(along[..., 0], along[..., 1]), tiny)
        long = np.hypot(far, along[..., 2])
        flat = along * (1.0, 1.0, 0.0)
        v, slope = np.zeros(along.shape[:2]), np.zeros(along.shape)
        for code, size, direction in ((RANGE, long, along), (LEVEL, far, flat)):
            k = self.code == code
            v[:, k], slope[:, k] = (self.observed - size)[:, k], (direction / size[..., None])[:, k]
        k = self.code == BEARING
        azimuth = np.arctan2(self.sense * along[..., 0], self.sense * along[..., 1])
        turn = np.stack([along[..., 1], -along[..., 0], 0 * far], axis=-1) / (far**2)[..., None]
        v[:, k], slope[:, k] = _wrapped(self.observed - azimuth)[:, k], turn[:, k]
        for own in range(self.own.max(initial=-1) + 1):  # the orientation of the point's own set is eliminated
            k = self.own == own
            mean = np.angle(np.mean(np.exp(1j * v[:, k]), axis=1, keepdims=True))
            v[:, k] = _wrapped(v[:, k] - mean)
            slope[:, k] -= slope[:, k].mean(axis=1, keepdims=True)
        k = self.code == ZENITH
        up = along[..., 2]
        fall = np.stack([up * along[..., 0] / far, up * along[..., 1] / far, -far], axis=-1)
        fall = fall * (self.sense / long**2)[..., None]
        v[:, k], slope[:, k] = (self.observed - np.arctan2(far, self.sense * up))[:, k], fall[:, k]
        angular = (self.code == BEARING) | (self.code == ZENITH)
        k = self.code == COORDINATE
        v[:, k] = self.observed[k] - x[:, self.axis[k]]
        slope[:, k] = np.eye(3)[self.axis[k]]
        scale = self.weight * np.where(angular, self.arm, 1.0)
        return v * scale, slope * scale[:, None]

    def solved(self, strictness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (b, 3) by rising cost (b,), and which of the best one's coordinates (3,) the ties hold."""
        x = self.starts()
        v, slope = self.residuals(x)
        cost, damping, step = np.sum(v**2, axis=1), np.full(len(x), 1e-2), np.full(x.shape, np.inf)
        for _ in range(60):
            normal = np.swapaxes(slope, 1, 2) @ slope
            scale = np.einsum("bii->b", normal) / 3 * damping + 1e-30
            right = np.einsum("bmi,bm->bi", slope, v)
            step = np.linalg.solve(normal + scale[:, None, None] * np.eye(3), right[..., None])[..., 0]
            step *= np.minimum(1.0, self.size / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
            trial_v, trial_slope = self.residuals(x + step)
            trial = np.sum(trial_v**2, axis=1)
            better = trial <= cost
            x = np.where(better[:, None], x + step, x)
            v, slope = np.where(better[:, None], trial_v, v), np.where(better[:, None, None], trial_slope, slope)
            cost, damping = np.where(better, trial, cost), np.clip(damping * np.where(better, 0.1, 8.0), 1e-12, 1e9)
            if np.all(np.linalg.norm(step, axis=1) < 1e-8 * self.size):
                break
        settled = np.linalg.norm(step, axis=1) < 1e-3 * self.size
        order = np.argsort(cost, kind="stable")
        order = order[settled[order] | (order == order[0])]
        plain = slope[order[0]] / self.weight[:, None]
        values, axes = np.linalg.eigh(plain.T @ plain)
        loose = axes[:, values < strictness * values[2]]
        held = np.sum(loose**2, axis=1) < 1e-4
        return x[order], cost[order], held

    def starts(self) -> np.ndarray:
        """Positions (b, 3) to begin from: polar ones, those of three ranges, else all around the known points."""
        known = np.full(3, np.nan)
        k = self.code == COORDINATE
        known[self.axis[k]] = self.observed[k]
        found = list(self._polar())
        k = self.code == RANGE
        if k.sum() >= 3 and not found:
            both = locate(self.anchor[k], self.observed[None, k])[0][0]
            found = [x for x in both if np.isfinite(x).all()]
        if found:
            return np.where(np.isfinite(known), known, np.array(found))
        about = self.anchor[self.code != COORDINATE]
        middle = np.nan_to_num(about).sum(axis=0) / np.maximum(np.isfinite(about).sum(axis=0), 1)
        angle = np.arange(12) * np.pi / 6 + 0.1
        rise = (0.0,) if np.any(self.code == ZENITH) or np.isfinite(known[2]) else (0.0, 1.0, -1.0)
        ring = [(r * np.sin(a), r * np.cos(a), h * r) for r in RADII for a in angle for h in rise]
        x = middle + 0.5 * self.size * np.array(ring)
        return np.where(np.isfinite(known), known, x)

    def _polar(self) -> Iterator[np.ndarray]:
        """Positions from one oriented direction, distance and zenith angle (level where there is none) at one point."""
        for b in np.flatnonzero((self.code == BEARING) & (self.own < 0)):
            same = np.all(self.anchor[:, :2] == self.anchor[b, :2], axis=1)
            distance = np.flatnonzero(same & ((self.code == RANGE) | (self.code == LEVEL)))
            zenith = np.flatnonzero(same & (self.code == ZENITH))
            if len(distance) and (len(zenith) or self.code[distance[0]] == LEVEL):
                d = distance[0]
                tilt = self.observed[zenith[0]] if len(zenith) else np.pi / 2
                far = self.observed[d] * (np.sin(tilt) if self.code[d] == RANGE else 1.0)
                up = far / np.tan(tilt) if abs(np.sin(tilt)) > 1e-9 else np.cos(tilt) * self.observed[d]
                along = np.array([far * np.sin(self.observed[b]), far * np.cos(self.observed[b]), up])
                yield np.nan_to_num(self.anchor[d]) + self.sense[b] * along


def _attach_level(search: _Search) -> bool:
    """Places points by local networks about a station, level and turned anyhow; whether any was placed.

    The directions of the station's set with all else give local coordinates; two placed points among them (or one, and
    an azimuth) say where it belongs. If the network gives no two points, the largest is laid down as it is.
    """
    r = search.rows
    local_rows = np.ones(len(r), dtype=bool)
    local_rows[(r.code == COORDINATE) | ((r.code == DIFFERENCE) & (r.which < 2))] = False
    local_rows[(r.code == BEARING) & np.isin(r.which, list(search.given))] = False
    rows = r.only(local_rows)
    turned = rows.only(rows.code == BEARING)
    sets = Counter(zip(turned.which.tolist(), turned.origin.tolist(), strict=True))
    unplaced, covered = set(search.unplaced.tolist()), set[int]()
    frames = []
    for which, station in (key for key, _ in sets.most_common()):
        seen = {station, *turned.target[turned.which == which].tolist()}
        if not (seen & unplaced) - covered:
            continue
        frame = _Search(rows, np.full(search.xyz.shape, np.nan), {which: 0.0}, search.bodies)
        frame.xyz[station] = 0.0
        frame.spread()
        covered |= seen & set(np.flatnonzero(np.isfinite(frame.xyz[:, :2]).all(axis=1)).tolist())
        if np.isfinite(frame.xyz[:, :2]).all(axis=1).sum() > 1:
            frames.append(frame)
    frames.sort(key=lambda f: -int(np.isfinite(f.xyz).sum()))
    return any(_helmert(search, frame) for frame in frames)


def _helmert(search: _Search, frame: _Search) -> bool:
    """Lays a level local network on the placed points, turned about the vertical; whether it placed any coordinate."""
    level = np.isfinite(frame.xyz[:, :2]).all(axis=1)
    placed = np.isfinite(search.xyz[:, :2]).all(axis=1)
    both = np.flatnonzero(level & placed)
    ours, theirs = (xyz[both, 0] + 1j * xyz[both, 1] for xyz in (search.xyz, frame.xyz))
    r = search.rows
    azimuth = (r.code == BEARING) & np.isin(r.which, list(search.given)) & level[r.origin] & level[r.target]
    turn = 0.0
    if len(both) >= 2 and np.ptp(np.abs(theirs - theirs[0])) > 0.0:
        turn = float(np.angle(np.sum((ours - ours.mean()) * np.conj(theirs - theirs.mean()))))
    elif azimuth.any():
        along = frame.xyz[r.target[azimuth]] - frame.xyz[r.origin[azimuth]] + r.shift[azimuth]
        given = r.observed[azimuth] + [search.orientations[w] for w in r.which[azimuth].tolist()]
        turn = -float(np.angle(np.mean(np.exp(1j * (given - np.arctan2(along[:, 0], along[:, 1]))))))
    elif placed.sum() > len(both) or len(both) > 1:
        return False
    if not len(both) and placed.any():
        return False
    spot = (frame.xyz[:, 0] + 1j * frame.xyz[:, 1]) * np.exp(1j * turn)
    spot = spot + (ours.mean() - spot[both].mean() if len(both) else 0.0)
    rise = search.xyz[:, 2] - frame.xyz[:, 2]
    height = np.median(rise[np.isfinite(rise)]) if np.isfinite(rise).any() else 0.0
    free = not np.isfinite(search.xyz[:, 2]).any()
    up = frame.xyz[:, 2] + (height if free or np.isfinite(rise).any() else np.nan)
    return _filled(search, np.stack([spot.real, spot.imag, up], axis=1))


def _filled(search: _Search, xyz: np.ndarray) -> bool:
    """Takes coordinates where there are none; whether there were any."""
    new = ~np.isfinite(search.xyz) & np.isfinite(xyz)
    search.xyz[new] = xyz[new]
    return bool(new.any())


def _attach_ranges(search: _Search) -> bool:
    """Places points by figures unfolded from ranges alone; whether any was placed.

    Points that range each other all give a figure by classical scaling, stations and targets by unfolding; what the
    other ranges tie to it follows. Three placed points off a line say where it belongs, and of its mirror images the
    one that fits a fourth off their plane, or zenith angles and height differences. If the network gives fewer points,
    the figure is laid down as it is, on those that it gives.
    """
    r = search.rows
    rows = r.only((r.code == RANGE) & ~r.shift.any(axis=1))
    done: set[int] = set()
    placed = set(np.flatnonzero(np.isfinite(search.xyz).all(axis=1)).tolist())
    for p in search.unplaced.tolist():
        if p in done or not len(rows):
            continue
        group = _hanging_together(rows, p)
        done |= set(group)
        frame = _Search(rows, np.full(search.xyz.shape, np.nan), {}, [])
        why = _figure(frame, group)
        why = why or _laid_down(search, frame)
        if not why:
            return True
        if len(group) > 1 and not (placed & set(group) and why.startswith(TOO_FEW.split("{")[0])):
            search.unfolding |= dict.fromkeys(group, f"; {why}")
    return False


def _hanging_together(rows: _Rows, first: int) -> list[int]:
    """The points that ranges connect with one."""
    ties = defaultdict(set)
    for a, b in zip(rows.origin.tolist(), rows.target.tolist(), strict=True):
        ties[a].add(b)
        ties[b].add(a)
    group, waiting = {first}, [first]
    while waiting:
        new = ties[waiting.pop()] - group
        group |= new
        waiting += new
    return sorted(group)


def _figure(frame: _Search, group: list[int]) -> str:
    """Fills a frame from the ranges between a group of points alone; why not, or nothing."""
    rows = frame.rows.only(np.isin(frame.rows.origin, group))
    if not len(rows):
        return "no range holds it"
    distance = dict(zip(zip(rows.origin.tolist(), rows.target.tolist(), strict=True), rows.observed, strict=True))
    distance |= {(b, a): d for (a, b), d in distance.items()}
    clique = _clique(distance)
    if len(clique) >= 4:
        table = np.array([[distance.get((a, b), 0.0) for b in clique] for a in clique])
        xyz, values = classical_scaling(table)
        if values[2] > STRICT * values[0]:
            frame.xyz[clique] = xyz
            frame.spread()
            return ""
    stations = np.unique(rows.origin)
    targets = np.setdiff1d(group, stations)
    ranges = np.array([[distance.get((a, b), np.nan) for b in targets.tolist()] for a in stations.tolist()])
    status, sigma = "", float(np.median(rows.sigma))
    for factor in (1.0, 10.0, 100.0):  # zeros and scales of the rangers that are still unknown make ranges worse
        found = unfold(ranges, factor * sigma)
        status = found.status
        if not status.startswith(NO_FIT.split("{")[0]):
            break
    if status != UNFOLDED:
        return status
    frame.xyz[stations], frame.xyz[targets] = found.stations, found.targets
    frame.spread()
    return ""


def _clique(distance: dict[tuple[int, int], float]) -> list[int]:
    """Points that have distances to each other all, grown from the one with the most."""
    ties = defaultdict(set)
    for a, b in distance:
        ties[a].add(b)
    order = sorted(ties, key=lambda p: -len(ties[p]))
    best: list[int] = []
    for first in order[:20]:
        clique, open_ = [first], set(ties[first])
        while open_:
            clique.append(max(open_, key=lambda p: len(ties[p] & open_)))
            open_ &= ties[clique[-1]]
        best = max(best, clique, key=len)
    return best


def _laid_down(search: _Search, frame: _Search) -> str:
    """Lays a figure that may be turned and mirrored on the placed points; why not, or nothing."""
    placed, here = (np.isfinite(xyz).all(axis=1) for xyz in (search.xyz, frame.xyz))
    both = placed & here
    tries = []
    for mirror in (1.0, -1.0):
        local = frame.xyz * (1.0, 1.0, mirror)
        motion = _motion(local[both], search.xyz[both])
        if motion is None:
            break
        xyz = motion[1] + local @ motion[0].T
        apart = float(np.sqrt(np.mean((xyz - search.xyz)[both] ** 2)))
        tries.append((apart, _misfit_of_heights(search.rows, xyz), xyz))
    if not tries:
        turned = (search.rows.code != RANGE) & here[search.rows.origin] & here[search.rows.target]
        if placed.sum() > both.sum() or turned.any():
            return f"of {int(here.sum())} points that ranges tie together {int(both.sum())} are placed, 3 are needed"
        turn = closed_form(frame.xyz[both], search.xyz[both])[0] if both.sum() > 1 else np.eye(3)
        shift = search.xyz[both].mean(axis=0) - turn @ frame.xyz[both].mean(axis=0) if both.any() else np.zeros(3)
        return "" if _filled(search, frame.xyz @ turn.T + shift) else "nothing new"
    for by in (0, 1):
        first, second = sorted(tries, key=lambda t: t[by])
        if second[by] > 3 * first[by] + 10 * FLOOR:
            return "" if _filled(search, first[2]) else "nothing new"
    return "a mirror image fits as well; give one more point off the plane of the others, or a zenith angle"


def _misfit_of_heights(r: _Rows, xyz: np.ndarray) -> float:
    """Median misfit, m, of what tells up from down: zenith angles and height differences; 0 without any."""
    up = (r.code == ZENITH) | ((r.code == DIFFERENCE) & (r.which == 2))
    r = r.only(up & np.isfinite(xyz[r.origin]).all(axis=1) & np.isfinite(xyz[r.target]).all(axis=1))
    if not len(r):
        return 0.0
    along = xyz[r.target] - xyz[r.origin] + r.shift
    rise = np.where(r.code == ZENITH, np.linalg.norm(along, axis=1) * np.cos(r.observed), r.observed)
    return float(np.median(np.abs(rise - along[:, 2])))
