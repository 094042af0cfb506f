"""Certificates of calibration: a result, its laboratory and its job as a file to sign."""

import os
from collections.abc import Callable
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from catseye.api.reading import place_of
from catseye.api.result import SinglePage
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.gateways.calibrations.certificate import CertifiedSubject
    from catseye.gateways.calibrations.document import CertificateDocument
    from catseye.gateways.writers.passage import Passage
    from catseye.records.laboratory.certificate_job import CertificateRecords
    from catseye.reduction.calibrations.calibration import Quantity
    from catseye.reduction.calibrations.conformity import Conformity


class CertificateIssue(NamedTuple):
    """Laboratory and job of a certificate, and the statements that the job asks for.

    records        laboratory, logo and job
    conformities   with the job's specifications
    """

    records: "CertificateRecords"
    conformities: "tuple[Conformity, ...]"

    def passages(self) -> "list[Passage]":
        """Statements of conformity, for a terminal."""
        from catseye.gateways.calibrations.summary import conformity_passages

        return conformity_passages(self.conformities)

    def page(self, subject: "Callable[[], CertifiedSubject]", *, folders: bool = False) -> SinglePage:
        """Certificate as a single file, PDF or HTML by its name.

        subject   made when the file is
        folders   True: another certificate of its number is looked for in the folders beside it, too
        """
        from catseye.gateways.calibrations.document import MARK

        made: dict[date, CertificateDocument] = {}

        def document(now: datetime) -> "CertificateDocument":
            from catseye.gateways.calibrations.certificate import certificate_document

            if now.date() not in made:
                made[now.date()] = certificate_document(subject(), self.records, self.conformities, now)
            return made[now.date()]

        def text(now: datetime, path: Path) -> str | bytes:
            from catseye.gateways.calibrations.certificate_html import certificate_html
            from catseye.gateways.calibrations.certificate_pdf import certificate_pdf

            return (certificate_pdf if path.suffix.lower() == ".pdf" else certificate_html)(document(now))

        def refuse(now: datetime, path: Path) -> None:
            from catseye.gateways.calibrations.certificate_number import refuse_number

            if self.records.number is not None:
                refuse_number(path, document(now), folders=folders)

        return SinglePage(MARK, text, html=True, pdf=True, refuse=refuse)


def certificate_records(
    laboratory: "str | os.PathLike[str] | None", job: "str | os.PathLike[str] | None"
) -> "CertificateRecords":
    """Records of a certificate: who issues it, for which job.

    laboratory, job   files (docs/formats/certificates.md); None: not stated

    Raises InputError for a file that cannot be used.
    """
    from catseye.records.laboratory.certificate_job import read_certificate_records

    return read_certificate_records(
        None if laboratory is None else place_of(laboratory), None if job is None else place_of(job)
    )


def issue_of(quantities: "tuple[Quantity, ...]", records: "CertificateRecords") -> CertificateIssue:
    """Issue of a certificate with the statements of conformity of its quantities.

    Raises InputError for a specification of a quantity that is none of them.
    """
    from catseye.reduction.calibrations.conformity import conformities

    try:
        return CertificateIssue(records, conformities(quantities, records.job))
    except InputError as problem:
        raise InputError(f"{records.read[-1].name}: {problem}") from problem
