"""Thermal expansion of the telescope's steel during a night."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.simulator.night.air import TrueAir
from catseye.simulator.night.lag import lagged
from catseye.simulator.night.limits import require
from catseye.simulator.night.movements import BodyDrift, BodySway

STEEL_PER_K = 11.7e-6  # structural steel: AISC, Steel Construction Manual, 6.5e-6 per degF
STEP_S = 10.0  # a thirtieth of the shortest wave


@dataclass(frozen=True)
class SteelExpansion:
    """Law of the telescope's expansion.

    share        of steel's full coefficient, about the pintle bearing
    lag_s        time constant of the steel behind the air
    dish_share   by which the dish additionally expands about its own middle, as a share of the telescope's expansion
    arm_share    by which the feed arm additionally expands away from the dish's middle, likewise
    alidade_share   by which the alidade, thicker than its load, additionally expands: dish and arm move away from the
                 pintle bearing as the dish's middle does
    """

    share: float = 1.0
    lag_s: float = 3600.0
    dish_share: float = 0.0
    arm_share: float = 0.0
    alidade_share: float = 0.0

    def __post_init__(self):
        require("share of the steel's expansion", self.share, -10.0, 10.0)
        require("lag_s of the steel", self.lag_s, 60.0, 86_400.0)
        require("dish_share of the expansion", self.dish_share, -1.0, 1.0)
        require("arm_share of the expansion", self.arm_share, -1.0, 1.0)
        require("alidade_share of the expansion", self.alidade_share, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class MovingPoints:
    """Points of a night at any time; constant without a law.

    points        m, ground frame, at `reference_s`
    own           by name, the additional expansion of a point about the dish's middle; 0 off dish and arm; points
                  not in it stand on the ground
    dish_middle   (3,) m
    carried       names of points carried by the alidade: dish and arm
    movements     of bodies
    bodies        names of the points of each body
    """

    points: Mapping[str, np.ndarray]
    air: TrueAir
    law: SteelExpansion | None = None
    reference_s: float = 0.0
    own: Mapping[str, float] = field(default_factory=dict)
    dish_middle: np.ndarray = field(default_factory=lambda: np.zeros(3))
    carried: frozenset[str] = frozenset()
    movements: tuple[BodySway | BodyDrift, ...] = ()
    bodies: Mapping[str, frozenset[str]] = field(default_factory=dict)

    def scale(self, seconds):
        """Expansion of the telescope since `reference_s`, at times (k,).

        1e-6 is a micrometre a metre.
        """
        if self.law is None:
            return np.zeros(np.shape(seconds))
        times = np.append(np.asarray(seconds, dtype=float), self.reference_s)
        steel_c = lagged(self.air.common_c, times, time_constant_s=self.law.lag_s, step_s=STEP_S)
        return self.law.share * STEEL_PER_K * (steel_c[:-1] - steel_c[-1])

    def at(self, names: list[str], seconds):
        """Positions of points (k, 3), each at its own time (k,)."""
        initial = np.array([self.points[name] for name in names])
        moved = self._moved(names, seconds)
        if self.law is None:
            return initial + moved
        scale = self.scale(seconds)[:, None]
        rides = np.array([name in self.own for name in names])[:, None]
        extra = np.array([self.own.get(name, 0.0) for name in names])[:, None]
        lifted = self.law.alidade_share * np.array([name in self.carried for name in names])[:, None]
        grown = rides * scale * (initial + extra * (initial - self.dish_middle) + lifted * self.dish_middle)
        return initial + grown + moved

    def _moved(self, names: list[str], seconds):
        """Displacements (k, 3) by the movements, m."""
        moved = np.zeros((len(names), 3))
        for movement in self.movements:
            body = self.bodies.get(movement.body, frozenset([movement.body]))
            members = np.array([name in body for name in names])[:, None]
            moved += members * movement.displacement(seconds, self.reference_s)
        return moved
