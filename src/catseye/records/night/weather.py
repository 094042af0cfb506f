"""weather.csv: samples of the weather stations, and as columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from catseye.records.files.reading import column
from catseye.records.files.record import Mjd, Name, Record, Within


class WeatherSample(Record):
    """Row of weather.csv; a millibar is a hectopascal.

    mjd_utc         time
    station         name of the station in site.toml
    temperature_c   temperature of the air
    pressure_mb     pressure of the air at the station
    humidity_pct    relative humidity
    """

    mjd_utc: Mjd
    station: Name
    temperature_c: Annotated[float, Within(-60, 60)]
    pressure_mb: Annotated[float, Within(500, 1100)]
    humidity_pct: Annotated[float, Within(0, 100)]


@dataclass(frozen=True, eq=False)
class Weather:
    """All samples in file order, as read-only columns."""

    mjd_utc: np.ndarray
    station: tuple[str, ...]
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray

    def __len__(self) -> int:
        return len(self.station)


def weather_columns(samples: Sequence[WeatherSample]) -> Weather:
    return Weather(
        mjd_utc=column([sample.mjd_utc for sample in samples], np.float64),
        station=tuple(sample.station for sample in samples),
        temperature_c=column([sample.temperature_c for sample in samples], np.float64),
        pressure_hpa=column([sample.pressure_mb for sample in samples], np.float64),
        humidity_percent=column([sample.humidity_pct for sample in samples], np.float64),
    )
