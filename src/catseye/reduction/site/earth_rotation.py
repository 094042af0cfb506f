"""Earth rotation: UT1 - UTC from astropy's tables, and the Sun.

Nothing is downloaded. The tables are as old as the installed package astropy-iers-data: measured until then, predicted
for a year after. Outside them UT1 = UTC is assumed, and the status says so. By definition the two differ by at most
0.9 s, 13.5" of the Sun's hour angle, as long as leap seconds keep them together (decided up to 2035; after that some 1"
a year more).
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.errors import ValidityError
from catseye.geometry.sky.sun import EARLIEST_MJD, LATEST_MJD, refracted, sun_direction
from catseye.records.site.site import Location

KNOT = 300.0 / SECONDS_PER_DAY  # days
EARLY_ROWS = 5000  # of the table that begins in 1962: well beyond the start of the newer one in 1973
WORTH_KNOTS = 16  # times from which interpolation may be faster


class RotationStatus(StrEnum):
    """Source of a UT1 - UTC value."""

    MEASURED = "measured"
    PREDICTED = "predicted: within 0.05 s"
    UNKNOWN = "outside the tables: UT1 = UTC taken, the Sun's hour angle may be off by 13.5 arc seconds"


@dataclass(frozen=True)
class Rotation:
    """UT1 - UTC (...), s, with the code of `STATUSES`, (...) int."""

    ut1_minus_utc: NDArray[np.float64]
    code: NDArray[np.int8]

    @property
    def status(self) -> RotationStatus:
        """Worst status of all instants."""
        return STATUSES[int(np.max(self.code, initial=0))]


STATUSES = (RotationStatus.MEASURED, RotationStatus.PREDICTED, RotationStatus.UNKNOWN)


@dataclass(frozen=True)
class SunDirection:
    """Direction (..., 3) of the Sun in the ground frame, with its status.

    The status says how certain the Earth's rotation is.
    """

    direction: NDArray[np.float64]
    status: RotationStatus


@dataclass(frozen=True)
class FramePlace:
    """Place of a ground frame, and its air if refraction counts.

    latitude, longitude    rad, geodetic, east positive
    height                 m
    pressure_hpa           None: no refraction
    temperature_c          of the air there
    """

    latitude: float
    longitude: float
    height: float = 0.0
    pressure_hpa: float | None = None
    temperature_c: float = 10.0


def rotation_at(mjd: ArrayLike) -> Rotation:
    """UT1 - UTC at some times, from astropy's IERS tables.

    mjd    (...), UTC

    Linear between the daily values, leap seconds taken out first. Raises ValidityError for a mjd that is not finite.

    Source: [IERS10] chapter 5; bulletins A and B of the International Earth Rotation and Reference Systems Service.

    >>> seen = rotation_at(52892.0)
    >>> round(float(seen.ut1_minus_utc), 2), str(seen.status)
    (-0.35, 'measured')
    """
    days = np.asarray(mjd, dtype=float)
    if not np.all(np.isfinite(days)):
        raise ValidityError("mjd holds a number that is not finite (expected UTC as Modified Julian Day)")
    table = _table()
    covered = (days >= table.mjd[0]) & (days <= table.mjd[-1])
    ut1_minus_tai = np.interp(days, table.mjd, table.ut1_minus_tai)
    leaps = table.steps[np.searchsorted(table.starts, days, side="right")]
    code = np.where(covered, np.where(days > table.last_measured, 1, 0), 2).astype(np.int8)
    return Rotation(np.where(covered, ut1_minus_tai - leaps, 0.0), code)


def sun_at(mjd: ArrayLike, place: FramePlace | Location) -> SunDirection:
    """Direction of the Sun over a site, in its ground frame.

    `sun_direction` with UT1 - UTC by the tables.

    mjd      (...), UTC, 41317 to 88069
    place    a FramePlace, or [site] of a site record: the origin of the ground frame, for all rangers of it

    A Place with a pressure gives the Sun's apparent direction through the air. Many times that lie close together are
    interpolated between knots 5 minutes apart, within 0.002". Raises ValidityError as `sun_direction` does.

    >>> green_bank = FramePlace(38.433 * DEGREE, -79.840 * DEGREE, 807.0)
    >>> sun_at(52892.72, green_bank).direction.round(3).tolist()
    [-0.002, -0.552, 0.834]
    """
    if isinstance(place, Location):
        place = place_of(place)
    days = np.asarray(mjd, dtype=float)
    rotation = rotation_at(days)
    direction = _interpolated(days, place) if days.size > WORTH_KNOTS else _directly(days, place)
    if place.pressure_hpa is not None:
        direction = refracted(direction, place.pressure_hpa, place.temperature_c)
    return SunDirection(direction, rotation.status)


def place_of(site: Location, pressure_hpa: float | None = None, temperature_c: float = 10.0) -> FramePlace:
    """Place of a site record's table [site].

    The elevation of z = 0 is taken as height, accurate enough for parallax.

    pressure_hpa    0 means no air; None the standard atmosphere at its height
    """
    longitude = math.remainder(site.longitude_deg, 360.0) * DEGREE
    height = site.elevation_of_z0_m
    air = standard_pressure_hpa(height) if pressure_hpa is None else pressure_hpa
    return FramePlace(site.latitude_deg * DEGREE, longitude, height, air, temperature_c)


def standard_pressure_hpa(height: float) -> float:
    """Pressure of the standard atmosphere at a height, hPa.

    For heights -1000 to 11 000 m; accurate enough for the Sun's refraction.

    Source: [ISO75] section 2, 6.5 K/km from 288.15 K and 1013.25 hPa. Weather differs by 4 %, 1' at the horizon.

    >>> round(standard_pressure_hpa(807.0), 1)
    920.0
    """
    return 1013.25 * (1.0 - 0.0065 * height / 288.15) ** 5.2559


def _directly(mjd: NDArray[np.float64], place: FramePlace) -> NDArray[np.float64]:
    """`sun_direction` at each time: a tenth of a millisecond."""
    turn = rotation_at(mjd).ut1_minus_utc
    return sun_direction(mjd, place.latitude, place.longitude, place.height, ut1_minus_utc=turn)


def _interpolated(mjd: NDArray[np.float64], place: FramePlace) -> NDArray[np.float64]:
    """`sun_direction` interpolated through four knots about each time.

    Directly where that takes fewer evaluations.

    The cubic's error is (w h)^4 0.5625/24 = 5e-9 rad for h = 300 s.
    """
    if not np.all((mjd >= EARLIEST_MJD + KNOT) & (mjd <= LATEST_MJD - 3.0 * KNOT)):
        return _directly(mjd, place)  # which raises outside its range
    cells, which = np.unique(np.floor(mjd / KNOT), return_inverse=True)
    knots, where = np.unique(cells[:, None] + np.arange(-1.0, 3.0), return_inverse=True)
    if len(knots) > mjd.size:
        return _directly(mjd, place)
    at = _directly(knots * KNOT, place)[where.reshape(-1, 4)][which.reshape(mjd.shape)]
    s = mjd / KNOT - cells[which.reshape(mjd.shape)]
    weights = np.stack(
        [
            -s * (s - 1.0) * (s - 2.0) / 6.0,
            (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
            -(s + 1.0) * s * (s - 2.0) / 2.0,
            (s + 1.0) * s * (s - 1.0) / 6.0,
        ],
        axis=-1,
    )
    direction = np.einsum("...k,...ki->...i", weights, at)
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class _RotationTable:
    """Earth rotation by day.

    mjd             (n,) UTC
    ut1_minus_tai   (n,) s, free of steps
    starts          (k,) mjd, where a step of UTC starts
    steps           (k + 1,) s, UTC - TAI less that of the table's first day, before the first start and from each on
    last_measured   mjd; later rows are predicted
    """

    mjd: NDArray[np.float64]
    ut1_minus_tai: NDArray[np.float64]
    starts: NDArray[np.float64]
    steps: NDArray[np.float64]
    last_measured: float


@cache
def _table() -> _RotationTable:
    """Table of astropy-iers-data, the older until the newer begins."""
    from astropy_iers_data import IERS_A_FILE, IERS_B_FILE

    newer_mjd, newer_ut1, flag = _newer(IERS_A_FILE)
    with open(IERS_B_FILE, encoding="ascii") as stream:
        older = [line.split() for line in islice(stream, EARLY_ROWS) if not line.startswith("#")]
    older_mjd, older_ut1 = np.array([(row[4], row[7]) for row in older], dtype=float).T
    early = older_mjd < newer_mjd[0]
    mjd = np.concatenate([older_mjd[early], newer_mjd])
    ut1_minus_utc = np.concatenate([older_ut1[early], newer_ut1])
    used = np.isfinite(ut1_minus_utc) & (mjd >= 41_317.0)
    mjd, ut1_minus_utc = mjd[used], ut1_minus_utc[used]
    jumps = np.concatenate([[0.0], np.round(np.diff(ut1_minus_utc))])  # a leap second, seen from one day to the next
    steps = -np.cumsum(jumps)
    measured = newer_mjd[(flag == "B") | (flag == "I")]
    return _RotationTable(
        mjd=mjd,
        ut1_minus_tai=ut1_minus_utc + steps,
        starts=mjd[jumps != 0.0],
        steps=np.concatenate([[0.0], steps[jumps != 0.0]]),
        last_measured=measured[-1],
    )


def _newer(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.str_]]:
    """MJD, UT1 - UTC, and type of each row of the newer table.

    UT1 - UTC final where available, NaN past the predictions; types B final, I measured, P predicted.

    Source: the readme of finals2000A.all, by columns. astropy's reader takes a second for the same, which a
    coordinator that starts again does not have.
    """
    with open(path, encoding="ascii") as stream:
        lines = [line.rstrip("\n").ljust(188) for line in stream]
    rapid, final = ([line[at] for line in lines] for at in (slice(58, 68), slice(154, 165)))
    chosen = [b if b.strip() else a for a, b in zip(rapid, final, strict=True)]
    flag = np.array(["B" if b.strip() else line[57] for line, b in zip(lines, final, strict=True)])
    return (
        np.array([float(line[7:15]) for line in lines]),
        np.array([float(v) if v.strip() else np.nan for v in chosen]),
        flag,
    )
