"""Tables of stations and of ranges from them to targets, for positions target by target.

    stations.csv   point,x,y,z and optionally u_x,u_y,u_z: standard uncertainties; a blank is zero, exact
    ranges.csv     from,to,distance and sigma, or a claim for those without: from is a station, to a target

Names and numbers are those of a network's folder (`folder.py`).
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from catseye.estimation.network.names import PointIndex, spelled
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import shown
from catseye.records.network.claim import NO_CLAIM, RangeClaim
from catseye.records.network.folder import POINT_COLUMNS, RANGE_COLUMNS, U_COLUMNS, names_of, numbered


class RangedTargets(NamedTuple):
    """Ranges from n stations to m targets.

    stations, targets   names
    x                   (n, 3) m, of the stations
    u                   (n, 3) m, their standard uncertainties
    ranges, sigma       (m, n) m, nan where there is none
    """

    stations: tuple[str, ...]
    targets: tuple[str, ...]
    x: np.ndarray
    u: np.ndarray
    ranges: np.ndarray
    sigma: np.ndarray


def read_stations(path: Path) -> tuple[PointIndex, np.ndarray, np.ndarray]:
    """Names, coordinates (n, 3) m and standard uncertainties (n, 3) m of a table; InputError if invalid."""
    table = columns_of(Folder(path.parent).text(path.name), path.name, POINT_COLUMNS, optional=U_COLUMNS)
    names = names_of(table, "point")
    x = np.stack([table.numbers(axis) for axis in "xyz"], axis=1)
    u = np.zeros_like(x)
    for k, name in enumerate(U_COLUMNS):
        if name in table.cells:
            u[:, k] = table.numbers(name, blank=0.0)
            table.check(name, u[:, k] >= 0.0, "0 or above")
    return names, x, u


def read_ranged_targets(stations: Path, ranges: Path, claim: RangeClaim = NO_CLAIM) -> RangedTargets:
    """Stations and ranges of two tables.

    claim   standard uncertainty of a range whose sigma is blank or missing

    Raises InputError for a station that is not in the table, a pair that occurs twice, and a range without sigma.
    """
    names, x, u = read_stations(stations)
    table = columns_of(Folder(ranges.parent).text(ranges.name), ranges.name, RANGE_COLUMNS, optional=("sigma",))
    targets, at = _targets(table)
    origin = numbered(table, "from", names)
    distance = table.numbers("distance")
    table.check("distance", distance > 0.0, "above 0 m")
    sigma = sigmas_of(table, distance, claim)
    array, u_array = np.full((2, len(targets), len(names)), np.nan)
    for row, (i, j) in enumerate(zip(at, origin, strict=True)):
        if np.isfinite(array[i, j]):
            pair = f"{shown(table.cells['from'][row])} to {shown(table.cells['to'][row])}"
            raise table.refuse(row, f"{pair} occurs twice (expected each pair once; `adjust` takes repeated ranges)")
        array[i, j], u_array[i, j] = distance[row], sigma[row]
    return RangedTargets(tuple(names), tuple(targets), x, u, array, u_array)


def _targets(table: TextColumns) -> tuple[PointIndex, np.ndarray]:
    """Targets in the order of the file, and the target of each range."""
    targets = PointIndex()
    for row, name in enumerate(table.cells["to"]):
        if not name:
            raise table.refuse(row, "to is empty (expected a name)")
        if name not in targets:
            targets[spelled(name)] = len(targets)
    return targets, np.array([targets[name] for name in table.cells["to"]])


def sigmas_of(table: TextColumns, distance: np.ndarray, claim: RangeClaim) -> np.ndarray:
    """Standard uncertainties of ranges (m), their own or claimed; InputError for a range without."""
    sigma = table.numbers("sigma", blank=np.nan) if "sigma" in table.cells else np.full(len(table), np.nan)
    without = np.isnan(sigma)
    if without.any() and not claim:
        options = "sigma_mm and sigma_ppm (--sigma-mm, --sigma-ppm) for ranges without"
        raise table.refuse(int(np.argmax(without)), f"no sigma (expected one, m, or {options})")
    if "sigma" in table.cells:
        table.check("sigma", without | (sigma > 0.0), "above 0 m: no measurement is exact")
    return np.where(without, claim.of(distance), sigma)
