"""Calibrations of a site: its records' certificates, their validity and main values."""

from collections.abc import Iterator
from datetime import date, timedelta
from typing import Any

from catseye.constants import MILLIMETRE
from catseye.records.files.record import Certificate
from catseye.records.site.folder import SiteFolder
from catseye.records.site.validity import MJD_ZERO
from catseye.service.watch.entries import Object

Row = tuple[str, str, str, Certificate, str, float | None, float | None, str]


def calibrations_object(site: SiteFolder, mjd: float) -> Object:
    """Certificates of the site's records with their validity at an MJD, and a value of each."""
    return {"mjd": mjd, "instruments": [_row(site, row, mjd) for row in _rows(site)]}


def mirror_certificate(site: SiteFolder, ranger: str, mjd: float) -> Object | None:
    """Certificate of a ranger's mirror and head; None for an unknown ranger."""
    if ranger not in site.rangers:
        return None
    mirror = site.mirror_of(ranger)
    return certificate_object(site, mirror.zp, f"mirrors/{mirror.zp}.toml", mirror, mjd)


def certificate_object(site: SiteFolder, instrument: str, file: str, certificate: Certificate, mjd: float) -> Object:
    """A certificate: instrument, file with hash, dates."""
    return {
        "instrument": instrument,
        "file": file,
        "sha256": site.hashes.get(file),
        "serial": certificate.serial,
        "measured_on": _day(certificate.measured_on),
        "valid_from": _day(certificate.measured_on),
        "valid_until": _day(certificate.valid_until),
        "valid": valid(certificate, mjd),
        "by": certificate.by,
        "report": certificate.report,
    }


def valid(certificate: Certificate, mjd: float) -> bool | None:
    """True on a day of its validity; None for a certificate without an end."""
    day = MJD_ZERO + timedelta(days=int(mjd // 1.0))
    if certificate.measured_on is not None and day < certificate.measured_on:
        return False
    return None if certificate.valid_until is None else day <= certificate.valid_until


def _row(site: SiteFolder, row: Row, mjd: float) -> Object:
    instrument, kind, file, certificate, quantity, value, u, unit = row
    named = {"kind": kind, "quantity": quantity, "value": value, "u": u, "unit": unit}
    return certificate_object(site, instrument, file, certificate, mjd) | named


def _rows(site: SiteFolder) -> Iterator[Row]:
    """Instrument, kind, file, certificate, and name, value, u and unit of its main quantity."""
    yield site.site.campaign.name, "site", "site.toml", site.site, "", None, None, ""
    for name, monument in site.monuments.items():
        file = f"monuments/{name}.toml"
        yield name, "monument", file, monument, "height of the fixed point", *_metres(monument.z_mm, monument.u_z_mm)
    for name, mirror in site.mirrors.items():
        yield name, "mirror", f"mirrors/{name}.toml", mirror, "D0", *_metres(mirror.d0_mm, mirror.u_d0_mm)
    for name, triplet in site.triplets.items():
        file = f"triplets/{name}.toml"
        yield name, "triplet", file, triplet, "H_corr", *_metres(triplet.h_corr_mm, triplet.u_h_corr_mm)


def _metres(value_mm: Any, u_mm: Any) -> tuple[float | None, float | None, str]:
    value, u = (None if v is None else v * MILLIMETRE for v in (value_mm, u_mm))
    return value, u, "m"


def _day(day: date | None) -> str | None:
    return None if day is None else day.isoformat()
