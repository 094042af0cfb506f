"""`calibrate`, `certificate`, `triplet`: instruments and targets measured in the laboratory."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, SinglePage, digest_of, quantities
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.certificates.file import CertificateFile
    from catseye.gateways.certificates.statement import CertifiedSubject
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.calibrations.calibration import Calibration
    from catseye.reduction.calibrations.conformity import CertificateIssue
    from catseye.reduction.calibrations.field_report import Report
    from catseye.reduction.triplet.result import TripletReduction


def certificate_page(file: "CertificateFile") -> SinglePage:
    """Certificate as a single file of a result, PDF or HTML by its name."""
    from catseye.gateways.certificates.document import MARK

    return SinglePage(MARK, file.content, html=True, pdf=True, refuse=file.refuse)


def certificate_places(
    laboratory: "str | os.PathLike[str] | None", job: "str | os.PathLike[str] | None"
) -> tuple[Path | None, Path | None]:
    """Places of a certificate's two records, examples by name; None: not stated."""
    return None if laboratory is None else place_of(laboratory), None if job is None else place_of(job)


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationResult(Result):
    """A calibration from a table of readings: q quantities.

    kind          as `catseye calibrate` calls it
    keys          names of the quantities, each with its unit
    values, u     (q,) in those units; u has all known causes together
    covariance    (q, q) in those units
    record        what can be copied into the record of the instrument
    calibration   everything else: residuals, tests, figure, provenance
    issue         laboratory and job of its certificate, with statements of conformity
    read          files that were read
    """

    kind: str
    keys: tuple[str, ...]
    values: np.ndarray
    u: np.ndarray
    covariance: np.ndarray
    record: dict[str, Any]
    calibration: "Calibration"
    issue: "CertificateIssue"
    read: tuple[Path, ...]

    def passages(self) -> "Sequence[Passage]":
        """Quantity, result, conformity, tests and readings."""
        from catseye.gateways.calibrations.summary import conformity_passages, passages
        from catseye.gateways.writers.passage import Passage

        of_calibration = [Passage(title, text) for title, text in passages(self.calibration)]
        return [*of_calibration, *conformity_passages(self.issue.conformities)]

    def headline(self) -> "Sequence[Passage]":
        """The calibration and what was found."""
        from itertools import takewhile

        return list(takewhile(lambda passage: passage.title in ("Calibration", "Found", ""), self.passages()))[:6]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye calibrate --json`."""
        from catseye.gateways.calibrations.certificate_record import calibration_object

        return calibration_object(self.calibration)

    def tables(self) -> "dict[str, QTable]":
        """`quantities`: a row a quantity, in its unit; `readings`: a row a reading."""
        found = self.calibration.quantities
        columns = {
            "quantity": (self.keys, ""),
            "value": (self.values, ""),
            "u": (self.u, ""),
            "coverage_factor": ([q.coverage for q in found], ""),
            "unit": ([q.unit for q in found], ""),
            "meaning": ([q.meaning for q in found], ""),
        }
        rows = list(zip(*self.calibration.rows, strict=True))
        readings = {name: (list(row), "") for name, row in zip(self.calibration.columns, rows, strict=True)}
        return {"quantities": quantities(columns), "readings": quantities(readings)}

    def figures(self) -> "dict[str, Figure]":
        """Readings and what is left of them."""
        from catseye.gateways.calibrations.certificate_figure import calibration_figure

        return {"readings": calibration_figure(self.calibration)}

    def pages(self) -> dict[str, SinglePage]:
        """`record`, to keep with the instrument's; `certificate`, to sign, PDF or HTML by its name."""
        from catseye.gateways.calibrations.certificate_record import MARK, calibration_toml

        return {
            "record": SinglePage(MARK, lambda now, path: calibration_toml(self.calibration)),
            "certificate": certificate_page(self._certificate()),
        }

    def _certificate(self) -> "CertificateFile":
        from catseye.gateways.calibrations.calibration_certificate import calibration_subject
        from catseye.gateways.certificates.file import CertificateFile

        return CertificateFile(partial(calibration_subject, self.calibration), self.issue)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write record.toml and certificate.html with tables, figure and JSON.

        Raises InputError where another certificate of this number is beside the directory or in a folder there.
        """
        self._certificate().refuse_beside(datetime.now(UTC), directory)
        self.write_files(
            directory, progress, self.page_texts({"record.toml": "record", "certificate.html": "certificate"})
        )

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the files that were read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """The readings and their sheet, the laboratory's record and the job."""
        return self.read


def calibrate(
    kind: str,
    readings: "str | os.PathLike[str]",
    sheet: "str | os.PathLike[str] | None" = None,
    *,
    reject: bool = False,
    laboratory: "str | os.PathLike[str] | None" = None,
    job: "str | os.PathLike[str] | None" = None,
) -> CalibrationResult:
    """Calibration from a table of readings: quantities with covariance and tests.

    kind       what is calibrated, as `catseye calibrate --help` lists
    readings   table (docs/formats/calibrations.md)
    sheet      who, when, with what; the file beside the table with the ending .toml without
    reject     leave out readings that the tests reject, one by one
    laboratory, job   who issues the certificate, for whom and how (docs/formats/certificates.md)

    A calibration whose tests fail is a result, too: its verdict is "failed" and its values stand.
    Raises InputError for an unknown kind and for files that cannot be used.

    >>> calibrate("linearity", "calibrations/linearity.csv").kind
    'linearity'
    """
    from catseye.reduction.calibrations.conformity import certificate_issue
    from catseye.reduction.calibrations.kinds import calibrate as calibrated

    table = place_of(readings)
    beside = None if sheet is None else place_of(sheet)
    found = calibrated(kind, table, beside, reject=reject)
    issue = certificate_issue(found.quantities, *certificate_places(laboratory, job))
    return CalibrationResult(
        verdict=found.verdict,
        kind=found.kind,
        keys=tuple(q.key for q in found.quantities),
        values=np.array([q.value for q in found.quantities]),
        u=np.array([q.u for q in found.quantities]),
        covariance=np.asarray(found.covariance),
        record=dict(found.record),
        calibration=found,
        issue=issue,
        read=(table, table.with_suffix(".toml") if beside is None else beside, *issue.records.read),
    )


def save_calibration_template(kind: str, path: "str | os.PathLike[str]") -> tuple[Path, Path]:
    """Write the table of a calibration without readings and its sheet with every key, to fill in.

    kind   what is calibrated, as `catseye calibrate --help` lists
    path   of the table, new; its name ends in .csv; the sheet is beside it with the ending .toml

    Returns both paths. Raises InputError for an unknown kind and where a file exists or cannot be written.
    """
    from catseye.gateways.calibrations.template import MARK, template_sheet, template_table
    from catseye.gateways.writers.output import atomic_file
    from catseye.reduction.calibrations.kinds import KINDS

    if kind not in KINDS:
        raise InputError(f"calibration {kind!r} is unknown (expected one of {', '.join(KINDS)})")
    table = Path(path)
    if table.suffix != ".csv":
        raise InputError(f"template {table}: does not end in .csv (expected the name of a table)")
    if table.exists():
        raise InputError(f"template {table}: exists (expected a new name: readings would be lost)")
    example = place_of(f"calibrations/{kind}.csv").read_text(encoding="utf-8").splitlines()[:3]
    sheet = table.with_suffix(".toml")
    header = template_table(KINDS[kind])
    with atomic_file(table, "template", header) as rows, atomic_file(sheet, "template", MARK) as pieces:
        rows.append(header)
        pieces.append(template_sheet(kind, KINDS[kind], tuple(example)))
    return table, sheet


@dataclass(frozen=True, eq=False, repr=False)
class CertificateResult(Result):
    """Calibration report of a monument or a mirror: f fields.

    kind      "monument" or "mirror"
    keys      of the fields in the record
    missing   keys of the fields that the record lacks
    report    every field with its value, u and unit; provenance
    issue     laboratory and job of its certificate, with statements of conformity
    read      file that was read; None: a blank form
    page      file that was written; None: none
    """

    kind: str
    keys: tuple[str, ...]
    missing: tuple[str, ...]
    report: "Report"
    issue: "CertificateIssue"
    read: Path | None
    page: Path | None = None

    def passages(self) -> "Sequence[Passage]":
        """Title and number of the report, the missing fields, and conformity."""
        from catseye.gateways.calibrations.field_report_fields import report_passages
        from catseye.gateways.calibrations.summary import conformity_passages

        return [*report_passages(self.report), *conformity_passages(self.issue.conformities)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye certificate --json`."""
        from catseye.gateways.calibrations.field_report_fields import report_object

        return report_object(self.report, None if self.page is None else str(self.page))

    def tables(self) -> "dict[str, QTable]":
        """`fields`: a row a field of the form."""
        fields = self.report.fields
        columns = {
            "field": ([each.entry.name for each in fields], ""),
            "key": ([each.entry.key for each in fields], ""),
            "value": (["" if each.value is None else str(each.value) for each in fields], ""),
            "u": ([np.nan if each.u is None else each.u for each in fields], ""),
            "unit": ([each.entry.unit for each in fields], ""),
        }
        return {"fields": quantities(columns)}

    def pages(self) -> dict[str, SinglePage]:
        """`page`: the notes' form; `certificate`: a calibration certificate, PDF or HTML by its name."""
        from catseye.gateways.calibrations.field_report import field_report, mark

        page = SinglePage(mark(self.kind), lambda now, path: field_report(self.report, now), html=True)
        return {"page": page, "certificate": certificate_page(self._certificate())}

    def _certificate(self) -> "CertificateFile":
        from catseye.gateways.calibrations.field_certificate import report_subject
        from catseye.gateways.certificates.file import CertificateFile

        return CertificateFile(partial(report_subject, self.report), self.issue)

    def save_page(
        self, path: "str | os.PathLike[str] | None", certificate: "str | os.PathLike[str] | None" = None
    ) -> "CertificateResult":
        """Write the report and the certificate, to print and sign, both or none.

        path          of the report: new, or an earlier page of catseye; its name ends in .html; None: not written
        certificate   of the certificate, .pdf or .html; None: not written

        Returns the result with the name of its page. Raises InputError where nothing can be written.
        """
        page = None if path is None else Path(path)
        self.save_pages(page=page, certificate=None if certificate is None else Path(certificate))
        return replace(self, page=page)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write certificate.html with table and JSON."""
        self.write_files(directory, progress, self.page_texts({"certificate.html": "page"}))

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the record, by its name."""
        return {self.report.file: self.report.sha256} if self.report.file else {}

    def sources(self) -> tuple[Path, ...]:
        """Record that fills the form, the laboratory's record and the job."""
        return (*(() if self.read is None else (self.read,)), *self.issue.records.read)


def certificate(
    kind: str,
    record: "str | os.PathLike[str] | None" = None,
    *,
    blank: bool = False,
    laboratory: "str | os.PathLike[str] | None" = None,
    job: "str | os.PathLike[str] | None" = None,
) -> CertificateResult:
    """Calibration report of a monument or a mirror, filled or blank.

    kind     "monument" or "mirror"
    record   record that fills it; None: a blank form
    blank    a blank form, for which there is no record
    laboratory, job   who issues the certificate, for whom and how (docs/formats/certificates.md)

    Raises InputError for a record that cannot be used; ArgumentError: an unknown kind, a blank form with a record.

    >>> certificate("monument", "monuments/ZY3.toml").missing[:2]
    ('measured_on', 'by')
    """
    from catseye.reduction.calibrations.conformity import certificate_issue
    from catseye.reduction.calibrations.field_report import FORMS, blank_report, read_report

    if kind not in FORMS:
        raise ArgumentError(f"kind = {kind!r} is unknown (expected one of {', '.join(FORMS)})", "kind")
    if blank and record is not None:
        raise ArgumentError("blank takes no record", "blank")
    path = None if record is None else place_of(record)
    report = blank_report(kind) if path is None else read_report(kind, path)
    return CertificateResult(
        verdict=report.verdict,
        kind=kind,
        keys=tuple(each.entry.key for each in report.fields),
        missing=tuple(entry.key for entry in report.missing),
        report=report,
        issue=certificate_issue(report.quantities, *certificate_places(laboratory, job)),
        read=path,
    )


@dataclass(frozen=True, eq=False, repr=False)
class TripletsResult(Result):
    """Triplet units measured in the laboratory: n, in the sheets' order.

    names         of the units
    h_corr, u_h_corr       (n,) m: ball centre above the prisms' mid-point, towards the prism side
    l_mpbc, u_l_mpbc       (n,) m: the same from the surface plate
    difference    (n,) m, of the two
    accepted      (n,) bool: |difference| within the memo's 0.15 mm
    conformity_probability   (n,)
    units         everything else: file and reduction of each sheet
    issue         laboratory and job of a certificate, with statements of conformity
    hashes        SHA-256 of each file
    replaces      record of the unit whose place a single one takes; None: none
    """

    names: tuple[str, ...]
    h_corr: np.ndarray
    u_h_corr: np.ndarray
    l_mpbc: np.ndarray
    u_l_mpbc: np.ndarray
    difference: np.ndarray
    accepted: np.ndarray
    conformity_probability: np.ndarray
    units: "tuple[tuple[Path, TripletReduction], ...]"
    issue: "CertificateIssue"
    hashes: dict[Path, str] = field(default_factory=dict)
    replaces: Path | None = None

    def passages(self) -> "Sequence[Passage]":
        """The heights, their difference and what is worth knowing, unit by unit."""
        from catseye.gateways.calibrations.summary import conformity_passages
        from catseye.gateways.triplet.sheet import results
        from catseye.gateways.writers.passage import Passage

        passages = []
        for path, unit in self.units:
            named = [Passage(unit.measurement.triplet, path.name)] if len(self.units) > 1 else []
            passages += [*named, *(Passage(title, text) for title, text in results(unit))]
        return [*passages, *conformity_passages(self.issue.conformities)]

    def sheet(self) -> str:
        """Sheets with every symbol of the memo, as text."""
        from catseye.gateways.triplet.sheet import text_sheet

        return "\n".join(text_sheet(unit, path.name).rstrip() for path, unit in self.units)

    def to_object(self) -> Any:
        """JSON object of `catseye triplet --json`; a list for several sheets."""
        from catseye.gateways.triplet.objects import triplet_object

        objects = [triplet_object(unit, path.name) for path, unit in self.units]
        return objects[0] if len(objects) == 1 else objects

    def tables(self) -> "dict[str, QTable]":
        """`triplets`: a row a unit."""
        columns = {
            "triplet": (self.names, ""),
            "h_corr": (self.h_corr / MILLIMETRE, "mm"),
            "u_h_corr": (self.u_h_corr / MILLIMETRE, "mm"),
            "l_mpbc": (self.l_mpbc / MILLIMETRE, "mm"),
            "u_l_mpbc": (self.u_l_mpbc / MILLIMETRE, "mm"),
            "difference": (self.difference / MILLIMETRE, "mm"),
            "accepted": (self.accepted, ""),
            "conformity_probability": (self.conformity_probability, ""),
        }
        return {"triplets": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """The placements of each unit against its limits."""
        from catseye.gateways.triplet.figure import triplet_figure

        return {path.stem: triplet_figure(unit) for path, unit in self.units}

    def pages(self) -> dict[str, SinglePage]:
        """`certificate` of a single unit, PDF or HTML by its name."""
        from catseye.gateways.certificates.file import CertificateFile

        return {"certificate": certificate_page(CertificateFile(self._subject, self.issue))}

    def save_records(self, where: "str | os.PathLike[str]") -> tuple[Path, ...]:
        """Write both heights into the units' records, all or none; other keys and comments stay.

        where   directory of records TRnn.toml, or one of them; with a unit to replace a new file, too

        Returns the files. Raises InputError for a unit that is not accepted, for a record of another unit or of
        other glass, and where nothing can be written.
        """
        from catseye.gateways.triplet.record import write_records

        return write_records(Path(where), dict(self.units), self.hashes, replaces=self.replaces)

    def _subject(self) -> "CertifiedSubject":
        from catseye.gateways.triplet.certificate import triplet_subject

        if len(self.units) != 1:
            raise InputError(f"certificate: {len(self.units)} sheets were read (expected one, for a certificate each)")
        [(path, unit)] = self.units
        return triplet_subject(unit, path.name, self.hashes[path])

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye triplet --out`."""
        from catseye.gateways.triplet.files import refuse_namesakes, write_triplets

        refuse_namesakes([path for path, _ in self.units])
        write_triplets(dict(self.units), directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each sheet, by its name."""
        return {path.name: digest for path, digest in self.hashes.items()}

    def sources(self) -> tuple[Path, ...]:
        """Files that were read, which `save` leaves alone."""
        return (*(path for path, _ in self.units), *self.issue.records.read)


def triplet(
    *files: "str | os.PathLike[str]",
    laboratory: "str | os.PathLike[str] | None" = None,
    job: "str | os.PathLike[str] | None" = None,
    replaces: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
) -> TripletsResult:
    """Triplet units from their laboratory sheets: H_corr with uncertainty, accepted or not.

    files      sheets of measured units (docs/formats/triplet.md)
    laboratory, job   who issues the certificate of a single sheet, for whom (docs/formats/certificates.md)
    replaces   record of the unit whose place a single one takes, for `save_records`
    progress   called with (what, done, of how many)

    Raises InputError for a sheet that cannot be used, and without any.

    >>> triplet("triplets/TR01.toml").accepted.tolist()
    [True]
    """
    from catseye.records.files.reading import Folder
    from catseye.records.laboratory.triplet_measurement import TripletMeasurement
    from catseye.reduction.calibrations.conformity import certificate_issue
    from catseye.reduction.triplet.certified import triplet_quantities
    from catseye.reduction.triplet.unit import reduce_triplet
    from catseye.verdict import worst

    if not files:
        raise InputError("triplet needs a sheet (expected one file or more)")
    if len(files) > 1 and (laboratory is not None or job is not None):
        raise ArgumentError("laboratory and job are of one certificate (expected a single sheet)", "job", "laboratory")
    units: list[tuple[Path, TripletReduction]] = []
    hashes: dict[Path, str] = {}
    for done, sheet in enumerate(files):
        path = place_of(sheet)
        if progress is not None:
            progress("reducing", done, len(files))
        folder = Folder(path.parent)
        units.append((path, reduce_triplet(folder.record(path.name, TripletMeasurement))))
        hashes[path] = folder.hashes[path.name]
    found = [unit for _, unit in units]
    results = triplet_quantities(found[0]) if len(found) == 1 else ()
    return TripletsResult(
        verdict=worst([unit.verdict for unit in found]),
        names=tuple(unit.measurement.triplet for unit in found),
        h_corr=np.array([unit.h_corr for unit in found]),
        u_h_corr=np.array([unit.u_h_corr for unit in found]),
        l_mpbc=np.array([unit.l_mpbc for unit in found]),
        u_l_mpbc=np.array([unit.u_l_mpbc for unit in found]),
        difference=np.array([unit.difference for unit in found]),
        accepted=np.array([unit.accepted for unit in found]),
        conformity_probability=np.array([unit.conformity_probability for unit in found]),
        units=tuple(units),
        issue=certificate_issue(results, *certificate_places(laboratory, job)),
        hashes=hashes,
        replaces=None if replaces is None else place_of(replaces),
    )


def save_triplet_form(path: "str | os.PathLike[str]") -> Path:
    """Write the blank form of a triplet's sheet.

    path   new, or an earlier form of catseye; its name ends in .html

    Returns the path. Raises InputError where nothing can be written.
    """
    from catseye.gateways.triplet.form import MARK, blank_form
    from catseye.gateways.writers.output import atomic_file, refuse_suffix

    where = Path(path)
    refuse_suffix(where, "form")
    with atomic_file(where, "form", MARK) as pieces:
        pieces.append(blank_form())
    return where
