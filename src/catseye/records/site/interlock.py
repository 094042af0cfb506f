"""interlocks.toml: periods, daily hours and switches that forbid rangers to shine or move."""

from datetime import UTC, datetime, time
from typing import Annotated, Literal

from pydantic import AwareDatetime, Field, model_validator

from catseye.constants import SECONDS_PER_DAY
from catseye.records.files.record import Certificate, Name, Record, Version, broken_rule

MJD_ZERO = datetime(1858, 11, 17, tzinfo=UTC)
FARTHEST = 400  # days, longest period of `spans`
Act = Literal["shine", "move"]


class Interlock(Record):
    """[[interlock]]: forbidden action, rangers, times and reason.

    rangers                  names; none means all
    forbids                  "shine": the laser on, and shots; "move": the mirror; by default both
    begin, end               date-times with their offset from UTC (2003-09-07T16:00:00Z); a missing one is open
    daily_from, daily_until  UTC, times of day, over midnight if until is earlier; within begin and end if given
    switch                   instead of times: a contact, open until reported closed
    why                      reason, repeated in refusals
    name                     name of the interlock
    """

    name: Name
    why: str = Field(min_length=3)
    rangers: Annotated[tuple[Name, ...], Field(strict=False)] = ()
    forbids: Annotated[tuple[Act, ...], Field(strict=False, min_length=1)] = ("shine", "move")
    begin: AwareDatetime | None = None
    end: AwareDatetime | None = None
    daily_from: time | None = None
    daily_until: time | None = None
    switch: bool = False

    @model_validator(mode="after")
    def _says_when(self) -> "Interlock":
        times = [k for k in ("begin", "end", "daily_from", "daily_until") if getattr(self, k) is not None]
        if self.switch and times:
            raise broken_rule(
                f"{self.name}: a switch has no times, but {times[0]} is given (expected one or the other)"
            )
        if not self.switch and not times:
            raise broken_rule(
                f"{self.name} has no times (expected begin, end, daily_from with daily_until, or switch = true)"
            )
        if (self.daily_from is None) != (self.daily_until is None):
            raise broken_rule(f"{self.name}: daily_from and daily_until belong together (expected both or none)")
        if self.daily_from is not None and self.daily_from == self.daily_until:
            raise broken_rule(f"{self.name}: daily_from and daily_until are the same (expected two times of day)")
        for key in ("daily_from", "daily_until"):
            if (at := getattr(self, key)) is not None and at.tzinfo is not None:
                raise broken_rule(f"{self.name}: {key} = {at} has an offset (expected UTC without one)")
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            raise broken_rule(
                f"{self.name}: end = {self.end.isoformat()} is not after begin = {self.begin.isoformat()}"
            )
        return self

    def concerns(self, ranger: str) -> bool:
        """True if it applies to a ranger."""
        return not self.rangers or ranger in self.rangers

    def spans(self, since_mjd: float, until_mjd: float) -> list[tuple[float, float]]:
        """Periods (begin, end), MJD, overlapping an interval, in order, cut to it; none for a switch.

        until_mjd    at most 400 days later are used

        >>> from datetime import UTC, datetime, time
        >>> night = Interlock(name="n", why="tests", daily_from=time(23), daily_until=time(1))
        >>> [(round(a, 4), round(b, 4)) for a, b in night.spans(52889.0, 52890.0)]
        [(52889.0, 52889.0417), (52889.9583, 52890.0)]
        """
        if self.switch:
            return []
        low = since_mjd if self.begin is None else max(since_mjd, _mjd(self.begin))
        high = until_mjd if self.end is None else min(until_mjd, _mjd(self.end))
        high = min(high, since_mjd + FARTHEST)
        if self.daily_from is None or self.daily_until is None:
            return [(low, high)] if low <= high else []
        start, stop = _share(self.daily_from), _share(self.daily_until)
        stop += 1.0 if stop < start else 0.0
        days = range(int(low // 1.0) - 1, int(high // 1.0) + 1)
        cut = [(max(low, day + start), min(high, day + stop)) for day in days]
        return [(a, b) for a, b in cut if a <= b and b > low - 1e-12 and (a < b or a == low)]


class Interlocks(Certificate):
    """Complete file.

    interlock   forbidden actions

    >>> Interlocks(format="catseye-interlocks-1").interlock
    ()
    """

    format: Annotated[int | str, Version("interlocks")] = 1
    interlock: Annotated[tuple[Interlock, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_unique_names(self) -> "Interlocks":
        names = [interlock.name for interlock in self.interlock]
        for name in names:
            if names.count(name) > 1:
                raise broken_rule(f"interlock {name!r} is given twice (expected unique names)")
        return self


def _mjd(at: datetime) -> float:
    return (at - MJD_ZERO).total_seconds() / SECONDS_PER_DAY


def _share(at: time) -> float:
    """Elapsed share of the day."""
    return (at.hour * 3600 + at.minute * 60 + at.second + at.microsecond * 1e-6) / SECONDS_PER_DAY
