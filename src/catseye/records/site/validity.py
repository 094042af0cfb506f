"""Check of a site's certificates against the date of measurements."""

import math
from collections.abc import Mapping
from datetime import date, timedelta

from catseye.records.files.record import Certificate
from catseye.records.site.folder import SiteFolder

MJD_ZERO = date(1858, 11, 17)  # day 0 of the Modified Julian Day, UTC


def expired(certificates: Mapping[str, Certificate], mjd: float) -> tuple[str, ...]:
    """Certificates that expired before the day of the data, one line each.

    The last day itself is valid.

    certificates   by name of the item
    mjd            UTC of the data
    """
    day = MJD_ZERO + timedelta(days=math.floor(mjd))
    return tuple(
        f"the certificate of {name} ended on {certificate.valid_until}, the data are of {day}"
        for name, certificate in certificates.items()
        if certificate.valid_until is not None and certificate.valid_until < day
    )


def expired_of_site(site: SiteFolder, mjd: float | None = None) -> tuple[str, ...]:
    """Expired certificates of a site's record, monuments, mirrors and triplets.

    mjd   UTC of the data; None: its campaign's start
    """
    certificates: dict[str, Certificate] = {"site.toml": site.site, **site.monuments, **site.mirrors, **site.triplets}
    return expired(certificates, site.site.campaign.start_mjd_utc if mjd is None else mjd)
