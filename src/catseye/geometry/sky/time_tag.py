"""Instants in two parts, a Modified Julian Day and whole nanoseconds of it, so that sums and differences are exact.

A double holds an MJD of today in steps of 0.63 us, a text of 8 decimals in steps of 0.864 ms. What either costs is the
speed of the target times half a step, times a step where it is cut and not rounded: at slew rates the GBT's rim moves
by 0.65 m/s across a beam, and 8 decimals cost up to 0.28 mm or 0.56 mm, 11 decimals a thousandth of that.

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
EXACT_DECIMALS = 14  # steps of 0.864 ns: each nanosecond has its own text
MOST_DECIMALS = 30
TEXT = re.compile(r"([0-9]{1,6})(?:\.([0-9]{0,60}))?")


@dataclass(frozen=True, eq=False)
class TimeTag:
    """Instants (...): `day` is the whole Modified Julian Day, `nanoseconds` what has passed of it.

    day          (...) whole, 0 to 106 000
    nanoseconds  (...) whole; any, carried into the days

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
        most = np.iinfo(np.int64).max  # before a cast wraps them round
        if np.any(nanoseconds > most) or np.any(day > most):
            raise ValidityError(f"day {day.max()} or {nanoseconds.max()} ns is too large (expected days to {LAST_DAY})")
        carry, rest = np.divmod(nanoseconds.astype(np.int64), PER_DAY)
        whole = day.astype(np.int64) + carry
        if np.any((whole < 0) | (whole > LAST_DAY)):
            wrong = int(whole[(whole < 0) | (whole > LAST_DAY)].flat[0])
            raise ValidityError(f"day {wrong} is outside 0 to {LAST_DAY}: a Modified Julian Day such as 52889 is meant")
        object.__setattr__(self, "day", whole)
        object.__setattr__(self, "nanoseconds", rest)

    @staticmethod
    def from_mjd(mjd: ArrayLike) -> "TimeTag":
        """Nearest nanosecond to the exact value of a float, which itself stands for a span of 0.6 us.

        mjd    (...) days, 0 to 106 000

        >>> TimeTag.from_mjd(52889.125).nanoseconds.item()
        10800000000000
        """
        days = np.asarray(mjd, dtype=float)
        if not np.all((days >= 0.0) & (days <= LAST_DAY)):
            raise ValidityError(f"mjd {days[~((days >= 0.0) & (days <= LAST_DAY))].flat[0]} is outside 0 to {LAST_DAY}")
        whole = np.floor(days)
        return TimeTag(whole.astype(np.int64), np.rint((days - whole) * PER_DAY).astype(np.int64))

    @staticmethod
    def parse(text: str) -> "TimeTag":
        """Nearest nanosecond to a decimal text such as "52889.12500000000", by whole numbers alone.

        >>> TimeTag.parse("52889.00000000001").nanoseconds.item()
        864
        """
        match = TEXT.fullmatch(text.strip())
        if match is None:
            shown = text if len(text) <= 40 else f"{text[:40]}..."
            raise ValidityError(f"{shown!r} is not a Modified Julian Day (expected digits such as '52889.12500000000')")
        digits = match[2] or ""
        scale = 10 ** len(digits)
        passed = (2 * int(digits or "0") * PER_DAY + scale) // (2 * scale)
        return TimeTag(np.asarray(int(match[1])), np.asarray(passed))

    def text(self, decimals: int = MICROSECOND_DECIMALS) -> str:
        """One instant as a decimal MJD, rounded; 11 decimals tell microseconds apart, 14 are read back without loss.

        decimals    0 to 30

        >>> TimeTag(52889, 864).text(), TimeTag(52889, 432_000).text(8)
        ('52889.00000000001', '52889.00000001')
        """
        if not 0 <= decimals <= MOST_DECIMALS:
            raise ValidityError(f"decimals = {decimals} is outside 0 to {MOST_DECIMALS}")
        if self.day.ndim:
            raise ValidityError(f"an array of {self.day.shape} instants has no one text (expected one: tag[i].text())")
        scale = 10**decimals
        units = int(self.day) * scale + (2 * int(self.nanoseconds) * scale + PER_DAY) // (2 * PER_DAY)
        whole, rest = divmod(units, scale)
        return f"{whole}.{rest:0{decimals}d}" if decimals else str(whole)

    @property
    def mjd(self) -> NDArray[np.float64]:
        """(...) days, as a float: good to 0.32 us only."""
        return self.day + self.nanoseconds / PER_DAY

    def __getitem__(self, at: Any) -> "TimeTag":
        return TimeTag(self.day[at], self.nanoseconds[at])

    def __sub__(self, earlier: "TimeTag") -> NDArray[np.int64]:
        """(...) whole nanoseconds between two instants, exact."""
        if not isinstance(earlier, TimeTag):
            return NotImplemented
        return np.asarray((self.day - earlier.day) * PER_DAY + (self.nanoseconds - earlier.nanoseconds))

    def plus(self, nanoseconds: ArrayLike) -> "TimeTag":
        """The instants so many whole nanoseconds later, exact."""
        return TimeTag(self.day, self.nanoseconds + np.asarray(nanoseconds))

    def after(self, seconds: ArrayLike) -> "TimeTag":
        """The instants so many seconds later, the seconds rounded to whole nanoseconds.

        >>> TimeTag(52889, 0).after(0.128).nanoseconds.item()
        128000000
        """
        later = np.asarray(seconds, dtype=float)
        if not np.all(np.abs(later) <= LAST_DAY * SECONDS_PER_DAY):
            wrong = later[~(np.abs(later) <= LAST_DAY * SECONDS_PER_DAY)].flat[0]
            raise ValidityError(f"{wrong} s is not a span of time within {LAST_DAY} days")
        whole = np.floor(later)
        rest = np.rint((later - whole) * PER_SECOND)
        return self.plus(whole.astype(np.int64) * PER_SECOND + rest.astype(np.int64))

    def seconds_since(self, earlier: "TimeTag") -> NDArray[np.float64]:
        """(...) s between two instants: to the last bit of a float as far as 104 days apart."""
        return (self - earlier) / PER_SECOND


def tag_step(decimals: int) -> float:
    """Step in seconds of an MJD printed with so many decimals; rounding moves the instant by half of it at most.

    decimals    0 to 30

    Source: definition. Exact.

    >>> tag_step(8), tag_step(11)
    (0.000864, 8.64e-07)
    """
    if not 0 <= decimals <= MOST_DECIMALS:
        raise ValidityError(f"decimals = {decimals} is outside 0 to {MOST_DECIMALS}")
    return float(SECONDS_PER_DAY / 10**decimals)


def utc_text(mjd: float) -> str:
    """A time as people write it, rounded up to a second.

    >>> utc_text(52889.6334491)
    '2003-09-07T15:12:11Z'
    """
    when = MJD_EPOCH + timedelta(seconds=float(np.ceil(round(mjd * SECONDS_PER_DAY, 3))))
    return when.strftime("%Y-%m-%dT%H:%M:%SZ")


def mjd_of(text: str) -> float:
    """The MJD of a time as people write it: the number itself, or UTC such as 2003-09-07T15:12:09Z.

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
