"""How the telescope expands, contracts and settles during a campaign: its points are those of the middle of it.

    place(t) = place + scale(t) place + dish scale(t) (place - middle of the dish) + (east, north, up)(t)

Everything on the telescope expands about the pintle bearing with the temperature of its steel (11.7 ppm/K: an hour of
a clear night moves the rim by half a millimetre), the dish by a share of its own, and the whole may move on its
foundation. Each is a random walk from zero in the middle of the campaign, with straight lines between knots, whose
strength the ranges tell. A body that turns or bends meanwhile is not modelled.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.reduction.epoch.air.process import hats
from catseye.reduction.site.places import RangedPoint

STEP = 1800.0  # s between knots
SHORTEST = 900.0  # s, of a campaign in which nothing expands that a range sees
PARTS = ("scale", "dish scale", "east", "north", "up")
UNITS = (PPM, PPM, MILLIMETRE, MILLIMETRE, MILLIMETRE)
WALK = (3.0, 1.0, 0.05, 0.05, 0.05)  # a root hour, ppm and mm: a quarter of a degree of steel; a foundation
ALIKE = ((0,), (1,), (2, 3), (4,))  # parts of one strength: no direction on the ground is another
LEAST_WALK, MOST_WALK = 0.02, 30.0  # factors on these


@dataclass(frozen=True, eq=False)
class TelescopeKnots:
    """Knots of the telescope's motion.

    knots      (k,) s since the campaign's middle, without that itself
    middle     (3,) m, of the dish
    bodies     point: body that carries it
    """

    knots: np.ndarray
    middle: np.ndarray
    bodies: Mapping[str, str]

    @staticmethod
    def of(span: float, places: Mapping[str, RangedPoint]) -> "TelescopeKnots | None":
        """Knots of a campaign of so many seconds; None of one that is short or sees no telescope.

        places   of the points that take part
        """
        bodies = {name: place.body for name, place in places.items() if place.body}
        dish = [place.start for place in places.values() if place.body == "dish"]
        if span < SHORTEST or not dish:
            return None
        half = max(1, round(0.5 * span / STEP))
        steps = np.concatenate([np.arange(-half, 0), np.arange(1, half + 1)])
        return TelescopeKnots(0.5 * span / half * steps, np.mean(dish, axis=0), bodies)

    @property
    def covariance(self) -> np.ndarray:
        """(k, k) h, of a walk of unit strength from zero in the middle."""
        less = np.minimum(np.abs(self.knots[:, None]), np.abs(self.knots))
        return np.asarray(np.where(self.knots[:, None] * self.knots > 0.0, less, 0.0) / 3600.0)

    def columns(self, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two knots (m, 2) on which each time hangs, -1 for the middle, and their shares (m, 2)."""
        whole = np.sort(np.append(self.knots, 0.0))
        first, share = hats(whole, seconds)
        number = np.where(whole == 0.0, -1, np.cumsum(whole != 0.0) - 1)
        return np.stack([number[first], number[first + 1]], axis=1), np.stack([1.0 - share, share], axis=1)

    def slopes(
        self, ranger: str, targets: Sequence[str], a: np.ndarray, b: np.ndarray, towards: np.ndarray
    ) -> np.ndarray:
        """(m, 5) m: derivatives of distances by each of `PARTS`, a ppm or a millimetre.

        a, b      (m, 3) m, scan points and targets
        towards   (m, 3) unit, from target to ranger
        """
        near = self._moved(np.full(len(targets), self.bodies.get(ranger, "")), a)
        far = self._moved(np.array([self.bodies.get(t, "") for t in targets]), b)
        return np.asarray(np.einsum("mpi,mi->mp", near - far, towards)) * UNITS

    def _moved(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(m, 5, 3) m: how points move by each part."""
        moved = np.zeros((len(points), 5, 3))
        moved[:, 0] = points
        moved[:, 1] = np.where((bodies == "dish")[:, None], points - self.middle, 0.0)
        moved[:, 2:] = np.eye(3)
        return np.where((bodies != "")[:, None, None], moved, 0.0)
