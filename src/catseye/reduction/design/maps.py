"""Maps of the predicted uncertainty against the place of one ranger."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array, Progress
from catseye.reduction.design.aim import DesignAim
from catseye.reduction.design.candidates import with_ranger_at
from catseye.reduction.design.regions import Constraints, MovingUnit
from catseye.reduction.design.scene import GROUND, DesignPoint, DesignScene
from catseye.reduction.design.search import new_ranger

MARGIN = 1.25  # of the rangers' extent
HELD = 1.3  # of a unit's region, in the map of its place


@dataclass(frozen=True, eq=False)
class DesignMap:
    """Predicted uncertainty against the place of one ranger.

    ranger     its name; "" for one more beside all others
    x, y       (k,) m, ground frame
    u          (k, k) m, row by y; nan in an obstacle
    place      (2,) m, of that ranger as designed; None for one more
    """

    ranger: str
    x: Array
    y: Array
    u: Array
    place: tuple[float, float] | None


def maps_of(
    scene: DesignScene,
    aim: DesignAim,
    constraints: Constraints,
    *,
    unit: MovingUnit | None,
    side: int,
    progress: Progress | None = None,
) -> tuple[DesignMap, ...]:
    """Maps for one more ranger on the ground, and for the place of one that varies.

    unit   ranger of the second map, with its region; None: no second map
    side   places along each side; 0: no maps
    """
    ground = [scene.points[i] for i in scene.rangers if scene.points[i].frame == GROUND]
    if side < 2 or not ground:
        return ()
    places = np.array([point.place for point in ground])
    centre = 0.5 * (places.min(axis=0) + places.max(axis=0))
    half = MARGIN * 0.5 * float(np.max(np.ptp(places[:, :2], axis=0))) or 1.0
    more = _map(scene, aim, new_ranger(scene, ""), constraints, _square(centre, half, side), progress)
    if unit is None:
        return (more,)
    if unit.between is not None and unit.within is None:
        grid = _square(np.zeros(3), HELD * unit.between[1], side)
    else:
        grid = _square(unit.home, HELD * unit.reach, side)
    point = scene.points[scene.row[unit.name]]
    return more, _map(scene.without([unit.name]), aim, point, constraints, grid, progress)


def _square(centre: Array, half: float, side: int) -> tuple[Array, Array]:
    steps = np.linspace(-half, half, side)
    return centre[0] + steps, centre[1] + steps


def _map(
    scene: DesignScene,
    aim: DesignAim,
    ranger: DesignPoint,
    constraints: Constraints,
    grid: tuple[Array, Array],
    progress: Progress | None,
) -> DesignMap:
    x, y = grid
    at = np.stack([*(a.ravel() for a in np.meshgrid(x, y)), np.full(len(x) * len(y), ranger.place[2])], axis=1)
    free = constraints.free_of_solids(scene, at)
    what = f"map of {ranger.name or 'one more ranger'}"

    def done(count: int) -> None:
        if progress is not None:
            progress(what, count, int(free.sum()))

    u = np.full(len(at), np.nan)
    u[free] = with_ranger_at(scene, aim, ranger, at[free], progress=done)
    place = (ranger.place[0], ranger.place[1]) if ranger.name else None
    return DesignMap(ranger.name, x, y, u.reshape(len(y), len(x)), place)
