"""Spectral projected gradient: descent within regions, by exact derivatives."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array

MEMORY = 5  # values that a step is compared with: the largest of them may be undercut
SUFFICIENT = 1e-4  # share of the predicted decrease
SHORTENINGS = 5  # of a step to a quarter
RESTARTS = 2  # with a hundredth of the step
SHORTEST, LONGEST = 1e-6, 1e6  # of the step's factor, in units of its first


@dataclass(frozen=True, eq=False)
class PlaceDescent:
    """Path of a descent.

    x            where it ended, the best of all
    value        there
    values       of every accepted step, the start's first
    evaluations  of value and derivative
    settled      True: no allowed move of `tolerance` was left; False: the cap was reached, or no step along the
                 derivative became smaller, as where a beam would be lost
    """

    x: Array
    value: float
    values: tuple[float, ...]
    evaluations: int
    settled: bool


def descend(
    function: Callable[[Array], tuple[float, Array]],
    restrict: Callable[[Array, Array], Array],
    start: Array,
    *,
    reach: float,
    steps: int,
    tolerance: float = 1e-3,
    smallest_decrease: float = 1e-7,
    accepted: Callable[[], None] = lambda: None,
) -> PlaceDescent:
    """Minimum of a function of places within regions.

    function    value and derivative at places (k, d)
    restrict    allowed places (k, d) for wished ones, from present allowed ones: restrict(wished, present)
    start       (k, d), allowed
    reach       m, longest first move of a place
    steps       cap; where it is reached, the best place so far is the answer
    tolerance   m, of a move of any place, below which it is settled
    smallest_decrease   of the value, relative, in five steps together, below which it is settled
    accepted    called after the start and every accepted step, directly after its evaluation

    Source: spectral projected gradient of Birgin, Martinez and Raydan with the step of Barzilai and Borwein
    [BIRGIN00].
    """
    x = best = start
    value, slope = function(x)
    best_value, values, evaluations = value, [value], 1
    accepted()
    largest = float(np.max(np.sqrt(np.sum(slope**2, axis=1)), initial=0.0))
    if largest == 0.0:
        return PlaceDescent(x, value, tuple(values), evaluations, True)
    first = factor = reach / largest
    settled, failures = False, 0
    for _ in range(steps):
        direction = restrict(x - factor * slope, x) - x
        if np.max(np.abs(direction), initial=0.0) < tolerance:
            settled = True
            break
        promised = float(np.sum(slope * direction))
        share, reference = 1.0, max(values[-MEMORY:])
        for _ in range(SHORTENINGS):
            trial = restrict(x + share * direction, x)
            trial_value, trial_slope = function(trial)
            evaluations += 1
            if trial_value <= reference + SUFFICIENT * share * min(promised, 0.0):
                break
            share *= 0.25
        else:
            failures += 1
            if failures > RESTARTS:
                break
            factor *= 0.01
            continue
        moved, turned = trial - x, trial_slope - slope
        curvature = float(np.sum(moved * turned))
        ratio = float(np.sum(moved**2)) / curvature if curvature > 0.0 else LONGEST * first
        factor = min(max(ratio, SHORTEST * first), LONGEST * first)
        x, value, slope = trial, trial_value, trial_slope
        values.append(value)
        accepted()
        if value < best_value:
            best, best_value = x, value
        earlier = values[-MEMORY - 1] if len(values) > MEMORY else np.inf
        if abs(earlier - value) < smallest_decrease * abs(value):
            settled = True
            break
    return PlaceDescent(best, best_value, tuple(values), evaluations, settled)
