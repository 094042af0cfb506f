"""Honest weather of any climate on night-01: fog, desert, fronts, still air, coarse loggers, one to three stations."""

import dataclasses

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.weather import Weather
from catseye.records.site.site import WeatherStation

G_OVER_R = 0.0341632  # K/m, of dry air
MELTING_C = 0.0


def honest_night(campaign, seed):
    """Night-01's shots under honest weather drawn from the seed, at another elevation."""
    rng = np.random.default_rng(seed)
    elevation = float(rng.choice([0.0, rng.uniform(0.0, 4500.0), 4500.0]))
    hours = rng.uniform(1.0, 12.0)
    interval = float(np.exp(rng.uniform(np.log(10.0), np.log(600.0))))
    seconds = np.arange(-1800.0, 3600.0 * hours + 1800.0, interval)
    rises = np.concatenate([[0.0], rng.uniform(-150.0, 150.0, rng.integers(0, 3))])
    air = _Air(rng, elevation, seconds)
    resolution = rng.choice([0.01, 0.1, 0.1, 0.5]), rng.choice([0.01, 0.1, 1.0]), rng.choice([0.1, 1.0])
    noise = rng.choice([0.0, 0.02, 0.05]), rng.choice([0.0, 0.02, 0.05]), rng.choice([0.0, 0.5])
    columns, names, places = [], [], []
    for k, rise in enumerate(rises):
        name = f"WX{k + 1}"
        read = air.at(rise, lag=rng.uniform(0.0, 600.0) * (k > 0), fog_below=air.fog_top)
        read = [v + n * rng.normal(size=len(seconds)) for v, n in zip(read, noise, strict=True)]
        read = [np.round(v / q) * q for v, q in zip(read, resolution, strict=True)]
        read[2] = np.clip(read[2], 0.0, 100.0)
        columns.append(np.column_stack(read))
        names += [name] * len(seconds)
        places.append(WeatherStation(name=name, elevation_m=elevation + rise))
    start = campaign.shots.mjd_utc.min()
    rows = np.concatenate(columns)
    weather = Weather(
        mjd_utc=np.tile(start + seconds / SECONDS_PER_DAY, len(rises)),
        station=tuple(names),
        temperature_c=rows[:, 0],
        pressure_hpa=rows[:, 1],
        humidity_percent=rows[:, 2],
    )
    return with_elevation(dataclasses.replace(campaign, weather=weather), elevation, tuple(places))


def with_elevation(campaign, elevation, stations):
    """The campaign at another elevation above the sea, with other stations."""
    old = campaign.site.site.elevation_of_z0_m
    place = campaign.site.site.model_copy(update={"elevation_of_z0_m": elevation})
    monuments = {
        n: m.model_copy(update={"elevation_m": m.elevation_m - old + elevation}) for n, m in campaign.monuments.items()
    }
    site = campaign.site.model_copy(update={"site": place, "weather_station": stations})
    return dataclasses.replace(campaign, site=site, monuments=monuments)


class _Air:
    """Air of a site: drift, waves, eddies that come and go, a front, melting snow, fog under an inversion."""

    def __init__(self, rng, elevation, seconds):
        self.seconds, self.elevation = seconds, elevation
        n, hour = len(seconds), seconds / 3600.0
        self.level = rng.uniform(-40.0, 45.0 - 0.0065 * elevation)
        self.gradient = rng.choice([rng.uniform(-0.01, 0.01), rng.uniform(0.0, 0.08)])
        self.drift = rng.uniform(-3.0, 1.0) * hour
        period = 3600.0 * rng.uniform(0.3, 3.0)
        self.wave = rng.uniform(0.0, 1.5) * np.sin(2.0 * np.pi * seconds / period + rng.uniform(0.0, 6.0))
        still = np.interp(seconds, np.linspace(seconds[0], seconds[-1], 7), rng.choice([0.0, 0.0, 1.0], 7))
        self.eddies = [rng.uniform(0.0, 0.5) * (still > 0.3) * still * rng.normal(size=n) for _ in range(3)]
        self.front = rng.choice([0.0, rng.uniform(-6.0, 6.0)]), rng.uniform(seconds[0], seconds[-1])
        self.rise_s = rng.uniform(60.0, 1800.0)
        self.calm = rng.uniform() < 0.3  # nothing but the drift of one station
        self.snow = rng.uniform() < 0.1
        self.fog_top = rng.uniform(-100.0, 100.0) if rng.uniform() < 0.3 and self.level < 15.0 else -1e9
        self.lifts = rng.uniform(seconds[0], seconds[-1])  # when the fog does, and the snow has melted
        self.unrest = 0.02 * rng.normal(size=(3, n))  # °C: of air that does not move
        sea = rng.uniform(950.0, 1055.0)
        lapse = rng.uniform(0.002, 0.0075)
        column = self.level + 273.15 + 0.5 * lapse * elevation
        self.pressure = sea * np.exp(-G_OVER_R * elevation / column)
        tide = rng.uniform(-2.0, 2.0) * hour + rng.uniform(0.0, 0.5) * np.sin(2.0 * np.pi * hour / 0.4)
        self.tide = tide * self.pressure / sea
        self.humidity = rng.choice([rng.uniform(3.0, 10.0), rng.uniform(10.0, 95.0), 100.0])
        self.humid_drift = rng.uniform(-3.0, 3.0) * hour * (self.humidity < 100.0)

    def at(self, rise, *, lag, fog_below):
        """Temperature, pressure and humidity at a height above the site's zero; the front arrives after `lag` s."""
        step, when = self.front
        front = 0.5 * step * (1.0 + np.tanh((self.seconds - when - lag) / (0.4 * self.rise_s)))
        temperature = self.level + self.gradient * rise + self.drift + (0.0 if self.calm else self.wave + front)
        if not self.calm:
            temperature = temperature + self.eddies[int(abs(rise)) % 3]
        still = self.unrest[int(abs(rise)) % 3]
        temperature, early = temperature + still, self.seconds < self.lifts
        if rise < fog_below:  # fog keeps its temperature for hours, whatever the air above does
            in_fog = self.level + self.gradient * rise + 0.03 * np.sin(self.seconds / 4000.0) + still
            temperature = np.where(early, in_fog, temperature)
        if self.snow:
            temperature = np.where(early & (temperature > MELTING_C), MELTING_C + still, temperature)
        kelvin = self.level + 273.15
        pressure = (self.pressure + self.tide) * np.exp(-G_OVER_R * rise / kelvin)
        humidity = np.clip(self.humidity + self.humid_drift, 2.0, 100.0)
        humidity = np.where(early & (rise < fog_below), 100.0, humidity * np.exp(-0.06 * still))
        humidity = np.minimum(humidity, 100.0 * np.exp(-0.057 * (temperature - 33.0)))  # dew points up to 33 °C
        return [temperature, pressure, humidity]
