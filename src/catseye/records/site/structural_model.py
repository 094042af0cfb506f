"""structural-model.toml: motion of frames and groups of points with gravity, temperature and track.

    StructuralModel (a certificate: author, date, source)
    ├── frame[]      name, parent, nominal place, motion
    ├── group[]      points of a frame: with their own motion, or a table each
    └── vibration[]  motion of a frame by one mode per metre on the quadrant detector

A motion is given by terms, or by a table over elevation and temperature; see docs/formats/structural-model.md.
"""

from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import DEGREE
from catseye.errors import ValidityError
from catseye.geometry.antenna.deformation import factors
from catseye.records.files.reading import read_record
from catseye.records.files.record import Certificate, Length, Name, Record, Vector, Version, Within, broken_rule
from catseye.records.files.toml_text import toml_value

FORMAT = "catseye-structural-model-1"
MARK = f'format = "{FORMAT}"'  # identifies a file of catseye
ROOT = "ground"
REQUIRED = ("alidade", "elevation", "reflector")  # each is the parent of the next
PARENTS = {"alidade": ROOT, "elevation": "alidade", "reflector": "elevation", "subreflector": "prime_focus"}
KEYS = ("shift_x_mm", "shift_y_mm", "shift_z_mm", "turn_x_arcsec", "turn_y_arcsec", "turn_z_arcsec")
NARROW_DEG = 5.0  # a narrower range of elevations indicates radians
LEAST_AXIS_MM = 500.0  # of the elevation axis above the ground; a smaller value indicates metres
SYMMETRY = 1e-9  # of the largest product of two standard uncertainties

MOST_SHIFT_MM, MOST_TURN_ARCSEC = 3000.0, 20_000.0  # largest plausible coefficients
Place = Annotated[Vector, Length(0, 1e6)]  # mm
Row = Annotated[tuple[float, ...], Field(strict=False)]
Values = Row | Annotated[tuple[Row, ...], Field(strict=False)]
Degrees = Annotated[float, Within(-10, 100)]
Celsius = Annotated[float, Within(-60, 70)]
Positive = Annotated[float, Within(0, 1000, above=True)]
RangeDeg = Annotated[tuple[Degrees, Degrees], Field(strict=False)]
RangeC = Annotated[tuple[Celsius, Celsius], Field(strict=False)]


class Basis(Record):
    """Functions of posture: `terms`, or knots `elevation_deg` and optionally `temperature_c` of a table.

    terms           functions of elevation and temperature, by name; instead of a table
    elevation_deg   knots of a table
    temperature_c   knots of a table, in addition
    """

    terms: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] | None = None
    elevation_deg: Annotated[tuple[Degrees, ...], Field(strict=False, min_length=1)] | None = None
    temperature_c: Annotated[tuple[Celsius, ...], Field(strict=False, min_length=1)] | None = None

    @model_validator(mode="after")
    def _has_terms_or_table(self) -> Self:
        if (self.terms is None) == (self.elevation_deg is None):
            raise broken_rule("expected terms, or a table's elevation_deg, and not both")
        if self.terms is not None and self.temperature_c is not None:
            raise broken_rule("temperature_c belongs to a table (expected the factor t in terms)")
        for term in self.terms or ():
            try:
                factors(term)
            except ValidityError as problem:
                raise broken_rule(str(problem)) from problem
        for key in ("terms", "elevation_deg", "temperature_c"):
            values = getattr(self, key)
            if key == "terms" and values is not None:
                values = tuple("*".join(sorted(term.replace(" ", "").split("*"))) for term in values)
            if values is not None and len(set(values)) != len(values):
                raise broken_rule(f"{key} = {list(values)} has a repeated value")
            if key != "terms" and values is not None and list(values) != sorted(values):
                raise broken_rule(f"{key} = {list(values)} is not increasing")
        if self.elevation_deg is not None and len(self.elevation_deg) > 1:
            refuse_narrow(self.elevation_deg[0], self.elevation_deg[-1])
        return self

    @property
    def size(self) -> int:
        """Number of functions of posture."""
        return len(self.terms or self.elevation_deg or ()) * len(self.temperature_c or (0,))

    def refuse_shape(self, key: str, values: Any, limit: float) -> None:
        """Raise InputError unless values match: one per term, or one row per elevation, by temperature."""
        flat, rows = flattened(values), len(self.terms or self.elevation_deg or ())
        width = len(self.temperature_c) if self.temperature_c is not None else None
        fits = len(values) == rows and all(
            isinstance(v, float | int) if width is None else isinstance(v, tuple) and len(v) == width for v in values
        )
        if not fits:
            expected = f"{rows} values" if width is None else f"{rows} rows of {width} values"
            raise broken_rule(f"{key} does not have the shape of its terms or knots (expected {expected})")
        for value in flat:
            if not -limit <= value <= limit:
                raise broken_rule(f"{key} holds {value:.6g} (expected {-limit:.6g} to {limit:.6g})")


class MotionRecord(Basis):
    """Shift and rotation of a frame or group in its nominal axes; missing components are zero.

    pivot_mm        point about which the frame rotates, in its own axes
    u_shift_mm      standard uncertainty of each shift in any one posture, independent each time: the model's residual
    u_turn_arcsec   of each rotation
    covariance      covariance of all coefficients, mm and arc seconds, component by component as the keys; 6 k rows
    shift_x_mm, shift_y_mm, shift_z_mm  coefficients of the shift along each axis, or its values at the knots
    turn_x_arcsec, turn_y_arcsec, turn_z_arcsec  component of the rotation about each axis, likewise
    """

    pivot_mm: Place
    u_shift_mm: Positive
    u_turn_arcsec: Positive
    shift_x_mm: Values | None = None
    shift_y_mm: Values | None = None
    shift_z_mm: Values | None = None
    turn_x_arcsec: Values | None = None
    turn_y_arcsec: Values | None = None
    turn_z_arcsec: Values | None = None
    covariance: Annotated[tuple[Row, ...], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _fits_its_basis(self) -> Self:
        for key in KEYS:
            values = getattr(self, key)
            if values is not None:
                self.refuse_shape(key, values, MOST_SHIFT_MM if key.startswith("shift") else MOST_TURN_ARCSEC)
        rows = 6 * self.size
        if self.covariance is not None:
            if len(self.covariance) != rows or any(len(row) != rows for row in self.covariance):
                raise broken_rule(f"covariance has {len(self.covariance)} rows (expected {rows} by {rows})")
            _refuse_asymmetry(self.covariance)
        return self


class FrameRecord(Record):
    """Frame with its parent's axes at rest, except alidade and elevation, which azimuth and elevation turn.

    parent      frame that carries it
    origin_mm   origin in the parent's axes
    name        name of the frame
    motion      motion of the frame; at rest without
    """

    name: Name
    parent: Name
    origin_mm: Place
    motion: MotionRecord | None = None


class PointRecord(Record):
    """Point of a group, in the frame of the group; shifts by the group's basis.

    name                                 name of the point
    position_mm                          position in the nominal posture
    u_position_mm                        of each coordinate
    shift_x_mm, shift_y_mm, shift_z_mm   coefficients or values of its own shift
    """

    name: Name
    position_mm: Place
    u_position_mm: Positive
    shift_x_mm: Values | None = None
    shift_y_mm: Values | None = None
    shift_z_mm: Values | None = None


class GroupRecord(Record):
    """Points that move together, or each by its own table.

    frame        frame of their coordinates
    motion       motion of all of them, in addition to the frame's
    shifts       functions of posture with values in each point
    u_shift_mm   residual u of each coordinate in any one posture; with `shifts` only
    name         name of the group
    point        points of the group
    """

    name: Name
    frame: Name
    motion: MotionRecord | None = None
    shifts: Basis | None = None
    u_shift_mm: Positive | None = None
    point: Annotated[tuple[PointRecord, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _has_one_way_to_move(self) -> Self:
        if self.motion is not None and self.shifts is not None:
            raise broken_rule("expected motion or shifts, and not both")
        if (self.shifts is None) != (self.u_shift_mm is None):
            raise broken_rule("u_shift_mm belongs to shifts (expected both or none)")
        for point in self.point:
            for key in KEYS[:3]:
                values = getattr(point, key)
                if values is None:
                    continue
                if self.shifts is None:
                    raise broken_rule(f"point {point.name!r} gives {key} but the group has no shifts")
                self.shifts.refuse_shape(f"point {point.name!r}, {key}", values, MOST_SHIFT_MM)
        return self


class VibrationRecord(Record):
    """Vibration mode of a frame, and its effect on the quadrant detector.

    frame                moved frame; rotations are about the pivot of its motion
    frequency_hz, u_frequency_hz, damping_ratio   frequency and damping ratio of the mode
    shift_per_x, shift_per_y                      m of shift per metre on the detector in x, in y
    turn_arcsec_per_mm_x, turn_arcsec_per_mm_y    rotation likewise
    name                 name of the mode
    """

    name: Name
    frame: Name
    frequency_hz: Annotated[float, Within(0.01, 1000)]
    u_frequency_hz: Annotated[float, Within(0, 100, above=True)]
    damping_ratio: Annotated[float, Within(1e-5, 0.2)]
    shift_per_x: Vector
    shift_per_y: Vector
    turn_arcsec_per_mm_x: Vector
    turn_arcsec_per_mm_y: Vector


class StructuralModel(Certificate):
    """Complete structural model; outside its ranges refused, not extrapolated.

    title                     title of the model
    elevation_deg             least and greatest elevation for which it holds
    temperature_c             least and greatest temperature for which it holds
    reference_temperature_c   temperature at which the thermal terms are zero
    assumed_temperature_c     of the structure, where nothing else gives it; the reference without
    frame                     frames that move
    group                     groups of points
    vibration                 vibration modes
    """

    format: Annotated[int | str, Version("structural-model")] = 1
    title: str = Field(min_length=1)
    elevation_deg: RangeDeg
    temperature_c: RangeC
    reference_temperature_c: Celsius
    assumed_temperature_c: Celsius | None = None
    frame: Annotated[tuple[FrameRecord, ...], Field(strict=False)]
    group: Annotated[tuple[GroupRecord, ...], Field(strict=False)] = ()
    vibration: Annotated[tuple[VibrationRecord, ...], Field(strict=False)] = ()

    @property
    def usual_temperature_c(self) -> float:
        """Temperature of the structure where nothing else gives it."""
        return self.reference_temperature_c if self.assumed_temperature_c is None else self.assumed_temperature_c

    @property
    def moving(self) -> list[FrameRecord | GroupRecord]:
        """Frames and groups, which may have a motion."""
        return [*self.frame, *self.group]

    @model_validator(mode="after")
    def _ranges_rise(self) -> Self:
        refuse_narrow(*self.elevation_deg)
        if not self.temperature_c[0] < self.temperature_c[1]:
            raise broken_rule(f"temperature_c = {list(self.temperature_c)} is not increasing")
        low_c, high_c = self.temperature_c
        if self.assumed_temperature_c is not None and not low_c <= self.assumed_temperature_c <= high_c:
            raise broken_rule(
                f"assumed_temperature_c = {self.assumed_temperature_c:g} is outside temperature_c = {low_c:g} to "
                f"{high_c:g}, where the model holds"
            )
        for owner, basis in _bases(self):
            for key, (low, high) in (("elevation_deg", self.elevation_deg), ("temperature_c", self.temperature_c)):
                knots = getattr(basis, key)
                if knots is None or (key == "temperature_c" and len(knots) == 1):
                    continue
                if knots[0] > low or knots[-1] < high:
                    raise broken_rule(
                        f"{owner}: {key} runs from {knots[0]:g} to {knots[-1]:g} and the model from {low:g} to "
                        f"{high:g} (expected a table that covers the model's range)"
                    )
        return self

    @model_validator(mode="after")
    def _stands_on_the_ground(self) -> Self:
        parents = {frame.name: frame.parent for frame in self.frame}
        _refuse_twice("frame", [frame.name for frame in self.frame])
        for name in REQUIRED:
            if name not in parents:
                raise broken_rule(f"frame {name!r} is missing (expected at least {', '.join(REQUIRED)})")
        below = [np.array(frame.origin_mm) for frame in self.frame if frame.name in ("alidade", "elevation")]
        height = float(np.linalg.norm(np.sum(below, axis=0)))
        if height < LEAST_AXIS_MM:
            raise broken_rule(
                f"frame 'elevation': origin_mm lies {height:g} mm from the ground's, which looks like metres "
                f"(expected at least {LEAST_AXIS_MM:g}, the elevation axis's height in mm)"
            )
        for name, parent in parents.items():
            expected = PARENTS.get(name, parent)
            if parent != expected:
                raise broken_rule(f"frame {name!r}: parent = {parent!r} (expected {expected!r})")
            if name == ROOT or (parent == ROOT and name != "alidade"):
                raise broken_rule(f"frame {name!r} on {parent!r}: only the alidade stands on the ground")
        for start in parents:
            chain, name = [start], start
            while name != ROOT:
                name = parents.get(name, "")
                if name in chain or not name:
                    what = "is circular" if name else f"ends at {chain[-1]!r}, which is not a frame here"
                    raise broken_rule(f"frame {start!r}: its line of parents {what} (expected it to end at 'ground')")
                chain.append(name)
        for kind, entries in (("group", self.group), ("vibration", self.vibration)):
            _refuse_twice(kind, [entry.name for entry in entries])
            for entry in entries:
                if entry.frame not in parents:
                    raise broken_rule(f"{kind} {entry.name!r}: frame = {entry.frame!r} is not a frame of this file")
        _refuse_twice("point", [point.name for group in self.group for point in group.point])
        _refuse_twice("frame or group", [*parents, *(group.name for group in self.group)])
        motions = {frame.name: frame.motion for frame in self.frame}
        for entry in self.vibration:
            if motions[entry.frame] is None:
                raise broken_rule(f"vibration {entry.name!r}: frame {entry.frame!r} has no motion and so no pivot")
        return self


def read_structural_model(path: Path | str) -> StructuralModel:
    """Structural model of a file; InputError with file, key and value if invalid.

    path    TOML file of docs/formats/structural-model.md
    """
    return read_record(path, StructuralModel)


def structural_model_toml(model: StructuralModel) -> str:
    """Structural model as TOML text, exact when read back."""
    values = model.model_dump(exclude_none=True) | {"format": FORMAT}
    head = [_pair(key, value) for key, value in values.items() if key not in ("frame", "group", "vibration", "format")]
    lines = [MARK, *head]
    for frame in values["frame"]:
        lines += ["", "[[frame]]", *_table(frame, "frame.motion")]
    for group in values["group"]:
        points = group.pop("point")
        lines += ["", "[[group]]", *_table(group, "group.motion", "group.shifts")]
        for point in points:
            lines += ["", "[[group.point]]", *_table(point)]
    for vibration in values["vibration"]:
        lines += ["", "[[vibration]]", *_table(vibration)]
    return "\n".join(lines) + "\n"


def _table(values: dict[str, Any], *inner: str) -> list[str]:
    """Lines of a table and its subtables."""
    places = {name.rpartition(".")[2]: name for name in inner}
    lines = [_pair(key, value) for key, value in values.items() if key not in places]
    for key, name in places.items():
        if key in values:
            lines += ["", f"[{name}]", *(_pair(k, v) for k, v in values[key].items())]
    return lines


def _pair(key: str, value: Any) -> str:
    if isinstance(value, tuple) and value and isinstance(value[0], tuple):
        return f"{key} = [\n" + "".join(f"  {toml_value(row)},\n" for row in value) + "]"
    return f"{key} = {toml_value(value)}"


def flattened(values: Any) -> list[float]:
    """Coefficients in the order of the basis: unchanged, or row by row."""
    return [float(v) for row in values for v in (row if isinstance(row, tuple) else (row,))]


def refuse_narrow(low_deg: float, high_deg: float) -> None:
    """Raise InputError unless a range of elevations increases and is in degrees."""
    if not high_deg - low_deg >= NARROW_DEG:
        hint = " looks like radians" if 0.0 < high_deg - low_deg <= 100.0 * DEGREE else " is not increasing"
        raise broken_rule(
            f"elevation_deg = {low_deg:g} to {high_deg:g}{hint} (expected a range of at least {NARROW_DEG:g})"
        )


def _bases(model: StructuralModel) -> list[tuple[str, Basis]]:
    bases: list[tuple[str, Basis]] = []
    for entry in model.moving:
        if entry.motion is not None:
            bases.append((f"motion of {entry.name!r}", entry.motion))
    return bases + [(f"shifts of {g.name!r}", g.shifts) for g in model.group if g.shifts is not None]


def _refuse_twice(kind: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise broken_rule(f"{kind} {name!r} occurs {names.count(name)} times (expected once)")


def _refuse_asymmetry(rows: tuple[tuple[float, ...], ...]) -> None:
    """Raise InputError unless a covariance is symmetric without negative eigenvalues."""
    q = np.array(rows)
    sigma = np.sqrt(np.maximum(np.diag(q), 0.0))
    scaled = q / np.where(sigma > 0.0, sigma, 1.0)[:, None] / np.where(sigma > 0.0, sigma, 1.0)
    if not np.allclose(scaled, scaled.T, rtol=0.0, atol=SYMMETRY):
        raise broken_rule("covariance is not symmetric")
    if np.linalg.eigvalsh(scaled)[0] < -SYMMETRY * len(q):
        raise broken_rule("covariance has a negative eigenvalue (expected variances of 0 or above)")
