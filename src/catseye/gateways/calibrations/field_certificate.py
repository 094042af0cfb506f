"""Certificate of a monument's or a mirror's geometry, from its record."""

from collections.abc import Mapping

from catseye.errors import InputError
from catseye.gateways.calibrations.field_report_fields import written_aid, written_value
from catseye.gateways.certificates.document import CellTable, Chapter, Paragraph
from catseye.gateways.certificates.statement import CertifiedSubject
from catseye.reduction.calibrations.field_report import FORMS, Report, ReportField

UNCERTAINTIES = (
    "The record states a standard uncertainty for each value and not its contributions, which are in the calibrations "
    "that it was made from; those of the direction cosines follow from the angles. A coordinate that is held fixed has "
    "the uncertainty 0."
)


def report_subject(report: Report) -> CertifiedSubject:
    """Geometry of a record as a certificate shows it.

    Raises InputError for a blank form.
    """
    if not report.file:
        raise InputError("certificate: a blank form has no results (expected a record; --out writes the form)")
    form = FORMS[report.kind]
    return CertifiedSubject(
        title=f"{form.title}, {report.fields[0].value}",
        identity=_identity(report),
        verdict=report.verdict,
        quantities=report.quantities,
        method=f"Values and standard uncertainties are those of the record {report.file}. {form.rule}. {UNCERTAINTIES}",
        conventions=tuple((f.entry.name, f.entry.sense) for f in report.fields if f.entry.sense),
        covariance=None,
        conditions={},
        chapters=(_others(report), _notes(report)),
        hashes={report.file: report.sha256},
        settings={},
    )


def _identity(report: Report) -> Mapping[str, object]:
    return {**report.provenance, "instrument": f"{report.fields[0].entry.name} {report.fields[0].value}"}


def _others(report: Report) -> Chapter:
    """Fields that are no results, and those missing."""
    certified = {q.key for q in report.quantities}
    fields = [f for f in report.fields if f.value is not None and f.entry.key not in certified]
    rows = tuple((f.entry.name, f.entry.key, written_value(f), f.entry.unit, _remark(f)) for f in fields)
    blocks: list[CellTable | Paragraph] = [CellTable(("field", "key", "value", "unit", "remark"), "wtttw", rows)]
    if report.missing:
        names = ", ".join(entry.key for entry in report.missing)
        blocks.append(Paragraph(f"Missing in {report.file}: {names}."))
    return Chapter("others", "Settings and numbers of the parts", tuple(blocks))


def _remark(field: ReportField) -> str:
    return ", ".join(filter(None, (written_aid(field), field.entry.sense)))


def _notes(report: Report) -> Chapter:
    lines = [line for line in report.notes.splitlines() if line.strip()] or ["none"]
    return Chapter("notes", "Notes of the record", tuple(Paragraph(line) for line in lines))
