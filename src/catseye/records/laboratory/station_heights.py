"""Weather stations at their heights: a CSV with columns station, z_m, temperature, pressure, humidity, perhaps time."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD

COLUMNS = ("station", "z_m", "temperature_c", "pressure_hpa", "humidity_percent")
TIME = "mjd_utc"
LIMITS = {
    "z_m": (-500.0, 9000.0),
    "temperature_c": (-60.0, 60.0),
    "pressure_hpa": (500.0, 1100.0),
    "humidity_percent": (0.0, 100.0),
}


@dataclass(frozen=True, eq=False)
class StationHeights:
    """Readings in file order.

    station            names of the stations of the readings
    z                  (n,) m, height of the sensors in the frame of the path
    mjd_utc            (n,) 0 for all without a column of it
    temperature_c, pressure_hpa, humidity_percent   (n,) pressure at the station
    digest             SHA-256 of the file
    """

    station: tuple[str, ...]
    z: np.ndarray
    mjd_utc: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    digest: str


def read_station_heights(path: Path) -> StationHeights:
    """Stations of a table; InputError names file, line, value."""
    table = columns_of(Folder(path.parent).text(path.name), path.name, COLUMNS, optional=(TIME,))
    values = {name: table.numbers(name) for name in LIMITS}
    for name, (low, high) in LIMITS.items():
        table.check(name, (values[name] >= low) & (values[name] <= high), f"{low:g} to {high:g}")
    timed = TIME in table.cells
    mjd = table.numbers(TIME) if timed else np.zeros(len(table))
    if timed:
        table.check(TIME, (mjd >= EARLIEST_MJD) & (mjd <= LATEST_MJD), f"{EARLIEST_MJD:g} to {LATEST_MJD:g}, UTC")
    heights: dict[str, float] = {}
    for row, (name, z) in enumerate(zip(table.cells["station"], values["z_m"].tolist(), strict=True)):
        if not name:
            raise table.refuse(row, "station is empty (expected a name)")
        if heights.setdefault(name, z) != z:
            raise table.refuse(row, f"z_m = {z:g} of {name!r}, which was at {heights[name]:g} (expected one height)")
    return StationHeights(
        station=tuple(table.cells["station"]),
        z=values["z_m"],
        mjd_utc=mjd,
        temperature_c=values["temperature_c"],
        pressure_hpa=values["pressure_hpa"],
        humidity_percent=values["humidity_percent"],
        digest=hashlib.sha256(path.read_bytes()).hexdigest(),
    )
