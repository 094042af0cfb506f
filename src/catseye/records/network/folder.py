"""Folder with points.csv and ranges.csv: rangers, targets, distances, metres.

    points.csv   point,x,y,z and optionally role (free, fixed or datum) and u_x,u_y,u_z
    ranges.csv   from,to,distance and sigma, or a claim for those without; with weather as displayed, see `folder_air`
    air.toml     perhaps: the instrument's wavelength and reference index, weather at stations

A target of ranges.csv that points.csv does not list is an unknown point; a station must be listed. A point without
coordinates has blank ones. A datum point is part of the inner constraints, relative to the
coordinates of the file. u_x, u_y, u_z are standard uncertainties of the coordinates: a blank is no prior, zero
holds the coordinate. All ranges are one group, in the order of the file.
"""

import difflib
from collections import Counter
from pathlib import Path

import numpy as np

from catseye.estimation.network.model import NetworkPoints, ObservationNetwork, absent_coordinates
from catseye.estimation.network.names import PointIndex, name_key, spelled
from catseye.estimation.observations.kinds import Distances, ObservationGroup, ObservedCoordinates
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import shown
from catseye.records.network.claim import NO_CLAIM, RangeClaim
from catseye.records.network.folder_air import AIR_COLUMNS, RangesAir, air_of_ranges, read_folder_air
from catseye.records.network.toml_air import NetworkAir

POINT_COLUMNS = ("point", "x", "y", "z")
U_COLUMNS = ("u_x", "u_y", "u_z")
MORE_POINT_COLUMNS = ("role", *U_COLUMNS)
RANGE_COLUMNS = ("from", "to", "distance")
FEWEST = 3  # ranges that determine a point; a target with fewer and a name close to a listed one is a typing error
CLOSE = 0.7  # similarity of two names, 1 for equal
ROLES = ("free", "fixed", "datum")


def read_network_folder(path: Path, claim: RangeClaim = NO_CLAIM, *, planned: bool = False) -> ObservationNetwork:
    """Network of a folder; InputError if invalid.

    path    a folder with points.csv and ranges.csv
    claim   standard uncertainty of a range whose sigma is blank or missing
    planned distances may be blank or missing, for a plan
    """
    folder = Folder(path)
    points = columns_of(folder.text("points.csv"), "points.csv", POINT_COLUMNS, optional=MORE_POINT_COLUMNS)
    required, optional = range_columns(planned)
    ranges = columns_of(folder.text("ranges.csv"), "ranges.csv", required, optional=(*optional, *AIR_COLUMNS))
    air = read_folder_air(folder)
    return network_of_tables(points, ranges, claim, planned=planned, source=path.name, air=air)


def range_columns(planned: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Required and optional columns of ranges.csv; of a plan the distances are optional."""
    return (RANGE_COLUMNS[:2], ("distance", "sigma")) if planned else (RANGE_COLUMNS, ("sigma",))


def network_of_tables(
    points: TextColumns,
    ranges: TextColumns,
    claim: RangeClaim,
    *,
    planned: bool,
    source: str = "",
    air: NetworkAir | None = None,
) -> ObservationNetwork:
    """Network of the two tables.

    points, ranges   columns, as in the files
    claim            standard uncertainty of a range whose sigma is blank or missing
    planned          distances may be blank or missing, for a plan
    source           name of the network
    air              of air.toml: distances are as displayed
    """
    names = names_of(points, "point")
    xyz, fixed, datum, priors = _places(points)
    unlisted = _unlisted(ranges, names)
    if unlisted:
        for name in unlisted:
            names[spelled(name)] = len(names)
        xyz, priors = (np.vstack([rows, np.full((len(unlisted), 3), np.nan)]) for rows in (xyz, priors))
        fixed, datum = (np.vstack([rows, np.zeros((len(unlisted), 3), dtype=bool)]) for rows in (fixed, datum))
    of_ranges = air_of_ranges(ranges, air)
    distances, claims = _distances(ranges, names, claim, planned, of_ranges)
    groups: list[ObservationGroup] = [distances]
    ranged = np.zeros((len(names), 1), dtype=bool)
    ranged[[distances.origin // 3, distances.target // 3]] = True
    absent = absent_coordinates(xyz, fixed | datum, np.broadcast_to(ranged, xyz.shape))
    places = [ranges.where()]
    if np.any(priors > 0.0):
        row, axis = np.nonzero(priors > 0.0)
        observed, variance = xyz[row, axis], priors[row, axis] ** 2
        groups.append(ObservedCoordinates("coordinates", observed, variance, 3 * row, axis))
        places.append(tuple(f"{points.file} {points.place} {points.lines[int(i)]}" for i in row))
    return ObservationNetwork(
        NetworkPoints(tuple(names), xyz, fixed, datum, absent),
        () if of_ranges is None else of_ranges.parameters,
        tuple(groups),
        tuple(places),
        source=source,
        claims=(claims, *(None for _ in groups[1:])),
        notes=names.notes(),
    )


def names_of(table: TextColumns, column: str) -> PointIndex:
    """Row of each name; names are unique."""
    written = table.cells[column]
    cells = list(map(spelled, written))
    names = PointIndex(cells)
    names.aliases |= {raw: name for raw, name in zip(written, cells, strict=True) if raw != name}
    if len(set(map(name_key, cells))) < len(cells) or "" in names:
        cells = list(map(name_key, cells))
        rows: dict[str, int] = {}
        for row, name in enumerate(cells):
            if not name:
                raise table.refuse(row, f"{column} is empty (expected a name)")
            if name in rows:
                first = table.lines[rows[name]]
                raise table.refuse(row, f"{column} {shown(name)} is in line {first} already (expected each name once)")
            rows[name] = row
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
        valid = ~(np.isnan(xyz[:, axis]) & (fixed | datum | ~np.isnan(u))[:, axis])
        points.check(name, valid, "its value: it is fixed, datum or has a prior")
    return xyz, fixed, datum, np.where(fixed, np.nan, u)


def _unlisted(ranges: TextColumns, names: PointIndex) -> list[str]:
    """Targets missing in points.csv, in ranges.csv order: unknown points."""
    written = Counter(ranges.cells["to"])
    first: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for name, count in written.items():
        counts[first.setdefault(name_key(name), name)] += count
    strangers = [name for name in counts if name and name not in names]
    for name in strangers:
        close = difflib.get_close_matches(name, names, n=1, cutoff=CLOSE) if counts[name] < FEWEST else []
        if close:
            row = ranges.cells["to"].index(name)
            expected = f"expected perhaps {shown(close[0])}; an unknown point needs at least {FEWEST} ranges"
            raise ranges.refuse(row, f"to = {shown(name)} is not in points.csv ({expected})")
    return strangers


def _distances(
    ranges: TextColumns, names: PointIndex, claim: RangeClaim, planned: bool, air: RangesAir | None
) -> tuple[Distances, np.ndarray | None]:
    """Ranges, and a, b, c of their claims; nan for distances not yet measured."""
    origin, target = (numbered(ranges, end, names) for end in ("from", "to"))
    ranges.check("to", origin != target, "another point than from")
    distance = np.full(len(ranges), np.nan)
    if "distance" in ranges.cells:
        distance = ranges.numbers("distance", blank=np.nan if planned else None)
        ranges.check("distance", ~(distance <= 0.0), "above 0 m")
    sigma = ranges.numbers("sigma", blank=np.nan) if "sigma" in ranges.cells else np.full(len(distance), np.nan)
    without = np.isnan(sigma)
    if without.any():
        if not claim:
            row = int(np.argmax(without))
            options = "sigma_mm and sigma_ppm (--sigma-mm, --sigma-ppm) for ranges without"
            raise ranges.refuse(row, f"no sigma (expected one, m, or {options})")
        sigma = np.where(without, claim.of(np.where(np.isnan(distance), 1.0, distance)), sigma)  # of a plan: there
    if "sigma" in ranges.cells:
        ranges.check("sigma", sigma > 0.0, "above 0 m: no measurement is exact")
    claims = np.where(without[:, None], claim.terms, (0.0, 0.0, 1.0))
    scaling = None
    if air is not None and air.scaling is not None:
        scaling = np.where(air.scaling >= 0, air.scaling + 3 * len(names), -1)
    lengths = Distances(
        "slope distance",
        distance,
        sigma**2,
        origin=3 * origin,
        target=3 * target,
        scale=1.0 if air is None else air.scale,
        scaling=scaling,
    )
    return lengths, claims if without.any() else None


def numbered(ranges: TextColumns, end: str, names: PointIndex, table: str = "points.csv") -> np.ndarray:
    """Row (m,) of the point at one end of each range; InputError for a name that is none."""
    cells = ranges.cells[end]
    try:
        return np.array(list(map(names.__getitem__, cells)))
    except KeyError:
        row = next(i for i, name in enumerate(cells) if name not in names)
        close = difflib.get_close_matches(cells[row], names, n=1)
        hint = f"perhaps {shown(close[0])}" if close else f"a point of {table}"
        raise ranges.refuse(row, f"{end} = {shown(cells[row])} is not a point (expected {hint})") from None
