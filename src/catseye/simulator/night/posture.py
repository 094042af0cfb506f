"""Posture of the telescope: nominal, and the night's departure."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.simulator.night.faults import Planted, Streams

REFLECTOR_TO_ELEVATION = np.array([0.0, -54.839108, 4.999990])
ELEVATION_AXIS_HEIGHT = 48.260
FEED_ARM_FOOT = np.array([0.0, -8.0, 10.0])


@dataclass(frozen=True)
class TruePosture:
    """Nominal rotation and shift of the reflector, and departures from it."""

    azimuth_deg: float
    elevation_deg: float
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m
    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))  # rotation vector, rad, about the elevation axis
    arm_shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    arm_turn: np.ndarray = field(default_factory=lambda: np.zeros(3))  # about the foot of the arm

    def _elevation_rotation(self):
        s, c = np.sin(self.elevation_deg * DEGREE), np.cos(self.elevation_deg * DEGREE)
        return np.array([[1.0, 0.0, 0.0], [0.0, s, c], [0.0, -c, s]])

    def _azimuth_rotation(self):
        s, c = np.sin(self.azimuth_deg * DEGREE), np.cos(self.azimuth_deg * DEGREE)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def nominal_direction(self, direction):
        return direction @ (self._azimuth_rotation() @ self._elevation_rotation()).T

    def nominal(self, reflector):
        """Nominal ground point of a reflector point.

        Source: [PARKER04] eq. 2.44.
        """
        lifted = (reflector + REFLECTOR_TO_ELEVATION) @ self._elevation_rotation().T
        return self.alidade(lifted + np.array([0.0, 0.0, ELEVATION_AXIS_HEIGHT]))

    def alidade(self, point):
        return point @ self._azimuth_rotation().T

    def reflector_from_nominal(self, ground):
        """Inverse of `nominal`: reflector point of a ground point."""
        lifted = ground @ self._azimuth_rotation() - np.array([0.0, 0.0, ELEVATION_AXIS_HEIGHT])
        return lifted @ self._elevation_rotation() - REFLECTOR_TO_ELEVATION

    def dish(self, reflector):
        """True ground point of a dish point."""
        moved = Rotation.from_rotvec(self.turn).apply(reflector + REFLECTOR_TO_ELEVATION) - REFLECTOR_TO_ELEVATION
        return self.nominal(moved + self.shift)

    def dish_direction(self, direction):
        return self.nominal_direction(Rotation.from_rotvec(self.turn).apply(direction))

    def arm(self, reflector):
        """True ground point of a feed-arm point."""
        bent = Rotation.from_rotvec(self.arm_turn).apply(reflector - FEED_ARM_FOOT) + FEED_ARM_FOOT + self.arm_shift
        return self.dish(bent)


def posture(azimuth_deg: float, elevation_deg: float, streams: Streams, *, planted: Planted) -> TruePosture:
    """Posture of the night: millimetres and arc seconds from nominal.

    More for the feed arm.

    The magnitudes are chosen; two sigma is the most.
    """
    draw = np.clip(streams("posture").normal(size=(4, 3)), -2.0, 2.0)
    rigid, arm = planted.gain("posture"), planted.gain("feed_arm")
    return TruePosture(
        azimuth_deg,
        elevation_deg,
        shift=rigid * draw[0] * 3.0 * MILLIMETRE,
        turn=rigid * draw[1] * np.array([18.0, 8.0, 8.0]) * ARCSECOND,
        arm_shift=arm * draw[2] * 4.0 * MILLIMETRE,
        arm_turn=arm * draw[3] * 12.0 * ARCSECOND,
    )
