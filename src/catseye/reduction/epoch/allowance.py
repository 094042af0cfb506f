"""Explanations judged: a prior is dropped only for one that can be, and what stays unexplained is allowed for.

An adjustment drops the prior of a thermometer, a zero or a sounded line where the ranges contradict it. That is an
explanation of the misfit, and it must be possible: an instrument that can be so wrong, ranges that know it better than
its record, air that can be so. Where it is not, the prior stays, and what the residuals look like says what is allowed
for: a family of `self_check`, or the air between the stations.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.covariance import Widened
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.parameter import BEND, Parameter, ParameterKind
from catseye.reduction.epoch.self_check import Family, FamilyCheck

LARGEST_OFFSET_C = 8.0  # of a thermometer that is still one; a broken one reads nothing near
MOST_ZEROS = 0.25  # share of the rangers whose zeros may be wrong at once; more is no matter of zeros
STEEPEST_UP, STEEPEST_DOWN = 0.025, -0.02  # °C/m between the stations: of most nights; near the adiabatic lapse
USUAL_GRADIENT = -0.0065  # °C/m, of the standard atmosphere
BEND_OF_GRADIENT = 0.1  # share of a strong inversion's temperature by which its profile may bend
UNSURE = 0.7  # of a thermometer's prior u that the ranges leave: they know nothing of it
UNPLACED = 80.0  # m, each of east and north, from the middle of the site to a station whose place nobody said
DOUBTED_C = 2.5  # prior u of a thermometer's offset from which it is doubted, before it is refuted


@dataclass(frozen=True)
class Allowance:
    """What is allowed for beyond the records.

    held           priors that stay, whatever the ranges say
    thermometers   station: °C, standard uncertainty of its offset with what is doubted of it
    profile        the same of the profile's parameter; 0: as the settings say
    families       of `self_check`: standard deviation of the error that each bin's shots share, unit of the family
    texts          why, a sentence each
    """

    held: frozenset[Parameter] = frozenset()
    thermometers: Mapping[str, float] = field(default_factory=dict)
    profile: float = 0.0
    families: Mapping[Family, float] = field(default_factory=dict)
    texts: tuple[str, ...] = ()

    def same(self, other: "Allowance") -> bool:
        """Whether no other adjustment is asked for, to a tenth: what is only considered moves none."""
        return (
            self.held == other.held
            and self.families.keys() == other.families.keys()
            and all(u <= 1.1 * other.thermometers.get(n, 0.0) for n, u in self._loose.items())
        )

    @property
    def _loose(self) -> dict[str, float]:
        """Thermometers whose priors are loosened: of the others the records stay, and their doubt is considered."""
        kept = {p.of for p in self.held if p.kind is ParameterKind.THERMOMETER}
        return {n: u for n, u in self.thermometers.items() if n not in kept}

    def sigmas(self, air: AirField) -> np.ndarray:
        """Standard uncertainties of the air's lasting parameters with all that is doubted of them."""
        sigmas = self.priors(air)
        for i, station in enumerate(air.stations):
            sigmas[i] = max(sigmas[i], self.thermometers.get(station, 0.0))
        at = len(air.stations)
        sigmas[at] = max(sigmas[at], self.profile)
        return sigmas

    def priors(self, air: AirField) -> np.ndarray:
        """The same as an adjustment takes them.

        A doubt of what the ranges do not know would let them say it: by what the model does not know of the air. So
        the answer keeps to the record, and its covariance takes the doubt in.
        """
        sigmas = air.sigmas.copy()
        for i, station in enumerate(air.stations):
            sigmas[i] = max(sigmas[i], self._loose.get(station, 0.0))
        return sigmas

    def considered(self, air: AirField, solution: LeastSquaresSolution, columns: np.ndarray) -> LeastSquaresSolution:
        """The solution whose covariance takes in what the priors' own values may be off by.

        columns   of the air's parameters

        A prior of sigma s that is off by d moves all parameters by Q d / s^2.

        Source: consider parameters, [SCHMIDT66].
        """
        taken = self.priors(air)
        doubt = np.sqrt(np.maximum(self.sigmas(air) ** 2 - taken**2, 0.0))
        at = np.flatnonzero(doubt > 0.0)
        if not len(at):
            return solution
        reach = solution.q.across(columns[at]) * (doubt[at] / taken[at] ** 2)
        return replace(solution, q=Widened(solution.q, reach))


NOTHING = Allowance()


def refused(
    before: Allowance, dropped: Mapping[Parameter, float], air: AirField, u: Mapping[str, float], rangers: int
) -> Allowance:
    """The allowance with the priors that were dropped for what cannot be.

    dropped   parameters whose priors the adjustment left out, and the values that it took instead
    u         station: °C, to which the ranges know its offset now
    """
    held, texts = set(before.held), list(before.texts)
    zeros = [p for p in dropped if p.kind is ParameterKind.ZERO]
    if len(zeros) > max(1, MOST_ZEROS * rangers):
        held |= set(zeros)
        names = ", ".join(p.of for p in zeros)
        texts.append(
            f"the ranges would explain their misfit by {len(zeros)} wrong zeros at once ({names}): the sheets are "
            "kept, something else is wrong"
        )
    for parameter, value in dropped.items():
        if parameter.kind is not ParameterKind.THERMOMETER:
            continue
        prior = float(air.sigmas[air.stations.index(parameter.of)])
        if abs(value) > LARGEST_OFFSET_C or u[parameter.of] > prior:
            held.add(parameter)
            texts.append(
                f"the ranges would have {parameter.of}'s thermometer read {value:+.1f} °C too high (u "
                f"{u[parameter.of]:.1f} °C), which they do not know well enough: its record is kept, and something "
                "else in the air is not as the model has it"
            )
    return replace(before, held=frozenset(held), texts=tuple(texts))


def for_the_air(
    before: Allowance,
    air: AirField,
    solution: LeastSquaresSolution,
    columns: np.ndarray,
    *,
    dropped: Collection[Parameter] = (),
) -> Allowance:
    """The allowance for a gradient that few nights have, for stations that stand nobody knows where, and for
    thermometers that certified paths all but refute.

    columns   of the air's parameters
    dropped   parameters whose priors the adjustment left out
    """
    values, variance = solution.x[columns], solution.q.diagonal()[columns]
    count = len(air.stations)
    thermometers, texts, profile = dict(before.thermometers), list(before.texts), before.profile
    slope = float(np.hypot(*air.across(values)))
    for i, station in enumerate(air.stations):
        if not air.placed[i]:
            u = float(np.hypot(air.sigmas[i], slope * UNPLACED))
            if u > 1.1 * max(air.sigmas[i], thermometers.get(station, 0.0)):
                thermometers[station] = u
        off = abs(float(values[i]))
        if (
            off > DOUBTED_C * air.sigmas[i]
            and station not in thermometers
            and Parameter(ParameterKind.THERMOMETER, station) not in {*before.held, *dropped}
        ):
            thermometers[station] = float(np.hypot(air.sigmas[i], off))  # all but refuted: its record pulls no more
            texts.append(
                f"{station}'s thermometer is biased by {values[i]:+.2f} °C by the ranges, {off / air.sigmas[i]:.1f} of "
                "its record's u: the uncertainties allow for that"
            )
    gradient = air.steepest(values)
    if air.profile == BEND.part and not STEEPEST_DOWN <= gradient <= STEEPEST_UP:
        apart = abs(gradient - (0.0 if gradient > 0.0 else USUAL_GRADIENT)) * float(np.ptp(air.heights))
        unsure = [s for i, s in enumerate(air.stations) if np.sqrt(variance[i]) > UNSURE * air.sigmas[i]]
        for station in unsure:
            thermometers[station] = max(thermometers.get(station, 0.0), float(np.hypot(air.sigmas[0], apart)))
        profile = max(profile, float(np.hypot(air.sigmas[count], BEND_OF_GRADIENT * apart)))
        blamed = " or ".join(f"{s}'s thermometer" for s in unsure) or "a thermometer"
        kind = "a strong inversion" if gradient > 0.0 else "air colder above than it stays at rest"
        texts = [t for t in texts if not t.startswith("the stations differ")]
        texts.append(
            f"the stations differ by {gradient:+.3f} °C a metre of height: {kind}, or {blamed} is off by some "
            f"{apart:.1f} °C, which no benchmark's path tells apart; the uncertainties allow for either"
        )
    return replace(before, thermometers=thermometers, profile=profile, texts=tuple(texts))


def for_families(before: Allowance, checks: list[FamilyCheck]) -> Allowance:
    """The allowance for the families in which an average stands out."""
    failed = [c for c in checks if not c.passed and c.family not in before.families]
    if not failed:
        return before
    worst = max(failed, key=lambda c: abs(c.worst.w))  # one at a time: a pattern shows in several families
    return replace(
        before, families={**before.families, worst.family: worst.spread}, texts=(*before.texts, worst.text())
    )
