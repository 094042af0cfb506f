"""doubts.csv: what was not believed while a night was measured, and why; a night is reduced without it."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import StringConstraints

from catseye.records.files.record import Mjd, Name, Record
from catseye.records.files.refusal import in_row, refusal, shown
from catseye.records.night.shot import ShotRow
from catseye.records.night.weather import WeatherSample

DOUBTS = "doubts.csv"  # optional
LONGEST_GAP = 1800.0 / 86_400.0  # days that a station may be without a believed reading before it counts for nothing


class DoubtRow(Record):
    """A row of doubts.csv.

    what      a shot, or a reading of the weather
    name      the shot's number, the station
    mjd_utc   as in its own file
    why       in words, as it was told then
    """

    what: Literal["shot", "weather"]
    name: Name
    mjd_utc: Mjd
    why: Annotated[str, StringConstraints(min_length=1, max_length=500)]


def refuse_doubts(doubts: Sequence[DoubtRow], shots: Sequence[ShotRow], samples: Sequence[WeatherSample]) -> None:
    """Every doubt is of a shot or a reading that is there, and there is one of each."""
    known = {("shot", str(shot.shot), shot.mjd_utc) for shot in shots}
    known |= {("weather", sample.station, sample.mjd_utc) for sample in samples}
    seen: dict[tuple[str, str, float], int] = {}
    for row, doubt in enumerate(doubts, start=1):
        which = (doubt.what, doubt.name, doubt.mjd_utc)
        if which not in known:
            file = "shots.csv" if doubt.what == "shot" else "weather.csv"
            text = f"{doubt.what} {shown(doubt.name)} at {doubt.mjd_utc!r} is not in {file} (expected name and time)"
            raise in_row(DOUBTS, row, text)
        if (first := seen.setdefault(which, row)) != row:
            raise in_row(DOUBTS, row, f"{doubt.what} {doubt.name} has a doubt in row {first} (expected one)")


def believed_samples(
    samples: Sequence[WeatherSample], doubts: Sequence[DoubtRow], times: np.ndarray
) -> tuple[list[WeatherSample], list[str]]:
    """The readings that count, and notes about those that do not.

    times   MJD of the shots

    A station that for half an hour of shots and more has no believed reading counts for nothing: what it reads
    before and after does not say what the air was meanwhile.

    Raises InputError where nothing is left.
    """
    doubted = {(each.name, each.mjd_utc): each.why for each in doubts if each.what == "weather"}
    if not doubted:
        return list(samples), []
    kept = [sample for sample in samples if (sample.station, sample.mjd_utc) not in doubted]
    notes = []
    for name in sorted({name for name, _ in doubted}):
        own = np.array([sample.mjd_utc for sample in kept if sample.station == name])
        count = sum(station == name for station, _ in doubted)
        why = next(text for (station, _), text in doubted.items() if station == name)
        gap = np.abs(times[:, None] - own).min(axis=1).max() if len(own) else np.inf
        if gap > LONGEST_GAP:
            kept = [sample for sample in kept if sample.station != name]
            what = "the whole station is left out"
        else:
            what = f"{count} of its readings {'is' if count == 1 else 'are'} left out"
        notes.append(f"{name} was not believed while it was measured ({why}): {what}, by {DOUBTS}")
    if not kept:
        raise refusal(DOUBTS, "leaves no weather reading (expected some that are believed; take rows out)")
    return kept, notes
