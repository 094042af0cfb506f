"""Placement of points one by one, or in blocks, from placed points, and orientation of sets."""

from collections import Counter

import numpy as np

from catseye.estimation.network.approximate.bodies import rigid_motion
from catseye.estimation.network.approximate.sightings import (
    BEARING,
    COORDINATE,
    DIFFERENCE,
    LEVEL,
    RANGE,
    WORDS,
    Sightings,
)
from catseye.estimation.network.approximate.ties import FLOOR, Ties, wrapped
from catseye.estimation.network.unfolding.location import locate

STRICT, LENIENT = 1e-3, 1e-7  # smallest over largest eigenvalue of a point's normal matrix: good geometry; any
DECIDED = 4.0  # a second position must fit this many times worse, in squares ...
BY_NOISE = 25.0  # ... and by more than five standard uncertainties
TWO_FIT = " and two positions fit"
MIRRORED = ", mirror images in the plane of the stations: give rough coordinates, or measure a zenith angle"
BLOCK = 20_000  # ranges per batch, to bound memory


class PlacingSearch:
    """Points and orientations found so far, and the search for more.

    sides        points on an assumed side of the plane of their stations
    conventional points of a figure, and dependent ones, without a relation to given coordinates
    why          reason for an unplaced point
    unfolding    reason why no figure of ranges placed a point
    """

    def __init__(
        self,
        rows: Sightings,
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
        self.sides: set[int] = set()
        self.conventional: set[int] = set()
        self.why: dict[int, str] = {}
        self.unfolding: dict[int, str] = {}

    def touching(self, p: int) -> np.ndarray:
        """Indices of the rows at a point."""
        return self._order[self._first[p] : self._first[p + 1]] % len(self.rows)

    def fill(self, xyz: np.ndarray) -> bool:
        """Fill missing coordinates from (n, 3); True if any were filled."""
        new = ~np.isfinite(self.xyz) & np.isfinite(xyz)
        self.xyz[new] = xyz[new]
        return bool(new.any())

    @property
    def unplaced(self) -> np.ndarray:
        return np.flatnonzero(~np.isfinite(self.xyz).all(axis=1))

    def spread(self) -> None:
        """Place points from placed ones, good geometry first."""
        while self.sweep(STRICT, DECIDED) or self.sweep(LENIENT, DECIDED):
            pass

    def sweep(self, strictness: float, decided: float) -> bool:
        """Try every point once; True if a coordinate was found."""
        before = int(np.isfinite(self.xyz).sum())
        self.orient_sets()
        self._place_by_ranges()
        self._place_by_bodies()
        for p in self.unplaced:
            usable = self._usable(p)
            attempt = (strictness, decided, len(usable))
            if len(usable) and self._tried.get(p) != attempt:
                self._tried[p] = attempt
                self._place(p, self.rows.only(usable), strictness=strictness, decided=decided)
        return int(np.isfinite(self.xyz).sum()) > before

    def _place_by_bodies(self) -> None:
        """Place the remaining points of bodies with three placed points, not collinear."""
        for point, local in self.bodies:
            motion = rigid_motion(local, self.xyz[point])
            if motion is not None:
                unplaced = ~np.isfinite(self.xyz[point]).all(axis=1) & np.isfinite(local).all(axis=1)
                self.xyz[point[unplaced]] = motion[1] + local[unplaced] @ motion[0].T

    def _usable(self, p: int) -> np.ndarray:
        """Rows at a point with known other end and orientation, or of the point's own set."""
        touching = self.touching(p)
        r = self.rows.only(touching)
        opposite = np.where(r.origin == p, r.target, r.origin)
        placed = np.isfinite(self.xyz[opposite])
        oriented = np.array([w in self.orientations for w in r.which.tolist()], dtype=bool)
        component = placed[np.arange(len(r)), np.where(r.code == DIFFERENCE, r.which, 0)]
        level = placed[:, :2].all(axis=1)
        fit = [placed.all(axis=1), level, level & (oriented | (r.origin == p)), placed.all(axis=1), component, True]
        return touching[np.choose(r.code, np.broadcast_arrays(*fit))]

    def _place(self, p: int, rows: Sightings, *, strictness: float, decided: float) -> None:
        """Place a point if one position fits clearly best.

        Otherwise place its plan position or height alone.
        """
        ties = Ties.of(p, rows, self.xyz, self.orientations)
        if self._take(p, ties, slice(3), strictness=strictness, decided=decided):
            return
        level = (ties.code == LEVEL) | (ties.code == BEARING) | ((ties.code == COORDINATE) & (ties.axis < 2))
        self._take(p, ties.in_plan(level), slice(2), strictness=strictness, decided=decided)
        up = (ties.code == COORDINATE) & (ties.axis == 2)
        if np.isnan(self.xyz[p, 2]) and up.any():
            self.xyz[p, 2] = np.average(ties.observed[up], weights=ties.weight[up] ** 2)

    def _take(self, p: int, ties: "Ties", part: slice, *, strictness: float, decided: float) -> bool:
        """Accept x, y, z or x, y of the only position that fits.

        True if they are then known.
        """
        if np.isfinite(self.xyz[p, part]).all():
            return True
        x, cost, determined = ties.solved(strictness)
        if not determined[part].all():
            return False
        apart = np.linalg.norm((x - x[0])[:, part], axis=1) > 0.01 * ties.size
        if np.any(apart & (cost < decided * cost[0] + BY_NOISE)):
            self.why[p] = TWO_FIT
            return False
        self.xyz[p, part] = np.where(np.isfinite(self.xyz[p, part]), self.xyz[p, part], x[0, part])
        return True

    def _place_by_ranges(self) -> None:
        """Place in blocks the points that four or more ranges determine."""
        r = self.rows
        plain = (r.code == RANGE) & ~r.shift.any(axis=1)
        placed = np.isfinite(self.xyz).all(axis=1)
        for origin, target in ((r.origin, r.target), (r.target, r.origin)):
            chosen = np.flatnonzero(plain & placed[origin] & ~placed[target])
            if not len(chosen):
                continue
            order = chosen[np.argsort(target[chosen], kind="stable")]
            cuts = np.arange(BLOCK, len(order), BLOCK)
            cuts = np.unique(np.searchsorted(target[order], target[order][cuts]))  # a point's ranges stay in one block
            for part in np.split(order, cuts):
                self._place_block(r.only(part), origin[part], target[part])

    def _place_block(self, r: Sightings, origin: np.ndarray, target: np.ndarray) -> None:
        """Place the targets of some ranges from placed origins, if four or more determine them."""
        points, at = np.unique(target, return_inverse=True)
        anchors, by = np.unique(origin, return_inverse=True)
        ranges = np.full((len(points), len(anchors)), np.nan)
        ranges[at, by] = r.observed
        enough = np.isfinite(ranges).sum(axis=1) >= 4
        ranges, points = ranges[enough], points[enough]
        if not len(points):
            return
        xyz, rms = locate(self.xyz[anchors], ranges)
        noise = (np.median(r.sigma) ** 2 + FLOOR**2) / np.isfinite(ranges).sum(axis=1)
        with np.errstate(invalid="ignore"):
            clear = rms[:, 1] ** 2 > DECIDED * rms[:, 0] ** 2 + BY_NOISE * noise
        self.xyz[points[clear]] = xyz[clear, 0]

    def orient_sets(self) -> None:
        """Orient every set with placed station and target: median over its longer sights."""
        r = self.rows
        placed = np.isfinite(self.xyz[:, :2]).all(axis=1)
        bearings = np.flatnonzero((r.code == BEARING) & placed[r.origin] & placed[r.target])
        along = self.xyz[r.target[bearings]] - self.xyz[r.origin[bearings]] + r.shift[bearings]
        turn = np.arctan2(along[:, 0], along[:, 1]) - r.observed[bearings]
        if not len(bearings):
            return
        far = np.hypot(along[:, 0], along[:, 1])
        order = np.argsort(r.which[bearings], kind="stable")
        sets, first = np.unique(r.which[bearings][order], return_index=True)
        for which, part in zip(sets.tolist(), np.split(order, first[1:]), strict=True):
            if which not in self.given and len(part):
                part = part[far[part] >= 0.3 * far[part].max()]
                zero = turn[part[np.argmax(far[part])]]
                self.orientations[which] = float(wrapped(zero + np.median(wrapped(turn[part] - zero))))

    def reason(self, p: int) -> str:
        """Reason why a point has no coordinates."""
        touching, usable = self.touching(p), self._usable(p)
        if not len(touching):
            return "no observation of it"
        text = f"seen by {_counted(self.rows.code[touching])}"
        if len(usable) < len(touching):
            text += f", of which {_counted(self.rows.code[usable])} from placed points"
        else:
            text += " only"
        determined = [name for name, finite in zip("xyz", np.isfinite(self.xyz[p]), strict=True) if finite]
        text += f" ({', '.join(determined)} found)" if determined else ""
        if p in self.unfolding and self.why.get(p) == TWO_FIT and np.all(self.rows.code[usable] == RANGE):
            return text + TWO_FIT + MIRRORED  # which also prevents a figure of all points
        return text + self.unfolding.get(p, self.why.get(p, ""))


def _counted(codes: np.ndarray) -> str:
    """Codes in words: "2 ranges, 1 direction"."""
    many = Counter(codes.tolist())
    return ", ".join(f"{k} {WORDS[code]}{'s' if k > 1 else ''}" for code, k in sorted(many.items())) or "none"
