"""Certificates that a night's result stood on, and whether they were valid then."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from catseye.errors import InputError
from catseye.names import counted
from catseye.reduction.query.span import ArchiveSpan
from catseye.verdict import Verdict


class CertificateState(Enum):
    """CertificateState of a certificate on the night; the value is the word of tables."""

    VALID = "valid"
    EXPIRED = "expired"
    LATER = "measured later"
    UNLIMITED = "no end stated"


@dataclass(frozen=True, eq=False)
class NightCertificates:
    """Certificates of one night, n of them.

    night, mjd       identifier, and UTC
    instrument       (n,) name of the record
    kind, file       (n,) kind of the record, and its file in the campaign
    sha256           (n,) of that file
    valid_from, valid_until   (n,) MJD; nan where not stated
    value, u, unit   (n,) main value of the record; nan without one
    validity         (n,) on the night
    """

    night: str
    mjd: float
    verdict: Verdict
    instrument: np.ndarray
    kind: np.ndarray
    file: np.ndarray
    sha256: np.ndarray
    valid_from: np.ndarray
    valid_until: np.ndarray
    value: np.ndarray
    u: np.ndarray
    unit: np.ndarray
    validity: tuple[CertificateState, ...]

    @property
    def left(self) -> np.ndarray:
        """Days from the night to the end of the last valid day, (n,); nan where no end is stated."""
        return np.floor(self.valid_until) + 1.0 - self.mjd


def night_certificates(span: ArchiveSpan, night: str) -> NightCertificates:
    """Certificates of a night, by its identifier or a beginning that only one has.

    Raises InputError: an unknown night, or one without certificates.
    """
    name = span.archive.entry(night).night
    columns = (
        *("instrument", "kind", "file", "sha256", "valid_from", "valid_until"),
        *("value", "u", "unit"),
    )
    rows = ArchiveSpan(span.archive).table("certificates", "mjd", *columns, night=name)
    if not len(rows["mjd"]):
        raise InputError(f"{span.archive.directory}: night {name} has no certificates (expected those of its records)")
    mjd = float(rows.pop("mjd")[0])
    validity = tuple(
        _validity(mjd, start, end)
        for start, end in zip(rows["valid_from"].tolist(), rows["valid_until"].tolist(), strict=True)
    )
    return NightCertificates(
        night=name, mjd=mjd, verdict=_judged(rows["instrument"].tolist(), validity), validity=validity, **rows
    )


def _validity(mjd: float, start: float, end: float) -> CertificateState:
    """CertificateState at a time; the last day itself is valid, and nan states nothing."""
    if np.floor(start) > np.floor(mjd):  # a date has no hour; False for nan
        return CertificateState.LATER
    if np.isnan(end):
        return CertificateState.UNLIMITED
    return CertificateState.VALID if mjd < np.floor(end) + 1.0 else CertificateState.EXPIRED


def _judged(instruments: list[str], validity: tuple[CertificateState, ...]) -> Verdict:
    bad = [
        (name, state)
        for name, state in zip(instruments, validity, strict=True)
        if state in (CertificateState.EXPIRED, CertificateState.LATER)
    ]
    if not bad:
        count = counted(len(instruments), "certificate")
        if endless := validity.count(CertificateState.UNLIMITED):
            return Verdict("good", f"{count}, none of them expired; {endless} without an end of validity")
        return Verdict("good", f"{count}, all of them valid on the night")
    name, state = bad[0]
    count = counted(len(instruments), "certificate")
    return Verdict("doubtful", f"{len(bad)} of {count} not valid on the night, first {name} ({state.value})")
