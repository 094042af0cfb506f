"""Provenance of an archived night: its inputs, and the programs, settings and certificates of its results."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from catseye.errors import InputError
from catseye.records.archive.index import read_sealed, sealed
from catseye.records.archive.layout import PROVENANCE
from catseye.records.archive.reading import ArchiveFolder, refuse_damaged

PROVENANCE_FORMAT = "catseye-archive-provenance-1"


@dataclass(frozen=True)
class InputFile:
    """File of a night before it was archived.

    path     relative to the campaign
    size     bytes
    sha256   of the content
    """

    path: str
    size: int
    sha256: str


@dataclass(frozen=True)
class NightProvenance:
    """Provenance of a night's results: inputs and versions.

    night      identifier
    inputs     files that come back when the night is restored
    samples    path of the one of them that holds the samples; "" without samples
    header     its bytes before the samples, hexadecimal
    versions   of catseye and its libraries
    details    settings, certificates and notes; of a journal its run and the head of its chain
    """

    night: str
    inputs: tuple[InputFile, ...]
    samples: str
    header: str
    versions: Mapping[str, str]
    details: Mapping[str, Any]


def provenance_text(provenance: NightProvenance) -> str:
    """Content of the file of a night's provenance."""
    return sealed({"format": PROVENANCE_FORMAT, **asdict(provenance)})


def read_provenance(archive: ArchiveFolder, night: str) -> NightProvenance:
    """Provenance of a night; InputError for an unknown night or a damaged file.

    night   identifier, or a beginning that only one has
    """
    entry = archive.entry(night)
    file = entry.file(PROVENANCE)
    if file is None:
        raise InputError(f"{archive.directory}: night {entry.night} has no provenance in the archive")
    refuse_damaged(archive.directory, file)
    document = read_sealed(archive.directory / file.path, PROVENANCE_FORMAT)
    del document["format"]
    return NightProvenance(**{**document, "inputs": tuple(InputFile(**each) for each in document["inputs"])})
