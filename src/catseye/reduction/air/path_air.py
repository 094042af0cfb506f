"""Index of a campaign's paths from its weather stations.

A profile in height and time, with full covariance.

`AirField` of `reduction.epoch.air.field` is the campaign's own air, a line in height and a mean over minutes, whose
thermometer offsets the adjustment estimates. This is the independent one: no range enters, and its covariance
holds all uncertainty. On night-01, with the same formula, this one's paths are 0.13 ppm above AirField's in the mean
and 0.35 ppm at most: with two heights it cannot separate a lapse from a layer at the ground, and gives each its share
where the other takes a line. It claims 0.63 ppm a path, 0.57 ppm of that common to all
(`tests/reduction/air/test_path_air.py`).
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
from catseye.names import AIR_MODEL
from catseye.records.night.weather import Weather
from catseye.records.site.site import SiteRecord

SCREEN = 2.0  # m, height of a station's sensors above the ground, as weather services install them
FIELDS = (("temperature", "C"), ("pressure", "hPa"), ("humidity", "%"))


@dataclass(frozen=True)
class WeatherPriors:
    """Prior of each quantity's field before a reading."""

    temperature: ProfilePrior = TEMPERATURE
    pressure: ProfilePrior = PRESSURE
    humidity: ProfilePrior = HUMIDITY


@dataclass(frozen=True, eq=False)
class SiteAir:
    """Air of a site over the time of its weather table.

    profile     see `atmosphere.path.air_profile`
    stations    names, in the order of the profile's numbers
    start_mjd   UTC of second zero
    block       s, averaging time of the readings; 0 for single readings
    wavelength_um, model, co2_ppm   of the index
    notes       for the user, one line each: outlying readings, biased stations
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
        """Mean group refractivity of straight paths, with covariance.

        As `AirProfile.along`.

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
    model: str = AIR_MODEL,
    co2_ppm: float = 450.0,
    priors: WeatherPriors | None = None,
) -> SiteAir:
    """Air of a site from its record and its table of weather.

    site      its weather stations' elevations, its light's wavelength
    weather   readings; a station of the record without readings is omitted
    ground    m, height of the ground in the ground frame; None: 2 m below the record's lowest station
    without   names of stations to leave out, for example a biased one
    block     s, average readings over it; None: none up to 2000 readings, beyond that the necessary minimum
    model     a name in `atmosphere.index.air.MODELS`
    co2_ppm   carbon dioxide, ppm
    priors    of the profiles; None: the defaults

    Outlying readings and biased stations are named in `notes`; nothing is left out except on request.
    Source: recipe; the model is `atmosphere.path.profile`'s. Raises InputError for an unknown station and where
    no station remains.
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
    notes = profile_notes(profile, names, start)
    return SiteAir(
        profile=profile,
        stations=names,
        start_mjd=start,
        block=block,
        wavelength_um=site.ranging.wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
        notes=notes,
    )


def site_readings(site: SiteRecord, weather: Weather, without: Sequence[str] = ()) -> WeatherReadings:
    """Readings of a site's stations with heights and seconds.

    Heights in the ground frame, seconds from the table's first row.

    site, weather, without   as in `site_air`, with its errors
    """
    names = tuple(station.name for station in site.weather_station)
    for name in (*without, *dict.fromkeys(weather.station)):
        if name not in names:
            raise InputError(f"weather station {name!r} is not in site.toml; it has {', '.join(names)}")
    number = np.array([names.index(name) for name in weather.station], dtype=int)
    selected = ~np.isin(number, [names.index(name) for name in without])
    if not selected.any():
        raise InputError(f"no weather reading remains without {', '.join(without) or 'any station'}")
    height = np.array([station.elevation_m - site.site.elevation_of_z0_m for station in site.weather_station])
    return WeatherReadings(
        seconds=(weather.mjd_utc[selected] - weather.mjd_utc.min()) * SECONDS_PER_DAY,
        z=height[number[selected]],
        station=number[selected],
        temperature_c=weather.temperature_c[selected],
        pressure_hpa=weather.pressure_hpa[selected],
        humidity_percent=weather.humidity_percent[selected],
        count=np.ones(int(selected.sum()), dtype=int),
    )


def _block(readings: WeatherReadings) -> float:
    """Block length that limits the readings to a profile's maximum, s.

    0 where there are not more.
    """
    if len(readings.z) <= MOST_READINGS:
        return 0.0
    return float(np.ptp(readings.seconds)) * len(np.unique(readings.station)) / (MOST_READINGS - 100)


def profile_notes(profile: AirProfile, names: tuple[str, ...], start_mjd: float) -> tuple[str, ...]:
    """Notes on outlying readings and biased stations of a profile, one line each."""
    notes = []
    for field, unit in FIELDS:
        of_field = getattr(profile, field)
        readings, suspects = of_field.readings, suspect_readings(of_field)
        if len(suspects.readings):
            row = int(suspects.readings[0])
            who, when = names[readings.station[row]], start_mjd + readings.seconds[row] / SECONDS_PER_DAY
            notes.append(
                f"{field}: {len(suspects.readings)} of {len(readings.value)} readings are outliers, the worst "
                f"{readings.value[row]:.2f} {unit} of {who} at MJD {when:.5f}, w = {suspects.w[row]:.1f}; check them"
            )
        for station in suspects.stations:
            notes.append(
                f"{field}: {names[station]} reads {suspects.error[station]:+.2f} {unit} against the others, "
                f"w = {suspects.w_station[station]:.1f}; leave it out or calibrate it"
            )
        if len(suspects.undecided):
            who = " and ".join(names[station] for station in suspects.undecided)
            notes.append(f"{field}: {who} contradict each other, undecided which is wrong; calibrate them")
    return tuple(notes)
