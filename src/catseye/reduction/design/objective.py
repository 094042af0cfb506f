"""Criterion of a scene as a function of the places of what moves."""

from dataclasses import dataclass, field

import numpy as np

from catseye.aliases import Array
from catseye.estimation.design.criteria import SQUARINGS
from catseye.estimation.design.gradient import Sensitivity, gradient
from catseye.estimation.design.network import DesignPrediction, predict
from catseye.reduction.design.aim import DesignAim
from catseye.reduction.design.regions import RETREATS, Constraints, MovingUnit
from catseye.reduction.design.scene import DesignScene


@dataclass(eq=False)
class DesignObjective:
    """Logarithm of a criterion by the places of the moving units.

    scene         with all its points
    aim           what is made small
    units         that move
    constraints   of rangers
    squarings     of a smooth worst axis
    evaluations   done so far
    largest       criterion of the last evaluated scene, m^2, not smoothed, in its worst posture

    Over several postures it is the mean; for the worst axis the mean of as high a power as that has.
    """

    scene: DesignScene
    aim: DesignAim
    units: tuple[MovingUnit, ...]
    constraints: Constraints
    squarings: int = SQUARINGS
    evaluations: int = field(default=0)
    largest: float = field(default=np.inf)

    @property
    def places(self) -> Array:
        """Middles (k, 3) m of the units in the scene, each in its own frame."""
        return np.array([self.scene.places[unit.rows].mean(axis=0) for unit in self.units]).reshape(-1, 3)

    def at(self, places: Array) -> DesignScene:
        """Scene with the units at other places."""
        moved = self.scene.places.copy()
        for unit, place in zip(self.units, places, strict=True):
            moved[unit.rows] += place - self.scene.places[unit.rows].mean(axis=0)
        return self.scene.with_places(moved)

    def value(self, scene: DesignScene) -> float:
        """Logarithm of the criterion of a scene, m^2."""
        self.largest = 0.0
        return self._joined([self._posture(scene, k)[0] for k in range(len(scene.postures))])[0]

    def __call__(self, places: Array) -> tuple[float, Array]:
        """Value, and its derivatives (k, 3) with respect to the units' places."""
        scene = self.at(places)
        values, slopes = [], []
        self.largest = 0.0
        for posture in range(len(scene.postures)):
            value, prediction, sensitivity = self._posture(scene, posture)
            in_frame = np.einsum("nij,ni->nj", scene.turns[posture], gradient(prediction, sensitivity))
            values.append(value)
            slopes.append(np.array([in_frame[unit.rows].sum(axis=0) for unit in self.units]).reshape(-1, 3))
        joined, weights = self._joined(values)
        total = sum((w * s for w, s in zip(weights, slopes, strict=True)), np.zeros((len(self.units), 3)))
        total[[unit.level for unit in self.units], 2] = 0.0
        return joined, total

    def _posture(self, scene: DesignScene, posture: int) -> tuple[float, DesignPrediction, Sensitivity]:
        self.evaluations += 1
        prediction = predict(scene.network(posture))
        criterion = self.aim.criterion(scene, posture, self.squarings)
        sensitivity = criterion.sensitivity(prediction)
        smooth = self.aim.name == "worst"
        self.largest = max(self.largest, criterion.true_value(prediction) if smooth else sensitivity.value)
        return float(sensitivity.value), prediction, sensitivity

    def _joined(self, values: list[float]) -> tuple[float, list[float]]:
        """Logarithm of the joint criterion, and the weights of the postures' derivatives in it."""
        power = 2.0**self.squarings if self.aim.name == "worst" else 1.0
        largest = max(values)
        relative = np.array(values) / largest
        mean = float(np.mean(relative**power))
        weights = relative ** (power - 1.0) / (len(values) * mean * largest)
        return float(np.log(largest) + np.log(mean) / power), weights.tolist()

    def restrict(self, wished: Array, present: Array) -> Array:
        """Allowed places (k, 3) for wished ones, from present allowed ones.

        Each is brought into its region; one that would stand in an obstacle goes a part of its way, or stays; of two
        rangers too near each other both stay.
        """
        result = np.array([unit.nearest(place) for unit, place in zip(self.units, wished, strict=True)]).reshape(-1, 3)
        for _ in range(RETREATS):
            blocked = self.blocked(result)
            if not len(blocked):
                break
            middle = 0.5 * (result[blocked] + present[blocked])
            result[blocked] = [self.units[k].nearest(place) for k, place in zip(blocked, middle, strict=True)]
        blocked = self.blocked(result)
        result[blocked] = present[blocked]
        for _ in range(len(self.units)):
            near = self.too_near(result)
            if not len(near) or np.array_equal(result[near], present[near]):
                break
            result[near] = present[near]
        return result

    def blocked(self, places: Array) -> Array:
        """Indices of the rangers on the ground that stand in a solid or too near one."""
        at = np.array([k for k, unit in enumerate(self.units) if unit.ranger and unit.level], dtype=int)
        if not len(at) or not self.constraints.solids.all:
            return np.zeros(0, dtype=int)
        return np.asarray(at[~self.constraints.free_of_solids(self.scene, places[at])])

    def too_near(self, places: Array) -> Array:
        """Indices of the units that stand nearer to a ranger than allowed."""
        ranging = np.array([k for k, unit in enumerate(self.units) if unit.ranger and unit.level], dtype=int)
        if not len(ranging):
            return ranging
        ground = np.array([i for i in self.scene.rangers if not self.scene.points[i].body], dtype=int)
        moving = {int(unit.rows[0]): k for k, unit in enumerate(self.units) if unit.ranger}
        everyone = np.array([places[moving[int(i)]] if int(i) in moving else self.scene.places[i] for i in ground])
        index = np.array([moving.get(int(i), -1) for i in ground])
        apart = np.linalg.norm(everyone[:, None] - everyone, axis=2)
        np.fill_diagonal(apart, np.inf)
        close = (apart < self.constraints.apart).any(axis=1)
        return np.asarray(index[close & (index >= 0)])
