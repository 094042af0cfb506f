"""Campaign: a directory of records, weather, shots and samples; invalid ones give one-line errors."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from catseye.constants import SECONDS_PER_DAY, SPEED_OF_LIGHT
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import in_row, refusal, shown
from catseye.records.files.verdicts import verdict_of_export
from catseye.records.night.doubt import DOUBTS, DoubtRow, refuse_doubts, trusted_samples
from catseye.records.night.jitter import JITTER, JitterRow, JitterTable, jitter_table
from catseye.records.night.live import LivePosture
from catseye.records.night.path_temperature import PathTemperature, PathTemperatureTable, path_temperature_columns
from catseye.records.night.postures import POSTURES, PostureRow, postures_of
from catseye.records.night.shot import (
    ShotColumns,
    ShotRow,
    read_buffers,
    read_shots,
    refuse_shots,
    shot_columns,
)
from catseye.records.night.weather import Weather, WeatherSample, weather_columns
from catseye.records.site.folder import (
    REFERENCE,
    SiteFolder,
    read_records,
    refuse_directory,
    refuse_unjoined,
    refuse_unknown_ends,
)
from catseye.verdict import Verdict

LONGEST_CAMPAIGN = 1.0  # days from its start to any shot
WEATHER_MARGIN = 3600.0 / SECONDS_PER_DAY  # days, largest time of a shot outside the weather
SOUND_MARGIN = 3600.0 / SECONDS_PER_DAY  # days, largest time of a path temperature outside the shots
PATH_TEMPERATURES = "path_temperatures.csv"  # optional


@dataclass(frozen=True, eq=False, repr=False)
class ObservedSite(SiteFolder):
    """Site with its shots and weather: all inputs for coordinates once phases are measured.

    `path_temperatures` is None without acoustic temperatures, `jitter` without known jitter; `postures` is set if the
    telescope moved. `weather` and the site's stations are those trusted; `doubted` are the rejected shots by id, with
    reasons; `doubt_notes` describe rejected weather. `verdict` is that of the export that wrote the campaign, or None.
    """

    weather: Weather
    shots: ShotColumns
    path_temperatures: PathTemperatureTable | None = None
    jitter: JitterTable | None = None
    postures: tuple[LivePosture, ...] = ()
    doubted: Mapping[int, str] = field(default_factory=dict)
    doubt_notes: tuple[str, ...] = ()
    verdict: Verdict | None = None

    @property
    def several_frequencies(self) -> bool:
        """True where shots have modulation frequencies of their own."""
        return self.shots.modulation_hz is not None

    def modulation_of(self, shots: np.ndarray) -> np.ndarray:
        """Modulation frequencies (m,), Hz, of shots by their index."""
        if self.shots.modulation_hz is None:
            return np.full(len(shots), self.site.ranging.modulation_hz)
        return np.asarray(self.shots.modulation_hz[shots])

    def half_wavelengths(self, shots: np.ndarray) -> np.ndarray:
        """Half wavelengths (m,) of the modulation in vacuum, m, of shots by their index."""
        return 0.5 * SPEED_OF_LIGHT / self.modulation_of(shots)


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(ObservedSite):
    """Content of a campaign's directory: its site and its night, with the samples of each shot."""

    frames: np.ndarray = field(kw_only=True)

    def __repr__(self) -> str:
        count, samples = self.frames.shape
        return (
            f"<Campaign {self.site.campaign.name}: {count} shots of {samples} samples by {len(self.rangers)} rangers, "
            f"{len(self.target_names)} targets known, {len(self.weather.mjd_utc)} weather readings; "
            f"from {self.directory.name}/>"
        )


def read_campaign(directory: Path | str) -> Campaign:
    """Campaign in the directory (layout: examples/night-01/README.md); InputError if invalid."""
    folder = Folder(Path(directory))
    refuse_directory(folder.directory, "campaign")
    records = read_records(folder)
    samples = folder.table("weather.csv", WeatherSample)
    shots = read_shots(folder)
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
    refuse_unknown_names(campaign, shots)
    refuse_frequencies(campaign)
    refuse_times(campaign, shots)
    refuse_path_temperatures(campaign, lines)
    refuse_doubts(doubts, shots, samples)
    return _without_doubts(campaign, doubts, samples, shots) if doubts else campaign


def _without_doubts(
    campaign: Campaign, doubts: Sequence[DoubtRow], samples: Sequence[WeatherSample], shots: Sequence[ShotRow]
) -> Campaign:
    """Campaign without rejected weather, with rejected shots in `doubted`."""
    trusted, notes = trusted_samples(samples, doubts, campaign.shots.mjd_utc)
    spoke = {sample.station for sample in trusted}
    stations = tuple(station for station in campaign.site.weather_station if station.name in spoke)
    reduced = replace(
        campaign,
        site=campaign.site.model_copy(update={"weather_station": stations}),
        weather=weather_columns(trusted),
        doubted={int(doubt.name): doubt.why for doubt in doubts if doubt.what == "shot"},
        doubt_notes=tuple(notes),
    )
    refuse_times(reduced, shots)
    return reduced


def refuse_unknown_names(campaign: Campaign, shots: Iterable[ShotRow]) -> None:
    targets, rangers = set(campaign.target_names), set(campaign.rangers)
    for row, shot in enumerate(shots, start=1):
        refuse_unknown_ends("shots.csv", row, shot, targets=targets, rangers=rangers)


def refuse_frequencies(campaign: ObservedSite) -> None:
    """Raise InputError for a sheet that repeats the site's frequency, and for a shot whose frequency no record has."""
    usual = campaign.site.ranging.modulation_hz
    for zp, mirror in campaign.mirrors.items():
        if any(further.modulation_hz == usual for further in mirror.frequency):
            text = f"frequency: modulation_hz = {usual:.10g} is that of site.toml (expected further ones)"
            raise refusal(f"mirrors/{zp}.toml", text)
    fired = [] if campaign.shots.modulation_hz is None else campaign.shots.modulation_hz.tolist()
    frequencies = {
        ranger: [usual, *(further.modulation_hz for further in campaign.mirror_of(ranger).frequency)]
        for ranger in set(campaign.shots.ranger)
    }
    for row, (hz, ranger) in enumerate(zip(fired, campaign.shots.ranger, strict=False), start=1):
        if hz not in frequencies[ranger]:
            sheet = f"mirrors/{campaign.mirror_of(ranger).zp}.toml"
            listed = ", ".join(f"{value:.10g}" for value in frequencies[ranger])
            text = f"modulation_hz = {hz:.10g} is neither site.toml's nor a frequency of {sheet}"
            raise in_row("shots.csv", row, f"{text} (expected one of {listed})")


def refuse_weather(samples: Iterable[WeatherSample], stations: list[str]) -> None:
    """Raise InputError unless each station has samples, in time order."""
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
    """Raise InputError for shots outside the campaign or without weather."""
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
    """Raise InputError for lines with unknown ends, outside the shots, or repeated at one time."""
    if not lines:
        return
    targets, rangers = set(campaign.target_names) - {REFERENCE}, set(campaign.rangers)
    first, last = float(campaign.shots.mjd_utc.min()), float(campaign.shots.mjd_utc.max())
    first_rows: dict[tuple[frozenset[str], float], int] = {}
    for row, line in enumerate(lines, start=1):
        refuse_unknown_ends(PATH_TEMPERATURES, row, line, targets=targets, rangers=rangers)
        if not first - SOUND_MARGIN <= line.mjd_utc <= last + SOUND_MARGIN:
            span = f"the shots cover {first!r} to {last!r}; expected within 1 h"
            raise in_row(PATH_TEMPERATURES, row, f"mjd_utc = {line.mjd_utc!r} is outside the campaign ({span})")
        key = (frozenset((line.ranger, line.target)), line.mjd_utc)
        if key in first_rows:
            duplicate = f"{line.ranger} - {line.target} has a temperature at that time in row {first_rows[key]}"
            raise in_row(PATH_TEMPERATURES, row, f"mjd_utc = {line.mjd_utc!r}: {duplicate} (expected one)")
        first_rows[key] = row
