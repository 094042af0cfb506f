"""Zenith angles, with vertical refraction and, where heights follow the Earth, its curvature."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, optional, value
from catseye.estimation.observations.sight import by_ends, elevation, level_length, nearest_turn, sight, triples

EARTH_RADIUS = 6_371_000.0  # m, mean radius: refraction is defined with it, and is not known to 0.3 %


@dataclass(frozen=True, eq=False)
class ZenithAngles(ObservationKind):
    """observed = pi/2 - elevation + (curved - k) D / 2R + error, with k = refraction + x[refraction_column].

    D is the horizontal distance, R the Earth's radius. A ray of curvature radius R / k is an arc over D: at its end
    it is k D / 2R off its chord. Air thins upward, so k > 0 bends it concave to the ground, the target appears higher
    and the angle reads smaller. Where z is a height above the curved Earth, a target of equal z lies D^2 / 2R below the
    horizontal plane of the origin, so the angle reads larger by D / 2R (`curved`). In plain Cartesian axes, whose z is
    the vertical of every station, there is no such term.
    Together they give the trigonometric height D cot z + (1 - k) D^2 / 2R.

    name                of the group, for reports
    observed            (m,) rad from straight up, first face
    covariance          of the observed values, see `ObservationGroup`
    origin              (m,) column of the x of the point where the instrument stands
    target              (m,) column of the x of the point sighted
    shift               (m, 3) or (3,) m, added to target minus origin: (0, 0, target less instrument height); or None
    refraction          (m,) or one, the known part of the coefficient k (0.13 is the usual geodetic mean by day)
    refraction_column   (m,) column of the unknown part of k, -1 for none; or None
    curved              True if z follows the curved Earth
    radius              Earth's radius, m
    """

    kind: ClassVar[str] = "zenith_angle"
    unit: ClassVar[str] = "rad"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    shift: np.ndarray | None = None
    refraction: np.ndarray | float = 0.0
    refraction_column: np.ndarray | None = None
    curved: bool = False
    radius: float = EARTH_RADIUS

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 7): origin, target, coefficient of refraction."""
        refraction = optional(self.refraction_column, len(self.observed))
        return joined_columns(self.name, len(self.observed), triples(self.origin), triples(self.target), refraction)

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 7); nan for a vertical sight.

        Values are on the turn nearest to the observed ones.

        >>> z = ZenithAngles("z", np.ones(1), np.ones(1), np.array([0]), np.array([3]))
        >>> z.predict(np.array([0.0, 0.0, 0.0, 0.0, 3.0, 3.0]))[0] == np.pi / 4
        array([ True])
        """
        along = sight(x, self.origin, self.target, shift=self.shift)
        above, slope = elevation(along)
        far, outward = level_length(along)
        bend = (float(self.curved) - self.refraction - value(x, self.columns[:, 6])) / (2.0 * self.radius)
        by_refraction = np.where(self.columns[:, 6] < 0, 0.0, -far / (2.0 * self.radius))
        jacobian = np.concatenate([by_ends(bend[:, None] * outward - slope), by_refraction[:, None]], axis=1)
        return nearest_turn(0.5 * np.pi - above + bend * far, self.observed), jacobian
