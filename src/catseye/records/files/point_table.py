"""Points of any CSV table: names, coordinates and their covariances, units by the columns' endings.

Columns in any order, capitals or not: `x`, `y`, `z` (metres), or `x_m`, `x_mm`, `x_um` and so on; perhaps `point`
(or `name`, `id`); perhaps `u` (of each coordinate) or `u_x`, `u_y`, `u_z`, and `cov_xy`, `cov_xz`, `cov_yz`, with units
of their own (`u_mm`, `cov_xy_mm2`). Other columns are ignored, except where they look like an uncertainty.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.refusal import refusal, shown

AXES = "xyz"
UNITS = {"": 1.0, "_m": 1.0, "_cm": 0.01, "_mm": 1e-3, "_um": 1e-6}
NAMES = ("point", "name", "id")
SPREADS = ("u_x", "u_y", "u_z")
PAIRS = {"cov_xy": (0, 1), "cov_xz": (0, 2), "cov_yz": (1, 2)}
DOUBTFUL = re.compile(r"(u|s|sd|std|sig(ma)?|unc|cov|var|err(or)?)(_?[xyz]{1,2})?(_[a-z0-9]+)?")
LARGEST_U = 0.1  # m
HEADER = "point,x_m,y_m,z_m and u_mm or u_x_mm,u_y_mm,u_z_mm; units _m, _cm, _mm, _um"


@dataclass(frozen=True, eq=False)
class PointTable:
    """Points of a table.

    file         name for messages
    names        n
    x            (n, 3) m
    covariance   (n, 3, 3) m²; None where the table has no uncertainty
    lines        line of each row
    """

    file: str
    names: tuple[str, ...]
    x: np.ndarray
    covariance: np.ndarray | None
    lines: Sequence[int]


def read_point_table(text: str, file: str, *, kind: str | None = None, u: float | None = None) -> PointTable:
    """Points of a CSV text.

    text   with a header
    file   name for messages
    kind   only rows of this kind, where the table has a column `kind`
    u      m, standard uncertainty of each coordinate where the table has none

    Raises InputError with file, line, value and expectation.

    >>> table = read_point_table("name,X_mm,Y_mm,Z_mm,u_um\\nA,1500,0,20,30\\n", "dish.csv")
    >>> table.x.tolist(), [round(float(v), 15) for v in table.covariance[0].diagonal()]
    ([[1.5, 0.0, 0.02]], [9e-10, 9e-10, 9e-10])
    """
    columns = _lower_case(text, file)
    headings = _headings(columns)
    coordinates = np.column_stack([_scaled(columns, *headings[axis]) for axis in AXES])
    covariance = _covariance(columns, headings)
    names = _names(columns)
    rows = np.arange(len(names))
    if kind is not None and "kind" in columns.cells:
        rows = np.array([k for k in rows.tolist() if columns.cells["kind"][k] == kind], dtype=int)
        if not len(rows):
            raise refusal(file, f"has no row of kind {kind!r} (expected prisms of the dish)")
    if covariance is None and u is not None:
        covariance = np.tile(u**2 * np.eye(3), (len(names), 1, 1))
    return PointTable(
        file=file,
        names=tuple(names[k] for k in rows.tolist()),
        x=coordinates[rows],
        covariance=None if covariance is None else covariance[rows],
        lines=[columns.lines[k] for k in rows.tolist()],
    )


def _lower_case(text: str, file: str) -> TextColumns:
    """Columns under their names in lower case."""
    head, line, body = text.removeprefix("\ufeff").replace("\r\n", "\n").partition("\n")
    header = head.lower()
    between = ";" if ";" in header and "," not in header else ","
    titles = [cell.strip().strip('"') for cell in header.split(between)]
    return columns_of(header + line + body, file, (), optional=titles)


def _headings(columns: TextColumns) -> dict[str, tuple[str, float]]:
    """Column and factor to metres of each quantity; a missing axis or two columns of one quantity are refused."""
    headings: dict[str, tuple[str, float]] = {}
    for title in columns.cells:
        for name in (*AXES, "u", *SPREADS, *PAIRS):
            unit = title.removeprefix(name)
            unit = unit.removesuffix("2") if name in PAIRS else unit
            if title.startswith(name) and unit in UNITS:
                if name in headings:
                    raise refusal(
                        columns.file,
                        f"line 1, columns {headings[name][0]!r} and {title!r} are both {name} (expected one)",
                    )
                headings[name] = title, UNITS[unit] ** (2 if name in PAIRS else 1)
                break
        else:
            if DOUBTFUL.fullmatch(title):
                raise refusal(
                    columns.file, f"line 1, column {shown(title)} looks like an uncertainty (expected {HEADER})"
                )
    for axis in AXES:
        if axis not in headings:
            titles = ", ".join(columns.cells)
            raise refusal(columns.file, f"line 1, no column of {axis} among {titles} (expected {HEADER})")
    return headings


def _scaled(columns: TextColumns, title: str, factor: float) -> np.ndarray:
    return columns.numbers(title) * factor


def _names(columns: TextColumns) -> list[str]:
    """Names of the points, unique; P1, P2, ... in a table without."""
    title = next((name for name in NAMES if name in columns.cells), None)
    if title is None:
        return [f"P{k + 1}" for k in range(len(columns))]
    names = columns.cells[title]
    first: dict[str, int] = {}
    for row, name in enumerate(names):
        if not name:
            raise columns.refuse(row, f"{title} is empty (expected a unique name)")
        if name in first:
            raise columns.refuse(
                row, f"{title} = {shown(name)} is also in line {columns.lines[first[name]]} (expected a unique name)"
            )
        first[name] = row
    return names


def _covariance(columns: TextColumns, headings: dict[str, tuple[str, float]]) -> np.ndarray | None:
    """Covariance of each point, (n, 3, 3) m²; None without columns of u."""
    spreads = [name for name in SPREADS if name in headings]
    pairs = [name for name in PAIRS if name in headings]
    if not spreads and "u" not in headings:
        if pairs:
            raise refusal(
                columns.file, f"line 1, {headings[pairs[0]][0]!r} without u_x, u_y and u_z (expected {HEADER})"
            )
        return None
    if spreads and len(spreads) < 3:
        missing = next(name for name in SPREADS if name not in headings)
        raise refusal(columns.file, f"line 1, {headings[spreads[0]][0]!r} without {missing} (expected all three)")
    titles = [headings[name] for name in (spreads or ("u",) * 3)]
    u = np.column_stack([_u(columns, *title) for title in titles])
    covariance = np.asarray(u[:, :, None] * np.eye(3) * u[:, None, :])
    for name in pairs:
        i, j = PAIRS[name]
        covariance[:, i, j] = covariance[:, j, i] = _scaled(columns, *headings[name])
    if pairs:
        smallest = np.linalg.eigvalsh(covariance)[:, 0]
        columns.check(headings[pairs[0]][0], smallest > 0.0, "a covariance smaller than the product of both u")
    return covariance


def _u(columns: TextColumns, title: str, factor: float) -> np.ndarray:
    values = columns.numbers(title)
    in_unit = LARGEST_U / factor
    unit = title.rpartition("_")[2] if factor != 1.0 else "m"
    columns.check(title, (values > 0.0) & (values <= in_unit), f"above 0 to {in_unit:g} {unit}")
    return values * factor


def require_uncertainty(table: PointTable, option: str = "u_mm (--u-mm)") -> np.ndarray:
    """Covariance of a table's points; InputError for a table without."""
    if table.covariance is None:
        raise InputError(
            f"{table.file}: has no uncertainty (expected a column u_mm, or u_x_mm, u_y_mm and u_z_mm, or the argument "
            f"{option})"
        )
    return table.covariance


def refuse_far(table: PointTable, origin: np.ndarray, farthest: float) -> None:
    """Raise InputError for a point farther from an origin (3,) m than any on a telescope."""
    distance = np.linalg.norm(table.x - origin, axis=1)
    if len(distance) and distance.max() > farthest:
        row = int(np.argmax(distance > farthest))
        raise refusal(
            table.file,
            f"line {table.lines[row]}, {table.names[row]} is {distance[row]:g} m away: a coordinate looks like mm "
            f"(expected up to {farthest:g} m; name columns in mm x_mm, y_mm, z_mm)",
        )
