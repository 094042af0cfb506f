"""A folder with points.csv and ranges.csv: rangers, targets and the distances between them, in metres.

    points.csv   point,x,y,z and, where wanted, role (free, fixed or datum) and u_x,u_y,u_z
    ranges.csv   from,to,distance,sigma

A point without coordinates has blank ones. A datum point takes part in the inner constraints, relative to the
coordinates of the file. u_x, u_y, u_z are standard uncertainties of the coordinates given: a blank is no prior, zero
holds the coordinate. All ranges are one group, in the order of the file.
"""

import difflib
from pathlib import Path

import numpy as np

from catseye.estimation.network.model import NetworkPoints, ObservationNetwork
from catseye.estimation.observations.kinds import Distances, ObservationGroup, ObservedCoordinates
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import shown

POINT_COLUMNS = ("point", "x", "y", "z")
U_COLUMNS = ("u_x", "u_y", "u_z")
RANGE_COLUMNS = ("from", "to", "distance", "sigma")
ROLES = ("free", "fixed", "datum")


def read_network_folder(path: Path) -> ObservationNetwork:
    """The network of a folder; InputError where it cannot be used.

    path   a folder with points.csv and ranges.csv
    """
    folder = Folder(path)
    points = columns_of(folder.text("points.csv"), "points.csv", POINT_COLUMNS, optional=("role", *U_COLUMNS))
    ranges = columns_of(folder.text("ranges.csv"), "ranges.csv", RANGE_COLUMNS)
    names = names_of(points, "point")
    xyz, fixed, datum, priors = _places(points)
    groups: list[ObservationGroup] = [_distances(ranges, names)]
    places = [ranges.where()]
    if np.any(priors > 0.0):
        row, axis = np.nonzero(priors > 0.0)
        observed, variance = xyz[row, axis], priors[row, axis] ** 2
        groups.append(ObservedCoordinates("coordinates", observed, variance, 3 * row, axis))
        places.append(tuple(f"points.csv line {points.lines[int(i)]}" for i in row))
    return ObservationNetwork(
        NetworkPoints(tuple(names), xyz, fixed, datum), (), tuple(groups), tuple(places), source=path.name
    )


def names_of(table: TextColumns, column: str) -> dict[str, int]:
    """Name -> row, each name once."""
    cells = table.cells[column]
    names = dict(zip(cells, range(len(cells)), strict=True))
    if len(names) < len(cells) or "" in names:
        seen: dict[str, int] = {}
        for row, name in enumerate(cells):
            if not name:
                raise table.refuse(row, f"{column} is empty (expected a name)")
            if name in seen:
                first = table.lines[seen[name]]
                raise table.refuse(row, f"{column} {shown(name)} is in line {first} already (expected each name once)")
            seen[name] = row
    return names


def _places(points: TextColumns) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """xyz (n, 3), fixed and datum (n, 3) bool, standard uncertainties (n, 3) with nan for none."""
    xyz = np.stack([points.numbers(axis, blank=np.nan) for axis in "xyz"], axis=1)
    role = np.array(points.cells.get("role", ["free"] * len(points)), dtype=object)
    role[role == ""] = "free"
    if "role" in points.cells:
        points.check("role", np.isin(role, ROLES), " or ".join(ROLES))
    fixed = np.repeat((role == "fixed")[:, None], 3, axis=1)
    datum = np.repeat((role == "datum")[:, None], 3, axis=1)
    u = np.full_like(xyz, np.nan)
    for axis, name in enumerate(U_COLUMNS):
        if name in points.cells:
            u[:, axis] = points.numbers(name, blank=np.nan)
            points.check(name, ~(u[:, axis] < 0.0), "0 or above")
    fixed |= u == 0.0
    datum &= ~fixed
    for axis, name in enumerate("xyz"):
        known = ~(np.isnan(xyz[:, axis]) & (fixed | datum | ~np.isnan(u))[:, axis])
        points.check(name, known, "its value: it is fixed, datum or has a prior")
    return xyz, fixed, datum, np.where(fixed, np.nan, u)


def _distances(ranges: TextColumns, names: dict[str, int]) -> Distances:
    origin, target = (_numbered(ranges, end, names) for end in ("from", "to"))
    ranges.check("to", origin != target, "another point than from")
    distance, sigma = ranges.numbers("distance"), ranges.numbers("sigma")
    ranges.check("distance", distance > 0.0, "above 0 m")
    ranges.check("sigma", sigma > 0.0, "above 0 m: nothing is measured without error")
    return Distances("slope distance", distance, sigma**2, 3 * origin, 3 * target)


def _numbered(ranges: TextColumns, end: str, names: dict[str, int]) -> np.ndarray:
    cells = ranges.cells[end]
    try:
        return np.array(list(map(names.__getitem__, cells)))
    except KeyError:
        row = next(i for i, name in enumerate(cells) if name not in names)
        close = difflib.get_close_matches(cells[row], names, n=1)
        hint = f"perhaps {shown(close[0])}" if close else "a point of points.csv"
        raise ranges.refuse(row, f"{end} = {shown(cells[row])} is no point (expected {hint})") from None
