"""File of a certificate: PDF or page by its name, and its number used once."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from catseye.gateways.certificates.document import CertificateDocument
from catseye.gateways.certificates.number import refuse_number
from catseye.gateways.certificates.page import certificate_html
from catseye.gateways.certificates.pdf import certificate_pdf
from catseye.gateways.certificates.statement import CertifiedSubject, certificate_document
from catseye.reduction.calibrations.conformity import CertificateIssue


@dataclass(frozen=True)
class CertificateFile:
    """Certificate that can be written.

    subject   makes what is certified, when it is needed
    issue     laboratory, job and statements of conformity
    """

    subject: Callable[[], CertifiedSubject]
    issue: CertificateIssue

    def content(self, now: datetime, path: Path) -> str | bytes:
        """PDF or page, by the name of the file.

        now   UTC
        """
        document = self._document(now)
        return certificate_pdf(document) if path.suffix.lower() == ".pdf" else certificate_html(document)

    def refuse(self, now: datetime, path: Path) -> None:
        """Raise InputError where another certificate of its number is beside the file."""
        if self.issue.records.number is not None:
            refuse_number(path, self._document(now))

    def refuse_beside(self, now: datetime, directory: Path) -> None:
        """Raise InputError where another certificate of its number is beside a directory, or in one beside it."""
        if self.issue.records.number is not None:
            refuse_number(directory.parent / "certificate.html", self._document(now), folders=True)

    @lru_cache(maxsize=1)  # noqa: B019 - one short-lived file, whose figure takes half a second
    def _document(self, now: datetime) -> CertificateDocument:
        return certificate_document(self.subject(), self.issue.records, self.issue.conformities, now)
