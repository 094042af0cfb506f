"""Movements of bodies during a night: sway and drift."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE, TWO_PI
from catseye.simulator.night.limits import require

ARM, DISH, ALIDADE, TELESCOPE = BODIES = ("arm", "dish", "alidade", "telescope")  # the last has the other three
SWAY_HZ = (0.2, 2.0)  # lowest structural frequencies of large telescopes; a ranger's shots are many periods apart
MODES = 40  # close to a normal distribution


@dataclass(frozen=True)
class BodySway:
    """Oscillation of a rigid body about its place.

    Two shots of a ranger meet independent displacements, all points of a body at one time the same.

    body     of `BODIES`
    rms_mm   of each coordinate
    seed     of frequencies, phases and directions
    """

    body: str
    rms_mm: float
    seed: int = 0

    def __post_init__(self):
        require(f"rms_mm of the sway of {self.body}", self.rms_mm, 0.0, 100.0)

    def displacement(self, seconds, reference_s: float) -> np.ndarray:
        """Displacement (k, 3), m, at times (k,)."""
        rng = np.random.default_rng(self.seed)
        frequency, phase = rng.uniform(*SWAY_HZ, MODES), rng.uniform(0.0, TWO_PI, (3, MODES))
        angle = TWO_PI * frequency * np.asarray(seconds, dtype=float)[:, None, None] + phase
        return self.rms_mm * MILLIMETRE * np.sqrt(2.0 / MODES) * np.cos(angle).sum(axis=2)


@dataclass(frozen=True)
class BodyDrift:
    """Steady motion of a body or of one point; its points hold at the reference time.

    body       of `BODIES`, or the name of a point
    mm_per_h   towards the east, the north and up
    """

    body: str
    mm_per_h: tuple[float, float, float]

    def __post_init__(self):
        require(f"mm_per_h of {self.body}", float(np.linalg.norm(self.mm_per_h)), 0.0, 1000.0)

    def displacement(self, seconds, reference_s: float) -> np.ndarray:
        """Displacement (k, 3), m, at times (k,)."""
        hours = (np.asarray(seconds, dtype=float) - reference_s) / 3600.0
        return hours[:, None] * np.asarray(self.mm_per_h) * MILLIMETRE
