"""Plausibility of explanations, and allowances for misfit that remains.

An adjustment drops the prior of a thermometer, a zero or a sounded line where the ranges contradict it. That
explains the misfit, and the explanation must be possible: an instrument that can be so wrong, ranges that determine
it better than its record, air that exists. Where it is not, the prior stays, and the residuals' pattern decides
what is allowed for: a family of `self_check`, or the air between the stations.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.covariance import Widened
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.parameter import BEND, Parameter, ParameterKind
from catseye.reduction.epoch.self_check import Family, FamilyCheck

LARGEST_OFFSET_C = 8.0  # of a working thermometer; a broken one is farther off
MOST_ZEROS = 0.25  # share of the rangers whose zeros may be wrong at once; more has another cause
STEEPEST_UP, STEEPEST_DOWN = 0.025, -0.02  # °C/m between the stations: of most nights; near the adiabatic lapse
USUAL_GRADIENT = -0.0065  # °C/m, of the standard atmosphere
BEND_OF_GRADIENT = 0.1  # share of a strong inversion's temperature by which its profile may bend
UNSURE = 0.7  # of a thermometer's prior u that remains: the ranges do not determine it
UNPLACED = 80.0  # m, each of east and north, from the middle of the site to a station without a place
DOUBTED_C = 2.5  # prior u of a thermometer's offset from which it is doubted, before it is refuted


class AllowanceReason(NamedTuple):
    """Reason for an allowance.

    text      a sentence
    subject   parameter that it judges to be off; None for one that judges none
    """

    text: str
    subject: Parameter | None = None


@dataclass(frozen=True)
class Allowance:
    """Allowances beyond the records.

    held           priors that are never dropped
    thermometers   station: °C, standard uncertainty of its offset, doubts included
    profile        the same for the profile's parameter; 0: by the settings
    families       of `self_check`: standard deviation of the error that each bin's shots share, unit of the family
    reasons        of the allowances
    """

    held: frozenset[Parameter] = frozenset()
    thermometers: Mapping[str, float] = field(default_factory=dict)
    profile: float = 0.0
    families: Mapping[Family, float] = field(default_factory=dict)
    reasons: tuple[AllowanceReason, ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """Reasons, a sentence each."""
        return tuple(reason.text for reason in self.reasons)

    def same(self, allowance: "Allowance") -> bool:
        """True if no further adjustment is needed.

        Equal to a tenth; what is only considered changes no adjustment.
        """
        return (
            self.held == allowance.held
            and self.families.keys() == allowance.families.keys()
            and all(u <= 1.1 * allowance.thermometers.get(n, 0.0) for n, u in self._loose.items())
        )

    @property
    def _loose(self) -> dict[str, float]:
        """Thermometers with loosened priors.

        The other doubtful ones keep their records, and the doubt is considered.
        """
        stations = {p.of for p in self.held if p.kind is ParameterKind.THERMOMETER}
        return {n: u for n, u in self.thermometers.items() if n not in stations}

    def sigmas(self, air: AirField) -> np.ndarray:
        """Standard uncertainties of the air's constant parameters, doubts included."""
        sigmas = self.priors(air)
        for i, station in enumerate(air.stations):
            sigmas[i] = max(sigmas[i], self.thermometers.get(station, 0.0))
        at = len(air.stations)
        sigmas[at] = max(sigmas[at], self.profile)
        return sigmas

    def priors(self, air: AirField) -> np.ndarray:
        """Standard uncertainties of the air's constant parameters for an adjustment.

        A loosened prior of a poorly determined offset would absorb errors of the air's model. So
        the answer keeps to the record, and its covariance includes the doubt.
        """
        sigmas = air.sigmas.copy()
        for i, station in enumerate(air.stations):
            sigmas[i] = max(sigmas[i], self._loose.get(station, 0.0))
        return sigmas

    def considered(self, air: AirField, solution: LeastSquaresSolution, columns: np.ndarray) -> LeastSquaresSolution:
        """Solution with a covariance that includes possible errors of the priors.

        columns   of the air's parameters

        A prior of sigma s that is off by d moves all parameters by Q d / s^2.

        Source: consider parameters, [SCHMIDT66].
        """
        sigmas = self.priors(air)
        doubt = np.sqrt(np.maximum(self.sigmas(air) ** 2 - sigmas**2, 0.0))
        at = np.flatnonzero(doubt > 0.0)
        if not len(at):
            return solution
        reach = solution.q.across(columns[at]) * (doubt[at] / sigmas[at] ** 2)
        return replace(solution, q=Widened(solution.q, reach))


NOTHING = Allowance()


def refused(
    before: Allowance, dropped: Mapping[Parameter, float], air: AirField, u: Mapping[str, float], rangers: int
) -> Allowance:
    """Allowance that keeps the priors whose removal is implausible.

    dropped   parameters whose priors the adjustment left out, and their estimates
    u         station: °C, of its offset by the ranges
    """
    retained, reasons = set(before.held), list(before.reasons)
    zeros = [p for p in dropped if p.kind is ParameterKind.ZERO]
    if len(zeros) > max(1, MOST_ZEROS * rangers):
        retained |= set(zeros)
        names = ", ".join(p.of for p in zeros)
        text = f"the misfit would need {len(zeros)} wrong zeros at once ({names}): the sheets are kept, the cause is "
        reasons.append(AllowanceReason(text + "something else"))
    for parameter, value in dropped.items():
        if parameter.kind is not ParameterKind.THERMOMETER:
            continue
        prior = float(air.sigmas[air.stations.index(parameter.of)])
        if abs(value) > LARGEST_OFFSET_C or u[parameter.of] > prior:
            retained.add(parameter)
            text = (
                f"the misfit would need a bias of {parameter.of}'s thermometer by {value:+.1f} °C (u "
                f"{u[parameter.of]:.1f} °C), which the ranges do not determine well enough: its record is kept, and "
                "something else in the air departs from the model"
            )
            reasons.append(AllowanceReason(text))
    return replace(before, held=frozenset(retained), reasons=tuple(reasons))


def for_the_air(
    before: Allowance,
    air: AirField,
    solution: LeastSquaresSolution,
    columns: np.ndarray,
    *,
    dropped: Collection[Parameter] = (),
) -> Allowance:
    """Allowance for unusual air and doubtful thermometers.

    For a rare gradient, for stations without a place, and for thermometers that certified paths almost refute.

    columns   of the air's parameters
    dropped   parameters whose priors the adjustment left out
    """
    values, variance = solution.x[columns], solution.q.diagonal()[columns]
    count = len(air.stations)
    thermometers, reasons, profile = dict(before.thermometers), list(before.reasons), before.profile
    slope = float(np.hypot(*air.across(values)))
    for i, station in enumerate(air.stations):
        if not air.placed[i]:
            u = float(np.hypot(air.sigmas[i], slope * UNPLACED))
            if u > 1.1 * max(air.sigmas[i], thermometers.get(station, 0.0)):
                thermometers[station] = u
        off, thermometer = abs(float(values[i])), Parameter(ParameterKind.THERMOMETER, station)
        if (
            off > DOUBTED_C * air.sigmas[i]
            and station not in thermometers
            and thermometer not in {*before.held, *dropped}
        ):
            thermometers[station] = float(
                np.hypot(air.sigmas[i], off)
            )  # almost refuted: its record no longer constrains it
            text = (
                f"{station}'s thermometer is biased by {values[i]:+.2f} °C by the ranges, {off / air.sigmas[i]:.1f} of "
                "its record's u: the uncertainties include this"
            )
            reasons.append(AllowanceReason(text, thermometer))
    gradient = air.steepest(values)
    if air.profile == BEND.part and not STEEPEST_DOWN <= gradient <= STEEPEST_UP:
        apart = abs(gradient - (0.0 if gradient > 0.0 else USUAL_GRADIENT)) * float(np.ptp(air.heights))
        unsure = [s for i, s in enumerate(air.stations) if np.sqrt(variance[i]) > UNSURE * air.sigmas[i]]
        for station in unsure:
            thermometers[station] = max(thermometers.get(station, 0.0), float(np.hypot(air.sigmas[0], apart)))
        profile = max(profile, float(np.hypot(air.sigmas[count], BEND_OF_GRADIENT * apart)))
        blamed = " or ".join(f"{s}'s thermometer" for s in unsure) or "a thermometer"
        kind = "a strong inversion" if gradient > 0.0 else "air that cools faster with height than is stable"
        text = (
            f"the stations differ by {gradient:+.3f} °C a metre of height: {kind}, or {blamed} is off by some "
            f"{apart:.1f} °C, which no benchmark's path decides; the uncertainties include both"
        )
        reasons = [*(reason for reason in reasons if reason.subject != BEND), AllowanceReason(text, BEND)]
    return replace(before, thermometers=thermometers, profile=profile, reasons=tuple(reasons))


def for_families(before: Allowance, checks: list[FamilyCheck]) -> Allowance:
    """Allowance for the families with a significant average."""
    failed = [c for c in checks if not c.passed and c.family not in before.families]
    if not failed:
        return before
    worst = max(failed, key=lambda c: abs(c.worst.w))  # one at a time: a pattern shows in several families
    return replace(
        before,
        families={**before.families, worst.family: worst.spread},
        reasons=(*before.reasons, AllowanceReason(worst.text())),
    )
