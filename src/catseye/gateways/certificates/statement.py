"""Certificate of calibration: what a subject, a laboratory and a job say, in the order of [ISO17] 7.8."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime

import numpy as np

from catseye.gateways.certificates.document import (
    NOT_STATED,
    Block,
    CellTable,
    CertificateDocument,
    Chapter,
    Facts,
    Letterhead,
    Paragraph,
)
from catseye.gateways.certificates.rounding import rounded_result, rounded_up
from catseye.gateways.writers.objects import versions
from catseye.records.laboratory.certificate_job import (
    CertificateJob,
    CertificateRecords,
    LaboratoryRecord,
    Specification,
    WorkEnvironment,
)
from catseye.reduction.calibrations.budget import COVERAGE, Contribution
from catseye.reduction.calibrations.calibration import Quantity
from catseye.reduction.calibrations.conformity import Conformity
from catseye.verdict import Verdict
from catseye.version import __version__

SIGNATURES = ("measured by", "checked by", "approved by")
LEAST_CORRELATED, MOST_CORRELATED = 2, 14  # quantities whose correlations are a table
CONDITIONS = {
    "temperature_c": ("temperature", "°C"),
    "pressure_hpa": ("pressure", "hPa"),
    "humidity_percent": ("relative humidity", "%"),
}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
BUDGET_COLUMNS = ("contribution", "u(x)", "unit", "type", "distribution", "ν", "c", "|c| u(x)", "share")
REPRODUCTION = (
    "The results relate only to the item described here. This certificate shall not be reproduced except in full "
    "without the laboratory's written approval."
)
UNCERTAINTY = (
    "U = k u is the expanded uncertainty. k is the factor of Student's distribution with the effective degrees of "
    f"freedom of u (Welch and Satterthwaite) for a coverage probability of {100 * COVERAGE:g} %, 2 for a normal one; u "
    "is evaluated as in JCGM 100:2008. U has two significant digits, rounded up, the value the same last place."
)
BUDGET_NOTE = (
    "Type A is evaluated by statistics of the readings, type B by other knowledge: the standard uncertainties that the "
    "sheet states, whose distribution is taken as normal and whose degrees of freedom as infinite where nobody stated "
    "them. Contributions below 0.01 % of the largest are left out."
)
CONVENTIONS = (
    "Each value has the sign that the description beside it says: too long, too high, added to the measured length. "
    f"Axes, angles and senses of rotation are those of catseye {__version__} (catseye help conventions)."
)
RULES = {
    "simple-acceptance": "Simple acceptance (ILAC-G8:09/2019, 4.2.1): pass where the value lies within the limits; the "
    "uncertainty is not taken into account, and the risk of a wrong decision is up to 50 % at a limit.",
    "guarded-acceptance": "Guarded acceptance (ILAC-G8:09/2019, 4.2.3) with a guard band of U: pass where the value "
    "lies within the limits less U, fail where it lies outside them by more than U, conditional between these.",
}


@dataclass(frozen=True, eq=False)
class CertifiedSubject:
    """Calibrated item with its results, whatever calibrated it.

    title                   one line
    identity                "instrument", "serial", "measured_on", "valid_until", "by", "report"; None: not stated
    verdict                 of the calibration's own tests
    quantities              results, in order
    method                  sentences
    conventions             name of a quantity -> what it is, with its sign
    covariance              (q, q) of the quantities; None: unknown
    conditions              lowest and highest temperature_c, pressure_hpa, humidity_percent of the readings
    chapters                of its own: tests, figure, readings
    hashes                  SHA-256 of each raw file, by name
    settings                what its sheet states
    """

    title: str
    identity: Mapping[str, object]
    verdict: Verdict
    quantities: tuple[Quantity, ...]
    method: str
    conventions: tuple[tuple[str, str], ...]
    covariance: np.ndarray | None
    conditions: Mapping[str, tuple[float, float]]
    chapters: tuple[Chapter, ...]
    hashes: Mapping[str, str]
    settings: Mapping[str, object]


def _verdict(tests: Verdict, conformities: Sequence[Conformity]) -> Verdict:
    """Verdict of the first page: no better than the statements of conformity.

    tests   verdict of the calibration's own tests
    """
    judged = {each.quantity.key: each.statement for each in conformities if each.statement != "pass"}
    if not judged:
        return tests
    why = f"{tests.why}; conformity: {', '.join(f'{key} {statement}' for key, statement in judged.items())}"
    fails = tests.word == "failed" or not {"fail", "conditional fail"}.isdisjoint(judged.values())
    return Verdict("failed" if fails else "doubtful", why)


def certificate_document(
    subject: CertifiedSubject, records: CertificateRecords, conformities: Sequence[Conformity], when: datetime
) -> CertificateDocument:
    """Certificate of a subject.

    records        laboratory and job
    conformities   statements for the job's specifications
    when           UTC; its day is that of the issue where the job has none
    """
    job = records.job
    issued_on = job.issued_on or when.date()
    return CertificateDocument(
        number=records.number,
        subject=subject.title,
        letterhead=_letterhead(records),
        issued_on=issued_on,
        verdict=_verdict(subject.verdict, conformities),
        facts=Facts(tuple(_facts(subject, records, issued_on))),
        results=_results(subject, conformities),
        signatures=_signatures(records.laboratory),
        chapters=(
            _work(subject, job),
            _traceability(records, subject.identity.get("measured_on")),
            _conventions(subject),
            Chapter("budget", "Uncertainty budgets", tuple(_budgets(subject.quantities))),
            *_correlations(subject),
            _decision(job, conformities),
            *subject.chapters,
            _provenance(subject),
        ),
    )


def stated(value: object) -> str:
    """Text of a value; a missing one is not stated.

    >>> stated(None), stated(("a", "b"))
    ('not stated', 'a; b')
    """
    if value is None or value in ("", ()):
        return NOT_STATED
    return "; ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)


def _letterhead(records: CertificateRecords) -> Letterhead:
    laboratory = records.laboratory
    if laboratory is None:
        return Letterhead(f"Laboratory: {NOT_STATED}", (), NOT_STATED, b"")
    return Letterhead(
        laboratory.name,
        (*laboratory.address, *laboratory.contact) or (f"address {NOT_STATED}",),
        stated(laboratory.accreditation),
        records.logo,
    )


def _facts(subject: CertifiedSubject, records: CertificateRecords, issued_on: date) -> Iterator[tuple[str, str]]:
    job, identity = records.job, subject.identity
    customer = job.customer
    yield "certificate number", stated(records.number)
    if job.replaces is not None:
        yield "replaces certificate", job.replaces
    yield "customer", NOT_STATED if customer is None else "; ".join((customer.name, *customer.address))
    yield "contact", stated(None if customer is None else customer.contact)
    yield "order", stated(job.order)
    yield "instrument", stated(identity.get("instrument"))
    yield "serial number", stated(identity.get("serial"))
    yield "item", stated(job.item)
    yield "condition", stated(job.condition)
    yield "received on", stated(job.received_on)
    yield "measured on", stated(identity.get("measured_on"))
    yield "issued on", issued_on.isoformat()
    if job.interval_agreed:
        yield "valid until (agreed)", stated(identity.get("valid_until"))
    yield "measured by", stated(identity.get("by"))
    yield "procedure", stated(job.procedure)
    yield "place", stated(job.place)
    yield "report", stated(identity.get("report"))


def _results(subject: CertifiedSubject, conformities: Sequence[Conformity]) -> Chapter:
    statements = {each.quantity.key: each.statement for each in conformities}
    rows = []
    for q in subject.quantities:
        row = (q.key, *_result(q), q.unit or "1")
        judged = (statements.get(q.key, "–"),) if statements else ()
        rows.append((*row, *judged, q.meaning or NOT_STATED))
    judged_head = ("conformity",) if statements else ()
    heads = ("quantity", "value", "u", "k", "U = k u", "unit", *judged_head, "what it is, and which way it counts")
    blocks: list[Block] = [
        CellTable(heads, "tnnnnt" + "t" * bool(statements) + "w", tuple(rows)),
        Paragraph(UNCERTAINTY, faint=True),
        Paragraph(REPRODUCTION, faint=True),
    ]
    return Chapter("results", "Results", tuple(blocks))


def _result(q: Quantity) -> tuple[str, str, str, str]:
    """Value, u, k and U of a quantity, rounded by U."""
    if math.isnan(q.u):
        return _readable(q.value, 9), NOT_STATED, "–", NOT_STATED
    value, u, expanded = rounded_result(q.value, q.u, q.coverage)
    return value, u, f"{q.coverage:.2f}", expanded


def _signatures(laboratory: LaboratoryRecord | None) -> tuple[tuple[str, str], ...]:
    if laboratory is None or not laboratory.signatory:
        return tuple((role, "") for role in SIGNATURES)
    return tuple((each.role, each.name) for each in laboratory.signatory)


def _work(subject: CertifiedSubject, job: CertificateJob) -> Chapter:
    return Chapter(
        "work",
        "Procedure and environment",
        (
            Facts(
                (
                    ("procedure", stated(job.procedure)),
                    ("place", stated(job.place)),
                    ("adjustment of the item", stated(job.adjustment)),
                    ("deviations from the procedure", stated(job.deviations)),
                    ("opinions and interpretations", stated(job.remarks)),
                )
            ),
            CellTable(
                ("environment during the work", "lowest", "highest", "u", "unit", "source"),
                "tnnntt",
                tuple(_conditions(subject, job.environment)),
            ),
            Paragraph(subject.method),
        ),
    )


def _conditions(subject: CertifiedSubject, environment: WorkEnvironment) -> Iterator[tuple[str, ...]]:
    """Conditions of the job, else those of the readings."""
    for key, (name, unit) in CONDITIONS.items():
        span, source = getattr(environment, key), "job"
        u = getattr(environment, f"u_{key}")
        if span is None:
            span, source = subject.conditions.get(key), "readings and sheet"
            u = subject.settings.get(f"u_{key}") if span is not None else None
        if span is None:
            yield name, NOT_STATED, NOT_STATED, NOT_STATED, unit, ""
        else:
            yield name, f"{span[0]:.7g}", f"{span[1]:.7g}", NOT_STATED if u is None else f"{u:g}", unit, source


def _traceability(records: CertificateRecords, measured_on: object) -> Chapter:
    job = records.job
    statement = None if records.laboratory is None else records.laboratory.traceability
    rows = tuple(
        (
            each.name,
            stated(each.serial),
            stated(each.certificate),
            stated(each.laboratory),
            stated(each.calibrated_on),
            _validity(each.valid_until, isinstance(measured_on, date) and each.expired(measured_on)),
            stated(each.traceability),
        )
        for each in job.reference
    )
    heads = ("standard", "serial", "certificate", "laboratory", "calibrated on", "valid until", "traceability")
    standards: Block = CellTable(heads, "ttttttt", rows) if rows else Facts((("reference standards", NOT_STATED),))
    return Chapter(
        "traceability",
        "Reference standards and traceability",
        (standards, Facts((("traceability", stated(statement)),))),
    )


def _validity(valid_until: date | None, expired: bool) -> str:
    return stated(valid_until) + (", before the measurement" if expired else "")


def _conventions(subject: CertifiedSubject) -> Chapter:
    blocks: tuple[Block, ...] = (Paragraph(CONVENTIONS),)
    if subject.conventions:
        blocks = (*blocks, CellTable(("quantity", "sense"), "tw", subject.conventions))
    return Chapter("conventions", "Sign conventions", blocks)


def _budgets(quantities: Sequence[Quantity]) -> Iterator[Block]:
    yield Paragraph(BUDGET_NOTE, faint=True)
    unstated: list[str] = []
    for q in quantities:
        if not q.budget:
            unstated.append(q.key)
            continue
        total = sum(row.part**2 for row in q.budget)
        rows = [_budget_row(row, total) for row in q.budget]
        rows.append(
            ("combined", "", "", "", "", _degrees(q.degrees), "", _readable(q.u, 4), "100 %"),
        )
        expanded = f"{rounded_up(q.coverage * q.u):f}" if q.u > 0.0 else "0"
        caption = (
            f"{q.key}, in {q.unit or '1'}: u = {_readable(q.u, 4)}, ν_eff = {_degrees(q.degrees)}, "
            f"k = {q.coverage:.3f}, U = {expanded}"
        )
        yield CellTable(BUDGET_COLUMNS, "wntttnnnn", tuple(rows), caption)
    if unstated:
        yield Facts((("budget of " + ", ".join(unstated), NOT_STATED),))


def _budget_row(row: Contribution, total: float) -> tuple[str, ...]:
    return (
        row.source,
        _readable(row.u, 3),
        row.unit,
        row.evaluation,
        row.distribution,
        _degrees(row.degrees),
        _readable(row.sensitivity, 4),
        _readable(row.part, 4),
        f"{row.part**2 / total:.1%}".replace("%", " %"),
    )


def _readable(number: float, digits: int) -> str:
    """Number with so many digits; a power of ten instead of an e.

    >>> _readable(-5e-8, 3), _readable(0.0025, 3)
    ('-5·10⁻⁸', '0.0025')
    """
    head, _, exponent = f"{number:.{digits}g}".partition("e")
    return head if not exponent else f"{head}·10{str(int(exponent)).translate(RAISED)}"


def _degrees(degrees: float) -> str:
    return "∞" if degrees > 1e6 else f"{degrees:.1f}"  # beyond it k is 2 to six digits


def _correlations(subject: CertifiedSubject) -> Iterator[Chapter]:
    """Correlation coefficients, where they are known and fit the page."""
    count = len(subject.quantities)
    if subject.covariance is None or not LEAST_CORRELATED <= count <= MOST_CORRELATED:
        return
    u = np.array([q.u or 1.0 for q in subject.quantities])
    matrix = np.asarray(subject.covariance) / np.outer(u, u)
    rows = tuple(
        (f"{i + 1}  {q.key}", *(f"{matrix[i, j]:+.3f}" for j in range(count))) for i, q in enumerate(subject.quantities)
    )
    yield Chapter(
        "correlation",
        "Correlation of the results",
        (CellTable(("", *(str(j + 1) for j in range(count))), "t" + "n" * count, rows),),
    )


def _decision(job: CertificateJob, conformities: Sequence[Conformity]) -> Chapter:
    if job.decision_rule is None:
        text = "No decision rule was agreed: no statement of conformity with a specification is made."
        return Chapter("decision", "Decision rule and conformity", (Paragraph(text),))
    rows = tuple(
        (
            each.quantity.key,
            _limit(each.specification, "lower"),
            _limit(each.specification, "upper"),
            each.quantity.unit,
            f"{rounded_up(each.guard):f}" if each.guard > 0.0 else "0",
            _probability(each.probability),
            each.statement,
            stated(each.specification.source),
        )
        for each in conformities
    )
    heads = ("quantity", "lower limit", "upper limit", "unit", "guard band", "probability", "statement", "limits by")
    blocks: tuple[Block, ...] = (Paragraph(RULES[job.decision_rule]),)
    if rows:
        text = "Probability that the true value lies within the limits, by the distribution of the result."
        blocks = (*blocks, CellTable(heads, "tnntnttt", rows), Paragraph(text, faint=True))
    return Chapter("decision", "Decision rule and conformity", blocks)


def _limit(specification: Specification, side: str) -> str:
    value = getattr(specification, side)
    return "–" if value is None else f"{value:.12g}"


def _probability(probability: float) -> str:
    if math.isnan(probability):
        return "unknown"
    if probability > 0.99995:
        return "above 0.9999"
    return "below 0.0001" if probability < 0.00005 else f"{probability:.4f}"


def _provenance(subject: CertifiedSubject) -> Chapter:
    programs = tuple(versions().items())
    settings = tuple((key, str(value)) for key, value in subject.settings.items())
    blocks: list[Block] = [CellTable(("raw data", "SHA-256"), "th", tuple(subject.hashes.items()))]
    if settings:
        blocks.append(CellTable(("stated with the readings", "value"), "tw", settings))
    blocks.append(CellTable(("program", "version"), "tt", programs))
    blocks.append(Paragraph("End of the certificate.", faint=True))
    return Chapter("provenance", "Raw data and software", tuple(blocks))
