"""Motion of the telescope relative to the middle of a campaign.

    place(t) = place + sum over parts of motion(t) shape(place)

Everything on the telescope expands about the pintle bearing with the temperature of its steel (11.7 ppm/K: an hour of
a clear night moves the rim by half a millimetre), the dish about its own middle and the arm away from that by
additional shares. The whole may turn about the pintle bearing and move on its foundation; dish and arm may tilt about
the dish's middle, and the dish may bend to a saddle. Each is a random walk from zero in the middle of the campaign,
with straight lines between knots; its strength follows from the ranges.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.reduction.epoch.air.process import hats
from catseye.reduction.site.places import RangedPoint

STEP = 1800.0  # s between knots
SHORTEST = 900.0  # s, of a campaign too short for a measurable expansion
MICRORADIAN = 1e-6
FEWEST = 6  # points of a dish that may bend
ROUNDING = 1e-12  # of a displacement, in its part along the line
PARTS = (
    "scale",
    "dish scale",
    "arm scale",
    "turn",
    "tilt east",
    "tilt north",
    "bend upright",
    "bend diagonal",
    "east",
    "north",
    "up",
)
UNITS = (PPM, PPM, PPM, *(MICRORADIAN,) * 3, *(MILLIMETRE,) * 5)  # bends at the rim
WALK = (3.0, 1.0, 0.5, 0.25, 0.25, 0.25, 0.02, 0.02, 0.02, 0.02, 0.02)  # a root hour: 0.25 K of steel; 0.05", 20 um
ALIKE = ((0,), (1,), (2,), (3,), (4, 5), (6, 7), (8, 9), (10,))  # parts of one strength: no direction is another
LEAST_WALK, MOST_WALK = 0.02, 30.0  # factors on these


@dataclass(frozen=True, eq=False)
class TelescopeKnots:
    """Knots of the telescope's motion.

    knots      (k,) s since the campaign's middle, without that itself
    middle     (3,) m, of the dish
    axes       (3, 3) unit: two across the dish, and its normal
    radius     m, of the dish's farthest point; infinite of a dish of so few points that no bend shows
    bodies     point: its body
    """

    knots: np.ndarray
    middle: np.ndarray
    axes: np.ndarray
    radius: float
    bodies: Mapping[str, str]

    @staticmethod
    def of(span: float, places: Mapping[str, RangedPoint]) -> "TelescopeKnots | None":
        """Knots of a campaign of so many seconds.

        None of a short campaign, or without a telescope.

        places   of the points involved
        """
        bodies = {name: place.body for name, place in places.items() if place.body}
        dish = [place.start for place in places.values() if place.body == "dish"]
        if span < SHORTEST or not dish:
            return None
        half = max(1, round(0.5 * span / STEP))
        steps = np.concatenate([np.arange(-half, 0), np.arange(1, half + 1)])
        middle = np.mean(dish, axis=0)
        away = np.array(dish) - middle
        axes = np.linalg.svd(away)[2]
        radius = float(np.max(np.linalg.norm(away, axis=1))) if len(dish) >= FEWEST else np.inf
        return TelescopeKnots(0.5 * span / half * steps, middle, axes, radius, bodies)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (k, k), h, of a random walk of unit strength.

        Zero in the middle.
        """
        less = np.minimum(np.abs(self.knots[:, None]), np.abs(self.knots))
        return np.asarray(np.where(self.knots[:, None] * self.knots > 0.0, less, 0.0) / 3600.0)

    def columns(self, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two knots (m, 2) of each time, and their shares (m, 2).

        -1 for the middle.
        """
        all_knots = np.sort(np.append(self.knots, 0.0))
        first, share = hats(all_knots, seconds)
        number = np.where(all_knots == 0.0, -1, np.cumsum(all_knots != 0.0) - 1)
        return np.stack([number[first], number[first + 1]], axis=1), np.stack([1.0 - share, share], axis=1)

    def slopes(
        self, ranger: str, targets: Sequence[str], a: np.ndarray, b: np.ndarray, towards: np.ndarray
    ) -> np.ndarray:
        """Derivatives (m, parts), m, of distances by each of `PARTS`, in its unit.

        a, b      (m, 3) m, scan points and targets
        towards   (m, 3) unit, from target to ranger
        """
        near = self._moved(np.full(len(targets), self.bodies.get(ranger, "")), a)
        far = self._moved(np.array([self.bodies.get(t, "") for t in targets]), b)
        apart = near - far
        slopes = np.einsum("mpi,mi->mp", apart, towards)
        rigid = np.abs(slopes) <= ROUNDING * np.linalg.norm(apart, axis=2)  # both ends turn as one: 0, not 1e-14
        return np.where(rigid, 0.0, slopes) * UNITS

    def _moved(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Displacement (m, parts, 3), m, of points by each part."""
        moved = np.zeros((len(points), len(PARTS), 3))
        dish, arm = (bodies == "dish")[:, None], (bodies == "arm")[:, None]
        away, axis = points - self.middle, np.eye(3)
        u, v = (away @ self.axes[:2].T / self.radius).T
        moved[:, 0] = points
        moved[:, 1] = np.where(dish, away, 0.0)
        moved[:, 2] = np.where(arm, away, 0.0)
        moved[:, 3] = np.cross(axis[2], points)
        for i in (0, 1):
            moved[:, 4 + i] = np.where(dish | arm, np.cross(axis[i], away), 0.0)
        for i, shape in enumerate((u**2 - v**2, 2.0 * u * v)):
            moved[:, 6 + i] = np.where(dish, shape[:, None] * self.axes[2], 0.0)
        moved[:, 8:] = axis
        return np.where((bodies != "")[:, None, None], moved, 0.0)
