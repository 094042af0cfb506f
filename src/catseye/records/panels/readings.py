"""Crew's results: READINGS.csv of the tool, SURVEY.csv of the actuators, MAPS/ of the panels."""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import InputError
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.records.panels.instrument import GAUGES, PanelInstrument
from catseye.records.panels.layout import PanelLayout

FLAT = "FLAT"  # name of the flat in the column of corners
REQUIRED = ("corner", "turn", "session", "a_mm", "b_mm", "c_mm", "d_mm")
OPTIONAL = ("member", "lean_x_arcsec", "lean_y_arcsec", "temperature_c", "elevation_deg")
LARGEST_LEAN = 3600.0  # arcsec


@dataclass(frozen=True, eq=False)
class PanelReadings:
    """Placements of the tool, in file order.

    file          file name
    corner        (m,) index of the corner, -1 on the flat
    turn          (m,) quarter turns
    session       (m,) index; sessions are their names
    member        (m,) crew member
    reading       (m, 4) m, nan without a reading
    lean          (m, 2) rad, of the tool's axis from the design normal towards the tool's x and y; nan if not read
    temperature_c (m,); nan if not read
    elevation     (m,) rad, of the telescope
    where         (m,) "line 2"
    digest        SHA-256
    """

    file: str
    corner: np.ndarray
    turn: np.ndarray
    session: np.ndarray
    sessions: tuple[str, ...]
    member: tuple[str, ...]
    reading: np.ndarray
    lean: np.ndarray
    temperature_c: np.ndarray
    elevation: np.ndarray
    where: tuple[str, ...]
    digest: str

    def __len__(self) -> int:
        return len(self.where)


def read_panel_readings(path: Path, layout: PanelLayout, sheet: PanelInstrument) -> PanelReadings:
    """Table of readings; InputError names line, column and value.

    path     READINGS.csv
    layout   panel layout with the allowed corners
    sheet    sheet with the limits of travel and lean
    """
    folder = Folder(path.parent)
    table = columns_of(folder.text(path.name), path.name, REQUIRED, optional=OPTIONAL)
    number = {name: k for k, name in enumerate(layout.corners)} | {FLAT: -1}
    names = table.cells["corner"]
    table.check("corner", np.array([n in number for n in names]), f"a corner of the layout, or {FLAT}")
    turn = table.numbers("turn")
    table.check("turn", np.isin(turn, (0.0, 1.0, 2.0, 3.0)), "0, 1, 2 or 3 quarter turns")
    table.check("session", np.array([bool(s) for s in table.cells["session"]]), "a name")
    m = len(table)
    reading = np.column_stack([table.numbers(f"{g}_mm", np.nan) for g in GAUGES])
    for k, g in enumerate(GAUGES):
        good = ~(np.abs(reading[:, k]) > sheet.travel_mm / 2.0)
        table.check(f"{g}_mm", good, f"within ± {sheet.travel_mm / 2.0:g} mm, half the travel")
    table.check("corner", np.isfinite(reading).any(axis=1), "at least one reading in its row")

    def column(name: str, limit: tuple[float, float], expected: str) -> np.ndarray:
        if name not in table.cells:
            return np.full(m, np.nan)
        values = table.numbers(name, np.nan)
        table.check(name, ~((values < limit[0]) | (values > limit[1])), expected)
        return values

    bounds = (-LARGEST_LEAN, LARGEST_LEAN)
    leans = [column(f"lean_{axis}_arcsec", bounds, "within a degree") for axis in "xy"]
    if np.any(np.isnan(leans[0]) != np.isnan(leans[1])):
        row = int(np.argmax(np.isnan(leans[0]) != np.isnan(leans[1])))
        raise table.refuse(row, "has one lean of two (expected lean_x_arcsec and lean_y_arcsec, or neither)")
    elevation = column("elevation_deg", (-5.0, 95.0), "-5 to 95 degrees")
    sessions = tuple(dict.fromkeys(table.cells["session"]))
    return PanelReadings(
        file=path.name,
        corner=np.array([number[n] for n in names]),
        turn=turn.astype(int),
        session=np.array([sessions.index(s) for s in table.cells["session"]]),
        sessions=sessions,
        member=tuple(name or "unknown" for name in table.cells.get("member", [""] * m)),
        reading=reading * MILLIMETRE,
        lean=np.column_stack(leans) * ARCSECOND,
        temperature_c=column("temperature_c", (-60.0, 60.0), "-60 to 60 °C"),
        elevation=np.radians(elevation),
        where=table.where(),
        digest=folder.hashes[path.name],
    )


@dataclass(frozen=True, eq=False)
class PanelSurvey:
    """Actuator heights over the design from laser ranging: corner indices (k,), height and u, m."""

    corner: np.ndarray
    height: np.ndarray
    u: np.ndarray
    digest: str


def read_survey(path: Path, layout: PanelLayout) -> PanelSurvey:
    """SURVEY.csv: corner, height_um, u_um; InputError for repeated corners."""
    folder = Folder(path.parent)
    table = columns_of(folder.text(path.name), path.name, ("corner", "height_um", "u_um"))
    number = {name: k for k, name in enumerate(layout.corners)}
    names = table.cells["corner"]
    table.check("corner", np.array([n in number for n in names]), "a corner of the layout")
    first = {name: row for row, name in reversed(list(enumerate(names)))}
    table.check("corner", np.array([first[n] == row for row, n in enumerate(names)]), "each corner once")
    height, u = table.numbers("height_um"), table.numbers("u_um")
    table.check("height_um", np.abs(height) <= 1e5, "within ± 100000 µm")
    table.check("u_um", (u > 0.0) & (u <= 1e5), "above 0, at most 100000 µm")
    corner = np.array([number[n] for n in names])
    return PanelSurvey(corner, height * 1e-6, u * 1e-6, folder.hashes[path.name])


@dataclass(frozen=True, eq=False)
class PanelMap:
    """Map of one panel by a coordinate measuring machine: (k, 2) m in panel axes, (k,) m off its design."""

    panel: str
    xy: np.ndarray
    deviation: np.ndarray
    digest: str


def read_maps(directory: Path, layout: PanelLayout) -> dict[str, PanelMap]:
    """Maps PANEL.csv of a directory by panel, or InputError; panels may lack one.

    directory   other files in it are refused, so that no map is lost by a wrong name
    """
    if not directory.is_dir():
        raise InputError(f"{directory}: is not a directory (expected one with maps PANEL.csv)")
    maps, names = {}, set(layout.panels)
    for path in sorted(directory.iterdir()):
        if path.name.startswith(".") or path.suffix in (".md", ".txt"):
            continue
        if path.suffix != ".csv" or path.stem not in names:
            raise refusal(path.name, f"is not a map of a panel (expected a name such as {layout.panels[0]}.csv)")
        maps[path.stem] = _map(path)
    if not maps:
        raise InputError(f"{directory}: has no map (expected files such as {layout.panels[0]}.csv)")
    return maps


def _map(path: Path) -> PanelMap:
    folder = Folder(path.parent)
    table = columns_of(folder.text(path.name), path.name, ("x_mm", "y_mm", "deviation_um"))
    xy = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    deviation = table.numbers("deviation_um")
    table.check("deviation_um", np.abs(deviation) <= 1e4, "within ± 10000 µm")
    if len(table) < 6:
        raise refusal(path.name, f"holds {len(table)} points (expected 6 or more)")
    if np.linalg.matrix_rank(xy - xy.mean(axis=0), tol=1.0) < 2:
        raise refusal(path.name, f"{shown(len(table))} points lie on one line (expected points over the panel)")
    return PanelMap(path.stem, xy * MILLIMETRE, deviation * 1e-6, folder.hashes[path.name])


def digest_of_maps(maps: Sequence[PanelMap]) -> str:
    """SHA-256 of all maps, over their names and hashes."""
    return sha256("".join(f"{m.panel} {m.digest}\n" for m in maps).encode()).hexdigest()
