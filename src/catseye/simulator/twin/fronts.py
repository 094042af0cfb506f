"""Endless fronts of a living site: one temperature step a time slot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array

SLOT = 7200.0  # s: a front in two hours, as `simulator.night.nature` has at most
SLOTS = 480  # 40 days; then they repeat
RISE = (120.0, 900.0)  # s, as `simulator.night.nature` has it
MEMORY = 16.0  # lags after which 1e-7 of a step remains


@dataclass(frozen=True, eq=False)
class LivingFronts:
    """Temperature levels, °C, begin and duration (n,), s, slowness (2,), s/m."""

    level: Array
    begin: Array
    rise: Array
    slowness: Array

    @staticmethod
    def drawn(rng: np.random.Generator, step_c: float, velocity: Array) -> "LivingFronts":
        """Fronts of steps up to step_c that pass with a velocity (2,), m/s."""
        rise = rng.uniform(*RISE, SLOTS)
        begin = rng.uniform(0.2, 0.8, SLOTS) * SLOT - 0.5 * rise
        return LivingFronts(0.5 * step_c * rng.uniform(-1.0, 1.0, SLOTS), begin, rise, velocity / (velocity @ velocity))

    def __call__(self, points: Array, seconds: Array, lag: float = 0.0) -> Array:
        """Temperature change at points (..., 3), times (...), °C, with a lag, s."""
        local = np.asarray(seconds, dtype=float) - points[..., :2] @ self.slowness
        slot = np.floor(local / SLOT).astype(int)
        back = 1 + int(np.ceil(MEMORY * lag / SLOT))
        first = slot.min()
        at = (first if first == slot.max() else slot[..., None]) - np.arange(back)  # usually all are in one slot
        row = at % SLOTS
        present, previous = self.level[row], self.level[row - 1]
        share = step_share(local[..., None] - (at * SLOT + self.begin[row]), self.rise[row], lag)
        change: Array = previous[..., -1] + np.sum((present - previous) * share, axis=-1)
        return change


def step_share(since: ArrayLike, rise: ArrayLike, lag: float) -> Array:
    """Share of a step reached at times since its begin, with a lag.

    Half a cosine, followed by y' = (x - y) / lag.
    """
    t, a = np.asarray(since, dtype=float), np.asarray(rise, dtype=float)
    w = np.pi / a
    u = np.clip(t, 0.0, a)
    if lag == 0.0:
        return 0.5 * (1.0 - np.cos(w * u))
    damped = 1.0 / (1.0 + (w * lag) ** 2)
    during = 0.5 - 0.5 * damped * (np.cos(w * u) + w * lag * np.sin(w * u)) - 0.5 * (1.0 - damped) * np.exp(-u / lag)
    return 1.0 - (1.0 - during) * np.exp(-np.maximum(t - a, 0.0) / lag)
