"""Jitter of the bodies by wind and vibration, from range scatter.

Its share of the shots' variance is not calibrated and changes with the wind: it is estimated epoch by epoch from the
residuals within an epoch, with exponential forgetting.

A residual is r times its shot's own deviation, plus as much of the state's error as the shot could correct. A state
that moved as the process noise says makes E v^2 = r sigma^2 of both; one that moved less, as on most nights, r^2
sigma^2. The second is used: too large by 1 / sqrt(r) at most, where the first would let jitter vanish whenever the
state is quiet. Shots are weighted by 1 / u^4, as for a variance: a weak return says nothing about a jitter of 0.1 mm.

Source: [FOERSTNER16] chapter 4, variance components, one step an epoch; prior weight, forgetting and floor are ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.reduction.epoch.range_shots import RangeShots

PRIOR_DEGREES = 20.0  # redundant shots: initial weight of the setting
FORGETTING = 0.9  # factor per epoch
LEAST = 0.25  # floor, of the usual jitter: one quiet epoch does not mean calm air
QUIET = 0.03 * MILLIMETRE  # m, other uncertainty of a strong return, which has full weight


@dataclass
class Jitter:
    """Distance of each body's points from their epoch mean.

    usual_mm   body: initial value, and the value that is returned to
    """

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
        """Update the jitter from an epoch's ranges.

        Shots between a body and the ground measure that body; shots between two bodies the one that moves more, after
        subtracting the other's assumed jitter.
        """
        variances = {body: (u * MILLIMETRE) ** 2 for body, u in self.mm.items()}
        samples: dict[str, list[tuple[float, float]]] = {body: [] for body in variances}
        for k, on in enumerate(ranges.used):
            a, b = bodies.get(ranges.ranger[k], ""), bodies.get(ranges.target[k], "")
            if not on or a == b or not {a, b} & set(variances):
                continue
            shaken = max((a, b), key=lambda body: variances.get(body, -1.0))
            remainder = ranges.u_range[k] ** 2 - variances[shaken]  # all variance but that of the body that moves more
            r = float(np.clip(ranges.redundancy[k], 0.0, 1.0)) ** 2
            weight = min(1.0, ((variances[shaken] + QUIET**2) / float(ranges.u_range[k]) ** 2) ** 2)
            samples[shaken].append((weight * (float(ranges.residual[k]) ** 2 - r * max(remainder, 0.0)), weight * r))
        for body, rows in samples.items():
            s, w = self._sums[body]
            s, w = FORGETTING * s + sum(v for v, _ in rows), FORGETTING * w + sum(r for _, r in rows)
            if w < PRIOR_DEGREES:  # few shots: return to the usual value
                s, w = s + (PRIOR_DEGREES - w) * (self.usual_mm[body] * MILLIMETRE) ** 2, PRIOR_DEGREES
            self._sums[body] = max(s, 0.0), w
