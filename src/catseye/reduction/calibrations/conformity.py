"""Statements of conformity with a specification, by an agreed decision rule."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from catseye.errors import InputError
from catseye.records.laboratory.certificate_job import (
    GUARDED,
    CertificateJob,
    CertificateRecords,
    DecisionRuleName,
    Specification,
    read_certificate_records,
)
from catseye.reduction.calibrations.calibration import Quantity

Statement = Literal["pass", "conditional pass", "conditional fail", "fail"]
LARGEST_DEGREES = 1e9  # beyond it Student's distribution is the normal one


@dataclass(frozen=True)
class Conformity:
    """One quantity against its limits.

    quantity        calibrated
    specification   limits
    guard           guard band inside each limit, in the quantity's unit
    probability     that the true value lies within the limits
    statement       by the decision rule
    """

    quantity: Quantity
    specification: Specification
    guard: float
    probability: float
    statement: Statement


@dataclass(frozen=True, eq=False)
class CertificateIssue:
    """Laboratory and job of a certificate, with the statements that the job asks for.

    records        laboratory, its logo and the job
    conformities   with the job's specifications, in their order
    """

    records: CertificateRecords
    conformities: tuple[Conformity, ...]


def certificate_issue(
    quantities: tuple[Quantity, ...], laboratory: Path | None = None, job: Path | None = None
) -> CertificateIssue:
    """Issue of a certificate of quantities, from its two records.

    laboratory, job   files (docs/formats/certificates.md); None: not stated

    Raises InputError for a file that cannot be used, and for a specification of a quantity that is none of them.
    """
    records = read_certificate_records(laboratory, job)
    try:
        return CertificateIssue(records, conformities(quantities, records.job))
    except InputError as problem:
        raise InputError(f"{job.name if job else 'job'}: {problem}") from problem


def conformities(quantities: tuple[Quantity, ...], job: CertificateJob) -> tuple[Conformity, ...]:
    """Statements for the specifications of a job, in their order.

    Raises InputError for a specification of a quantity that is none of them.
    """
    by_key = {q.key: q for q in quantities}
    if job.decision_rule is None:
        return ()
    for number, each in enumerate(job.specification):
        if each.key not in by_key:
            raise InputError(
                f"specification[{number}].key = {each.key!r} is not a quantity of this calibration (expected one of "
                f"{', '.join(by_key)})"
            )
        if not math.isfinite(by_key[each.key].u):
            raise InputError(f"specification[{number}].key = {each.key!r} has no uncertainty to judge it by")
    return tuple(conformity(by_key[each.key], each, job.decision_rule) for each in job.specification)


def conformity(quantity: Quantity, specification: Specification, rule: DecisionRuleName) -> Conformity:
    """Conformity of a quantity by a decision rule.

    Simple acceptance: pass within the limits, else fail. Guarded acceptance, with the expanded uncertainty U as guard
    band: pass within the limits less U, fail outside them by more than U, between these conditional.

    Source: [ILAC19] sections 4.2.1 and 4.2.3; probability by [JCGM106] section 7, Student's where u rests on few
    readings.
    """
    low = -math.inf if specification.lower is None else specification.lower
    high = math.inf if specification.upper is None else specification.upper
    room = min(quantity.value - low, high - quantity.value)  # below zero outside
    guard = quantity.coverage * quantity.u if rule == GUARDED else 0.0
    statement: Statement
    if room >= guard:
        statement = "pass"
    elif room < -guard:
        statement = "fail"
    else:
        statement = "conditional pass" if room >= 0.0 else "conditional fail"
    return Conformity(quantity, specification, guard, _probability(quantity, low, high), statement)


def _probability(quantity: Quantity, low: float, high: float) -> float:
    """Probability that the quantity lies between the limits."""
    from scipy.special import stdtr

    if quantity.u == 0.0:
        return float(low <= quantity.value <= high)
    degrees = min(quantity.degrees, LARGEST_DEGREES)
    ends = [stdtr(degrees, (end - quantity.value) / quantity.u) for end in (low, high)]
    return float(ends[1] - ends[0])
