"""How much the bodies shake, learnt from how their ranges scatter within an epoch: wind, vibration.

A share of the shots' variance that nobody calibrates, and that changes with the wind: estimated epoch by epoch from the
residuals, and forgotten again.

A residual is r times its shot's own deviation, and as much of what the state was off as the shot could correct. A state
that moved as it was loosened makes E v^2 = r sigma^2 of both; one that moved less, as in most nights, r^2 sigma^2. The
second is taken: careful by 1 / sqrt(r) at most, where the first would let what shakes vanish whenever the state is
quiet. Shots count by 1 / u^4, as a variance's estimate has it: a weak return knows nothing of a shaking of 0.1 mm.

Source: [FOERSTNER16] chapter 4, variance components, one step an epoch; prior weight, forgetting and floor are ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.reduction.epoch.range_shots import RangeShots

PRIOR_DEGREES = 20.0  # redundant shots that the setting is worth at first
FORGETTING = 0.9  # an epoch
LEAST = 0.25  # of what is usual: a lucky epoch is no calm
QUIET = 0.03 * MILLIMETRE  # m, what else a strong return is uncertain by: it counts whole


@dataclass
class Jitter:
    """How far the points of each body are from their mean of an epoch; `usual_mm` is what is believed first."""

    usual_mm: Mapping[str, float]
    _sums: dict[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for body, u in self.usual_mm.items():
            self._sums.setdefault(body, (PRIOR_DEGREES * (u * MILLIMETRE) ** 2, PRIOR_DEGREES))

    @property
    def mm(self) -> dict[str, float]:
        """Jitter of each body by its name, mm."""
        learnt = {body: (s / w) ** 0.5 / MILLIMETRE if s > 0.0 else 0.0 for body, (s, w) in self._sums.items()}
        return {body: max(u, LEAST * self.usual_mm[body]) for body, u in learnt.items()}

    def learn(self, ranges: RangeShots, bodies: Mapping[str, str]) -> None:
        """Take in an epoch's ranges.

        Shots between a body and the ground speak of that body; between two bodies of the one that shakes more, less
        what the other is believed to do.
        """
        now = {body: (u * MILLIMETRE) ** 2 for body, u in self.mm.items()}
        seen: dict[str, list[tuple[float, float]]] = {body: [] for body in now}
        for k, on in enumerate(ranges.used):
            a, b = bodies.get(ranges.ranger[k], ""), bodies.get(ranges.target[k], "")
            if not on or a == b or not {a, b} & set(now):
                continue
            shaken = max((a, b), key=lambda body: now.get(body, -1.0))
            rest = ranges.u_range[k] ** 2 - now[shaken]  # everything but the one that shakes more
            r = float(np.clip(ranges.redundancy[k], 0.0, 1.0)) ** 2
            weight = min(1.0, ((now[shaken] + QUIET**2) / float(ranges.u_range[k]) ** 2) ** 2)
            seen[shaken].append((weight * (float(ranges.residual[k]) ** 2 - r * max(rest, 0.0)), weight * r))
        for body, rows in seen.items():
            s, w = self._sums[body]
            s, w = FORGETTING * s + sum(v for v, _ in rows), FORGETTING * w + sum(r for _, r in rows)
            if w < PRIOR_DEGREES:  # little is seen: the usual comes back
                s, w = s + (PRIOR_DEGREES - w) * (self.usual_mm[body] * MILLIMETRE) ** 2, PRIOR_DEGREES
            self._sums[body] = max(s, 0.0), w
