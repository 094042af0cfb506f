"""Test each epoch's thermometers against each other and the ranges.

An epoch's adjustment determines the offset of a thermometer whose air a certified path crosses. For the others the
stations determine the air between them: an unusual gradient is an inversion, or an offset. `allowed` of
`reduction.epoch.settling` judges so for a night; here its judgement is a number for each station.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.allowance import (
    DOUBTED_C,
    STEEPEST_DOWN,
    STEEPEST_UP,
    UNSURE,
    USUAL_GRADIENT,
    Allowance,
    AllowanceReason,
)
from catseye.reduction.epoch.parameter import BEND, Parameter, ParameterKind

Judgement = Literal["biased", "apart"]


@dataclass(frozen=True)
class SuspectedBias:
    """A thermometer that may be biased.

    judgement   "biased": the ranges say so; "apart": either it is biased, or the air between the stations is unusual
    offset_c    °C, by which it reads too high
    u_c         of that, °C
    """

    judgement: Judgement
    offset_c: float
    u_c: float

    def text(self, station: str) -> str:
        """Judgement in one line.

        >>> SuspectedBias("biased", 1.65, 0.13).text("WX1")
        "WX1's thermometer is biased by +1.65 °C (u 0.13 °C) according to the ranges; corrected in the solution"
        """
        if self.judgement == "biased":
            return (
                f"{station}'s thermometer is biased by {self.offset_c:+.2f} °C (u {self.u_c:.2f} °C) "
                "according to the ranges; corrected in the solution"
            )
        return (
            f"{station}'s thermometer is biased by about {self.offset_c:+.1f} °C, or the air between the stations is "
            "unusual; no certified path can tell which, so the uncertainties allow for both"
        )


def biases_of(air: AirField, solution: LeastSquaresSolution, columns: np.ndarray) -> dict[str, SuspectedBias]:
    """Stations of an epoch's air with a suspected bias, by name.

    columns   of the air's parameters in the solution
    """
    values, u = solution.x[columns], np.sqrt(solution.q.diagonal()[columns])
    suspects: dict[str, SuspectedBias] = {}
    sure = [bool(u[i] < UNSURE * air.sigmas[i]) for i in range(len(air.stations))]
    for i, station in enumerate(air.stations):
        if sure[i] and abs(values[i]) > DOUBTED_C * air.sigmas[i]:
            suspects[station] = SuspectedBias("biased", float(values[i]), float(u[i]))
    gradient = air.steepest(values)
    if air.profile != BEND.part or STEEPEST_DOWN <= gradient <= STEEPEST_UP:
        return suspects
    apart = (gradient - (0.0 if gradient > 0.0 else USUAL_GRADIENT)) * float(np.ptp(air.heights))
    middle = 0.5 * float(air.heights.min() + air.heights.max())
    for i, station in enumerate(air.stations):
        if not sure[i]:
            off = apart if air.heights[i] > middle else -apart
            suspects[station] = SuspectedBias("apart", float(off), float(np.hypot(u[i], apart / np.sqrt(3.0))))
    return suspects


def with_suspected_biases(
    allowance: Allowance,
    biases: Mapping[str, SuspectedBias],
    air: AirField,
    *,
    opened: Collection[str] = (),
    refuted: Collection[str] = (),
) -> Allowance:
    """Allowance whose claims cover suspected biases without changing the estimates.

    allowance  from `allowed`: its looser priors are for an adjustment that starts anew
    opened    stations whose records no longer affect the estimates
    refuted   stations whose records this adjustment dropped and reports
    """
    sigmas = dict(zip(air.stations, air.sigmas, strict=False))
    wide = {n: float(np.hypot(sigmas[n], bias.offset_c)) for n, bias in biases.items() if n not in {*opened, *refuted}}
    fixed = {p for p in air.parameters[: len(air.stations)] if p.of in wide}
    suspected = {Parameter(ParameterKind.THERMOMETER, n): bias for n, bias in biases.items()}
    remaining = (reason for reason in allowance.reasons if reason.subject not in suspected)
    named = (
        AllowanceReason(bias.text(p.of), p)
        for p, bias in suspected.items()
        if bias.judgement == "biased" and p.of not in refuted
    )
    return replace(allowance, held=allowance.held | fixed, thermometers=wide, reasons=(*remaining, *named))


def prior_pulls(allowance: Allowance, air: AirField) -> dict[Parameter, float]:
    """Possible errors of the air's priors over their variances.

    Of its persistent parameters; covariances are multiplied by it: a prior of sigma s that is off by d moves all
    parameters by Q d / s^2, in this epoch and all later ones.

    Source: consider parameters, [SCHMIDT66].
    """
    used, wide = allowance.priors(air), allowance.sigmas(air)
    doubt = np.sqrt(np.maximum(wide**2 - used**2, 0.0))
    return {p: float(d / s**2) for p, d, s in zip(air.parameters, doubt, used, strict=False) if d > 0.0}
