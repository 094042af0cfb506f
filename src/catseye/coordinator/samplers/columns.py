"""Columns of the samplers: names that end with their unit, and which of them hold text."""

BODY = ("x", "y", "z", "rx", "ry", "rz")  # translation of the pivot, m, and rotation, rad
TRIANGLE = tuple((i, j) for i in range(6) for j in range(i, 6))


def _unit(i: int, j: int) -> str:
    """Unit of a covariance of a body's motion, by rows of `BODY`."""
    return {0: "m2", 1: "m_rad", 2: "rad2"}[(i > 2) + (j > 2)]


COLUMNS = {
    "RANGES": ("number", "ranger", "target", "status", "range_m", "u_range_m", "misfit_m"),
    "EPOCHS": (
        *("epoch", "points", "shots", "rejected", "variance_factor", "degrees_of_freedom", "refractivity_ppm"),
        *("azimuth_rad", "elevation_rad", "verdict"),
    ),
    "POINTS": (
        *("epoch", "point", "x_m", "y_m", "z_m"),
        *("xx_m2", "xy_m2", "xz_m2", "yy_m2", "yz_m2", "zz_m2", "used"),
    ),
    "POSE": (
        *("epoch", "reference", "body", "pivot_x_m", "pivot_y_m", "pivot_z_m"),
        *("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"),
        *(f"{BODY[i]}_{BODY[j]}_{_unit(i, j)}" for i, j in TRIANGLE),
    ),
    "BEAM": (
        *("epoch", "reference", "azimuth_cos_e_rad", "elevation_rad"),
        *("azimuth_azimuth_rad2", "azimuth_elevation_rad2", "elevation_elevation_rad2", "verdict"),
    ),
    "FOCUS": ("epoch", "reference", "along_axis_m", "u_along_axis_m", "verdict"),
    "SURFACE": (
        *("epoch", "prisms", "rms_m", "u_deviation_m", "focal_length_m", "u_focal_length_m", "verdict", "text"),
    ),
    "CORRECTIONS": (
        *("epoch", "state", "azimuth_cos_e_rad", "elevation_rad", "focus_m"),
        *("u_azimuth_cos_e_rad", "u_elevation_rad", "u_focus_m"),
        *("reference", "reference_mjd_d", "reference_azimuth_rad", "reference_elevation_rad", "moves"),
    ),
    "MOVES": ("actuator", "value", "unit", "by", "reference"),
    "HEALTH": (
        *("ranger", "state", "laser", "supplies", "temperature_c", "azimuth_error_counts", "elevation_error_counts"),
        *("azimuth_motor", "elevation_motor", "clock", "clock_offset_s", "round_trip_s", "status"),
    ),
    "POSTURE": ("azimuth_rad", "elevation_rad", "azimuth_rate_rad_s", "elevation_rate_rad_s"),
    "WEATHER": ("station", "temperature_c", "pressure_hpa", "humidity_percent"),
    "EVENTS": ("severity", "who", "kind", "text"),
}
TEXTS = frozenset(
    [
        *("ranger", "target", "status", "verdict", "point", "body", "state", "actuator", "unit", "by", "laser"),
        *("supplies", "azimuth_motor", "elevation_motor", "clock", "station", "severity", "who", "kind", "text"),
    ]
)
UNITS = {  # by the end of a column's name, the longest first; FITS units
    "_m_rad": "m rad",
    "_rad_s": "rad / s",
    "_counts": "",
    "_percent": "",
    "_rad2": "rad2",
    "_ppm": "",
    "_rad": "rad",
    "_hpa": "hPa",
    "_m2": "m2",
    "_m": "m",
    "_c": "",
    "_s": "s",
    "_d": "d",
}


def unit_of(column: str) -> str:
    """Unit of a column as the FITS standard writes it; "" for none, and for °C, %, ppm and counts, which it lacks.

    >>> unit_of("azimuth_rate_rad_s"), unit_of("xy_m2"), unit_of("x_rx_m_rad"), unit_of("temperature_c")
    ('rad / s', 'm2', 'm rad', '')
    """
    return next((unit for end, unit in UNITS.items() if column.endswith(end)), "")
