"""Thermometers of a living site: offsets, lags, solar radiation errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import SECONDS_PER_DAY
from catseye.records.site.folder import SiteFolder
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.stations import AIRING_M_S
from catseye.simulator.night.sun import sine_of_sun
from catseye.simulator.twin.air import LivingAir


@dataclass(frozen=True, eq=False)
class Thermometer:
    """Thermometer of one station.

    place         (3,) m, ground
    offset_c      reading less air
    lag           s, time constant
    radiation_c   °C, excess reading under a Sun in the zenith in still air
    """

    place: Array
    offset_c: float
    lag: float
    radiation_c: float
    start_mjd: float
    latitude_deg: float
    longitude_deg: float

    def temperature_c(self, air: LivingAir, seconds: ArrayLike) -> Array:
        """Reading at times (k,), without scatter."""
        times = np.asarray(seconds, dtype=float)
        warmed = self.warmed_c(times, air.conditions.wind_m_s)
        return air.felt_c(self.place, times, self.lag) + self.offset_c + warmed

    def warmed_c(self, seconds: ArrayLike, wind_m_s: float) -> Array:
        """Radiation error at times (k,), °C."""
        mjd = self.start_mjd + np.asarray(seconds, dtype=float) / SECONDS_PER_DAY
        sun = sine_of_sun(mjd, latitude_deg=self.latitude_deg, longitude_deg=self.longitude_deg)
        return self.radiation_c * sun / (1.0 + wind_m_s / AIRING_M_S)


def thermometers(
    site: SiteFolder, air: LivingAir, start_mjd: float, *, places: dict[str, Array], streams: Streams, planted: Planted
) -> dict[str, Thermometer]:
    """Draw a thermometer at each place."""
    c, drawn = air.conditions, {}
    for name, place in places.items():
        offset = planted.gain("thermometer_offsets") * streams(f"thermometer/{name}").normal(
            0.0, c.thermometer_offset_c
        )
        lag, warm = streams(f"thermometer nature/{name}").uniform(size=2)
        drawn[name] = Thermometer(
            place=place,
            offset_c=float(offset),
            lag=abs(planted.gain("thermometer_lag")) * c.thermometer_lag * float(lag),
            radiation_c=planted.gain("radiation_error") * c.radiation_c * float(warm),
            start_mjd=start_mjd,
            latitude_deg=site.site.site.latitude_deg,
            longitude_deg=site.site.site.longitude_deg,
        )
    return drawn
