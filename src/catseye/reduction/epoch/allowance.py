"""Plausibility of explanations, and allowances for misfit that remains.

Where the ranges contradict a record, `record_tests` says by how much each possible explanation errs, and the
adjustment is repeated with that allowed for. Where no record explains a misfit, the residuals' pattern decides what is
allowed for: a family of `self_check`, or the air between the stations.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.covariance import Widened
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.contradictions.contradiction import Contradiction, RecordGroup
from catseye.reduction.epoch.contradictions.hypotheses import RecordKey
from catseye.reduction.epoch.motion.scatter import sway_text
from catseye.reduction.epoch.parameter import BEND, Parameter, ParameterKind
from catseye.reduction.epoch.self_check import Family, FamilyCheck

LARGEST_OFFSET_C = 8.0  # of a working thermometer; a broken one is farther off
MOST_ZEROS = 0.25  # share of the rangers whose zeros may be wrong at once; more has another cause
STEEPEST_UP, STEEPEST_DOWN = 0.025, -0.02  # °C/m between the stations: of most nights; near the adiabatic lapse
USUAL_GRADIENT = -0.0065  # °C/m, of the standard atmosphere
BEND_OF_GRADIENT = 0.1  # share of a strong inversion's temperature by which its profile may bend
UNSURE = 0.7  # of a thermometer's prior u that remains: the ranges do not determine it
STRANGE_C = 4.0  # between two stations beyond the usual lapse: rather a wrong thermometer than an inversion
UNPLACED = 80.0  # m, each of east and north, from the middle of the site to a station without a place
DOUBTED_C = 2.5  # prior u of a thermometer's offset from which it is doubted, before it is refuted


class AllowanceReason(NamedTuple):
    """Reason for an allowance.

    text      a sentence
    subject   parameter that it judges to be off; None for one that judges none
    doubtful  False where the uncertainties include all that it may mean
    """

    text: str
    subject: Parameter | None = None
    doubtful: bool = True


@dataclass(frozen=True)
class Allowance:
    """Allowances beyond the records.

    held           priors that are never dropped
    thermometers   station: °C, standard uncertainty of its offset, doubts included
    profile        the same for the profile's parameter; 0: by the settings
    errors         records that may err by more than they state: SI standard uncertainty of each of their parts
    contradictions   between records and ranges, which these errors explain
    refused        records that cannot be what is wrong: with their errors allowed for, nothing settled
    searched       no contradiction explains the wrong shots that remain: they are left out whatever else would explain
                   them
    families       of `self_check`: standard deviation of the error that each bin's shots share, unit of the family
    sway           body, of `scatter.SWAYING`: m, standard deviation of a displacement drawn anew for each shot
    reasons        of the allowances
    """

    held: frozenset[Parameter] = frozenset()
    thermometers: Mapping[str, float] = field(default_factory=dict)
    profile: float = 0.0
    families: Mapping[Family, float] = field(default_factory=dict)
    errors: Mapping[RecordKey, tuple[float, ...]] = field(default_factory=dict)
    contradictions: tuple[Contradiction, ...] = ()
    refused: frozenset[RecordKey] = frozenset()
    searched: bool = False
    sway: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[AllowanceReason, ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """Sways and reasons, a sentence each."""
        return (*(sway_text(body, size) for body, size in self.sway.items()), *(reason.text for reason in self.reasons))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons against a good verdict."""
        return tuple(reason.text for reason in self.reasons if reason.doubtful)

    def same(self, allowance: "Allowance") -> bool:
        """True if no further adjustment is needed.

        Equal to a tenth; what is only considered changes no adjustment.
        """
        return (
            self.held == allowance.held
            and self.errors.keys() == allowance.errors.keys()
            and self.refused == allowance.refused
            and self.searched == allowance.searched
            and self.families.keys() == allowance.families.keys()
            and all(u <= 1.1 * allowance.thermometers.get(n, 0.0) for n, u in self._loose.items())
        )

    @property
    def refuted(self) -> tuple[Parameter, ...]:
        """Parameters named wrong: thermometers, zeros, sounded lines."""
        kinds = {
            RecordGroup.THERMOMETERS: ParameterKind.THERMOMETER,
            RecordGroup.ZEROS: ParameterKind.ZERO,
            RecordGroup.SOUND: ParameterKind.SOUND,
        }
        named = [c.named for c in self.contradictions if c.named is not None]
        return tuple(Parameter(kinds[n.group], n.of) for n in named if n.group in kinds and n.of)

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

    def explained(
        self, contradictions: Sequence[Contradiction], errors: Mapping[RecordKey, tuple[float, ...]]
    ) -> "Allowance":
        """Allowance for more contradictions, and the errors that explain them.

        What was allowed for while these were unknown is judged anew.
        """
        return replace(
            self,
            errors={**self.errors, **errors},
            contradictions=(*self.contradictions, *contradictions),
            thermometers={},
            profile=0.0,
            families={},
            reasons=(),
        )

    def refusing(self, keys: Collection[RecordKey]) -> "Allowance":
        """Allowance that keeps some records: with their errors allowed for, an adjustment did not settle."""
        text = "the ranges contradict records, but do not settle with the likeliest of them wrong"
        reasons = (*self.reasons, AllowanceReason(text))
        return replace(self, refused=self.refused | set(keys), searched=True, reasons=reasons)

    def acquitting(self, keys: Collection[RecordKey]) -> "Allowance":
        """Allowance that keeps records which were named, and are right beside what was named later."""
        remaining = tuple(
            c for c in self.contradictions if c.named is None or RecordKey(c.named.group, c.named.of) not in keys
        )
        errors = {key: sigma for key, sigma in self.errors.items() if key not in keys}
        return replace(self, errors=errors, contradictions=remaining, refused=self.refused | set(keys))

    def considered(self, air: AirField, solution: LeastSquaresSolution, columns: np.ndarray) -> LeastSquaresSolution:
        """Solution with a covariance that includes possible errors of the priors.

        columns   of the air's parameters

        A prior of sigma s that is off by d moves all parameters by Q d / s^2.

        Source: consider parameters, [SCHMIDT66].
        """
        sigmas = self.priors(air)
        doubt = np.sqrt(np.maximum(self.sigmas(air) ** 2 - sigmas**2, 0.0))
        if any(key.group is RecordGroup.THERMOMETERS for key in self.errors):
            doubt[: len(air.stations)] = 0.0  # their priors are wide, and the ranges determine what they can
        at = np.flatnonzero(doubt > 0.0)
        if not len(at):
            return solution
        reach = solution.q.across(columns[at]) * (doubt[at] / sigmas[at] ** 2)
        return replace(solution, q=Widened(solution.q, reach))


NOTHING = Allowance()


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
                f"the ranges lean to a bias of {values[i]:+.2f} °C of {station}'s thermometer, "
                f"{off / air.sigmas[i]:.1f} of its record's u, or to another scale or pressure: the uncertainties "
                "include this"
            )
            reasons.append(AllowanceReason(text, thermometer, doubtful=False))
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
        reasons = [
            *(reason for reason in reasons if reason.subject != BEND),
            AllowanceReason(text, BEND, doubtful=apart > STRANGE_C),
        ]
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
