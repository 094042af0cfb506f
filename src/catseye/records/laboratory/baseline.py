"""EDM baselines: observations, heights, and the record BASELINE.toml."""

import re
from datetime import date
from decimal import Decimal
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import DEGREE
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder, read_record
from catseye.records.files.record import Certificate, Version, Within, broken_rule
from catseye.records.files.refusal import refusal, shown

FORMAT = "catseye-baseline-1"
NUMBERS = ("height_of_instrument", "height_of_target", "slope_distance", "temperature", "pressure", "humidity")
REQUIRED = ("from_pillar", "to_pillar", *NUMBERS)
DIRECTION = "horizontal_direction(dd)"
HEIGHTS = ("pillar_name", "pillar_rl", "rl_standard_deviation")
ROUNDED = re.compile(r"[+-]?[0-9.]+[eE][+-]?[0-9]+")
SPANS = {
    "height_of_instrument": (-5.0, 5.0, "m"),
    "height_of_target": (-5.0, 5.0, "m"),
    "slope_distance": (0.1, 1e5, "m"),
    "temperature": (-40.0, 60.0, "°C"),
    "pressure": (500.0, 1100.0, "hPa"),
    "humidity": (0.0, 100.0, "%"),
}


class BaselineShots:
    """Shots of one instrument on a baseline, each column (m,).

    names              names of the pillars, in order of first appearance
    start, end         indices in `names`
    instrument, target heights above the pillar, m
    slope              slope distance as displayed, m
    temperature_c, pressure_hpa, humidity_percent
    direction, u_rounding   clockwise circle reading and u of its printed rounding, rad; nan if missing
    set, setup         shots in a row on one target; shots in a row from one pillar
    where              place in the file
    """

    def __init__(self, table: TextColumns, digest: str) -> None:
        self.file, self.digest = table.file, digest
        ends = table.cells["from_pillar"], table.cells["to_pillar"]
        for name, cells in zip(("from_pillar", "to_pillar"), ends, strict=True):
            table.check(name, np.array([c != "" for c in cells]), "the name of a pillar")
        apart = np.array([a != b for a, b in zip(*ends, strict=True)])
        table.check("to_pillar", apart, "another pillar than from_pillar")
        values = {name: table.numbers(name) for name in NUMBERS}
        for name, (low, high, unit) in SPANS.items():
            table.check(name, (values[name] >= low) & (values[name] <= high), f"{low:g} to {high:g} {unit}")
        self.names = tuple(dict.fromkeys(name for pair in zip(*ends, strict=True) for name in pair))
        number = {name: i for i, name in enumerate(self.names)}
        self.start, self.end = (np.array([number[n] for n in cells]) for cells in ends)
        self.instrument, self.target = values["height_of_instrument"], values["height_of_target"]
        self.slope = values["slope_distance"]
        self.temperature_c, self.pressure_hpa = values["temperature"], values["pressure"]
        self.humidity_percent = values["humidity"]
        self.direction, self.u_rounding = _directions(table)
        moved = np.diff(self.start, prepend=-1) != 0
        aimed = moved | (np.diff(self.end, prepend=-1) != 0)
        self.setup, self.set = np.cumsum(moved) - 1, np.cumsum(aimed) - 1
        self.where = table.where()

    def __len__(self) -> int:
        return len(self.slope)


def _directions(table: TextColumns) -> tuple[np.ndarray, np.ndarray]:
    """Circle readings and rounding; only cells with an exponent count as rounded to the last digit."""
    if DIRECTION not in table.cells:
        return np.full(len(table), np.nan), np.full(len(table), np.nan)
    cells = table.cells[DIRECTION]
    value = table.numbers(DIRECTION, blank=0.0)
    table.check(DIRECTION, (value > -360.0) & (value < 720.0), "degrees, above -360 and below 720")
    last = [float(Decimal(c).as_tuple().exponent) if ROUNDED.fullmatch(c) else -8.0 for c in cells]
    present = np.array([c != "" for c in cells])
    rounding = 10.0 ** np.array(last) / 12.0**0.5
    return np.where(present, value, np.nan) * DEGREE, np.where(present, rounding, np.nan) * DEGREE


def read_observations(path: Path) -> BaselineShots:
    """Shots of a CSV table, columns as in docs/formats/baseline.md.

    path   of the file

    Raises InputError in one line for invalid input.
    """
    folder, file = Folder(path.parent), path.name
    table = columns_of(folder.text(file), str(path), REQUIRED, optional=(DIRECTION,))
    return BaselineShots(table, folder.hashes[file])


class Heights:
    """Heights of pillars.

    height   pillar -> height of its top, m
    u        pillar -> standard uncertainty, m; 0 for the reference pillar
    """

    def __init__(self, table: TextColumns, digest: str) -> None:
        self.file, self.digest = table.file, digest
        names = table.cells["pillar_name"]
        value, u = table.numbers("pillar_rl"), table.numbers("rl_standard_deviation")
        table.check(
            "pillar_name", np.array([n != "" and names.index(n) == i for i, n in enumerate(names)]), "a new name"
        )
        table.check("pillar_rl", np.abs(value) <= 9000.0, "-9000 to 9000 m")
        table.check("rl_standard_deviation", (u >= 0.0) & (u <= 10.0), "0 to 10 m")
        self.height = dict(zip(names, value.tolist(), strict=True))
        self.u = dict(zip(names, u.tolist(), strict=True))


def read_heights(path: Path) -> Heights:
    """Heights of a CSV table, columns as in docs/formats/baseline.md.

    path   of the file

    Raises InputError in one line for invalid input.
    """
    folder, file = Folder(path.parent), path.name
    return Heights(columns_of(folder.text(file), str(path), HEIGHTS), folder.hashes[file])


Text = Annotated[str, Field(min_length=1, max_length=200)]
Metres = Annotated[float, Within(-1e5, 1e5)]


class Baseline(Certificate):
    """Calibrated pillars; `BASELINE.toml`.

    format                "catseye-baseline-1"
    name                  name of the baseline
    reference_height_m    height at which distances are horizontal; absent without heights
    pillars               names, the first with x = y = 0
    x_m, y_m              coordinates of each pillar: along the line from the first to the last, and to its left
    known                 rows and columns of the covariance: "x NAME", "y NAME"
    covariance_mm2        covariance matrix of the coordinates in `known`
    s_mm                  experimental standard deviation of a single distance (full test procedure)
    degrees_of_freedom    degrees of freedom of s_mm
    zero_mm, u_zero_mm    zero of the instrument that measured it: observed minus true
    inputs_sha256         SHA-256 of each input file, by name
    """

    format: Annotated[int | str, Version("baseline")]
    name: Text
    reference_height_m: Annotated[float, Within(-9000, 9000)] | None = None
    pillars: Annotated[tuple[Text, ...], Field(strict=False, min_length=2)]
    x_m: Annotated[tuple[Metres, ...], Field(strict=False)]
    y_m: Annotated[tuple[Metres, ...], Field(strict=False)]
    known: Annotated[tuple[Text, ...], Field(strict=False, min_length=1)]
    covariance_mm2: Annotated[tuple[Annotated[tuple[float, ...], Field(strict=False)], ...], Field(strict=False)]
    s_mm: Annotated[float, Within(0, 1000)] | None = None
    degrees_of_freedom: Annotated[int, Within(0, 1e6)] | None = None
    zero_mm: Annotated[float, Within(-1e5, 1e5)] | None = None
    u_zero_mm: Annotated[float, Within(0, 1000)] | None = None
    inputs_sha256: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _joined(self) -> "Baseline":
        n, r = len(self.pillars), len(self.known)
        if len(set(self.pillars)) != n:
            raise broken_rule("pillars names one twice (expected unique names)")
        for key in ("x_m", "y_m"):
            if len(getattr(self, key)) != n:
                raise broken_rule(f"{key} has {len(getattr(self, key))} values for {n} pillars (expected {n})")
        places = {f"{axis} {pillar}" for axis in "xy" for pillar in self.pillars}
        for entry in self.known:
            if entry not in places:
                raise broken_rule(f"known names {shown(entry)} (expected x or y and the name of a pillar)")
        if len(set(self.known)) != r:
            raise broken_rule("known names one twice (expected unique names)")
        if len(self.covariance_mm2) != r or any(len(row) != r for row in self.covariance_mm2):
            raise broken_rule(f"covariance_mm2 is not {r} x {r} (expected a row and a column for each of known)")
        c = np.array(self.covariance_mm2)
        if not np.allclose(c, c.T, rtol=1e-6, atol=0.0):
            raise broken_rule("covariance_mm2 is not symmetric (expected a covariance)")
        size = np.sqrt(np.maximum(np.diag(c), 0.0))
        if np.any(size == 0.0) or np.linalg.eigvalsh(c / size[:, None] / size)[0] < 1e-12:
            raise broken_rule("covariance_mm2 is not positive definite (expected a covariance)")
        return self

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the pillars' places, (r, r) m²."""
        c = np.array(self.covariance_mm2) * 1e-6
        return 0.5 * (c + c.T)


def read_baseline(path: Path) -> Baseline:
    """Calibrated pillars of BASELINE.toml; or InputError in one line."""
    return read_record(path, Baseline)


def baseline_text(baseline: Baseline) -> str:
    """Record of a baseline as TOML text."""
    lines = ["# Pillars of an EDM baseline, by catseye baseline: observed = (1 + scale) distance + zero"]
    for key, value in baseline.model_dump(exclude_none=True).items():
        if key == "inputs_sha256":
            continue
        if key == "covariance_mm2":
            rows = ",\n".join("  [" + ", ".join(f"{v:.12e}" for v in row) + "]" for row in value)
            lines.append(f"{key} = [\n{rows},\n]")
        else:
            lines.append(f"{key} = {_toml(value)}")
    lines.append("\n[inputs_sha256]")
    lines += [f"{_toml(name)} = {_toml(digest)}" for name, digest in baseline.inputs_sha256.items()]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return repr(value)


def numbers_of(baseline: Baseline, names: tuple[str, ...], file: str) -> dict[str, int]:
    """Index of each pillar of a baseline; InputError for observed pillars that it lacks."""
    number = {name: i for i, name in enumerate(baseline.pillars)}
    for name in names:
        if name not in number:
            raise refusal(file, f"pillar {shown(name)} is unknown (expected one of {', '.join(baseline.pillars)})")
    return number
