"""Numbers of certificates, which are used once."""

from collections.abc import Iterator
from pathlib import Path

from catseye.errors import InputError
from catseye.gateways.certificates.document import CertificateDocument
from catseye.gateways.writers.output import PAGES, holds

SUFFIXES = (".pdf", *PAGES)


def refuse_number(path: Path, document: CertificateDocument, *, folders: bool = False) -> None:
    """Raise InputError where another certificate of this number is in the place of the output.

    path       of the file to be written
    document   to be written; the same one, as PDF or as page, is no other certificate
    folders    True: in the folders of that place, too
    """
    if document.number is None:
        return
    place = path.resolve().parent
    for file in _certificates(place, folders):
        try:
            if not holds(file, document.number_mark) or holds(file, document.content_mark):
                continue
        except OSError:  # a file that cannot be read is nobody's certificate
            continue
        raise InputError(
            f"certificate {path}: number {document.number!r} stands in {file.relative_to(place)} already (expected a "
            "new number, and this one as `replaces` of the job for an amendment)"
        )


def _certificates(place: Path, folders: bool) -> Iterator[Path]:
    """Files that may be certificates, in order."""
    if not place.is_dir():
        return
    for entry in sorted(place.iterdir()):
        if entry.suffix.lower() in SUFFIXES and entry.is_file():
            yield entry
        elif folders and entry.is_dir() and not entry.name.startswith("."):
            yield from _certificates(entry, False)
