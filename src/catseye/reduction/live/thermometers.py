"""Thermometers against each other and against the ranges, at each epoch from the first on.

An epoch's adjustment knows the offset of a thermometer whose air a certified path crosses. Of the others it knows what
the stations make of the air between them: a gradient that few nights have is an inversion, or an offset. `allowed` of
`reduction.epoch.settling` judges so for a night; here its judgement is a number for each station.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.allowance import DOUBTED_C, STEEPEST_DOWN, STEEPEST_UP, UNSURE, USUAL_GRADIENT, Allowance
from catseye.reduction.epoch.parameter import BEND, Parameter

Judgement = Literal["biased", "apart"]


@dataclass(frozen=True)
class SuspectedBias:
    """A thermometer that may be biased.

    judgement   "biased": the ranges say so; "apart": it is, or the air between the stations is of few nights
    offset_c    °C, by which it reads too high
    u_c         of that, °C
    """

    judgement: Judgement
    offset_c: float
    u_c: float

    def text(self, station: str) -> str:
        """The judgement in one line.

        >>> SuspectedBias("biased", 1.65, 0.13).text("WX1")
        "WX1's thermometer is biased by +1.65 °C (u 0.13 °C), by the ranges: its readings count less that"
        """
        if self.judgement == "biased":
            return (
                f"{station}'s thermometer is biased by {self.offset_c:+.2f} °C (u {self.u_c:.2f} °C), by the ranges: "
                "its readings count less that"
            )
        return (
            f"{station}'s thermometer is biased by some {self.offset_c:+.1f} °C, or the air between the stations is "
            "of few nights, which no certified path tells apart: the uncertainties allow for either"
        )


def biases_of(air: AirField, solution: LeastSquaresSolution, columns: np.ndarray) -> dict[str, SuspectedBias]:
    """Suspects among the stations of an epoch's air, by name.

    columns   of the air's parameters in the solution
    """
    values, u = solution.x[columns], np.sqrt(solution.q.diagonal()[columns])
    found: dict[str, SuspectedBias] = {}
    sure = [bool(u[i] < UNSURE * air.sigmas[i]) for i in range(len(air.stations))]
    for i, station in enumerate(air.stations):
        if sure[i] and abs(values[i]) > DOUBTED_C * air.sigmas[i]:
            found[station] = SuspectedBias("biased", float(values[i]), float(u[i]))
    gradient = air.steepest(values)
    if air.profile != BEND.part or STEEPEST_DOWN <= gradient <= STEEPEST_UP:
        return found
    apart = (gradient - (0.0 if gradient > 0.0 else USUAL_GRADIENT)) * float(np.ptp(air.heights))
    middle = 0.5 * float(air.heights.min() + air.heights.max())
    for i, station in enumerate(air.stations):
        if not sure[i]:
            off = apart if air.heights[i] > middle else -apart
            found[station] = SuspectedBias("apart", float(off), float(np.hypot(u[i], apart / np.sqrt(3.0))))
    return found


def considering(
    told: Allowance,
    biases: Mapping[str, SuspectedBias],
    air: AirField,
    *,
    opened: Collection[str] = (),
    refuted: Collection[str] = (),
) -> Allowance:
    """Allowance whose claims take in what is suspected, and whose estimates do not move by it.

    told      as `allowed` gave it: its looser priors are for an adjustment that begins anew
    opened    stations whose records pull the estimates no more
    refuted   stations whose records this very adjustment left out, and says so
    """
    sigmas = dict(zip(air.stations, air.sigmas, strict=False))
    wide = {n: float(np.hypot(sigmas[n], each.offset_c)) for n, each in biases.items() if n not in {*opened, *refuted}}
    held = {p for p in air.parameters[: len(air.stations)] if p.of in wide}
    texts = tuple(each.text(n) for n, each in biases.items() if each.judgement == "biased" and n not in refuted)
    named = tuple(f"{n}'s thermometer" for n in biases)
    others = tuple(text for text in told.texts if not text.startswith(named))
    return replace(told, held=told.held | held, thermometers=wide, texts=(*others, *texts))


def pull_of(allowance: Allowance, air: AirField) -> dict[Parameter, float]:
    """Doubt of each of the air's lasting parameters over its prior's variance: what its covariances are multiplied by.

    A prior of sigma s that is off by d moves all parameters by Q d / s^2, in this epoch and in all that follow.

    Source: consider parameters, [SCHMIDT66].
    """
    taken, wide = allowance.priors(air), allowance.sigmas(air)
    doubt = np.sqrt(np.maximum(wide**2 - taken**2, 0.0))
    return {p: float(d / s**2) for p, d, s in zip(air.parameters, doubt, taken, strict=False) if d > 0.0}
