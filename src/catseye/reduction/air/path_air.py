"""The index of a campaign's paths from its weather stations: a profile in height and time, with full covariance.

`AirField` of `reduction.epoch.air.field` is the campaign's own air, a line in height and a mean over minutes, whose
thermometer offsets the adjustment estimates. This is the independent one: no range enters, and what it does not know is
in its covariance. On night-01, with the same formula, this one's paths are 0.13 ppm above AirField's in the mean and
0.35 ppm at most: with two heights it cannot tell a lapse from a layer at the ground, and gives each its share where the
other takes a line. It claims 0.63 ppm a path, 0.57 ppm of that common to all (`tests/reduction/air/test_path_air.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.path.air_profile import AirProfile, PathIndex, WeatherReadings
from catseye.atmosphere.path.profile import HUMIDITY, MOST_READINGS, PRESSURE, TEMPERATURE, ProfilePrior
from catseye.atmosphere.path.suspect_readings import suspect_readings
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.night.weather import Weather
from catseye.records.site.site import SiteRecord

SCREEN = 2.0  # m, height of a station's sensors above the ground, as weather services stand them
FIELDS = (("temperature", "C"), ("pressure", "hPa"), ("humidity", "%"))


@dataclass(frozen=True)
class WeatherPriors:
    """What is expected of each quantity's field before a reading."""

    temperature: ProfilePrior = TEMPERATURE
    pressure: ProfilePrior = PRESSURE
    humidity: ProfilePrior = HUMIDITY


@dataclass(frozen=True, eq=False)
class SiteAir:
    """The air of a site over the time of its weather table.

    profile     see `atmosphere.path.air_profile`
    stations    names, in the order of the profile's numbers
    start_mjd   UTC of second zero
    block       s, readings were averaged over; 0 where each counts by itself
    wavelength_um, model, co2_ppm   what the index is for
    notes       what a person should know, one line each: wild readings, lying stations
    """

    profile: AirProfile
    stations: tuple[str, ...]
    start_mjd: float
    block: float
    wavelength_um: float
    model: str
    co2_ppm: float
    notes: tuple[str, ...]

    def along(self, mjd_utc: ArrayLike, a: ArrayLike, b: ArrayLike) -> PathIndex:
        """Mean group refractivity of straight paths, with covariance, as `AirProfile.along`.

        mjd_utc   (m,) time of each
        a, b      (m, 3) ends in the ground frame, m
        """
        seconds = (np.atleast_1d(np.asarray(mjd_utc, float)) - self.start_mjd) * SECONDS_PER_DAY
        return self.profile.along(
            seconds, a, b, wavelength_um=self.wavelength_um, model=self.model, co2_ppm=self.co2_ppm
        )


def site_air(
    site: SiteRecord,
    weather: Weather,
    *,
    ground: float | None = None,
    without: Sequence[str] = (),
    block: float | None = None,
    model: str = "ciddor_hill1999",
    co2_ppm: float = 450.0,
    priors: WeatherPriors | None = None,
) -> SiteAir:
    """The air of a site from its record and its table of weather.

    site      its weather stations' elevations, its light's wavelength
    weather   readings; a station of the record without readings is simply missing
    ground    m, height of the ground in the ground frame; None: 2 m below the record's lowest station
    without   names of stations to leave out, one that lies perhaps
    block     s, average readings over it; None: none up to 2000 readings, beyond that just as much as is needed
    model     a name in `atmosphere.index.air.MODELS`
    co2_ppm   carbon dioxide, ppm
    priors    of the profiles; the usual where it is None

    Wild readings and lying stations are named in `notes`; nothing is left out that was not asked for.
    Source: recipe; the model is `atmosphere.path.profile`'s. Raises InputError for a name that is no station and where
    no station is left.
    """
    readings = site_readings(site, weather, without)
    start = float(weather.mjd_utc.min())
    if block is not None and not block >= 0.0:
        raise InputError(f"block = {block} s is below zero (expected 0 for none, or a length)")
    block = _block(readings) if block is None else block
    if block > 0.0:
        readings = readings.averaged(block)
    lowest = min(station.elevation_m for station in site.weather_station) - site.site.elevation_of_z0_m
    ground = lowest - SCREEN if ground is None else ground
    of = priors or WeatherPriors()
    profile = AirProfile.of(
        readings, ground=ground, temperature=of.temperature, pressure=of.pressure, humidity=of.humidity
    )
    names = tuple(station.name for station in site.weather_station)
    notes = _notes(profile, names, start)
    return SiteAir(profile, names, start, block, site.ranging.wavelength_um, model, co2_ppm, notes)


def site_readings(site: SiteRecord, weather: Weather, without: Sequence[str] = ()) -> WeatherReadings:
    """Readings of a site's stations with heights in the ground frame, seconds from the table's first row.

    site, weather, without   as `site_air`'s, which says what is refused
    """
    names = tuple(station.name for station in site.weather_station)
    for name in (*without, *dict.fromkeys(weather.station)):
        if name not in names:
            raise InputError(f"weather station {name!r} is not in site.toml; it has {', '.join(names)}")
    number = np.array([names.index(name) for name in weather.station], dtype=int)
    kept = ~np.isin(number, [names.index(name) for name in without])
    if not kept.any():
        raise InputError(f"no weather reading is left without {', '.join(without) or 'any station'}")
    height = np.array([station.elevation_m - site.site.elevation_of_z0_m for station in site.weather_station])
    return WeatherReadings(
        (weather.mjd_utc[kept] - weather.mjd_utc.min()) * SECONDS_PER_DAY,
        height[number[kept]],
        number[kept],
        weather.temperature_c[kept],
        weather.pressure_hpa[kept],
        weather.humidity_percent[kept],
        np.ones(int(kept.sum()), dtype=int),
    )


def _block(readings: WeatherReadings) -> float:
    """Length of blocks that leave no more readings than a profile takes, s; 0 where there are not more."""
    if len(readings.z) <= MOST_READINGS:
        return 0.0
    return float(np.ptp(readings.seconds)) * len(np.unique(readings.station)) / (MOST_READINGS - 100)


def _notes(profile: AirProfile, names: tuple[str, ...], start_mjd: float) -> tuple[str, ...]:
    notes = []
    for field, unit in FIELDS:
        of_field = getattr(profile, field)
        readings, suspects = of_field.readings, suspect_readings(of_field)
        if len(suspects.readings):
            row = int(suspects.readings[0])
            who, when = names[readings.station[row]], start_mjd + readings.seconds[row] / SECONDS_PER_DAY
            notes.append(
                f"{field}: {len(suspects.readings)} of {len(readings.value)} readings are wild, the worst "
                f"{readings.value[row]:.2f} {unit} of {who} at MJD {when:.5f}, w = {suspects.w[row]:.1f}; check them"
            )
        for station in suspects.stations:
            notes.append(
                f"{field}: {names[station]} reads {suspects.error[station]:+.2f} {unit} against the others, "
                f"w = {suspects.w_station[station]:.1f}; leave it out or compare it"
            )
        if len(suspects.undecided):
            who = " and ".join(names[station] for station in suspects.undecided)
            notes.append(f"{field}: {who} contradict each other and nothing says which is wrong; compare them")
    return tuple(notes)
