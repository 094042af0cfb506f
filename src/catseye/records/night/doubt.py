"""doubts.csv: readings and shots rejected during a night, with reasons; excluded from its reduction."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import StringConstraints

from catseye.records.files.record import Mjd, Name, Record
from catseye.records.files.refusal import in_row, refusal, shown
from catseye.records.night.shot import ShotRow
from catseye.records.night.weather import WeatherSample

DOUBTS = "doubts.csv"  # optional
LONGEST_GAP = 1800.0 / 86_400.0  # days, largest gap between trusted readings of a usable station


class DoubtRow(Record):
    """Row of doubts.csv.

    what      shot, or weather reading
    name      number of the shot, or station
    mjd_utc   time, as in the other file
    why       reason given at the time
    """

    what: Literal["shot", "weather"]
    name: Name
    mjd_utc: Mjd
    why: Annotated[str, StringConstraints(min_length=1, max_length=500)]


def refuse_doubts(doubts: Sequence[DoubtRow], shots: Sequence[ShotRow], samples: Sequence[WeatherSample]) -> None:
    """Raise InputError for doubts on missing shots or readings, or repeated ones."""
    existing = {("shot", str(shot.shot), shot.mjd_utc) for shot in shots}
    existing |= {("weather", sample.station, sample.mjd_utc) for sample in samples}
    first_rows: dict[tuple[str, str, float], int] = {}
    for row, doubt in enumerate(doubts, start=1):
        which = (doubt.what, doubt.name, doubt.mjd_utc)
        if which not in existing:
            file = "shots.csv" if doubt.what == "shot" else "weather.csv"
            text = f"{doubt.what} {shown(doubt.name)} at {doubt.mjd_utc!r} is not in {file} (expected name and time)"
            raise in_row(DOUBTS, row, text)
        if (first := first_rows.setdefault(which, row)) != row:
            raise in_row(DOUBTS, row, f"{doubt.what} {doubt.name} has a doubt in row {first} (expected one)")


def trusted_samples(
    samples: Sequence[WeatherSample], doubts: Sequence[DoubtRow], times: np.ndarray
) -> tuple[list[WeatherSample], list[str]]:
    """Trusted readings, and notes on the others.

    times   MJD of the shots

    A station without a trusted reading for half an hour of shots is excluded: its readings before and after do not
    describe the air in between.

    Raises InputError if no reading remains.
    """
    reasons = {(doubt.name, doubt.mjd_utc): doubt.why for doubt in doubts if doubt.what == "weather"}
    if not reasons:
        return list(samples), []
    trusted = [sample for sample in samples if (sample.station, sample.mjd_utc) not in reasons]
    notes = []
    for name in sorted({name for name, _ in reasons}):
        station_times = np.array([sample.mjd_utc for sample in trusted if sample.station == name])
        count = sum(station == name for station, _ in reasons)
        why = next(text for (station, _), text in reasons.items() if station == name)
        gap = np.abs(times[:, None] - station_times).min(axis=1).max() if len(station_times) else np.inf
        if gap > LONGEST_GAP:
            trusted = [sample for sample in trusted if sample.station != name]
            what = "the station is left out"
        else:
            what = f"{count} of its readings {'is' if count == 1 else 'are'} left out"
        notes.append(f"{name} was rejected during the measurement ({why}): {what}, by {DOUBTS}")
    if not trusted:
        raise refusal(DOUBTS, "leaves no weather reading (expected some trusted ones; remove rows)")
    return trusted, notes
