"""Instants as Modified Julian Day and whole nanoseconds, with exact arithmetic.

A double holds an MJD of today in steps of 0.63 us, a text of 8 decimals in steps of 0.864 ms. The error of either is
the speed of the target times half a step, or times a step where it is truncated: at slew rates the GBT's rim moves
by 0.65 m/s across a beam, and the error of 8 decimals is up to 0.28 mm or 0.56 mm, 11 decimals a thousandth of that.

A day has 86 400 s here. A Modified Julian Day in UTC has no name for a leap second: a track is not sent across one.
"""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.clock import PER_DAY, PER_SECOND
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import ValidityError

MJD_EPOCH = datetime(1858, 11, 17, tzinfo=UTC)
LAST_DAY = 106_000  # the difference of any two instants still fits 64 bits
MICROSECOND_DECIMALS = 11  # of an MJD: steps of 0.864 us
EXACT_DECIMALS = 14  # steps of 0.864 ns: each nanosecond has a distinct text
MOST_DECIMALS = 30
TEXT = re.compile(r"([0-9]{1,6})(?:\.([0-9]{0,60}))?")


@dataclass(frozen=True, eq=False)
class TimeTag:
    """Instants (...): whole Modified Julian Day and nanoseconds of it.

    day          (...) whole, 0 to 106 000
    nanoseconds  (...) whole; any; overflow goes into the days

    Source: the notes' time base, [PARKER04] sec. 2.6.1 (1 us). Exact.

    >>> (TimeTag(52889, 1_000) - TimeTag(52888, PER_DAY - 500)).item()
    1500
    """

    day: NDArray[np.int64]
    nanoseconds: NDArray[np.int64]

    def __post_init__(self) -> None:
        day, nanoseconds = np.broadcast_arrays(np.asarray(self.day), np.asarray(self.nanoseconds))
        if day.dtype.kind not in "iu" or nanoseconds.dtype.kind not in "iu":
            raise ValidityError(
                f"day and nanoseconds are {day.dtype} and {nanoseconds.dtype}, not whole numbers "
                "(expected both whole; a float MJD goes through TimeTag.from_mjd)"
            )
        most = np.iinfo(np.int64).max  # before a cast overflows
        if np.any(nanoseconds > most) or np.any(day > most):
            raise ValidityError(f"day {day.max()} or {nanoseconds.max()} ns is too large (expected days to {LAST_DAY})")
        carry, remainder = np.divmod(nanoseconds.astype(np.int64), PER_DAY)
        days = day.astype(np.int64) + carry
        if np.any((days < 0) | (days > LAST_DAY)):
            wrong = int(days[(days < 0) | (days > LAST_DAY)].flat[0])
            raise ValidityError(f"day {wrong} is outside 0 to {LAST_DAY}: a Modified Julian Day such as 52889 is meant")
        object.__setattr__(self, "day", days)
        object.__setattr__(self, "nanoseconds", remainder)

    @staticmethod
    def from_mjd(mjd: ArrayLike) -> "TimeTag":
        """Nearest nanosecond to a float MJD, which itself spans 0.6 us.

        mjd    (...) days, 0 to 106 000

        >>> TimeTag.from_mjd(52889.125).nanoseconds.item()
        10800000000000
        """
        days = np.asarray(mjd, dtype=float)
        if not np.all((days >= 0.0) & (days <= LAST_DAY)):
            raise ValidityError(f"mjd {days[~((days >= 0.0) & (days <= LAST_DAY))].flat[0]} is outside 0 to {LAST_DAY}")
        day = np.floor(days)
        return TimeTag(day.astype(np.int64), np.rint((days - day) * PER_DAY).astype(np.int64))

    @staticmethod
    def parse(text: str) -> "TimeTag":
        """Nearest nanosecond to a decimal text such as "52889.12500000000".

        By integer arithmetic.

        >>> TimeTag.parse("52889.00000000001").nanoseconds.item()
        864
        """
        match = TEXT.fullmatch(text.strip())
        if match is None:
            excerpt = text if len(text) <= 40 else f"{text[:40]}..."
            raise ValidityError(
                f"{excerpt!r} is not a Modified Julian Day (expected digits such as '52889.12500000000')"
            )
        digits = match[2] or ""
        scale = 10 ** len(digits)
        passed = (2 * int(digits or "0") * PER_DAY + scale) // (2 * scale)
        return TimeTag(np.asarray(int(match[1])), np.asarray(passed))

    def text(self, decimals: int = MICROSECOND_DECIMALS) -> str:
        """Decimal MJD of one instant, rounded.

        11 decimals separate microseconds, 14 are read back without loss.

        decimals    0 to 30

        >>> TimeTag(52889, 864).text(), TimeTag(52889, 432_000).text(8)
        ('52889.00000000001', '52889.00000001')
        """
        if not 0 <= decimals <= MOST_DECIMALS:
            raise ValidityError(f"decimals = {decimals} is outside 0 to {MOST_DECIMALS}")
        if self.day.ndim:
            raise ValidityError(
                f"an array of {self.day.shape} instants has no single text (expected one: tag[i].text())"
            )
        scale = 10**decimals
        units = int(self.day) * scale + (2 * int(self.nanoseconds) * scale + PER_DAY) // (2 * PER_DAY)
        day, fraction = divmod(units, scale)
        return f"{day}.{fraction:0{decimals}d}" if decimals else str(day)

    @property
    def mjd(self) -> NDArray[np.float64]:
        """MJD (...) days, as a float: good to 0.32 us only."""
        return self.day + self.nanoseconds / PER_DAY

    def __getitem__(self, at: Any) -> "TimeTag":
        return TimeTag(self.day[at], self.nanoseconds[at])

    def __sub__(self, earlier: "TimeTag") -> NDArray[np.int64]:
        """Difference (...) of two instants, whole nanoseconds, exact."""
        if not isinstance(earlier, TimeTag):
            return NotImplemented
        return np.asarray((self.day - earlier.day) * PER_DAY + (self.nanoseconds - earlier.nanoseconds))

    def plus(self, nanoseconds: ArrayLike) -> "TimeTag":
        """Instants later by whole nanoseconds, exact."""
        return TimeTag(self.day, self.nanoseconds + np.asarray(nanoseconds))

    def after(self, seconds: ArrayLike) -> "TimeTag":
        """Instants later by seconds, rounded to whole nanoseconds.

        >>> TimeTag(52889, 0).after(0.128).nanoseconds.item()
        128000000
        """
        later = np.asarray(seconds, dtype=float)
        if not np.all(np.abs(later) <= LAST_DAY * SECONDS_PER_DAY):
            wrong = later[~(np.abs(later) <= LAST_DAY * SECONDS_PER_DAY)].flat[0]
            raise ValidityError(f"{wrong} s is not a span of time within {LAST_DAY} days")
        full_seconds = np.floor(later)
        nanoseconds = np.rint((later - full_seconds) * PER_SECOND)
        return self.plus(full_seconds.astype(np.int64) * PER_SECOND + nanoseconds.astype(np.int64))

    def seconds_since(self, earlier: "TimeTag") -> NDArray[np.float64]:
        """Difference (...) of two instants, s, exact up to 104 days.

        To the last bit of a float.
        """
        return (self - earlier) / PER_SECOND


def tag_step(decimals: int) -> float:
    """Step, s, of an MJD printed with a number of decimals.

    Rounding moves the instant by at most half of it.

    decimals    0 to 30

    Source: definition. Exact.

    >>> tag_step(8), tag_step(11)
    (0.000864, 8.64e-07)
    """
    if not 0 <= decimals <= MOST_DECIMALS:
        raise ValidityError(f"decimals = {decimals} is outside 0 to {MOST_DECIMALS}")
    return float(SECONDS_PER_DAY / 10**decimals)


def utc_text(mjd: float) -> str:
    """UTC text of an instant, rounded up to a second.

    >>> utc_text(52889.6334491)
    '2003-09-07T15:12:11Z'
    """
    when = MJD_EPOCH + timedelta(seconds=float(np.ceil(round(mjd * SECONDS_PER_DAY, 3))))
    return when.strftime("%Y-%m-%dT%H:%M:%SZ")


def mjd_of(text: str) -> float:
    """MJD of a number or of a UTC text such as 2003-09-07T15:12:09Z.

    Without a zone it is UTC. Good to a microsecond. Raises ValidityError for any other text.

    >>> mjd_of("2003-09-07T12:00:00Z"), mjd_of("52889.5")
    (52889.5, 52889.5)
    """
    if TEXT.fullmatch(text):
        return float(text)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as problem:
        raise ValidityError(f"{text!r} is neither an MJD nor a time such as 2003-09-07T15:12:09Z") from problem
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return (moment - MJD_EPOCH).total_seconds() / SECONDS_PER_DAY
