"""Tests of every record of an adjusted epoch, and contradictions with the records that would explain them.

Each record's error is estimated by everything else; alternatives are compared by the decrease of the weighted sum of
squares, less a price for each error beyond the first. The best is named where no other comes near; otherwise all that
explain the misfit about as well are listed. Nothing is corrected: what is named may err by what was found, and the
adjustment is repeated.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtrc

from catseye.constants import MILLIMETRE
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit, LeastSquaresSolution
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.least_squares.patterns import PatternFit, Patterns, PatternTests
from catseye.estimation.least_squares.rows import variances
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.reduction.epoch.allowance import LARGEST_OFFSET_C, MOST_ZEROS
from catseye.reduction.epoch.contradictions.contradiction import (
    Contradiction,
    GroupTest,
    RecordError,
    RecordGroup,
    RecordTest,
)
from catseye.reduction.epoch.contradictions.hypotheses import (
    DIRECTIONS,
    Hypothesis,
    RecordKey,
    frequency_texts,
    is_parameter,
    line_hypothesis,
    parameter_of,
    patterns_of,
    range_hypotheses,
)
from catseye.reduction.epoch.contradictions.in_common import DATUM, HEIGHTS, record_hypotheses
from catseye.reduction.epoch.parameter import XYZ, ParameterKind
from catseye.reduction.epoch.prior_names import APPROXIMATE
from catseye.reduction.epoch.shots import ShotGroup, ShotParts
from catseye.reduction.epoch.unknowns import CampaignNetwork

MARGIN = 9.0  # difference of scores below which two explanations are not told apart
SUSPECTED = 3.0  # |w| from which a single number, or a line's shots, is an explanation to be compared
MOST = 6  # contradictions explained at once
NAMED, LISTED = 10.0, 1.0  # sigma of the wider prior over the error found: of a named record; of one of several
FARTHEST_MM = 20.0  # error of a place beyond which whole cycles may be wrong, and the test with them
LONGEST_MM = 100.0  # error of a length that all shots on it share: half a wavelength
LARGEST = {  # errors beyond which an explanation is impossible, in the unit of its group
    RecordGroup.THERMOMETERS: LARGEST_OFFSET_C,
    RecordGroup.SOUND: 40.0,  # °C: of a path's length misjudged by 7 %
    RecordGroup.MODULATION: 100.0,  # ppm: a quartz without an oven is good to 50
    RecordGroup.PRESSURE: 150.0,  # hPa: station pressure and sea level's differ by so much up to 1300 m
    RecordGroup.HUMIDITY: 100.0,
    RecordGroup.GLASS: 20.0,  # mm: half a prism's, a radius typed for a height
    RecordGroup.LEAKAGE: 200.0,  # mV: a tenth of a usual return
    RecordGroup.MOVEMENTS: 20.0,  # mm/h: a telescope that is driven moves faster, pillars and steel do not
}
LEAST_INFORMATION = 1e-3  # information of the data over a prior's, below which they say nothing of a parameter
LARGEST_GROUP = 300  # records tested together; of more, as of glass constants, each is tested alone


@dataclass(frozen=True, eq=False)
class EpochRecords:
    """An adjusted epoch with all that may be wrong in it.

    network, solution, shots   as settled
    """

    network: CampaignNetwork
    solution: LeastSquaresSolution
    shots: Sequence[tuple[ShotGroup, ShotParts]]

    @cached_property
    def groups(self) -> list[ObservationGroup]:
        """Observations, the rangers' first."""
        return [*(group for group, _ in self.shots), *self.network.priors]

    @cached_property
    def of_priors(self) -> list[Hypothesis]:
        """Hypotheses of records with priors; in a live epoch each alone, as seconds show nothing in common."""
        network = self.network
        each = record_hypotheses(network.priors, network.layout.parameters, network.campaign, network.places)
        return [h for h in each if network.motion is None or h.key.group is not RecordGroup.COMMON]

    @cached_property
    def of_ranges(self) -> list[Hypothesis]:
        """Hypotheses of records without priors; none of a live epoch, whose seconds show no scale and no drift."""
        network = self.network
        if network.motion is not None:
            return []
        seconds = np.concatenate([part.sight.seconds for _, part in self.shots])
        monuments = [n for n in network.rangers if n in network.campaign.monuments]
        return range_hypotheses(
            network.rangers,
            {p.body for p in network.places.values()},
            monuments=monuments,
            seconds=float(np.ptp(seconds)) if len(seconds) else 0.0,
            frequencies=frequency_texts(network.campaign),
        )

    def patterns(self, hypotheses: Sequence[Hypothesis]) -> Patterns:
        """Patterns of hypotheses in the active observations."""
        fits = self.solution.fits
        return patterns_of(
            hypotheses,
            [part.sight for _, part in self.shots],
            [len(fit.active) for fit in fits],
            np.concatenate([fit.active for fit in fits]),
        )

    @cached_property
    def untested(self) -> frozenset[str]:
        """Errors in common that nothing tests: a survey's datum, where no monument is held horizontally.

        Typed positions have the datum too, but a posture moves these alike.
        """
        held = any(0.0 in (m.u_x_mm, m.u_y_mm) for m in self.network.campaign.monuments.values())
        return frozenset((HEIGHTS,)) if held else DATUM

    @property
    def rivals(self) -> list[Hypothesis]:
        """Hypotheses compared with wrong shots while these are searched for.

        Records of one number each are compared where they stand out, and not those that the allowance has released
        or keeps; nor a survey's datum, which no range shows.
        """
        each = (*self.of_priors, *self.of_ranges)
        return [h for h in each if h.key.of not in DATUM and not self._settled(h)]

    def _settled(self, hypothesis: Hypothesis) -> bool:
        group, of = hypothesis.key
        allowance = self.network.allowance
        thermometers = {p.of for p in allowance.held if p.kind is ParameterKind.THERMOMETER}
        zeros = {p.of for p in allowance.held if p.kind is ParameterKind.ZERO}
        return (
            hypothesis.key in allowance.errors
            or hypothesis.key in allowance.refused
            or (group is RecordGroup.THERMOMETERS and of in thermometers)
            or (group is RecordGroup.ZEROS and of in zeros)
        )

    def suspected(self) -> list[Hypothesis]:
        """Rivals to be compared: those of many numbers, and single ones that stand out."""
        fits = self.solution.fits[len(self.shots) :]
        return [h for h in self.rivals if _stands_out(h, fits)]

    def lines(self) -> list[Hypothesis]:
        """Hypotheses of lines with a certificate, where it stands out.

        All shots of such a line may be a reflection, which fits as well as a wrong certificate. Of other lines each
        shot is tested, and left out.
        """
        certified = [h.key.of.split() for h in self.suspected() if h.key.group is RecordGroup.BENCHMARKS]
        return [line_hypothesis(ranger, target) for ranger, target in certified]


def _stands_out(hypothesis: Hypothesis, fits: Sequence[GroupFit]) -> bool:
    """False for a record of one row whose own test it passes."""
    if len(hypothesis.parts) > 1 or len(hypothesis.priors) != 1:
        return True
    ((i, (rows, _)),) = hypothesis.priors.items()
    return len(rows) > 1 or bool(abs(fits[i].standardised[rows[0]]) > SUSPECTED)


@dataclass(frozen=True, eq=False)
class Findings:
    """Contradictions of an adjusted epoch.

    contradictions   between records and ranges
    errors           records to be allowed for: SI standard uncertainty of each of their parts
    impossible       best explanation of a misfit that no record can have; None where a possible one explains it
    """

    contradictions: tuple[Contradiction, ...]
    errors: dict[RecordKey, tuple[float, ...]]
    impossible: RecordError | None = None


def findings_of(records: EpochRecords) -> Findings:
    """Contradictions between ranges and records, and the errors to be allowed for."""
    hypotheses = [*records.suspected(), *records.lines()]
    tests = PatternTests(Influence(records.groups, records.solution), records.patterns(hypotheses))
    explained: list[Contradiction] = []
    errors: dict[RecordKey, tuple[float, ...]] = {}
    impossible = None
    for _ in range(MOST):
        fits = list(zip(hypotheses, tests.fits, strict=True))
        possible = [(h, fit) for h, fit in fits if is_possible(h, fit)]
        best = max((fit.score for _, fit in possible if fit.significant), default=0.0)
        if best == 0.0:
            rejected = [(h, fit) for h, fit in fits if fit.significant]
            if rejected and not explained:
                impossible = explanation_of(*max(rejected, key=lambda pair: pair[1].score))
            break
        near = [(h, fit) for h, fit in possible if fit.score > max(best - MARGIN, 0.5 * best)]
        near.sort(key=lambda pair: -pair[1].score)
        explained.append(Contradiction(tuple(explanation_of(h, fit) for h, fit in near)))
        share = NAMED if len(near) == 1 else LISTED
        for h, fit in near:
            size = share * float(np.linalg.norm(np.nan_to_num(fit.errors)))
            errors[h.key] = (size,) * len(h.parts)
        tests.accept(hypotheses.index(near[0][0]))
    return _without_many_zeros(Findings(tuple(explained), errors, impossible), len(records.network.rangers))


def innocent_of(records: EpochRecords) -> list[RecordKey]:
    """Records named wrong whose errors are no longer significant, beside what was found since."""
    allowance = records.network.allowance
    named = {RecordKey(c.named.group, c.named.of) for c in allowance.contradictions if c.named is not None}
    accused = [h for h in (*records.of_priors, *records.of_ranges) if h.key in named]
    if len(allowance.contradictions) < 2 or not accused:
        return []
    tests = PatternTests(Influence(records.groups, records.solution), records.patterns(accused))
    fits = [_parameter_fit(records, h) or tests.fit(i) for i, h in enumerate(accused)]
    return [
        h.key
        for h, fit in zip(accused, fits, strict=True)
        if not fit.beside(np.array(allowance.errors[h.key])).significant
    ]


def _parameter_fit(records: EpochRecords, hypothesis: Hypothesis) -> PatternFit | None:
    """Fit of an error that is allowed for as parameters; None of another.

    A pattern beside parameters that are as free as the data leaves nothing to estimate but their prior. So the fit
    follows from these: with the prior S, estimate x and covariance Q, the data alone have the information Q^-1 - S^-1
    and the right side Q^-1 x. Directions without information are undetermined.
    """
    sigma = np.array(records.network.allowance.errors.get(hypothesis.key, ()))
    if not len(sigma) or not is_parameter(hypothesis.key):
        return None
    columns = records.network.layout.columns(parameter_of(hypothesis.key), len(sigma))
    inverse = np.linalg.inv(records.solution.q.within(columns) / np.outer(sigma, sigma))
    values, directions = np.linalg.eigh(inverse - np.eye(len(sigma)))
    used = values > LEAST_INFORMATION
    projector = directions[:, used] @ directions[:, used].T
    by_data = directions[:, used] / values[used] @ directions[:, used].T
    errors = by_data @ inverse @ (records.solution.x[columns] / sigma)
    covariance = (by_data + projector) * np.outer(sigma, sigma)  # beside a prior as wide
    determined = np.diag(projector) > LEAST_INFORMATION
    return PatternFit(
        gain=float(errors @ np.linalg.solve(by_data + np.eye(len(sigma)), errors)),
        degrees=int(np.count_nonzero(used)),
        errors=np.where(determined, errors * sigma, np.nan),
        u=np.where(determined, np.sqrt(np.diag(covariance)), np.inf),
        covariance=covariance,
    )


def _without_many_zeros(findings: Findings, rangers: int) -> Findings:
    """Findings that name no more zeros than can be wrong at once."""
    zeros = [c for c in findings.contradictions if c.named is not None and c.named.group is RecordGroup.ZEROS]
    if len(zeros) <= max(1, MOST_ZEROS * rangers):
        return findings
    remaining = tuple(c for c in findings.contradictions if c not in zeros)
    named = {c.named.of for c in zeros if c.named is not None}
    errors = {k: e for k, e in findings.errors.items() if k.group is not RecordGroup.ZEROS or k.of not in named}
    return Findings(remaining, errors, zeros[0].named)


def is_possible(hypothesis: Hypothesis, fit: PatternFit) -> bool:
    """True for an error that such a record can have."""
    group = hypothesis.key.group
    in_mm = FARTHEST_MM if len(hypothesis.parts) > 1 else LONGEST_MM
    limit = LARGEST.get(group, in_mm if hypothesis.unit == "mm" else None)
    if fit.degrees == 0:
        return False
    return limit is None or bool(np.nanmax(np.abs(fit.errors)) <= limit * abs(hypothesis.per_unit))


def explanation_of(hypothesis: Hypothesis, fit: PatternFit) -> RecordError:
    """Error of a record by a fit, in the record's units; parts that the fit does not determine are left out."""
    determined = np.isfinite(fit.u)
    return RecordError(
        group=hypothesis.key.group,
        of=hypothesis.key.of,
        record=hypothesis.record,
        where=hypothesis.where,
        parts=tuple(p for p, on in zip(hypothesis.parts, determined, strict=True) if on),
        unit=hypothesis.unit,
        errors=tuple((fit.errors[determined] / hypothesis.per_unit).tolist()),
        u=tuple((fit.u[determined] / abs(hypothesis.per_unit)).tolist()),
        gain=fit.gain,
    )


def record_tests(records: EpochRecords) -> tuple[tuple[RecordTest, ...], tuple[GroupTest, ...]]:
    """Test of every number of every record, and of each group of records."""
    hypotheses = [*records.of_priors, *records.of_ranges]
    counts = Counter(h.key.group for h in hypotheses)
    many = [h for h in hypotheses if counts[h.key.group] > LARGEST_GROUP]
    few = [h for h in hypotheses if counts[h.key.group] <= LARGEST_GROUP]
    tests = PatternTests(Influence(records.groups, records.solution), records.patterns(few))
    rows = [row for i, h in enumerate(few) for row in _rows(h, tests, tests.patterns.columns(i), records)]
    rows += [_alone(h, records) for h in many]
    groups = []
    tested = [(i, h.key.group) for i, h in enumerate(few) if h.key.of not in records.untested]
    for group in dict.fromkeys(group for _, group in tested):
        at = np.concatenate([tests.patterns.columns(i) for i, own in tested if own is group])
        fit = tests.fit_of(at)
        groups.append(GroupTest(group, fit.gain, fit.degrees, float(chdtrc(max(fit.degrees, 1), max(fit.gain, 0.0)))))
    return (*rows, *_typed(records)), tuple(groups)


def _rows(hypothesis: Hypothesis, tests: PatternTests, at: np.ndarray, records: EpochRecords) -> list[RecordTest]:
    """Tests of a record's numbers; of a movement, or of parameters, together, of others each by itself."""
    if hypothesis.key.of in records.untested:
        parts = enumerate(hypothesis.parts)
        return [_row(hypothesis, part, _stated(hypothesis, k, records), np.nan, np.inf, 0.0) for k, part in parts]
    together = _parameter_fit(records, hypothesis)
    if together is None and hypothesis.key.group is RecordGroup.MOVEMENTS:
        together = tests.fit_of(at)
    allowed = records.network.allowance.errors.get(hypothesis.key, (0.0,) * len(hypothesis.parts))
    result = []
    for k, part in enumerate(hypothesis.parts):
        fit = tests.fit_of(at[[k]]) if together is None else together
        error, u = (float(v[k if together is not None else 0]) for v in (fit.errors, fit.u))
        result.append(_row(hypothesis, part, _stated(hypothesis, k, records), error, u, allowed[k]))
    return result


def _row(hypothesis: Hypothesis, part: str, stated: float, error: float, u: float, allowed: float) -> RecordTest:
    """Test of one number, from SI values; what is allowed for beyond the record does not count."""
    u_own = np.sqrt(max(u**2 - allowed**2, 0.0)) if np.isfinite(u) else np.inf
    return RecordTest(
        group=hypothesis.key.group,
        record=hypothesis.record,
        where=hypothesis.where,
        part=part,
        unit=hypothesis.unit,
        u=stated / abs(hypothesis.per_unit),
        error=error / hypothesis.per_unit,
        u_error=float(u_own) / abs(hypothesis.per_unit),
    )


def _stated(hypothesis: Hypothesis, part: int, records: EpochRecords) -> float:
    """Standard uncertainty that a record states, SI; 0 for one that states none."""
    network, allowed = records.network, records.network.allowance.errors.get(hypothesis.key)
    for i, (rows, change) in hypothesis.priors.items():
        along = change[:, part]
        covariance = np.asarray(network.priors[i].covariance)
        matrix = np.diag(covariance[rows]) if covariance.ndim == 1 else covariance[np.ix_(rows, rows)]
        variance = 1.0 / float(along @ np.linalg.solve(matrix, along))
        return float(np.sqrt(max(variance - (0.0 if allowed is None else allowed[part] ** 2), 0.0)))
    return 0.0


def _alone(hypothesis: Hypothesis, records: EpochRecords) -> RecordTest:
    """Test of a record that is one row of a prior, by the row's own."""
    ((i, ((k,), _)),) = hypothesis.priors.items()
    prior, fit = records.network.priors[i], records.solution.fits[len(records.shots) + i]
    allowed = records.network.allowance.errors.get(hypothesis.key, (0.0,))[0]
    stated = float(np.sqrt(max(variances(prior)[k] - allowed**2, 0.0)))
    error, u = float(fit.estimated_error[k]), float(fit.detectable_error[k]) / NONCENTRALITY
    return _row(hypothesis, "", stated, error, u, allowed)


def _typed(records: EpochRecords) -> list[RecordTest]:
    """Tests of typed positions."""
    network, result = records.network, []
    prisms = network.campaign.triplet_of
    arm = {ranger.name for ranger in network.campaign.feedarm.ranger}
    for prior, fit in zip(network.priors, records.solution.fits[len(records.shots) :], strict=True):
        if prior.name != APPROXIMATE:
            continue
        first = prior.columns if prior.columns.ndim == 1 else prior.columns[:, 0]
        for k, column in enumerate(first.tolist()):
            parameter = network.layout.parameters[column]
            name = parameter.of
            where = (
                f"triplets/{prisms[name]}.toml" if name in prisms else "feedarm.toml" if name in arm else "targets.toml"
            )
            result.append(
                RecordTest(
                    group=RecordGroup.POSITIONS,
                    record=f"typed position of {name}",
                    where=f"{where}: {name}",
                    part=DIRECTIONS[XYZ.index(parameter.part)],
                    unit="mm",
                    u=float(fit.sigma[k]) / MILLIMETRE,
                    error=float(fit.estimated_error[k]) / MILLIMETRE,
                    u_error=float(fit.detectable_error[k]) / NONCENTRALITY / MILLIMETRE,
                )
            )
    return result
