"""Check of points against the design of a dish.

Inside its aperture, on its paraboloid, each at the place of its own name. A paraboloid is the same from all sides,
so that a fit passes prisms with exchanged or mirrored axes; the aperture of an offset dish, and the names of its
prisms, do not.
"""

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import PARAMETERS, POSE, PlacedParaboloid, place_paraboloid
from catseye.geometry.frames.frame import Transform
from catseye.reduction.surface.dish import DishDesign
from catseye.reduction.surface.shape import Prisms

RIM = 0.05  # of the radius: corners of panels stand up to 0.028 outside the circle (examples/sites/gbt)
AXES = "xyz"
ROUNDING = 1e-6  # of the radius: rounding of coordinates in tables
FAR_ENOUGH = 0.6  # of the radius of a dish without a site: points that reach less far do not fill its aperture
HALF, DOUBLE = (0.4, 0.6), (1.6, 2.5)  # of the radius: reach of points where it is twice, or half, the dish's
ANOTHER_UNIT = 0.02, 50.0  # of the radius: reach of points in a unit other than their columns say


@dataclass(frozen=True, eq=False)
class DishPlacement:
    """Position of k points on a dish.

    dish       the design
    inside     points within the circle of the aperture
    outside    (k,) m beyond its rim, the panels' corners allowed for; 0 inside
    deviation  m, largest off the paraboloid of the site's focal length, at its best place; inf where none fits
    elsewhere  names of prisms that stand nearer to another's design place than to their own
    cures      changes of the axes after which every prism is inside, on the paraboloid and at its own place
    reach      distance of the farthest point from the middle of the aperture, in units of its radius
    """

    dish: DishDesign
    inside: int
    outside: np.ndarray
    deviation: float
    elsewhere: tuple[str, ...]
    cures: tuple[str, ...]
    reach: float

    @property
    def doubt(self) -> str:
        """Misfit of the points and the dish, as a text; "" for none."""
        count, faults, noun = len(self.outside), [], self.dish.noun
        if np.any(self.outside > 0.0):
            inside = f"{self.inside or 'none'} of {count}"
            faults.append(
                f"{inside} {noun} inside the aperture, the farthest {self.outside.max():.2f} m beyond its rim"
            )
        if self.deviation > self.dish.largest:
            size = f"up to {self.deviation:.3g} m off" if np.isfinite(self.deviation) else "nowhere near"
            faults.append(f"{size} its paraboloid, beyond {self.dish.limit}")
        if self.dish.site is None and self.reach < FAR_ENOUGH:
            faults.append(f"they reach only {self.reach:.2g} of its radius of {self.dish.aperture.radius:g} m")
        if self.elsewhere:
            named = ", ".join(self.elsewhere[:3]) + (" ..." if len(self.elsewhere) > 3 else "")
            faults.append(f"{len(self.elsewhere)} prisms nearer to another's design place than to their own ({named})")
        if not faults:
            return ""
        cure = f"with {' or '.join(self.cures)} they do" if self.cures else self._advice
        owner = "this dish" if self.dish.site is None else "the site's dish"
        return f"the points do not fit {owner}: {'; '.join(faults)}; {cure}"

    @property
    def _advice(self) -> str:
        """Likely mistake in the arguments."""
        if self.dish.site is not None:
            return "check the site and the units, or give focal_length_m and a size for another dish"
        size, radius = self.dish.size, self.dish.aperture.radius
        given = f"{size} = {2.0 * radius if size == 'diameter_m' else radius:g}"
        if not ANOTHER_UNIT[0] < self.reach < ANOTHER_UNIT[1]:
            return "are the coordinates in another unit than their columns say, such as mm in x_m?"
        if size == "radius_m" and HALF[0] < self.reach < HALF[1]:
            return f"is {given} the diameter?"
        if size == "diameter_m" and DOUBLE[0] < self.reach < DOUBLE[1]:
            return f"is {given} the radius?"
        return "check focal length, size, units, and vertex and axis, which must be roughly right"


def placement_of(prisms: Prisms, dish: DishDesign) -> DishPlacement:
    """Position of points on a dish, and axis changes that fit.

    prisms   as measured
    dish     design; without a site its vertex and axis are rough, and the points' own paraboloid says their place
    """
    local = prisms.nominal.inverse().points(prisms.points)
    placed = _placed(prisms.names, local, dish)
    if not placed.doubt:
        return placed
    cures = [text for text, changed in _changes(local) if not _placed(prisms.names, changed, dish).doubt]
    return replace(placed, cures=tuple(cures))


def _changes(local: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Points with two axes exchanged, all three permuted, or one reversed."""
    changed = []
    for order in list(permutations(range(3)))[1:]:
        moved = [k for k in range(3) if order[k] != k]
        text = " and ".join(AXES[k] for k in moved) if len(moved) == 2 else ", ".join(AXES[k] for k in order)
        changed.append((f"{text} exchanged" if len(moved) == 2 else f"axes in the order {text}", local[:, order]))
    changed += [(f"{AXES[k]} reversed", local * np.where(np.arange(3) == k, -1.0, 1.0)) for k in range(3)]
    return changed


def _placed(names: tuple[str, ...], local: np.ndarray, dish: DishDesign) -> DishPlacement:
    fit = _own_paraboloid(local, dish)
    if fit is not None and dish.site is None:
        local = fit.local
    size = np.linalg.norm(dish.aperture.unit(local), axis=1)
    return DishPlacement(
        dish=dish,
        inside=int((size <= 1.0 + ROUNDING).sum()),
        outside=np.maximum(size - 1.0 - RIM, 0.0) * dish.aperture.radius,
        deviation=float("inf") if fit is None else float(np.abs(fit.deviation).max()),
        elsewhere=_elsewhere(names, local, dish),
        cures=(),
        reach=float(size.max()),
    )


def _own_paraboloid(local: np.ndarray, dish: DishDesign) -> PlacedParaboloid | None:
    """Paraboloid through points (k, 3) m; None where none fits roughly in place.

    Of the design's focal length; without a site of the points' own, where they determine it.
    """
    identity = Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    for free in (POSE,) if dish.site is not None else (tuple(PARAMETERS), POSE):
        try:
            fit = place_paraboloid(local, identity, focal_length=dish.aperture.focal_length, free=free)
        except EstimationError:
            continue
        return fit if _small(fit.rotation) else None
    return None


def _small(rotation: np.ndarray) -> bool:
    """True if a turn (rad) keeps the dish's opening in place."""
    return bool(np.linalg.norm(rotation) < 0.5)


def _elsewhere(names: tuple[str, ...], local: np.ndarray, dish: DishDesign) -> tuple[str, ...]:
    """Prisms nearer to another's design place than to their own."""
    from scipy.spatial import cKDTree

    design = dish.places
    designed = [k for k, name in enumerate(names) if name in design]
    if not designed:
        return ()
    called = list(design)
    nearest = cKDTree(np.array([design[name] for name in called])).query(local[designed])[1]
    return tuple(names[k] for k, at in zip(designed, nearest.tolist(), strict=True) if called[at] != names[k])
