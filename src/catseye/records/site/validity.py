"""Certificates of a site against the date of what was measured with them."""

import math
from collections.abc import Mapping
from datetime import date, timedelta

from catseye.records.files.record import Certificate
from catseye.records.site.folder import SiteFolder

MJD_ZERO = date(1858, 11, 17)  # day 0 of the Modified Julian Day, UTC


def expired(certificates: Mapping[str, Certificate], mjd: float) -> tuple[str, ...]:
    """Certificates that ended before the day of the data, one line each; the last day itself is valid.

    certificates   by the name of the thing
    mjd            UTC of the data
    """
    day = MJD_ZERO + timedelta(days=math.floor(mjd))
    return tuple(
        f"the certificate of {name} ended on {each.valid_until}, the data are of {day}"
        for name, each in certificates.items()
        if each.valid_until is not None and each.valid_until < day
    )


def expired_of_site(site: SiteFolder, mjd: float | None = None) -> tuple[str, ...]:
    """Expired certificates of a site's record, monuments, mirrors and triplets.

    mjd   UTC of the data; None: its campaign's start
    """
    held: dict[str, Certificate] = {"site.toml": site.site, **site.monuments, **site.mirrors, **site.triplets}
    return expired(held, site.site.campaign.start_mjd_utc if mjd is None else mjd)
