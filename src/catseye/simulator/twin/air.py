"""Air of a living site, a function of place and time.

Its effects on paths, readings and wet glass.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import DEGREE, PPM, SECONDS_PER_DAY, TWO_PI
from catseye.records.site.folder import SiteFolder
from catseye.simulator.night.air import PRESSURE_LAPSE_HPA_PER_M, group_refractivity_ppm
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.twin.conditions import LivingConditions
from catseye.simulator.twin.passing import PassingAir
from catseye.simulator.twin.waves import Waves, correlated, joined, walk

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # below 1e-10 of the index on a profile of 10 m scale height
SHARES, WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * WEIGHTS
WARMEST_HOUR, BRIGHTEST_HOUR = 15.0, 12.5  # local mean time
STEEL_LAG_HOURS, STEEL_SHARE = 1.0, 0.8  # delay and attenuation of the steel against the day's swing
STEEL_AT = np.array([0.0, 0.0, 50.0])  # m: middle of the telescope
WET, WET_WIDTH_C = 0.03, 0.15  # amplitude left on wet glass; width of the change about the dew point


def saturation_hpa(temperature_c: ArrayLike, pressure_hpa: ArrayLike) -> Array:
    """Saturation vapour pressure over water as in `simulator.night.air.group_refractivity_ppm`, hPa."""
    t = np.asarray(temperature_c, dtype=float)
    return 6.1121 * (1.0007 + 3.46e-6 * np.asarray(pressure_hpa)) * np.exp(17.502 * t / (240.97 + t))


@dataclass(frozen=True, eq=False)
class LivingAir:
    """True air at points (..., 3), m, and times (...), s.

    Ground frame; times since the start.

    start_hour        local mean solar time at the start
    slope             (2,) °C/m east and north
    wander            waves: temperature, pressure, dew point
    stratification    factor on what changes with height; diurnal, dew: on these
    """

    conditions: LivingConditions
    start_hour: float
    slope: Array
    wander: Waves
    stratification: float
    diurnal: float
    dew: float
    dew_point_c: float
    passing: PassingAir

    @staticmethod
    def of(
        site: SiteFolder, conditions: LivingConditions, start_mjd: float, *, streams: Streams, planted: Planted
    ) -> "LivingAir":
        """Draw the air over a site."""
        c, rng = conditions, streams("living air")
        slope = planted.gain("horizontal_gradient") * c.horizontal_c_per_100m / 100.0 * rng.normal(size=2)
        wander = joined(
            correlated(rng, c.wander_c, 1200.0),
            walk(rng, c.pressure_walk_hpa / 60.0, shortest=600.0),
            correlated(rng, c.dew_point_wander_c, 10_800.0),
        ).scaled(planted.gain("weather_wander"))
        vapour = saturation_hpa(c.temperature_c, c.pressure_hpa) * c.humidity_percent / 100.0
        return LivingAir(
            conditions=c,
            start_hour=float((start_mjd % 1.0) * 24.0 + site.site.site.longitude_deg / 15.0),
            slope=slope,
            wander=wander,
            stratification=planted.gain("stratification"),
            diurnal=planted.gain("diurnal"),
            dew=planted.gain("dew"),
            dew_point_c=float(_dew_point_c(vapour, c.pressure_hpa)),
            passing=PassingAir.of(c, streams=streams, planted=planted),
        )

    def sunshine(self, seconds: ArrayLike) -> Array:
        """Sunshine from 0 at midnight to 1 at noon.

        Without the day's effects as at the start.
        """
        hours = self.start_hour + self.diurnal * np.asarray(seconds, dtype=float) / 3600.0
        return 0.5 * (1.0 + np.cos(TWO_PI * (hours - BRIGHTEST_HOUR) / 24.0))

    def _day(self, seconds: ArrayLike, lag_hours: float = 0.0) -> Array:
        """Temperature of the day's swing less that at the start, °C."""
        begin = TWO_PI * (self.start_hour - lag_hours - WARMEST_HOUR) / 24.0
        turn = np.asarray(seconds, dtype=float) * (TWO_PI / SECONDS_PER_DAY)
        return self.diurnal * self.conditions.diurnal_c * (np.cos(begin + turn) - np.cos(begin))

    def steel_c(self, seconds: ArrayLike) -> Array:
        """Temperature of the structure less that at the start (...), °C."""
        times = np.append(np.asarray(seconds, dtype=float).ravel(), 0.0)
        passing = self.passing.common_c(STEEL_AT, times, STEEL_LAG_HOURS * 3600.0)
        return STEEL_SHARE * self._day(seconds, STEEL_LAG_HOURS) + (passing[:-1] - passing[-1]).reshape(
            np.shape(seconds)
        )

    def weather(self, points: Array, seconds: Array) -> tuple[Array, Array, Array]:
        """Temperature, °C, pressure, hPa, humidity, %, (k, m), at points (k, m, 3), times (k,)."""
        return self._weather(points, seconds, self.passing.eddies_c(points, seconds[:, None]))

    def _weather(self, points: Array, seconds: Array, eddies_c: Array) -> tuple[Array, Array, Array]:
        """Weather as `weather`, with eddies (k, m)."""
        c, drift, z = self.conditions, self.wander(seconds), points[..., 2]
        temperature = self._temperature(points, seconds, drift[:, 0]) + eddies_c
        pressure = (c.pressure_hpa + drift[:, 1])[:, None] + self.passing.pressure_hpa(points, seconds[:, None])
        pressure = pressure - self.stratification * PRESSURE_LAPSE_HPA_PER_M * z
        # vapour is well mixed: its pressure is one, relative humidity changes with temperature
        vapour = saturation_hpa(self.dew_point_c + drift[:, 2], c.pressure_hpa)
        humidity = np.minimum(100.0 * vapour[:, None] / saturation_hpa(temperature, pressure), 100.0)
        return temperature, pressure, humidity

    def _temperature(self, points: Array, seconds: Array, wander: Array, lag: float = 0.0) -> Array:
        """Temperature (k, m), °C, at a lag, s, without eddies.

        `wander` (k,) already has the lag.

        Day and layers are slow: there a lag of a minute or two is a delay, to 0.1 mK.
        """
        c, slow = self.conditions, seconds - lag
        gradient, layer = (a + (b - a) * self.sunshine(slow) for a, b in (c.gradient_c_per_m, c.surface_layer_c))
        z = points[..., 2]
        layered = gradient[:, None] * z + layer[:, None] * (1.0 - np.exp(-z / c.surface_layer_m))
        level = c.temperature_c + self._day(slow) + wander
        even = level[:, None] + self.stratification * layered + points[..., :2] @ self.slope
        return even + self.passing.common_c(points, seconds[:, None], lag)

    def felt_c(self, point: Array, seconds: Array, lag: float) -> Array:
        """Temperature (k,), °C, of a body at a point (3,) with a lag, s."""
        wander = self.wander.lagged(lag)(seconds)[:, 0]
        even = self._temperature(point[None, None], seconds, wander, lag)[:, 0]
        return even + self.passing.eddies_c(point, seconds, lag)

    def index(self, points: Array, seconds: Array) -> Array:
        """Group index (k,) at points (k, 3)."""
        return 1.0 + PPM * group_refractivity_ppm(*self.weather(points[:, None], seconds))[:, 0]

    def along(self, start: Array, end: Array, seconds: Array) -> tuple[Array, Array, Array]:
        """Mean and end index of straight lines (k, 3), and dry amplitude share, (k,) each.

        The share of amplitude is that of an outdoor retroreflector at the end, reduced when wet below the dew point.

        By quadrature; eddies enter as their mean, which neglects their correlation with layers: 20 nm in 100 m. The ray
        itself is bent, by less than 0.1 um of path here.
        """
        on = start[:, None] + (end - start)[:, None] * np.append(SHARES, 1.0)[:, None]
        eddies = np.repeat(self.passing.mean_eddies_c(start, end, seconds)[:, None], on.shape[1], axis=1)
        eddies[:, -1] = self.passing.eddies_c(end, seconds)
        weather = self._weather(on, seconds, eddies)
        index = 1.0 + PPM * group_refractivity_ppm(*weather)
        temperature_c, pressure_hpa, humidity_percent = (v[:, -1] for v in weather)
        dry = self._dry_share(temperature_c, pressure_hpa, humidity_percent, seconds)
        return index[:, :-1] @ WEIGHTS, index[:, -1], dry

    def _dry_share(self, temperature_c: Array, pressure_hpa: Array, humidity_percent: Array, seconds: Array) -> Array:
        """Amplitude share (k,) of outdoor glass, colder than air by night radiation."""
        calm = 1.0 / (1.0 + self.conditions.wind_m_s / 4.0)
        cooling = self.conditions.sky_cooling_c * calm * (1.0 - self.sunshine(seconds))
        dew_point = _dew_point_c(saturation_hpa(temperature_c, pressure_hpa) * humidity_percent / 100.0, pressure_hpa)
        below = np.clip((dew_point - temperature_c + cooling) / WET_WIDTH_C, -50.0, 50.0)
        return 1.0 - self.dew * (1.0 - WET) / (1.0 + np.exp(-below))


def _dew_point_c(vapour_hpa: ArrayLike, pressure_hpa: ArrayLike) -> Array:
    """Dew point, °C: the inverse of `saturation_hpa`."""
    ratio = np.log(np.asarray(vapour_hpa) / (6.1121 * (1.0007 + 3.46e-6 * np.asarray(pressure_hpa))))
    return 240.97 * ratio / (17.502 - ratio)


def station_places(site: SiteFolder, streams: Streams) -> dict[str, Array]:
    """Places of the weather stations (3,), m, ground.

    At their elevation; 130 m out, bearings drawn (chosen).
    """
    places = {}
    for station in site.site.weather_station:
        bearing = streams(f"weather station/{station.name}").uniform(0.0, 360.0) * DEGREE
        z = station.elevation_m - site.site.site.elevation_of_z0_m
        places[station.name] = np.array([130.0 * np.sin(bearing), 130.0 * np.cos(bearing), z])
    return places
