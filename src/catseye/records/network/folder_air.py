"""Air of a folder network: displayed distances in ranges.csv, with weather beside each, and air.toml.

air.toml     [air] and [[weather]] as in `toml_air`
ranges.csv   temperature_c, pressure_hpa and humidity_percent, or group_index, or index: what the distance displays
             for a metre; blank where the weather of the station (`from`) in air.toml counts
"""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.errors import ValidityError
from catseye.estimation.network.model import NetworkParameter
from catseye.estimation.network.names import name_key, spelled
from catseye.records.files.columns import TextColumns
from catseye.records.files.reading import Folder, toml_of
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.toml_fields import Fields
from catseye.records.network.draft import NetworkDraft
from catseye.records.network.toml_air import GIVEN, HIGHEST_INDEX, WEATHER, NetworkAir

FILE = "air.toml"
AIR_COLUMNS = (*GIVEN, "index")  # of ranges.csv
SMALLEST, LARGEST = 0.99, 1.01  # display of a metre: the index of air over the reference's


@dataclass(frozen=True, eq=False)
class RangesAir:
    """Air of m ranges.

    scale        (m,) display of a metre
    scaling      (m, s) parameters of the air's errors, from 0; None: none
    parameters   s or more, in that order
    """

    scale: np.ndarray
    scaling: np.ndarray | None
    parameters: tuple[NetworkParameter, ...]


def read_folder_air(folder: Folder) -> NetworkAir | None:
    """Air of a folder's air.toml; None without the file. InputError for one that is invalid."""
    if not (folder.directory / FILE).is_file():
        return None
    values = toml_of(folder.text(FILE), FILE)
    strange = sorted(set(values) - {"air", "weather"})
    if strange:
        raise refusal(FILE, f"{shown(strange[0])} is not a known table (expected [air] and [[weather]])")
    table, stations = values.get("air"), values.get("weather", [])
    if not isinstance(table, dict):
        raise refusal(FILE, "[air] is missing (expected it, with wavelength_um and reference_index)")
    if not isinstance(stations, list) or not all(isinstance(item, dict) for item in stations):
        raise refusal(FILE, f"weather = {shown(stations)} (expected tables [[weather]])")
    items = [Fields(FILE, f"weather {k}", item) for k, item in enumerate(stations, start=1)]
    return NetworkAir(Fields(FILE, "air", table), items, NetworkDraft(FILE))


def air_of_ranges(ranges: TextColumns, air: NetworkAir | None) -> RangesAir | None:
    """Air of each row of ranges.csv; None where neither the table nor air.toml has any.

    ranges   columns, with `AIR_COLUMNS` where the table has them
    air      of `read_folder_air`

    Raises InputError, with the line, for a row without weather, with two, or outside the formula of the index.
    """
    present = [name for name in AIR_COLUMNS if name in ranges.cells]
    if air is None:
        if present:
            raise refusal(
                ranges.file, f"{present[0]} needs {FILE} (expected it, with [air] wavelength_um and reference_index)"
            )
        return None
    values = {name: _numbers(ranges, name) for name in AIR_COLUMNS}
    filled = {name: ~np.isnan(column) for name, column in values.items()}
    weather = np.any([filled[name] for name in WEATHER], axis=0)
    several = weather.astype(int) + filled["group_index"] + filled["index"] > 1
    if several.any():
        row = int(np.argmax(several))
        names = [name for name in AIR_COLUMNS if filled[name][row]]
        raise ranges.refuse(row, f"has {names[0]} and {names[-1]} (expected one of weather, group_index, index)")
    for name in WEATHER:
        lacks = weather & ~filled[name]
        if lacks.any():
            raise ranges.refuse(int(np.argmax(lacks)), f"{name} is blank (expected {', '.join(WEATHER)})")
    scale = np.where(filled["index"], values["index"], values["group_index"] / air.reference)
    if weather.any():
        scale[weather] = (1.0 + _refractivity(ranges, values, weather, air)) / air.reference
    keys = list(map(name_key, ranges.cells["from"]))
    by_station = np.array([air.stations.get(key, np.nan) for key in keys]) / air.reference
    scale = np.where(np.isnan(scale), by_station, scale)
    if np.isnan(scale).any():
        row = int(np.argmax(np.isnan(scale)))
        raise ranges.refuse(
            row,
            f"has no weather (expected {', '.join(WEATHER)}, or group_index, or [[weather]] of "
            f"{shown(ranges.cells['from'][row])} in {FILE}, or index = 1 for a length without air)",
        )
    return RangesAir(scale, _scaling(ranges, air, ~filled["index"]), tuple(air.draft.parameters))


def _numbers(ranges: TextColumns, name: str) -> np.ndarray:
    """Column (m,) with nan for blank cells, or all nan without it."""
    if name not in ranges.cells:
        return np.full(len(ranges), np.nan)
    values = ranges.numbers(name, blank=np.nan)
    if name in ("group_index", "index"):
        low, high = (1.0, HIGHEST_INDEX) if name == "group_index" else (SMALLEST, LARGEST)
        ranges.check(name, np.isnan(values) | ((values >= low) & (values <= high)), f"{low:g} to {high:g}")
    return values


def _refractivity(
    ranges: TextColumns, values: dict[str, np.ndarray], weather: np.ndarray, air: NetworkAir
) -> np.ndarray:
    """Group refractivity of the rows with weather."""
    readings = [values[name][weather] for name in WEATHER]
    try:
        return np.asarray(
            group_refractivity(*readings, wavelength_um=air.wavelength_um, model=air.model, co2_ppm=air.co2_ppm)
        )
    except ValidityError as problem:
        bad = 0 if problem.mask is None else int(np.argmax(problem.mask))
        raise ranges.refuse(int(np.flatnonzero(weather)[bad]), str(problem)) from problem


def _scaling(ranges: TextColumns, air: NetworkAir, weather: np.ndarray) -> np.ndarray | None:
    """Parameters (m, s) of each row's air, -1 for none; they begin at 0."""
    roles: dict[str, dict[str, int]] = {}
    for station in dict.fromkeys(ranges.cells["from"]):
        roles[station] = air.parameters(spelled(station))
    names = list(dict.fromkeys(role for of in roles.values() for role in of))
    if not names:
        return None
    columns = np.array([[roles[station].get(role, -1) for role in names] for station in ranges.cells["from"]])
    return np.where(weather[:, None], columns, -1)
