"""Check of prisms against the site's dish.

Inside its aperture, on its paraboloid, each at the place of its own name. A paraboloid is the same from all sides,
so that a fit passes prisms with exchanged or mirrored axes; the aperture of an offset dish, and the names of its
prisms, do not.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import fit_paraboloid
from catseye.geometry.frames.frame import Transform
from catseye.records.panels.actuators import LIMIT_MM
from catseye.records.site.folder import SiteFolder
from catseye.reduction.surface.shape import LitAperture, Prisms

RIM = 0.05  # of the radius: corners of panels stand up to 0.028 outside the circle (examples/sites/gbt)
TRAVEL = LIMIT_MM * MILLIMETRE  # m: largest deviation of a surface on actuators from its paraboloid
AXES = "xyz"
ROUNDING = 1e-6  # of the radius: rounding of coordinates in tables


@dataclass(frozen=True, eq=False)
class DishPlacement:
    """Position of k prisms on the site's dish.

    inside     prisms within the circle of the aperture
    outside    (k,) m beyond its rim, the panels' corners allowed for; 0 inside
    deviation  m, largest off the paraboloid of the site's focal length, at its best place; inf where none fits
    elsewhere  names of prisms that stand nearer to another's design place than to their own
    cures      changes of the axes after which every prism is inside, on the paraboloid and at its own place
    """

    inside: int
    outside: np.ndarray
    deviation: float
    elsewhere: tuple[str, ...]
    cures: tuple[str, ...]

    @property
    def doubt(self) -> str:
        """Misfit of the prisms and the site's dish, as a text; "" for none."""
        count, faults = len(self.outside), []
        if np.any(self.outside > 0.0):
            inside = f"{self.inside or 'none'} of {count}"
            faults.append(
                f"{inside} prisms inside the aperture, the farthest {self.outside.max():.2f} m beyond its rim"
            )
        if self.deviation > TRAVEL:
            size = f"up to {self.deviation:.3g} m off" if np.isfinite(self.deviation) else "nowhere near"
            faults.append(f"{size} its paraboloid, beyond the actuators' {TRAVEL / MILLIMETRE:g} mm")
        if self.elsewhere:
            named = ", ".join(self.elsewhere[:3]) + (" ..." if len(self.elsewhere) > 3 else "")
            faults.append(f"{len(self.elsewhere)} prisms nearer to another's design place than to their own ({named})")
        if not faults:
            return ""
        cure = f"; with {' or '.join(self.cures)} they do" if self.cures else "; check --site and the units"
        return f"the points do not fit the site's dish: {'; '.join(faults)}{cure}"


def placement_of(prisms: Prisms, aperture: LitAperture, design: Mapping[str, np.ndarray]) -> DishPlacement:
    """Position of prisms on the site's dish, and axis changes that fit.

    prisms     as measured
    aperture   of the design
    design     (3,) m of each prism that the site's records name, in the dish's frame
    """
    local = prisms.nominal.inverse().points(prisms.points)
    placed = _placed(prisms.names, local, aperture, design)
    if not placed.doubt:
        return placed
    cures = [text for text, changed in _changes(local) if not _placed(prisms.names, changed, aperture, design).doubt]
    return replace(placed, cures=tuple(cures))


def design_places(site: SiteFolder) -> dict[str, np.ndarray]:
    """Design place (3,), m, of each dish prism in the site's records.

    In the dish's frame.
    """
    return {
        name: np.array(target.position_mm) * MILLIMETRE for name, target in site.targets.items() if target.shapes_dish
    }


def _changes(local: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Points with two axes exchanged, all three permuted, or one reversed."""
    changed = []
    for order in list(permutations(range(3)))[1:]:
        moved = [k for k in range(3) if order[k] != k]
        text = " and ".join(AXES[k] for k in moved) if len(moved) == 2 else ", ".join(AXES[k] for k in order)
        changed.append((f"{text} exchanged" if len(moved) == 2 else f"axes in the order {text}", local[:, order]))
    changed += [(f"{AXES[k]} reversed", local * np.where(np.arange(3) == k, -1.0, 1.0)) for k in range(3)]
    return changed


def _placed(
    names: tuple[str, ...], local: np.ndarray, aperture: LitAperture, design: Mapping[str, np.ndarray]
) -> DishPlacement:
    size = np.linalg.norm(aperture.unit(local), axis=1)
    overhang = np.maximum(size - 1.0 - RIM, 0.0) * aperture.radius
    inside = int((size <= 1.0 + ROUNDING).sum())
    return DishPlacement(inside, overhang, _largest_deviation(local, aperture), _elsewhere(names, local, design), ())


def _largest_deviation(local: np.ndarray, aperture: LitAperture) -> float:
    """Largest deviation of points (k, 3) m from the paraboloid of the design's focal length, m."""
    identity = Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    exact = np.zeros((len(local), 3, 3))
    try:
        fit = fit_paraboloid(local, exact, identity, focal_length=aperture.focal_length)
    except EstimationError:
        return float("inf")
    return float(np.abs(fit.deviation).max()) if _small(fit.rotation) else float("inf")


def _small(rotation: np.ndarray) -> bool:
    """True if a turn (rad) keeps the dish's opening in place."""
    return bool(np.linalg.norm(rotation) < 0.5)


def _elsewhere(names: tuple[str, ...], local: np.ndarray, design: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Prisms nearer to another's design place than to their own."""
    from scipy.spatial import cKDTree

    designed = [k for k, name in enumerate(names) if name in design]
    if not designed:
        return ()
    called = list(design)
    nearest = cKDTree(np.array([design[name] for name in called])).query(local[designed])[1]
    return tuple(names[k] for k, at in zip(designed, nearest.tolist(), strict=True) if called[at] != names[k])
