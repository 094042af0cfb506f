"""Coordinates of a monument's fixed point, from a survey adjustment.

For the monument's record and report.

The table is `coordinates.csv` of `catseye adjust --out DIR`, as it stands; the sheet says which point is meant, and
whether the survey's coordinates are of the ground frame or of the state plane. Both come out: x, y, z of the ground
frame with full covariance, latitude, longitude, elevation, and easting, northing, elevation of the state plane.
"""

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.frames.local_frame import LocalFrame, elevation_factor, grid
from catseye.records.files.readings import TEXT, SheetLayout, SheetReadings
from catseye.records.files.record import Elevation, Within
from catseye.records.files.refusal import refusal, shown
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.kind import CalibrationKind, Plausibility, provenance, quantities
from catseye.reduction.calibrations.monument.frame_sheet import FrameSheet, frame_of

KIND = "monument-place"
ROUNDING_MM = 2e-5  # of geocentric coordinates and PROJ's inverse
TILT = 10.0 * ARCSECOND  # of derivatives by the deflection, straight to 1e-9 over it
STEP = 0.5  # m, of derivatives of a map that is straight to 1e-10 over it
SYMMETRIC = ("xx", "xy", "xz", "yy", "yz", "zz")
NAMES = ("x", "y", "z")


class PlaceSheet(FrameSheet):
    """Sheet of a monument's place.

    point          name in the table of the Kelvin fixed point
    system         "ground": x, y, z of the ground frame; "state-plane": easting, northing (West Virginia South, NAD83,
                   metres) and elevation (NAVD88)
    origin_elevation_m, geoid_height_m   have no defaults here: all absolute heights hang on them
    """

    point: Annotated[str, Field(min_length=1)]
    system: Literal["ground", "state-plane"]
    origin_elevation_m: Elevation
    geoid_height_m: Annotated[float, Within(-120, 100)]


METRES, COVARIANCE = Within(-1e7, 1e7), Within(-1e8, 1e8)
LAYOUT = SheetLayout(
    KIND,
    PlaceSheet,
    required={
        "point": TEXT,
        **dict.fromkeys(("x_m", "y_m", "z_m"), METRES),
        **{f"cov_{pair}_mm2": COVARIANCE for pair in SYMMETRIC},
    },
    optional={
        **{f"u_{k}_mm": Within(0, 1e4) for k in NAMES},
        **{f"semi_axis_{k}_mm": Within(0, 1e4) for k in (1, 2, 3)},
        "fixed": TEXT,
        "datum": TEXT,
        "observations": Within(0, 1e9),
    },
)
KEYS = (
    *((f"{k}_mm", "mm", f"{k} of the fixed point, ground frame") for k in NAMES),
    ("latitude_deg", "degrees", "latitude, NAD83"),
    ("longitude_deg", "degrees", "longitude, NAD83, east positive"),
    ("elevation_m", "m", "elevation, NAVD88"),
    ("wv_x_m", "m", "easting, state plane West Virginia South, NAD83"),
    ("wv_y_m", "m", "northing"),
)


def measure_place(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Place of a fixed point in every system of the monument's report.

    readings   `coordinates.csv` of an adjustment; sheet PlaceSheet
    reject     has no effect: the adjustment has tested its observations

    Raises InputError where the point is not in the table, is there twice, or its covariance is none.

    Source: [PARKER04] section 2.1 and figure 2.2; [JCGM102] 6.2 (propagation to several quantities).
    """
    sheet = readings.sheet
    rows = [k for k, name in enumerate(readings.words["point"]) if name == sheet.point and readings.active[k]]
    if len(rows) != 1:
        state = f"is there {len(rows)} times" if rows else "is not there"
        raise refusal(readings.file, f"point {shown(sheet.point)} of {readings.sheet_file} {state} (expected once)")
    row = rows[0]
    coordinates = np.array([readings.get(f"{k}_m")[row] for k in NAMES])
    frame = frame_of(sheet)
    try:
        values, covariance = monument_place(frame, coordinates, _covariance(readings, row), system=sheet.system)
        survey = SharedInput(
            "coordinates of the survey adjustment", np.sqrt(np.diag(covariance)), "", np.ones(len(KEYS))
        )
        deflection = _by_deflection(sheet, coordinates)
    except ValueError as problem:
        raise refusal(readings.file, f"{readings.where[row]}, {problem}") from problem
    covariance = covariance + sum(each.covariance for each in deflection)
    return _calibration(readings, row, frame, values, covariance, [survey, *deflection])


def monument_place(
    frame: LocalFrame, coordinates: np.ndarray, covariance: np.ndarray, *, system: str = "ground"
) -> tuple[np.ndarray, np.ndarray]:
    """Values (8,) and covariance (8, 8) in the order and units of KEYS.

    frame         ground frame
    coordinates   (3,), m, in the system
    covariance    (3, 3), m²
    system        "ground" or "state-plane"

    Raises ValidityError for state-plane coordinates outside the zone, InputError for another system.
    """
    if system not in ("ground", "state-plane"):
        raise InputError(f"system {system!r} is unknown (expected 'ground' or 'state-plane')")
    to_ground: Callable[[np.ndarray], np.ndarray] = frame.from_state_plane if system == "state-plane" else np.asarray

    def all_values(at: np.ndarray) -> np.ndarray:
        points = to_ground(at)
        plane = frame.state_plane(points)
        latitude, longitude, _ = frame.geodetic(points)
        return np.concatenate(
            [
                points / MILLIMETRE,
                np.stack([latitude / DEGREE, longitude / DEGREE], axis=-1),
                plane[..., [2, 0, 1]],
            ],
            axis=-1,
        )

    at_point = np.asarray(coordinates, dtype=float)
    slope = (all_values(at_point + STEP * np.eye(3)) - all_values(at_point - STEP * np.eye(3))).T / (2.0 * STEP)
    full = slope @ np.asarray(covariance, dtype=float) @ slope.T
    return all_values(at_point), 0.5 * (full + full.T)


def _covariance(readings: SheetReadings, row: int) -> np.ndarray:
    """Covariance (3, 3), m², of one row; InputError for an invalid one."""
    cells = {pair: float(readings.get(f"cov_{pair}_mm2")[row]) for pair in SYMMETRIC}
    matrix = np.array([[cells["".join(sorted(a + b))] for b in NAMES] for a in NAMES])
    u = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale = np.where(u > 0.0, u, 1.0)  # correlations: a bad small variance hides behind large ones
    if np.diag(matrix).min() < 0.0 or np.linalg.eigvalsh(matrix / np.outer(scale, scale)).min() < -1e-6:
        raise readings.refuse(row, "cov_..._mm2 is not positive: a direction would have u² below 0")
    return matrix * MILLIMETRE**2


def _by_deflection(sheet: PlaceSheet, coordinates: np.ndarray) -> list[SharedInput]:
    """Deflection of the plumb line as inputs.

    Heights above the geoid tilt with it, 1 mm at 2" and 100 m.
    """
    inputs = []
    for name in ("xi", "eta"):
        ends = [
            monument_place(frame_of(sheet, **{name: sign * TILT}), coordinates, np.zeros((3, 3)), system=sheet.system)[
                0
            ]
            for sign in (1.0, -1.0)
        ]
        slope = (ends[0] - ends[1]) / (2.0 * TILT)
        source = f"deflection of the plumb line, {name}"
        inputs.append(SharedInput(source, sheet.u_deflection_arcsec * ARCSECOND, "rad", slope))
    return inputs


def _calibration(
    readings: SheetReadings,
    row: int,
    frame: LocalFrame,
    values: np.ndarray,
    covariance: np.ndarray,
    inputs: list[SharedInput],
) -> Calibration:
    sheet = readings.sheet
    calibrated = quantities(KEYS, values, covariance, inputs=inputs)
    latitude, longitude = values[3] * DEGREE, values[4] * DEGREE
    scale, convergence = grid(latitude, longitude)
    height = frame.geodetic(values[:3] * MILLIMETRE)[2]
    factor = float(elevation_factor(latitude, height))
    fixed = readings.words.get("fixed", ("",) * len(readings))[row]
    value = {q.key: q.value for q in calibrated}
    record: dict[str, RecordValue] = {key: value[key] for key in ("x_mm", "y_mm", "z_mm")}
    record |= {f"u_{q.key}": q.u for q in calibrated[:3]}
    record |= {key: value[key] for key in ("latitude_deg", "longitude_deg", "elevation_m", "wv_x_m", "wv_y_m")}
    record["wv_z_m"] = value["elevation_m"]
    back = frame.from_state_plane(frame.state_plane(values[:3] * MILLIMETRE)) / MILLIMETRE - values[:3]
    closure = float(np.max(np.abs(back)))
    origin = frame.state_plane(np.zeros(3)) if sheet.system == "state-plane" else np.zeros(3)
    plan = np.column_stack([readings.get("x_m"), readings.get("y_m")])
    return Calibration(
        kind=KIND,
        title=f"Place of monument {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("point", "x_m", "y_m", "z_m"),
        rows=tuple(
            (readings.words["point"][k], *(float(readings.get(f"{c}_m")[k]) for c in NAMES)) for k in range(len(plan))
        ),
        decisions=(
            CheckOutcome(
                "to the state plane and back, mm",
                closure,
                ROUNDING_MM,
                closure <= ROUNDING_MM,
                "the largest coordinate of what is left; rounding of coordinates of 6e6 m",
            ),
        ),
        notes=(
            f"grid scale {scale:.9f}, elevation factor {factor:.9f}, combined {scale * factor:.9f}: grid length over "
            "horizontal length here",
            f"convergence {convergence / DEGREE:+.6f} degrees: grid north lies "
            f"{'east' if convergence > 0 else 'west'} of true north; grid azimuth = azimuth - convergence",
            f"z = {value['z_mm'] * MILLIMETRE:.4f} m, elevation {value['elevation_m']:.4f} m: their difference from "
            "that of the origin is curvature, deflection and what the sheet says of the geoid",
            "u is that of the survey's datum; of latitude, longitude and the state plane it does not hold the origin's",
            *((f"{sheet.point} was held fixed in {fixed}: its u is that assumed by the adjustment",) if fixed else ()),
        ),
        curve={
            "readings": (plan[:, 0], plan[:, 1]),
            "fit": (np.array([origin[0], plan[row, 0]]), np.array([origin[1], plan[row, 1]])),
        },
        axes=("x or easting (m)", "y or northing (m); line: from the origin to this monument"),
        method="Coordinates and covariance of the fixed point come from a survey adjustment. They are turned between "
        "the ground frame, NAD83 and the state plane on the ellipsoid GRS 80; the geoid is a plane over the site, "
        "square to the plumb line.",
        record=record,
        equal_axes=True,
    )  # fmt: skip


RECIPE = CalibrationKind(
    "place of a fixed point from a survey adjustment, in all systems of its report",
    LAYOUT,
    measure_place,
    plausible=Plausibility(),
)
