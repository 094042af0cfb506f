"""A campaign: a directory of records, weather, shots and samples, read whole or refused in one line."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.mirror import Mirror
from catseye.records.monument import Monument
from catseye.records.path_temperature import PathTemperature, PathTemperatureTable, path_temperature_columns
from catseye.records.reading import Folder
from catseye.records.refusal import refusal, shown
from catseye.records.shot import Shot, Shots, in_row, read_buffers, refuse_shots, shot_columns
from catseye.records.site import Site
from catseye.records.target import Benchmark, FeedArm, Target, Targets
from catseye.records.triplet import Triplet
from catseye.records.weather import Weather, WeatherSample, weather_columns

T = TypeVar("T")

REFERENCE = "ZRG"  # as a target: the ranger's internal cube
LONGEST_CAMPAIGN = 1.0  # days from its start to any shot
WEATHER_MARGIN = 3600.0 / SECONDS_PER_DAY  # days that a shot may lie outside the weather
SOUND_MARGIN = 3600.0 / SECONDS_PER_DAY  # days that a path temperature may lie outside the shots
PATH_TEMPERATURES = "path_temperatures.csv"  # optional


@dataclass(frozen=True, eq=False)
class Campaign:
    """Everything that a campaign's directory holds; `hashes` are the SHA-256 of its files by relative path.

    `path_temperatures` is None where no line's temperature was measured by sound.
    """

    directory: Path
    site: Site
    monuments: dict[str, Monument]
    mirrors: dict[str, Mirror]
    feedarm: FeedArm
    targets: dict[str, Target]
    triplets: dict[str, Triplet]
    benchmarks: tuple[Benchmark, ...]
    weather: Weather
    shots: Shots
    frames: np.memmap
    hashes: dict[str, str]
    path_temperatures: PathTemperatureTable | None = None

    @property
    def rangers(self) -> tuple[str, ...]:
        """The names of all rangers, on the ground and on the feed arm, sorted."""
        return tuple(sorted(mounts(self.monuments, self.feedarm)))

    @property
    def target_names(self) -> tuple[str, ...]:
        """Every name that a shot's target may have, sorted."""
        prisms_and_balls = (name for triplet in self.triplets.values() for name in triplet.targets)
        return tuple(sorted([*self.targets, *prisms_and_balls, *self.rangers, REFERENCE]))

    def mirror_of(self, ranger: str) -> Mirror:
        mounted = mounts(self.monuments, self.feedarm)
        if ranger not in mounted:
            raise InputError(f"ranger = {shown(ranger)} is not in monuments/ or feedarm.toml")
        return self.mirrors[mounted[ranger][0]]


def read_campaign(directory: Path | str) -> Campaign:
    """The campaign in the directory (layout: examples/night-01/README.md); a bad one raises InputError."""
    folder = Folder(Path(directory))
    refuse_directory(folder.directory)
    site = folder.record("site.toml", Site)
    monuments = {file: folder.record(file, Monument) for file in folder.records_in("monuments")}
    mirrors = {file: folder.record(file, Mirror) for file in folder.records_in("mirrors")}
    feedarm = folder.record("feedarm.toml", FeedArm)
    targets = folder.record("targets.toml", Targets).target
    triplets = {file: folder.record(file, Triplet) for file in folder.records_in("triplets")}
    benchmarks = folder.table("benchmarks.csv", Benchmark)
    samples = folder.table("weather.csv", WeatherSample)
    shots = folder.table("shots.csv", Shot)
    buffers = read_buffers(folder)
    sounded = os.path.lexists(folder.directory / PATH_TEMPERATURES)
    lines = folder.table(PATH_TEMPERATURES, PathTemperature) if sounded else []

    campaign = Campaign(
        directory=folder.directory,
        site=site,
        monuments=by_stem("monument", {file: (record.monument, record) for file, record in monuments.items()}),
        mirrors=by_stem("zp", {file: (record.zp, record) for file, record in mirrors.items()}),
        feedarm=feedarm,
        targets={target.name: target for target in targets},
        triplets=by_stem("triplet", {file: (record.triplet, record) for file, record in triplets.items()}),
        benchmarks=tuple(benchmarks),
        weather=weather_columns(samples),
        shots=shot_columns(shots),
        frames=buffers,
        hashes=dict(sorted(folder.hashes.items())),
        path_temperatures=path_temperature_columns(lines) if lines else None,
    )
    refuse_double_names(campaign, [target.name for target in targets])
    refuse_mirrors(campaign)
    refuse_benchmarks(campaign)
    refuse_weather(samples, [station.name for station in site.weather_station])
    refuse_shots("shots.csv", shots, buffers)
    refuse_strangers(campaign, shots)
    refuse_times(campaign, shots)
    refuse_path_temperatures(campaign, lines)
    return campaign


def refuse_directory(directory: Path) -> None:
    try:
        if directory.is_dir():
            return
        state = "is not a directory" if directory.exists() else "missing"
    except (OSError, ValueError) as problem:
        state = f"cannot be read: {problem}"
    raise refusal(str(directory), f"{state} (expected a campaign directory)")


def by_stem(key: str, records: dict[str, tuple[str, T]]) -> dict[str, T]:
    """The records by name, which must be the name of the file too."""
    for file, (name, _) in records.items():
        if name != Path(file).stem:
            raise refusal(file, f"{key} = {shown(name)} (expected {shown(Path(file).stem)}, as the file's name)")
    return dict(records.values())


def mounts(monuments: dict[str, Monument], feedarm: FeedArm) -> dict[str, tuple[str, str]]:
    """By ranger: its mirror's name, and the file and place that say so."""
    ground = {name: (monument.zp, f"monuments/{name}.toml: ") for name, monument in monuments.items()}
    arm = {ranger.name: (ranger.zp, f"feedarm.toml: ranger[{ranger.name!r}].") for ranger in feedarm.ranger}
    return ground | arm


def refuse_double_names(campaign: Campaign, targets: Iterable[str]) -> None:
    """A name stands for one thing; a monument's name with -F stands for its fixed point."""
    taken = {REFERENCE: "the internal reference cube"}
    named = [(name, f"monuments/{name}.toml", "monument") for name in campaign.monuments]
    named += [(f"{name}-F", f"monuments/{name}.toml", "fixed point") for name in campaign.monuments]
    named += [(ranger.name, "feedarm.toml", "ranger") for ranger in campaign.feedarm.ranger]
    named += [(name, "targets.toml", "target") for name in targets]
    for triplet in campaign.triplets.values():
        named += [(name, f"triplets/{triplet.triplet}.toml", "target") for name in triplet.targets]
    for name, file, key in named:
        if name in taken:
            raise refusal(file, f"{key} = {name!r} is a name taken by {taken[name]} (expected each name once)")
        taken[name] = file


def refuse_mirrors(campaign: Campaign) -> None:
    """Every ranger has a mirror, and a mirror of its own."""
    users: dict[str, str] = {}
    for ranger, (zp, place) in mounts(campaign.monuments, campaign.feedarm).items():
        file, _, key = place.partition(": ")
        if zp not in campaign.mirrors:
            raise refusal(file, f"{key}zp = {zp!r} has no calibration (expected a file mirrors/{zp}.toml)")
        if zp in users:
            raise refusal(file, f"{key}zp = {zp!r} is on {users[zp]} already (expected a mirror a ranger)")
        users[zp] = ranger


def refuse_benchmarks(campaign: Campaign) -> None:
    known, rangers = set(campaign.target_names) - {REFERENCE}, set(campaign.rangers)
    for row, benchmark in enumerate(campaign.benchmarks, start=1):
        refuse_stranger("benchmarks.csv", row, benchmark, known, rangers)


def refuse_strangers(campaign: Campaign, shots: Iterable[Shot]) -> None:
    known, rangers = set(campaign.target_names), set(campaign.rangers)
    for row, shot in enumerate(shots, start=1):
        refuse_stranger("shots.csv", row, shot, known, rangers)


def refuse_stranger(
    file: str, row: int, line: Shot | Benchmark | PathTemperature, known: set[str], rangers: set[str]
) -> None:
    """A row's ranger and target are known, and two."""
    if line.ranger not in rangers:
        raise in_row(file, row, f"ranger = {shown(line.ranger)} is not in monuments/ or feedarm.toml")
    if line.target not in known:
        places = "targets.toml, triplets/, monuments/ or feedarm.toml"
        raise in_row(file, row, f"target = {shown(line.target)} is not in {places}")
    if line.target == line.ranger:
        raise in_row(file, row, f"target = {shown(line.target)} is the ranger itself (expected another)")


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


def refuse_times(campaign: Campaign, shots: Iterable[Shot]) -> None:
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
        refuse_stranger(PATH_TEMPERATURES, row, line, known, rangers)
        if not first - SOUND_MARGIN <= line.mjd_utc <= last + SOUND_MARGIN:
            span = f"the shots cover {first!r} to {last!r}; expected within 1 h"
            raise in_row(PATH_TEMPERATURES, row, f"mjd_utc = {line.mjd_utc!r} is outside the campaign ({span})")
        key = (frozenset((line.ranger, line.target)), line.mjd_utc)
        if key in seen:
            same = f"{line.ranger} - {line.target} has a temperature at that time in row {seen[key]}"
            raise in_row(PATH_TEMPERATURES, row, f"mjd_utc = {line.mjd_utc!r}: {same} (expected one)")
        seen[key] = row
