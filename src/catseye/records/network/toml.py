"""Network file of catseye: TOML with `format = "catseye-network-1"`, units in the keys.

    description        free text
    [[point]]          name; xyz_m, or x_m, y_m, z_m or some of them: coordinates measured but not given are computed,
                       others are absent (x and y of a levelled point); fixed and datum = "xyz" or some of it;
                       u_mm, one or three, or covariance_mm2: a prior of xyz, zero holds the coordinate
    [[points]]         many: columns and rows, or file; keys of [[point]], x_m y_m z_m, and role = free, fixed or datum
    [[ranger]]         name of a point; its zero and scale: zero_mm, scale_ppm known, with u_zero_mm, u_scale_ppm priors
                       about them, or zero = "free", scale = "free"
    [[parameter]]      name, value_ppm (or _mm, _arcsec ...): known, with u_ppm a prior, with free = true unknown;
                       observations name it as refractivity, scale, zero, orientation, refraction or level
    [[observation]]    kind, its points, value_m (or _mm, _deg, _gon, _dms ...), u_mm (or _arcsec ...), or for lengths
                       u_mm + u_ppm of the length
    [[observations]]   many: columns and rows, or file; keys beside them apply to all rows
    [[correlated]]     observation = [tables], correlation = matrix of all their values
    [air] [[weather]]  displayed distances with weather, see `toml_air`
    [[body]] [[shape]] [[frame]] [[tilt]] [[plane]] [[line]] [[sphere]]     see `toml_bodies`

Kinds: slope_distance horizontal_distance fixed_distance distance_difference (from, to, from_2, to_2) direction (with
set, "1" by default) angle (at, backsight, foresight) azimuth zenith_angle height_difference inclination level_plane
(point, level, height_m) coordinates (point, xyz_m) vector (xyz_m). instrument_height_m and target_height_m apply to
slope_distance, zenith_angle, height_difference and inclination; index (reading of a metre) and offset_mm to lengths;
refraction_coefficient and curved to zenith_angle. Azimuths run clockwise from y to x, z is up.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.network.names import name_key, spelled
from catseye.records.files.columns import TextColumns, columns_of, pointed
from catseye.records.files.reading import Folder, toml_of
from catseye.records.files.refusal import NUMBER, refusal, shown
from catseye.records.files.toml_fields import ANGLE, DIMENSIONS, LENGTH, RATIO, Fields
from catseye.records.network.draft import NetworkDraft
from catseye.records.network.kinds import ANGLES, ENDS, LENGTHS, Row
from catseye.records.network.toml_air import GIVEN, NetworkAir
from catseye.records.network.toml_bodies import SECTIONS, Bodies

FORMAT = "catseye-network-1"
U_FIXED_DISTANCE = 1e-7  # m, as `FixedDistances`
ROLES = ("orientation", "zero", "scale", "refractivity", "refraction", "level")
ROLE_UNIT = {"orientation": "rad", "zero": "m", "scale": "1", "refractivity": "1", "refraction": "1", "level": "m"}
ALLOWED = {  # roles allowed for a kind
    "slope_distance": ("zero", "scale", "refractivity"),
    "horizontal_distance": ("zero", "scale", "refractivity"),
    "distance_difference": ("zero", "scale", "refractivity"),
    "direction": ("orientation",),
    "zenith_angle": ("refraction",),
    "inclination": ("zero",),
    "level_plane": ("level",),
}
HEIGHTS = ("slope_distance", "zenith_angle", "height_difference", "inclination")
RANGED = ("slope_distance", "horizontal_distance")  # kinds affected by a ranger's zero and scale
TOP = (
    *("format", "description", "point", "points", "ranger", "parameter", "observation", "observations", "correlated"),
    *("air", "weather"),
    *SECTIONS,
)


def read_network_toml(path: Path, *, planned: bool = False) -> ObservationNetwork:
    """Network of a catseye TOML file; InputError, with the table's number, if invalid.

    path      the file; tables that it names are in the same directory
    planned   True if observed values may be missing, for a plan
    """
    folder = Folder(path.parent)
    document = toml_of(folder.text(path.name), path.name)
    return _Reader(path.name, folder, document, planned).network()


class _Reader:
    def __init__(self, file: str, folder: Folder, document: dict[str, Any], planned: bool) -> None:
        if document.get("format") != FORMAT:
            raise refusal(file, f"format = {shown(document.get('format'))} (expected {FORMAT!r})")
        self.document = Fields(file, "top", document)
        self.draft, self.folder = NetworkDraft(file, planned=planned), folder
        self.named: dict[str, int] = {}
        self.rangers: dict[str, dict[str, int]] = {}
        self.sets: dict[tuple[str, str], int] = {}
        self.air: NetworkAir | None = None

    def network(self) -> ObservationNetwork:
        for key in TOP:
            self.document.has(key)
        self.draft.description = self.document.text("description", "")
        self.document.used.update(TOP)
        self.document.refuse_unused()
        for fields in self.sections("point", "points"):
            self.point(fields)
        for fields in self.sections("parameter"):
            self.parameter(fields)
        for fields in self.sections("ranger"):
            self.ranger(fields)
        self._read_air()
        for fields in self.sections("observation", "observations"):
            self.observation(fields)
        for fields in self.sections("correlated"):
            start = len(self.draft.rows)
            for inner in fields.tables("observation"):
                self.observation(inner)
            u = np.array([row.u for row in self.draft.rows[start:]])
            self.draft.correlate(start, fields.array("correlation", (len(u), len(u))) * np.outer(u, u), fields.place)
            fields.refuse_unused()
        bodies = Bodies(self.draft, self.named)
        for section, read in SECTIONS.items():
            for fields in self.sections(section):
                read(bodies, fields)
                fields.refuse_unused()
        return self.draft.network()

    def _read_air(self) -> None:
        weather = self.sections("weather")
        if "air" in self.document.values:
            table = self.document.take("air", dict, "a table")
            self.air = NetworkAir(Fields(self.draft.file, "air", table), weather, self.draft)
        elif weather:
            raise weather[0].refuse("needs [air] (expected it, with wavelength_um and reference_index)")

    def sections(self, single: str, many: str = "") -> list[Fields]:
        """All tables of a section, including compact ones."""
        tables = self.document.tables(single)
        for table in tables:
            table.place = table.place.removeprefix("top, ")
        for compact in self.document.tables(many) if many else []:
            compact.place = compact.place.removeprefix("top, ")
            tables += self._expanded(compact)
        return tables

    def _expanded(self, compact: Fields) -> list[Fields]:
        """Rows of a compact table, each with the common keys."""
        common = {key: value for key, value in compact.values.items() if key not in ("columns", "rows", "file")}
        if "file" in compact.values:
            file = compact.text("file")
            table = columns_of(self.folder.text(file), file, (), optional=_AnyColumn())
            return _rows_of(table, common)
        columns = compact.take("columns", list, "names of columns, or file")
        fields = []
        for i, row in enumerate(compact.take("rows", list, "rows"), start=1):
            place = f"{compact.place} row {i}"
            if not isinstance(row, list) or len(row) != len(columns):
                raise refusal(self.draft.file, f"{place}, {shown(row)} (expected {len(columns)} values)")
            double = [key for key in columns if key in common or columns.count(key) > 1]
            if double:
                raise compact.refuse(f"{shown(double[0])} occurs twice (expected unique keys)")
            fields.append(Fields(self.draft.file, place, {**common, **dict(zip(columns, row, strict=True))}))
        return fields

    def point(self, fields: Fields) -> None:
        name = fields.text("name")
        if fields.has("x_m") or fields.has("y_m") or fields.has("z_m"):
            xyz = np.array([fields.number(f"{axis}_m") if fields.has(f"{axis}_m") else np.nan for axis in "xyz"])
        else:
            xyz = fields.vector("xyz", LENGTH, default=(np.nan,) * 3)
        role = fields.text("role", "free")
        if role not in ("free", "fixed", "datum"):
            raise fields.refuse(f"role = {shown(role)} (expected free, fixed or datum)")
        fixed_axes, in_datum = (self._axes(fields, key) for key in ("fixed", "datum"))
        present = np.isfinite(xyz)
        some = present if present.any() else np.ones(3, dtype=bool)  # a levelled point has only a height
        fixed_axes |= (role == "fixed") & some
        in_datum |= (role == "datum") & some
        covariance = fields.uncertainties(3, or_zero=True)
        if covariance is not None:
            per_axis = fields.has("covariance_mm2") or any(
                isinstance(fields.values.get(f"u_{k}"), list) for k in LENGTH
            )
            if not (present.all() or (present.any() and not per_axis)):
                raise fields.refuse(f"point {shown(name)} has a prior and no xyz (expected both)")
            exact = (np.diag(covariance) == 0.0) & present
            if np.any(covariance[exact]):
                raise fields.refuse("covariance_mm2 has a zero variance with covariances (expected them zero too)")
            fixed_axes |= exact  # a prior without error holds the coordinate
        self.draft.point(name, xyz, fixed=fixed_axes, datum=in_datum, place=fields.place)
        if covariance is not None and not fixed_axes[present].all():
            at = np.flatnonzero(~fixed_axes & present)
            start = len(self.draft.rows)
            for axis in at:
                self.draft.observe(Row("coordinates", (name,), xyz[axis], 1.0, fields.place, component="xyz"[axis]))
            self.draft.correlate(start, covariance[np.ix_(at, at)], fields.place)
        fields.refuse_unused()

    def _axes(self, fields: Fields, key: str) -> np.ndarray:
        text = fields.text(key, "")
        if set(text) - set("xyz"):
            raise fields.refuse(f"{key} = {shown(text)} (expected letters of xyz)")
        return np.array([axis in text for axis in "xyz"])

    def parameter(self, fields: Fields) -> None:
        name = fields.text("name")
        if name in self.named:
            raise fields.refuse(f"parameter {shown(name)} occurs twice (expected unique names)")
        for unit, units in DIMENSIONS.items():
            if fields.keyed("value", units):
                value = fields.quantity("value", units)
                sigma = fields.quantity("u", units, np.nan) if fields.keyed("u", units) else 0.0
                free = fields.take("free", bool, "true or false", False)
                self._refuse_prior(fields, "u", sigma, free=free)
                self.named[name] = self.draft.parameter(name, value, np.inf if free else sigma, unit)
                fields.refuse_unused()
                return
        raise fields.refuse("value is missing (expected value_mm, value_ppm, value_arcsec etc.)")

    def _refuse_prior(self, fields: Fields, key: str, sigma: float, *, free: bool) -> None:
        if sigma < 0.0:
            raise fields.refuse(f"{key} is negative (expected 0 or above)")
        if free and sigma > 0.0:
            raise fields.refuse(f"is free and has {key} (expected one of them)")

    def ranger(self, fields: Fields) -> None:
        name = name_key(fields.text("name"))
        if name in self.rangers:
            raise fields.refuse(f"ranger {shown(name)} occurs twice (expected unique names)")
        if name not in self.draft.names:
            raise fields.refuse(f"ranger {shown(name)} is not a point (expected the name of one)")
        columns = self.rangers[name] = {}
        for role, unit, units in (("zero", "m", LENGTH), ("scale", "1", RATIO)):
            free = fields.text(role, "") == "free"
            if fields.has(role) and not free:
                raise fields.refuse(
                    f"{role} = {shown(fields.values[role])} (expected 'free', or a value with its unit)"
                )
            value = fields.quantity(role, units, 0.0)
            sigma = fields.quantity(f"u_{role}", units, 0.0)
            self._refuse_prior(fields, f"u_{role}", sigma, free=free)
            if free or sigma or value:
                columns[role] = self.draft.parameter(f"{role} {name}", value, np.inf if free else sigma, unit)
        fields.refuse_unused()

    def observation(self, fields: Fields) -> None:
        kind = fields.text("kind")
        if kind not in (*LENGTHS, *ANGLES):
            raise fields.refuse(f"kind = {shown(kind)} (expected {' '.join((*LENGTHS, *ANGLES))})")
        ends = tuple(fields.text(key) for key in ENDS.get(kind, ("from", "to")))
        if kind in ("coordinates", "vector"):
            self._components(fields, kind, ends)
        else:
            self._single(fields, kind, ends)
        fields.refuse_unused()

    def _components(self, fields: Fields, kind: str, ends: tuple[str, ...]) -> None:
        unknown = (np.nan,) * 3 if self.draft.planned else None
        xyz, start = fields.vector("xyz", LENGTH, default=unknown), len(self.draft.rows)
        covariance = fields.uncertainties(3)
        if covariance is None:
            raise fields.refuse("u is missing (expected u_mm, one or three, or covariance_mm2)")
        for axis, value in zip("xyz", xyz, strict=True):
            self.draft.observe(Row(kind, ends, float(value), 1.0, fields.place, component=axis))
        self.draft.correlate(start, covariance, fields.place)

    def _single(self, fields: Fields, kind: str, ends: tuple[str, ...]) -> None:
        units = LENGTH if kind in LENGTHS else ANGLE
        missing = 0.0 if kind == "level_plane" else np.nan if self.draft.planned else None
        value = fields.quantity("value", units, missing)
        claim = (0.0, 0.0, 1.0)
        default = U_FIXED_DISTANCE if kind == "fixed_distance" else None
        if units is LENGTH and fields.has("u_ppm"):
            claim = (fields.quantity("u", units, 0.0), fields.quantity("u", {"ppm": RATIO["ppm"]}), 1.0)
            u = claim[0] + claim[1] * (1.0 if np.isnan(value) else abs(value))  # in a plan computed later
        else:
            u = fields.quantity("u", units, default)
        heights: tuple[float, ...] = ()
        if kind in HEIGHTS:
            heights = tuple(fields.quantity(key, LENGTH, 0.0) for key in ("instrument_height", "target_height"))
        constants: dict[str, float] = {}
        if "scale" in ALLOWED.get(kind, ()):
            constants |= {"index": fields.number("index", 1.0)} if fields.has("index") else {}
            constants |= {"offset": fields.quantity("offset", LENGTH)} if fields.keyed("offset", LENGTH) else {}
        if kind == "zenith_angle":
            constants["refraction"] = fields.number("refraction_coefficient", 0.0)
            constants["curved"] = float(fields.take("curved", bool, "true or false", False))
        if kind == "level_plane":
            constants["height"] = fields.quantity("height", LENGTH, 0.0)
        parameters = self._parameters(fields, kind, ends)
        if kind in RANGED:
            self._weather(fields, ends[0], constants, parameters)
        shifted = heights if any(heights) else ()
        key = fields.keyed("value", units)
        unit = "gon" if key is not None and key[0].endswith("gon") else "deg" if units is ANGLE else ""
        row = Row(
            kind=kind,
            ends=ends,
            value=value,
            u=u,
            place=fields.place,
            heights=shifted,
            parameters=parameters,
            constants=constants,
            claim=claim,
            unit=unit,
        )
        self.draft.observe(row)

    def _weather(self, fields: Fields, station: str, constants: dict[str, float], parameters: dict[str, int]) -> None:
        """Index and air's parameters of a distance with weather."""
        written = [key for key in GIVEN if fields.has(key)]
        if self.air is None:
            if written:
                raise fields.refuse(f"{written[0]} needs [air] (expected it, with wavelength_um and reference_index)")
            return
        if "index" in constants:
            if written:
                raise fields.refuse(f"has index and {written[0]} (expected one of them)")
            return
        constants["index"] = self.air.reading(fields, station)
        parameters |= self.air.parameters(spelled(station))

    def _parameters(self, fields: Fields, kind: str, ends: tuple[str, ...]) -> dict[str, int]:
        """Parameters by role: those of the observation, its ranger, and its set's orientation."""
        parameters = dict(self.rangers.get(name_key(ends[0]), {})) if kind in RANGED else {}
        for role in ALLOWED.get(kind, ()):
            if not fields.has(role):
                continue
            name = fields.text(role)
            if name not in self.named:
                raise fields.refuse(f"{role} = {shown(name)} is not a parameter (expected the name of a [[parameter]])")
            expected_unit, unit = ROLE_UNIT[role], self.draft.parameters[self.named[name]].unit
            if (expected_unit if kind != "inclination" else "rad") != unit:
                raise fields.refuse(f"{role} = {shown(name)} has the unit {unit} (expected one in {expected_unit})")
            if role in parameters:
                raise fields.refuse(f"{role} = {shown(name)}, but ranger {shown(ends[0])} has its own (expected one)")
            parameters[role] = self.named[name]
        if kind == "direction" and "orientation" not in parameters:
            key = (name_key(ends[0]), fields.text("set", "1"))
            if key not in self.sets:
                self.sets[key] = self.draft.parameter(f"orientation {spelled(ends[0])} set {key[1]}", unit="rad")
            parameters["orientation"] = self.sets[key]
        return parameters


class _AnyColumn(tuple[str, ...]):
    """Columns of a table named in a TOML file: its keys are checked row by row."""

    def __contains__(self, name: object) -> bool:
        return name != ""


def _rows_of(table: TextColumns, common: dict[str, Any]) -> list[Fields]:
    """Rows of a CSV as tables: numeric cells become numbers; blank cells are absent."""
    columns: list[list[Any]] = []
    for name, cells in table.cells.items():
        if name in common:
            raise refusal(table.file, f"line 1, column {shown(name)} occurs twice (expected unique keys)")
        is_text: Callable[[str], bool] = TEXT_KEYS.__contains__
        numbers = [pointed(c) for c in cells] if table.comma else cells
        typed = [float(n) if NUMBER.fullmatch(n) else c for n, c in zip(numbers, cells, strict=True)]
        columns.append(cells if is_text(name) else typed)
    rows = []
    for line, row in zip(table.lines, zip(*columns, strict=True), strict=True):
        values = {key: value for key, value in zip(table.cells, row, strict=True) if value != ""}
        rows.append(Fields(table.file, f"{table.file} line {line}", {**common, **values}))
    return rows


TEXT_KEYS = (
    *("name", "kind", "role", "set", "fixed", "datum", *ROLES),
    *("from", "to", "from_2", "to_2", "point", "at", "backsight", "foresight"),
)
