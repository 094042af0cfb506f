"""Weather stations of a night: places, sensors and readings."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import SECONDS_PER_DAY, TWO_PI
from catseye.errors import InputError
from catseye.simulator.night.air import ELEVATION_OF_Z0, TrueAir
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.lag import lagged
from catseye.simulator.night.limits import require
from catseye.simulator.night.sun import sine_of_sun

STATIONS = {"WX1": 803.800, "WX2": 850.150}  # elevation above sea level, m
USUAL_INTERVAL_S = 30.0
OUT_M = (100.0, 150.0)  # from the pintle bearing, as the monuments are
AIRING_M_S = 2.0  # wind that halves a radiation error: WMO-8 (Guide to Instruments), part I ch. 2, by its curves' form
STEP_S = 0.25  # an eddy of 5 m passes in 0.8 s at 6 m/s


@dataclass(frozen=True)
class ReadingGap:
    """Interval without readings of a weather station, s since the start."""

    station: str
    start_s: float
    end_s: float

    def __post_init__(self):
        require(f"end_s - start_s of a gap of {self.station}", self.end_s - self.start_s, 0.0, 1e6)


@dataclass(frozen=True)
class StationNature:
    """Sensor properties of weather stations; stations without an entry are perfect.

    lags_s        station -> time constant of its thermometer, 0 to 1800
    radiation_c   station -> excess reading under a Sun in the zenith in still air
    """

    lags_s: Mapping[str, float] = field(default_factory=dict)
    radiation_c: Mapping[str, float] = field(default_factory=dict)
    interval_s: float = USUAL_INTERVAL_S
    gaps: tuple[ReadingGap, ...] = ()

    def __post_init__(self):
        for station in (*self.lags_s, *self.radiation_c, *(gap.station for gap in self.gaps)):
            if station not in STATIONS:
                raise InputError(f"station {station!r} of a nature (expected {' or '.join(STATIONS)})")
        for station, lag in self.lags_s.items():
            require(f"lags_s of {station}", lag, 0.0, 1800.0)
        for station, warmer in self.radiation_c.items():
            require(f"radiation_c of {station}", warmer, 0.0, 10.0)
        require("interval_s of readings", self.interval_s, 1.0, 3600.0)


@dataclass(frozen=True)
class WeatherReading:
    """One line of weather.csv."""

    seconds: float
    station: str
    temperature_c: float
    pressure_hpa: float
    humidity_percent: float


@dataclass(frozen=True, eq=False)
class WeatherStations:
    """Weather stations of a night.

    places   station -> (3,) m, ground frame
    wind     m/s
    """

    places: Mapping[str, np.ndarray]
    nature: StationNature
    wind: float
    start_mjd_utc: float

    def temperature_c(self, air: TrueAir, station: str, seconds):
        """Temperature at times (k,) of a perfect sensor with this station's lag.

        In its screen.
        """
        place, lag = self.places[station], self.nature.lags_s.get(station, 0.0)
        read = lagged(lambda t: air.weather_at(place, t)[0], seconds, time_constant_s=lag, step_s=STEP_S)
        return read + self.radiation_c(station, seconds)

    def radiation_c(self, station: str, seconds):
        """Radiation error at times (k,), °C, by Sun and wind."""
        sun = sine_of_sun(self.start_mjd_utc + np.asarray(seconds, dtype=float) / SECONDS_PER_DAY)
        return self.nature.radiation_c.get(station, 0.0) * sun / (1.0 + self.wind / AIRING_M_S)

    def readings(
        self, air: TrueAir, *, streams: Streams, faults: Faults, planted: Planted, until_s: float
    ) -> tuple[list[WeatherReading], dict[str, float]]:
        """Readings of all stations, and true thermometer offsets.

        From 180 s before the start to 570 s and more after the last shot.
        """
        interval = self.nature.interval_s
        until = max(4110.0, until_s + 600.0) + interval - USUAL_INTERVAL_S
        seconds = np.arange(-180.0, until, interval)
        columns, offsets = {}, {}
        for station, place in self.places.items():
            rng = streams(f"weather/{station}")
            offset = planted.gain("thermometer_offsets") * rng.normal(0.0, air.conditions.thermometer_offset_c)
            offset += faults.lying_thermometer_c if station == faults.lying_station else 0.0
            scatter = planted.gain("weather_scatter") * rng.normal(size=(len(seconds), 3)) * (0.05, 0.05, 0.5)
            _, pressure, humidity = air.weather_at(place, seconds)
            columns[station] = np.column_stack(
                (
                    self.temperature_c(air, station, seconds) + offset + scatter[:, 0],
                    pressure + scatter[:, 1],
                    np.clip(humidity + scatter[:, 2], 0.0, 100.0),
                )
            )
            offsets[station] = float(offset)
        silent = {station: self._silent(station, seconds) for station in self.places}
        readings = [
            WeatherReading(float(s), station, *(float(v) for v in columns[station][i]))
            for i, s in enumerate(seconds)
            for station in self.places
            if not silent[station][i]
        ]
        return readings, offsets

    def _silent(self, station: str, seconds):
        """True (k,) for readings in a gap; first and last are never in one."""
        silent = np.zeros(len(seconds), dtype=bool)
        for gap in self.nature.gaps:
            if gap.station == station:
                silent |= (seconds >= gap.start_s) & (seconds < gap.end_s)
        silent[[0, -1]] = False
        return silent


def station_points(streams: Streams) -> dict[str, np.ndarray]:
    """Places of the stations (3,), m, ground frame.

    Distances and bearings are drawn, heights as in site.toml.
    """
    places = {}
    for station, elevation in STATIONS.items():
        rng = streams(f"station place/{station}")
        out, bearing = rng.uniform(*OUT_M), rng.uniform(0.0, TWO_PI)
        places[station] = np.array([out * np.sin(bearing), out * np.cos(bearing), elevation - ELEVATION_OF_Z0])
    return places
