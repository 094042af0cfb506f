"""A campaign: a directory of records, weather, shots and samples, read whole or refused in one line."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import in_row, refusal, shown
from catseye.records.files.verdicts import verdict_of_export
from catseye.records.night.doubt import DOUBTS, DoubtRow, believed_samples, refuse_doubts
from catseye.records.night.jitter import JITTER, JitterRow, JitterTable, jitter_table
from catseye.records.night.live import LivePosture
from catseye.records.night.path_temperature import PathTemperature, PathTemperatureTable, path_temperature_columns
from catseye.records.night.postures import POSTURES, PostureRow, postures_of
from catseye.records.night.shot import ShotColumns, ShotRow, read_buffers, refuse_shots, shot_columns
from catseye.records.night.weather import Weather, WeatherSample, weather_columns
from catseye.records.site.folder import (
    REFERENCE,
    SiteFolder,
    read_records,
    refuse_directory,
    refuse_stranger,
    refuse_unjoined,
)
from catseye.verdict import Verdict

LONGEST_CAMPAIGN = 1.0  # days from its start to any shot
WEATHER_MARGIN = 3600.0 / SECONDS_PER_DAY  # days that a shot may lie outside the weather
SOUND_MARGIN = 3600.0 / SECONDS_PER_DAY  # days that a path temperature may lie outside the shots
PATH_TEMPERATURES = "path_temperatures.csv"  # optional


@dataclass(frozen=True, eq=False, repr=False)
class ObservedSite(SiteFolder):
    """A site with its shots and its weather, all that ranges and coordinates need once phases are known.

    `path_temperatures` is None where no line's temperature was measured by sound, `jitter` where nothing is known to
    shake; `postures` where the telescope moved. `weather` and the site's stations are
    what was believed, `doubted` the shots that were not, by their ids, with why; `doubt_notes` tell of the weather.
    `verdict` is that of the export that wrote the campaign; None of others.
    """

    weather: Weather
    shots: ShotColumns
    path_temperatures: PathTemperatureTable | None = None
    jitter: JitterTable | None = None
    postures: tuple[LivePosture, ...] = ()
    doubted: Mapping[int, str] = field(default_factory=dict)
    doubt_notes: tuple[str, ...] = ()
    verdict: Verdict | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(ObservedSite):
    """Everything that a campaign's directory holds: its site and its night, with the samples of each shot."""

    frames: np.ndarray = field(kw_only=True)

    def __repr__(self) -> str:
        count, samples = self.frames.shape
        return (
            f"<Campaign {self.site.campaign.name}: {count} shots of {samples} samples by {len(self.rangers)} rangers, "
            f"{len(self.target_names)} targets known, {len(self.weather.mjd_utc)} weather readings; "
            f"from {self.directory.name}/>"
        )


def read_campaign(directory: Path | str) -> Campaign:
    """The campaign in the directory (layout: examples/night-01/README.md); a bad one raises InputError."""
    folder = Folder(Path(directory))
    refuse_directory(folder.directory, "campaign")
    records = read_records(folder)
    samples = folder.table("weather.csv", WeatherSample)
    shots = folder.table("shots.csv", ShotRow)
    buffers = read_buffers(folder)
    sounded = os.path.lexists(folder.directory / PATH_TEMPERATURES)
    lines = folder.table(PATH_TEMPERATURES, PathTemperature) if sounded else []
    judged = os.path.lexists(folder.directory / DOUBTS)
    doubts = folder.table(DOUBTS, DoubtRow) if judged else []
    shaken = os.path.lexists(folder.directory / JITTER)
    moved = os.path.lexists(folder.directory / POSTURES)

    campaign = Campaign(
        **records.named(folder),
        weather=weather_columns(samples),
        shots=shot_columns(shots),
        frames=buffers,
        path_temperatures=path_temperature_columns(lines) if lines else None,
        jitter=jitter_table(folder.table(JITTER, JitterRow)) if shaken else None,
        postures=postures_of(folder.table(POSTURES, PostureRow), shots) if moved else (),
        verdict=verdict_of_export(folder),
    )
    refuse_unjoined(campaign, records)
    refuse_weather(samples, [station.name for station in campaign.site.weather_station])
    refuse_shots("shots.csv", shots, buffers)
    refuse_strangers(campaign, shots)
    refuse_times(campaign, shots)
    refuse_path_temperatures(campaign, lines)
    refuse_doubts(doubts, shots, samples)
    return _as_believed(campaign, doubts, samples, shots) if doubts else campaign


def _as_believed(
    campaign: Campaign, doubts: Sequence[DoubtRow], samples: Sequence[WeatherSample], shots: Sequence[ShotRow]
) -> Campaign:
    """Without the weather that was not believed, and with the shots that were not named."""
    kept, notes = believed_samples(samples, doubts, campaign.shots.mjd_utc)
    spoke = {sample.station for sample in kept}
    stations = tuple(station for station in campaign.site.weather_station if station.name in spoke)
    believed = replace(
        campaign,
        site=campaign.site.model_copy(update={"weather_station": stations}),
        weather=weather_columns(kept),
        doubted={int(each.name): each.why for each in doubts if each.what == "shot"},
        doubt_notes=tuple(notes),
    )
    refuse_times(believed, shots)
    return believed


def refuse_strangers(campaign: Campaign, shots: Iterable[ShotRow]) -> None:
    known, rangers = set(campaign.target_names), set(campaign.rangers)
    for row, shot in enumerate(shots, start=1):
        refuse_stranger("shots.csv", row, shot, known=known, rangers=rangers)


def refuse_weather(samples: Iterable[WeatherSample], stations: list[str]) -> None:
    """Each station's samples come in order of time, and each station has some."""
    latest: dict[str, float] = {}
    for row, sample in enumerate(samples, start=1):
        if sample.station not in stations:
            expected = f"expected one of {', '.join(stations)}, as in site.toml"
            raise in_row("weather.csv", row, f"station = {shown(sample.station)} ({expected})")
        if sample.mjd_utc <= latest.get(sample.station, 0.0):
            before = f"is not after {latest[sample.station]!r}, {sample.station}'s last"
            raise in_row("weather.csv", row, f"mjd_utc = {sample.mjd_utc!r} {before} (expected in order of time)")
        latest[sample.station] = sample.mjd_utc
    for station in stations:
        if station not in latest:
            raise refusal("weather.csv", f"station = {shown(station)} of site.toml has no row (expected at least one)")


def refuse_times(campaign: Campaign, shots: Iterable[ShotRow]) -> None:
    """Every shot was fired during the campaign, and the weather was known."""
    start = campaign.site.campaign.start_mjd_utc
    first, last = float(campaign.weather.mjd_utc.min()), float(campaign.weather.mjd_utc.max())
    for row, shot in enumerate(shots, start=1):
        if abs(shot.mjd_utc - start) > LONGEST_CAMPAIGN:
            expected = f"expected within {LONGEST_CAMPAIGN:g} day of the campaign's start, {start!r}"
            raise in_row("shots.csv", row, f"mjd_utc = {shot.mjd_utc!r} ({expected})")
        if not first - WEATHER_MARGIN <= shot.mjd_utc <= last + WEATHER_MARGIN:
            span = f"weather.csv covers {first!r} to {last!r}"
            raise in_row("shots.csv", row, f"mjd_utc = {shot.mjd_utc!r} has no weather ({span}; expected within 1 h)")


def refuse_path_temperatures(campaign: Campaign, lines: Sequence[PathTemperature]) -> None:
    """Every line has two known ends, was sounded during the shots, and once at a time."""
    if not lines:
        return
    known, rangers = set(campaign.target_names) - {REFERENCE}, set(campaign.rangers)
    first, last = float(campaign.shots.mjd_utc.min()), float(campaign.shots.mjd_utc.max())
    seen: dict[tuple[frozenset[str], float], int] = {}
    for row, line in enumerate(lines, start=1):
        refuse_stranger(PATH_TEMPERATURES, row, line, known=known, rangers=rangers)
        if not first - SOUND_MARGIN <= line.mjd_utc <= last + SOUND_MARGIN:
            span = f"the shots cover {first!r} to {last!r}; expected within 1 h"
            raise in_row(PATH_TEMPERATURES, row, f"mjd_utc = {line.mjd_utc!r} is outside the campaign ({span})")
        key = (frozenset((line.ranger, line.target)), line.mjd_utc)
        if key in seen:
            same = f"{line.ranger} - {line.target} has a temperature at that time in row {seen[key]}"
            raise in_row(PATH_TEMPERATURES, row, f"mjd_utc = {line.mjd_utc!r}: {same} (expected one)")
        seen[key] = row
