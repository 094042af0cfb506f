"""Finite element results by node: displacements of load cases (Nastran punch file, CSV table), places of nodes."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.errors import InputError
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown

UNITS = {"m": 1.0, "mm": 1e-3, "in": 0.0254}  # m
PUNCH = (".pch", ".pun")
WIDTHS = ((0, 10), (18, 36), (36, 54), (54, 72))  # of a card: grid point, then x, y, z
SUBCASE = re.compile(r"\$SUBCASE ID\s*=\s*(\d+)")
LARGEST = 10.0  # m, of a plausible displacement


@dataclass(frozen=True, eq=False)
class NodalResult:
    """Displacements of nodes in load cases, axes of the finite element model.

    file           name, for messages
    cases          names of the load cases, c of them
    elevation_deg  (c,) of each case; NaN where the file does not say it
    nodes          n numbers
    displacement   (c, n, 3) m
    """

    file: str
    cases: tuple[str, ...]
    elevation_deg: np.ndarray
    nodes: tuple[int, ...]
    displacement: np.ndarray


@dataclass(frozen=True, eq=False)
class NodePlaces:
    """Places of nodes at rest, axes of the finite element model.

    file      name, for messages
    nodes     n numbers
    place     (n, 3) m
    targets   name of the target at each node; "" where the table does not say it
    """

    file: str
    nodes: tuple[int, ...]
    place: np.ndarray
    targets: tuple[str, ...]


def read_nodal_result(folder: Folder, file: str, *, unit: str | None = None) -> NodalResult:
    """Displacements of a punch file (.pch) or a table (CSV).

    folder   that holds it, and takes its hash
    file     name
    unit     of a punch file, which does not say it: "m", "mm" or "in"; None for a table, whose columns say it

    Raises InputError with file, line, value and expectation.
    """
    if Path(file).suffix.lower() not in PUNCH:
        if unit is not None:
            raise refusal(file, f"unit {unit!r} is for a punch file (expected none: a table's columns say theirs)")
        return _of_table(folder.text(file), file)
    if unit not in UNITS:
        raise refusal(file, f"unit = {shown(unit)} (expected {', '.join(UNITS)}: a punch file does not say it)")
    return _of_punch(folder.text(file), file, UNITS[unit])


def _of_punch(text: str, file: str, scale: float) -> NodalResult:
    """Displacements of a punch file: cards of 80 columns, a subcase after the other."""
    values: dict[str, dict[int, list[float]]] = {}
    section, case = "", ""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("$"):
            subcase = SUBCASE.match(line)
            if line.startswith("$TITLE"):
                section, case = "", ""
            elif line.startswith(("$DISPLACEMENTS", "$EIGENVECTOR", "$SPCF", "$OLOADS", "$ELEMENT")):
                section = line[1:].split()[0]
            elif section == "DISPLACEMENTS" and ("IMAGINARY" in line or "MAGNITUDE" in line):
                raise refusal(file, f"line {number} is {shown(line.strip())} (expected $REAL OUTPUT)")
            elif subcase:
                case = subcase[1]
        elif section == "DISPLACEMENTS" and line.strip() and not line.startswith("-CONT-"):
            node, place = _card(line, file, number)
            rows = values.setdefault(case or "1", {})
            if node in rows:
                raise refusal(file, f"line {number}, node {node} occurs twice in subcase {case} (expected once)")
            rows[node] = place
    if not values:
        raise refusal(file, "has no $DISPLACEMENTS (expected DISPLACEMENT(PUNCH) = ALL in the case control)")
    return _joined(file, values, {name: float("nan") for name in values}, scale)


def _card(line: str, file: str, number: int) -> tuple[int, list[float]]:
    """Node and displacements of a card."""
    node, *values = (line[low:high].strip() for low, high in WIDTHS)
    try:
        return int(node), [float(value) for value in values]
    except ValueError:
        raise refusal(
            file,
            f"line {number} is {shown(line.rstrip())} (expected a grid point in columns 1-10 and x, y, z in 19-72)",
        ) from None


def _of_table(text: str, file: str) -> NodalResult:
    """Displacements of a table: node, dx, dy, dz with their unit, and case or elevation_deg."""
    names, scale = _columns(text, file, ("dx", "dy", "dz"))
    table = columns_of(text, file, ("node", *names), optional=("case", "elevation_deg"))
    if "case" in table.cells and "elevation_deg" in table.cells:
        raise refusal(file, "has case and elevation_deg (expected one of them)")
    nodes, places = _nodes(table), np.column_stack([table.numbers(name) for name in names])
    elevation = table.numbers("elevation_deg") if "elevation_deg" in table.cells else np.full(len(table), np.nan)
    values: dict[str, dict[int, list[float]]] = {}
    angles: dict[str, float] = {}
    for row, node in enumerate(nodes):
        label = (
            f"{elevation[row]:g}" if np.isfinite(elevation[row]) else table.cells.get("case", ["1"] * len(table))[row]
        )
        rows = values.setdefault(label, {})
        if node in rows:
            raise table.refuse(row, f"node {node} occurs twice in case {label} (expected once)")
        rows[node], angles[label] = places[row].tolist(), float(elevation[row])
    return _joined(file, values, angles, scale)


def read_node_places(folder: Folder, file: str) -> NodePlaces:
    """Places of nodes: CSV of node, x, y, z with their unit (x_m, x_mm, x_in), and perhaps target.

    folder   that holds it, and takes its hash
    file     name

    Raises InputError with file, line, value and expectation.
    """
    text = folder.text(file)
    names, scale = _columns(text, file, ("x", "y", "z"))
    table = columns_of(text, file, ("node", *names), optional=("target",))
    nodes = _nodes(table)
    for row, node in enumerate(nodes):
        if nodes.index(node) != row:
            raise table.refuse(row, f"node {node} occurs twice (expected once)")
    place = scale * np.column_stack([table.numbers(name) for name in names])
    return NodePlaces(file, nodes, place, tuple(table.cells.get("target", [""] * len(table))))


def _columns(text: str, file: str, axes: tuple[str, ...]) -> tuple[tuple[str, ...], float]:
    """Columns of three axes with one unit, and m of it."""
    header = [cell.strip().strip('"') for cell in re.split("[,;]", text.partition("\n")[0])]
    for unit, scale in UNITS.items():
        names = tuple(f"{axis}_{unit}" for axis in axes)
        if set(names) <= set(header):
            return names, scale
    expected = ", ".join(f"{axes[0]}_{unit}" for unit in UNITS)
    raise refusal(file, f"has no {', '.join(axes)} with one unit (expected columns such as {expected})")


def _nodes(table: TextColumns) -> tuple[int, ...]:
    """Whole numbers of the nodes."""
    numbers = table.numbers("node")
    table.check("node", (numbers == np.round(numbers)) & (numbers > 0), "a whole number above 0")
    return tuple(int(value) for value in numbers)


def _joined(
    file: str, values: dict[str, dict[int, list[float]]], angles: dict[str, float], scale: float
) -> NodalResult:
    """Result whose cases have the same nodes; InputError otherwise."""
    first, *remaining = values
    nodes = tuple(sorted(values[first]))
    for case in remaining:
        different = set(nodes) ^ set(values[case])
        if different:
            raise refusal(file, f"node {min(different)} is not in every case (expected the same nodes in all)")
    displacement = scale * np.array([[values[case][node] for node in nodes] for case in values])
    if not np.all(np.isfinite(displacement)):
        raise refusal(file, "holds a displacement that is not a number (expected finite ones)")
    largest = float(np.max(np.abs(displacement)))
    if largest > LARGEST:
        raise InputError(f"{file}: a displacement is {largest:.4g} m (expected at most {LARGEST:g}: another unit?)")
    return NodalResult(file, tuple(values), np.array([angles[case] for case in values]), nodes, displacement)
