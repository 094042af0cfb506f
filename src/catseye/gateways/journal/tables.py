"""Tables of a journal's runs: a row per shot, reading, posture, command, event, solution, and point of a solution."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, ZERO_CELSIUS_K
from catseye.coordinator.journal.entries import Entry, EpochSolution
from catseye.coordinator.journal.reader import Kind
from catseye.gateways.writers.cells import harmless
from catseye.gateways.writers.columns import Column, Table, Values, each
from catseye.ranger.line import stamp_text

PAGE = "journal.md"
NAN = float("nan")


class ExportRow(NamedTuple):
    """Row of a table: time in ticks, and an entry, or the part of it that makes a row."""

    run: int
    seq: int
    ticks: int
    part: Any


@dataclass(frozen=True)
class ExportColumn(Column[Sequence[ExportRow]]):
    """Column with its form in FITS.

    fits        name in FITS
    kind        "f" double, "i" integer, "s" text
    fits_unit   unit in FITS; None for that in CSV
    factor, shift   FITS value = factor * CSV value + shift
    """

    fits: str = ""
    kind: Literal["f", "i", "s"] = "f"
    fits_unit: str | None = None
    factor: float = 1.0
    shift: float = 0.0

    def cells(self, values: Values) -> list[str]:
        """Values as texts; those that a spreadsheet would evaluate get a leading apostrophe."""
        cells = super().cells(values)
        return [harmless(cell) for cell in cells] if self.kind == "s" else cells


def _text(name: str, doc: str, value: Callable[[Any], Any], fits: str = "") -> ExportColumn:
    return ExportColumn(name, "", doc, each(lambda r: value(r.part)), fits=fits or name.upper(), kind="s")


def _count(name: str, doc: str, value: Callable[[Any], Any], fits: str = "") -> ExportColumn:
    return ExportColumn(name, "", doc, each(lambda r: value(r.part)), fits=fits or name.upper(), kind="i")


def _number(
    name: str,
    unit: str,
    doc: str,
    value: Callable[[Any], Any],
    fits: str = "",
    *,
    fits_unit: str | None = None,
    factor: float = 1.0,
    shift: float = 0.0,
) -> ExportColumn:
    return ExportColumn(
        name,
        unit,
        doc,
        each(lambda r: value(r.part)),
        fits=fits or name.upper(),
        fits_unit=fits_unit,
        factor=factor,
        shift=shift,
    )


RUN = (
    ExportColumn("run", "", "number of the run", each(lambda r: r.run), fits="RUN", kind="i"),
    ExportColumn("seq", "", "number of the entry in its run", each(lambda r: r.seq), fits="SEQ", kind="i"),
    ExportColumn(
        "mjd_utc",
        "d",
        "time, Modified Julian Date; FITS has it as a double in DMJD and exactly in TICKS",
        each(lambda r: stamp_text(r.ticks)),
        fits="DMJD",
        kind="s",
    ),
)


@dataclass(frozen=True)
class ExportTable:
    """Quantity: the entries it is made of, its columns, and the parts of one entry that make rows."""

    kind: Kind
    table: Table[Sequence[ExportRow]]
    parts: Callable[[Any], Iterable[Any]] = lambda entry: (entry,)


def _table(name: str, *columns: ExportColumn) -> Table[Sequence[ExportRow]]:
    return Table(f"{name}.csv", PAGE, (*RUN, *columns))


def ticks_of(entry: Entry) -> int:
    """Time of an entry, ticks."""
    return entry.shot.ticks if hasattr(entry, "shot") else entry.ticks


def _answer(key: str) -> Callable[[dict[str, Any]], float]:
    """Function that gives a number of a solution; NaN where it is missing."""

    def number(answer: dict[str, Any]) -> float:
        value = answer.get(key)
        return NAN if value is None else value

    return number


class SolvedPoint(NamedTuple):
    """Point of a solution: place, m; covariance (3, 3), mm², NaN without one."""

    name: str
    x: tuple[float, float, float]
    covariance: np.ndarray


def _points(entry: EpochSolution) -> Iterable[SolvedPoint]:
    names, x = entry.answer.get("names"), entry.answer.get("x")
    if not isinstance(names, list) or not isinstance(x, list) or len(names) != len(x):
        return
    matrix = entry.covariance
    complete = matrix is not None and matrix.shape == (3 * len(names),) * 2
    for row, name in enumerate(names):
        at = slice(3 * row, 3 * row + 3)
        c = matrix[at, at].copy() if complete and matrix is not None else np.full((3, 3), np.nan)
        a, b, h = (NAN if value is None else value for value in x[row])
        yield SolvedPoint(name, (a, b, h), c / MILLIMETRE**2)


def _x(k: int) -> ExportColumn:
    return _number(f"{'xyz'[k]}_m", "m", "place in the ground frame", lambda p: p.x[k], "XYZ"[k])


def _u(k: int) -> ExportColumn:
    doc = f"standard uncertainty of {'xyz'[k]}"
    return _number(f"u_{'xyz'[k]}_mm", "mm", doc, lambda p: float(np.sqrt(p.covariance[k, k])), f"U_{'XYZ'[k]}")


def _cov(i: int, j: int) -> ExportColumn:
    pair = "xyz"[i] + "xyz"[j]
    doc = f"covariance of {pair[0]} and {pair[1]}"
    return _number(f"cov_{pair}_mm2", "mm2", doc, lambda p: float(p.covariance[i, j]), f"COV_{pair.upper()}")


SHOTS = _table(
    "shots",
    _count("number", "number of the shot", lambda e: e.shot.number),
    _text("ranger", "ranger", lambda e: e.shot.ranger),
    _text("target", "target", lambda e: e.shot.target),
    _count("cycles", "cycles of the buffer", lambda e: e.shot.cycles),
    _count("samples_per_cycle", "samples per cycle", lambda e: e.shot.samples_per_cycle, "SAMPLES"),
    ExportColumn("if_hz", "Hz", "intermediate frequency", each(lambda r: r.part.shot.if_hz), fits="IFFREQ", kind="i"),
    _number("amplitude_v", "V", "amplitude, as the ranger detected it", lambda e: e.shot.amplitude, "AMPLITUDE"),
    _number("phase_rad", "rad", "phase, as the ranger detected it", lambda e: e.shot.phase, "PHASE"),
    _text("status", "`used`, or the reason of the rejection", lambda e: e.status),
    _text("text", "the reason in words", lambda e: e.text),
    _number("range_m", "m", "range by this shot alone", lambda e: e.range_, "RANGE"),
    _number("u_range_mm", "mm", "standard uncertainty of the range", lambda e: e.u_range / MILLIMETRE, "U_RANGE"),
    _number("misfit_mm", "mm", "range less prediction", lambda e: e.misfit / MILLIMETRE, "MISFIT"),
)

WEATHER = _table(
    "weather",
    _text("station", "weather station", lambda e: e.station),
    _number(
        "temperature_c",
        "deg_C",
        "air temperature; in FITS kelvin",
        lambda e: e.temperature_c,
        "TEMPERATURE",
        fits_unit="K",
        shift=ZERO_CELSIUS_K,
    ),
    _number("pressure_hpa", "hPa", "pressure", lambda e: e.pressure_hpa, "PRESSURE"),
    _number(
        "humidity_percent",
        "percent",
        "relative humidity; in FITS a fraction",
        lambda e: e.humidity_percent,
        "HUMIDITY",
        fits_unit="",
        factor=0.01,
    ),
)

POSTURES = _table(
    "postures",
    _number("azimuth_deg", "deg", "azimuth of the telescope", lambda e: e.azimuth / DEGREE, "AZIMUTH"),
    _number("elevation_deg", "deg", "elevation of the telescope", lambda e: e.elevation / DEGREE, "ELEVATION"),
    _number("azimuth_rate_deg_s", "deg / s", "rate of the azimuth", lambda e: e.azimuth_rate / DEGREE, "AZRATE"),
    _number("elevation_rate_deg_s", "deg / s", "rate of the elevation", lambda e: e.elevation_rate / DEGREE, "ELRATE"),
)

COMMANDS = _table(
    "commands",
    _text("ranger", "ranger", lambda e: e.ranger),
    _count("tid", "number of the command on its connection", lambda e: e.tid),
    _text("line", "command as sent", lambda e: e.line),
    _text("reply", "reply as received", lambda e: e.reply),
    _text(
        "ok",
        "1 where the ranger did it, 0 where not; empty without a reply",
        lambda e: "" if e.ok is None else str(int(e.ok)),
    ),
)

HAPPENINGS = _table(
    "happenings",
    _text("severity", "severity", lambda e: e.severity),
    _text("who", "ranger or part of the coordinator", lambda e: e.who),
    _text("kind", "kind of event", lambda e: e.kind),
    _text("text", "event in words", lambda e: e.text),
    _text("details", "details, JSON", lambda e: json.dumps(e.details) if e.details else ""),
)

SOLUTIONS = _table(
    "solutions",
    _count("number", "number of the epoch", lambda a: a.get("number") or 0),
    _number("variance_factor", "", "variance factor", _answer("variance_factor"), "VARFACTOR"),
    _number("degrees_of_freedom", "", "degrees of freedom", _answer("degrees_of_freedom"), "FREEDOM"),
    _number(
        "refractivity_ppm",
        "ppm",
        "mean group refractivity; in FITS a fraction",
        _answer("refractivity_ppm"),
        "REFRACTIVITY",
        fits_unit="",
        factor=1e-6,
    ),
    _count("points", "number of points", lambda a: len(a.get("names") or ())),
    _text("pose", "pose of the telescope, JSON", lambda a: "" if a.get("pose") is None else json.dumps(a["pose"])),
)

COORDINATES = _table(
    "coordinates",
    _text("point", "name", lambda p: p.name),
    *(_x(k) for k in range(3)),
    *(_u(k) for k in range(3)),
    *(_cov(i, j) for i, j in ((0, 1), (0, 2), (1, 2))),
)

TABLES: dict[str, ExportTable] = {
    "shots": ExportTable("shots", SHOTS),
    "weather": ExportTable("weather", WEATHER),
    "postures": ExportTable("postures", POSTURES),
    "commands": ExportTable("commands", COMMANDS),
    "happenings": ExportTable("happenings", HAPPENINGS),
    "solutions": ExportTable("solutions", SOLUTIONS, lambda entry: (entry.answer,)),
    "coordinates": ExportTable("solutions", COORDINATES, _points),
}
