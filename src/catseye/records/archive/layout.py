"""Layout of an archive: its folders, and the columns of its tables.

Format: docs/formats/archive.md. Lengths are metres and angles radians unless a name says otherwise.
"""

from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Literal

from catseye.errors import InputError

FORMAT = "catseye-archive-1"
HEAD = "archive.toml"  # identifies the directory
INDEX = "index"  # a file a night, written last; a file a joined year
SAMPLES, INPUTS, PROVENANCE = "samples", "inputs", "provenance"
LOCK = "archive.lock"  # held while a night is written
YEAR_PREFIX = "year="
JOINED = "joined"  # first part of the name of a table's file of many nights

FieldKind = Literal["text", "float", "integer"]


@dataclass(frozen=True)
class Field:
    """Column of a table.

    name   with its unit where that is not SI
    kind   text: never null, "" for none; float: null is NaN; integer: never null
    unit   for astropy; "" for none
    doc    for the page
    """

    name: str
    kind: FieldKind
    unit: str
    doc: str


@dataclass(frozen=True)
class TableLayout:
    """Table of an archive: rows sorted by its first column and `mjd`."""

    name: str
    fields: tuple[Field, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(field.name for field in self.fields)

    def field(self, name: str) -> Field:
        """Field of that name; InputError if unknown."""
        for field in self.fields:
            if field.name == name:
                return field
        raise InputError(f"table {self.name}: column {name!r} is unknown (expected one of {', '.join(self.names)})")


def _floats(unit: str, doc: str, *names: str) -> tuple[Field, ...]:
    return tuple(Field(name, "float", unit, doc) for name in names)


NIGHT = Field("night", "text", "", "identifier: name and the first 8 digits of the SHA-256 of the inputs")
MJD = Field("mjd", "float", "d", "middle of the shots, Modified Julian Date, UTC")
POSTURE = (
    Field("azimuth", "float", "rad", "azimuth of the telescope, mean of the night"),
    Field("elevation", "float", "rad", "elevation of the telescope, mean of the night"),
)
TEMPERATURE = Field("temperature_c", "float", "deg_C", "air temperature, mean of stations and readings")
AXES = ("x", "y", "z")
PRODUCTS = ("xx", "xy", "xz", "yy", "yz", "zz")  # upper triangle of a 3 x 3 matrix, by rows
POSE_PRODUCTS = tuple(f"c{i}{j}" for i in range(1, 7) for j in range(i, 7))  # of a 6 x 6 matrix

NIGHTS = TableLayout(
    "nights",
    (
        NIGHT,
        MJD,
        Field("name", "text", "", "name of the campaign, or of the journal's site and run"),
        Field("source", "text", "", "`campaign` or `journal`"),
        Field("inputs_sha256", "text", "", "SHA-256 over names and SHA-256 of all input files"),
        Field("digest", "text", "", "SHA-256 over names, coordinates and covariances of the result"),
        Field("version", "text", "", "version of catseye that made the result"),
        Field("air_model", "text", "", "formula for the index of air"),
        Field("points", "integer", "", "number of points"),
        Field("shots", "integer", "", "number of shots"),
        Field("rejected", "integer", "", "number of rejected shots"),
        Field("variance_factor", "float", "", "[pvv] over degrees of freedom, expectation 1"),
        Field("degrees_of_freedom", "float", "", "of the adjustment"),
        Field("verdict", "text", "", "`good`, `doubtful` or `failed`"),
        Field("why", "text", "", "reason of the verdict"),
        Field("refractivity_ppm", "float", "", "mean group refractivity over the used paths, ppm"),
        *POSTURE,
        TEMPERATURE,
        Field("pressure_hpa", "float", "hPa", "air pressure, mean of stations and readings"),
        Field("humidity_percent", "float", "%", "relative humidity, mean of stations and readings"),
        Field("raw_bytes", "integer", "", "size of all inputs before compression"),
        Field("archived_mjd", "float", "d", "time of archiving, Modified Julian Date, UTC"),
    ),
)
POINTS = TableLayout(
    "points",
    (
        Field("point", "text", "", "name"),
        NIGHT,
        MJD,
        Field("body", "text", "", "kind of the point: `dish prism`, `structure`, `ground ranger`, ..."),
        *_floats("m", "coordinate in the ground frame", *AXES),
        *_floats("m2", "covariance of two coordinates", *PRODUCTS),
        Field("shots", "integer", "", "used shots to or from it"),
        *POSTURE,
        TEMPERATURE,
    ),
)
POSES = TableLayout(
    "poses",
    (
        Field("body", "text", "", "`dish`, or the body of the live site"),
        NIGHT,
        MJD,
        Field("frame", "text", "", "frame of all vectors"),
        *_floats("m", "point about which the rotation turns", *(f"pivot_{axis}" for axis in AXES)),
        *_floats("m", "translation from the nominal place", *(f"translation_{axis}" for axis in AXES)),
        *_floats("rad", "rotation vector from the nominal attitude", *(f"rotation_{axis}" for axis in AXES)),
        *_floats("", "covariance of translation (1 to 3, m) and rotation (4 to 6, rad)", *POSE_PRODUCTS),
        *POSTURE,
        TEMPERATURE,
        Field("unobserved", "text", "", "directions that were not observed, joined by `; `"),
    ),
)
ZEROS = TableLayout(
    "zeros",
    (
        Field("ranger", "text", "", "name"),
        NIGHT,
        MJD,
        Field("parameter", "text", "", "`zero`, or another estimated parameter of a ranger"),
        Field("value", "float", "", "estimate: m for `zero`, else the parameter's own unit"),
        Field("u", "float", "", "standard uncertainty of the estimate"),
        Field("prior", "float", "", "value of the calibration"),
        Field("u_prior", "float", "", "standard uncertainty of the calibration"),
        TEMPERATURE,
    ),
)
WEATHER = TableLayout(
    "weather",
    (
        Field("station", "text", "", "name"),
        NIGHT,
        Field("mjd", "float", "d", "time of the reading, Modified Julian Date, UTC"),
        Field("temperature_c", "float", "deg_C", "air temperature as read"),
        Field("pressure_hpa", "float", "hPa", "air pressure as read"),
        Field("humidity_percent", "float", "%", "relative humidity as read"),
        Field("t_error_c", "float", "deg_C", "error of the thermometer as the ranges show it; NaN where not estimated"),
        Field("u_t_error_c", "float", "deg_C", "its standard uncertainty"),
    ),
)
RESIDUALS = TableLayout(
    "residuals",
    (
        Field("shot", "integer", "", "number of the shot"),
        NIGHT,
        Field("mjd", "float", "d", "time of the shot, Modified Julian Date, UTC"),
        Field("ranger", "text", "", "name"),
        Field("target", "text", "", "retroreflector"),
        Field("elevation", "float", "rad", "elevation of the telescope"),
        Field("range", "float", "m", "range from scan point to retroreflector; NaN where there is none"),
        Field("u", "float", "m", "standard uncertainty of the range"),
        Field("residual", "float", "m", "observed less adjusted"),
        Field("w", "float", "", "standardised residual"),
        Field("status", "text", "", "`used`, `reference`, or why it is not used"),
    ),
)
CERTIFICATES = TableLayout(
    "certificates",
    (
        Field("instrument", "text", "", "name of the record: mirror, monument, triplet, site"),
        NIGHT,
        MJD,
        Field("kind", "text", "", "`mirror`, `monument`, `triplet` or `site`"),
        Field("file", "text", "", "file of the record in the campaign"),
        Field("sha256", "text", "", "SHA-256 of that file"),
        Field("valid_from", "float", "d", "date of measurement, Modified Julian Date; NaN where not stated"),
        Field("valid_until", "float", "d", "end of validity, Modified Julian Date; NaN where not stated"),
        Field("value", "float", "", "distance of a mirror's reference cube, height of a triplet's ball; NaN: none"),
        Field("u", "float", "", "its standard uncertainty"),
        Field("unit", "text", "", "unit of both"),
        Field("ranger", "text", "", "ranger that carries the mirror, or stands on the monument"),
    ),
)
TABLES = {table.name: table for table in (NIGHTS, POINTS, POSES, ZEROS, WEATHER, RESIDUALS, CERTIFICATES)}


def table_layout(kind: str) -> TableLayout:
    """Layout of a table by its name; InputError if unknown."""
    if kind not in TABLES:
        raise InputError(f"table {kind!r} is unknown (expected one of {', '.join(TABLES)})")
    return TABLES[kind]


def year_folder(kind: str, year: int) -> PurePosixPath:
    """Folder of a kind and year, relative to the archive.

    >>> str(year_folder("points", 2026))
    'points/year=2026'
    """
    return PurePosixPath(kind) / f"{YEAR_PREFIX}{year:04d}"


def year_of(mjd: float) -> int:
    """Calendar year of a Modified Julian Date, UTC.

    >>> year_of(61041.0), year_of(61040.99)
    (2026, 2025)
    """
    from datetime import UTC, datetime, timedelta

    return (datetime(1858, 11, 17, tzinfo=UTC) + timedelta(days=mjd)).year
