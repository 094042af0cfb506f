"""Array of loudspeakers and microphones: its stations, the travel times between them, and the sheet of both."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.record import Name, Record, Vector, Version, Within, broken_rule
from catseye.records.files.refusal import refusal

PLACES = ("x_m", "y_m", "z_m")
LARGEST_M = 100_000.0  # of a coordinate
FARTHEST_S = 20.0  # of a travel time
MOST_TIMES = 5_000  # their covariance is inverted
SpreadC = Annotated[float, Within(0, 50)]
Speed = Annotated[float, Within(0, 60)]
Extent = Annotated[float, Within(0, 1e5, above=True)]


class ChosenLine(Record):
    """Line whose mean temperature is wanted, such as a laser's.

    name         of the line
    start, end   x, y, z in the frame of the stations
    """

    name: Name
    start: Vector
    end: Vector


class SoundArraySheet(Record):
    """Sheet of an array: weather, equipment, expected variation of temperature and wind, chosen lines.

    temperature_c, u_temperature_c   expected mean of the field
    variation_c                      standard deviation of the field about its mean
    variation_m, variation_z_m       correlation lengths of the field, horizontal and vertical
    u_wind_m_per_s                   standard deviation of the mean wind's components about 0; 0 for still air
    wind_variation_m_per_s           standard deviation of each component about the mean wind
    wind_m, wind_z_m                 correlation lengths of the wind, horizontal and vertical
    pressure_hpa, u_pressure_hpa     pressure of the air, common to all paths
    humidity_percent, u_humidity_percent   relative humidity, common to all paths
    co2_ppm                          carbon dioxide in the air
    u_position_mm                    standard uncertainty of each coordinate of each station
    delay_us, u_delay_us             delay of the equipment in every time
    u_time_us                        standard uncertainty of each time; added in squares to the table's
    frequency_hz                     frequency of the sound, for the air's dispersion
    wavelength_um                    wavelength of the light, for the group refractivity of the lines
    map_z_m                          height of the map; the mean height of the stations if missing
    lines                            lines whose mean is wanted
    """

    format: Annotated[int | str, Version("sound-array")] = 1
    temperature_c: Annotated[float, Within(-60, 60)]
    u_temperature_c: SpreadC
    variation_c: SpreadC
    variation_m: Extent
    variation_z_m: Extent
    u_wind_m_per_s: Speed
    wind_variation_m_per_s: Speed = 0.0
    wind_m: Extent = 100.0
    wind_z_m: Extent = 10.0
    pressure_hpa: Annotated[float, Within(500, 1100)]
    u_pressure_hpa: Annotated[float, Within(0, 50)]
    humidity_percent: Annotated[float, Within(0, 100)]
    u_humidity_percent: Annotated[float, Within(0, 50)]
    co2_ppm: Annotated[float, Within(0, 2000)] = 450.0
    u_position_mm: Annotated[float, Within(0, 1000)]
    delay_us: Annotated[float, Within(-1e6, 1e6)] = 0.0
    u_delay_us: Annotated[float, Within(0, 1e5)] = 0.0
    u_time_us: Annotated[float, Within(0, 1e5)] = 0.0
    frequency_hz: Annotated[float, Within(0, 1e5)]
    wavelength_um: Annotated[float, Within(0.3, 2.0)] = 0.780
    map_z_m: Annotated[float, Within(-LARGEST_M, LARGEST_M)] | None = None
    lines: Annotated[tuple[ChosenLine, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _belongs_together(self) -> "SoundArraySheet":
        if self.u_temperature_c == 0.0 and self.variation_c == 0.0:
            raise broken_rule("u_temperature_c and variation_c are 0 (expected one above 0: nothing is to be found)")
        if self.u_wind_m_per_s == 0.0 and self.wind_variation_m_per_s > 0.0:
            raise broken_rule(
                "u_wind_m_per_s = 0 is still air, wind_variation_m_per_s is above 0 (expected both or none)"
            )
        names = [line.name for line in self.lines]
        for line in self.lines:
            if names.count(line.name) > 1:
                raise broken_rule(f"lines names {line.name!r} {names.count(line.name)} times (expected once)")
            if line.start == line.end:
                raise broken_rule(f"line {line.name!r} starts where it ends (expected two points)")
        return self


@dataclass(frozen=True, eq=False)
class SoundArray:
    """Stations of an array and the m travel times between them.

    sheet              weather, equipment, expected variation
    names              of the stations
    places             (n, 3) m
    source, receiver   (m,) int, into the stations
    time               (m,) s, nan for a blank cell
    u_time             (m,) s
    hashes             SHA-256 of each file read
    """

    sheet: SoundArraySheet
    names: tuple[str, ...]
    places: np.ndarray
    source: np.ndarray
    receiver: np.ndarray
    time: np.ndarray
    u_time: np.ndarray
    hashes: dict[str, str]

    @property
    def both_ways(self) -> int:
        """Number of pairs of stations with a time in each direction."""
        heard = np.isfinite(self.time)
        ways = set(zip(self.source[heard].tolist(), self.receiver[heard].tolist(), strict=True))
        return sum((b, a) in ways for a, b in ways) // 2


def read_sound_array(stations: Path, times: Path, sheet: Path) -> SoundArray:
    """Stations, times and sheet; InputError names file, line, value.

    stations   table of station, x_m, y_m, z_m
    times      table of source, receiver, time_s, perhaps u_time_us
    """
    files = (stations, times, sheet)
    if len({file.name for file in files}) < len(files):
        raise refusal(times.name, "is given twice (expected stations, times and sheet, names that differ)")
    folder = Folder(sheet.parent)
    record = folder.record(sheet.name, SoundArraySheet)
    names, places = _stations(_table(stations, ("station", *PLACES)))
    table = _table(times, ("source", "receiver", "time_s"), ("u_time_us",))
    if len(table) > MOST_TIMES:
        raise refusal(times.name, f"has {len(table)} times (expected at most {MOST_TIMES})")
    source, receiver = _ends(table, names)
    time = table.numbers("time_s", blank=np.nan)
    table.check("time_s", np.isnan(time) | ((time > 0.0) & (time <= FARTHEST_S)), f"above 0 to {FARTHEST_S:g} s")
    own = np.zeros(len(table))
    if "u_time_us" in table.cells:
        own = table.numbers("u_time_us")
        table.check("u_time_us", (own >= 0.0) & (own <= 1e5), "0 to 100000")
    u_time = 1e-6 * np.hypot(own, record.u_time_us)
    if not (u_time > 0.0).all():
        row = int(np.argmin(u_time))
        raise table.refuse(row, "the time has no uncertainty (expected u_time_us above 0, here or in the sheet)")
    hashes = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in (stations, times)}
    return SoundArray(
        sheet=record,
        names=names,
        places=places,
        source=source,
        receiver=receiver,
        time=time,
        u_time=u_time,
        hashes={**hashes, **folder.hashes},
    )


def _table(path: Path, required: tuple[str, ...], optional: tuple[str, ...] = ()) -> TextColumns:
    return columns_of(Folder(path.parent).text(path.name), path.name, required, optional=optional)


def _stations(table: TextColumns) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and places; each name and each place once."""
    columns = []
    for name in PLACES:
        values = table.numbers(name)
        table.check(name, np.abs(values) <= LARGEST_M, f"-{LARGEST_M:g} to {LARGEST_M:g}")
        columns.append(values)
    places = np.stack(columns, axis=1)
    seen: dict[str, int] = {}
    for row, name in enumerate(table.cells["station"]):
        if not name:
            raise table.refuse(row, "station is empty (expected a name)")
        if name in seen:
            raise table.refuse(row, f"station {name!r} is also in line {table.lines[seen[name]]} (expected once)")
        seen[name] = row
    return tuple(seen), places


def _ends(table: TextColumns, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Stations of each time; a direction may be measured many times."""
    number = {name: k for k, name in enumerate(names)}
    ends = []
    for column in ("source", "receiver"):
        for row, name in enumerate(table.cells[column]):
            if name not in number:
                raise table.refuse(row, f"{column} = {name!r} is no station (expected one of {', '.join(names[:8])})")
        ends.append(np.array([number[name] for name in table.cells[column]]))
    source, receiver = ends
    if (source == receiver).any():
        row = int(np.argmax(source == receiver))
        raise table.refuse(row, f"source and receiver are both {names[source[row]]!r} (expected two stations)")
    return source, receiver
