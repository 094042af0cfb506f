"""Places where a ranger or target may stand."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.records.site.design_layout import GOLDEN_ANGLE
from catseye.records.site.solids import Solids
from catseye.reduction.design.scene import GROUND, DesignScene
from catseye.reduction.design.vary import Variation

RETREATS = 3  # halvings of a move that would end in an obstacle
EPSILON = 1e-6  # m: within it a place is where its region allows it


@dataclass(frozen=True, eq=False)
class MovingUnit:
    """Unit that moves as one: a ranger, a target or a triplet.

    name       of it
    rows       of its points in the scene
    home       (3,) m, middle of its points before the design, in their frame
    level      True: on the ground, moves horizontally
    within     m from home; None: not limited so
    between    m, least and greatest level distance from the ground frame's origin; None: not limited so
    ranger     True for a ranger, which keeps clear of solids and of other rangers
    """

    name: str
    rows: NDArray[np.int64]
    home: Array
    level: bool
    within: float | None
    between: tuple[float, float] | None
    ranger: bool

    @property
    def reach(self) -> float:
        """Size of its region, the smaller of both limits, m."""
        sizes = [] if self.within is None else [self.within]
        sizes += [] if self.between is None else [0.5 * (self.between[1] - self.between[0])]
        return min(sizes)

    def nearest(self, place: Array) -> Array:
        """Nearest place (3,) of its region."""
        place = np.array(place, dtype=float)
        if self.level:
            place[2] = self.home[2]
        for _ in range(3):  # two convex regions, but for a ring's hole
            if self.between is not None:
                radius = float(np.hypot(place[0], place[1]))
                wanted = min(max(radius, self.between[0]), self.between[1])
                place[:2] = place[:2] * (wanted / radius) if radius > 0.0 else (wanted, 0.0)
            if self.within is not None:
                shift = place - self.home
                distance = float(np.linalg.norm(shift))
                if distance > self.within:
                    place = self.home + shift * (self.within / distance)
        return place

    def contains(self, place: Array) -> bool:
        """True for a place (3,) of its region."""
        return bool(np.linalg.norm(self.nearest(place) - place) <= EPSILON)

    def candidates(self, count: int) -> Array:
        """Places (k, 3) all over its region, at most `count`; by golden angles in a disc or ring, or in a ball."""
        k = np.arange(count)
        share, angle = (k + 0.5) / count, GOLDEN_ANGLE * k
        if self.within is None:
            assert self.between is not None
            inner, outer = self.between
            radius = np.sqrt(inner**2 + share * (outer**2 - inner**2))
            places = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, self.home[2])], axis=1)
        else:
            z = np.zeros(count) if self.level else 1.0 - 2.0 * share
            radius = self.within * (np.sqrt(share) if self.level else np.cbrt((k * 0.618033988749895) % 1.0))
            flat = radius * np.sqrt(1.0 - z * z)
            places = self.home + np.stack([flat * np.cos(angle), flat * np.sin(angle), radius * z], axis=1)
        return np.array([place for place in places if self.contains(place)]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Obstacles that rangers keep clear of.

    apart       m, least distance between two rangers
    clearance   m, least distance of a ranger from every solid
    solids      that stand there, keep-out boxes among them
    """

    apart: float
    clearance: float
    solids: Solids

    def free_of_solids(self, scene: DesignScene, places: Array) -> NDArray[np.bool_]:
        """True (k,) for ground places (k, 3) m outside every solid, in every posture."""
        free = np.ones(len(places), dtype=bool)
        for frames in scene.postures:
            for record in self.solids.all:
                at = frames[record.frame].inverse().points(places)
                step = np.array([0.0, 0.0, 2.0 * EPSILON])
                free &= ~np.isfinite(record.solid().grown(self.clearance).first_hit(at - 0.5 * step, at + 0.5 * step))
        return free


def moving_units(scene: DesignScene, variations: tuple[Variation, ...]) -> tuple[MovingUnit, ...]:
    """Units of a scene whose places vary; the first variation that names one counts.

    Raises InputError for a variation without a point, and a target's level distance.
    """
    chosen: dict[str, Variation] = {}
    for variation in variations:
        matched = [p for p in scene.points if variation.selects(p.name, p.role, not p.body)]
        if not matched:
            raise InputError(f"vary {variation.text!r}: no such {variation.role} in {scene.name}")
        if variation.between is not None and any(p.frame != GROUND for p in matched):
            raise InputError(f"vary {variation.text!r}: not on the ground (expected within L m)")
        for point in matched:
            if variation.moves:
                chosen.setdefault(point.unit, variation)
    units = []
    for name, variation in chosen.items():
        rows = np.array([i for i, p in enumerate(scene.points) if p.unit == name], dtype=int)
        first = scene.points[rows[0]]
        unit = MovingUnit(
            name=name,
            rows=rows,
            home=scene.places[rows].mean(axis=0),
            level=first.role == "ranger" and not first.body,
            within=variation.within,
            between=variation.between,
            ranger=first.role == "ranger",
        )
        if not unit.contains(unit.home):
            raise InputError(f"vary {variation.text!r}: {name} stands outside (expected a region with its place)")
        units.append(unit)
    return tuple(units)
