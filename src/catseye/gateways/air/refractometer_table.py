"""Table of a refractometer path: group index by reading."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import PPM
from catseye.gateways.writers.columns import Column, Table

if TYPE_CHECKING:
    from catseye.reduction.air.refractometer_calibration import PathCalibration


def _ppm(name: str, doc: str, value: "Callable[[PathCalibration], np.ndarray]") -> "Column[PathCalibration]":
    """Column in ppm of a refractivity."""
    return Column(f"{name}_ppm", "ppm", doc, lambda c: value(c) / PPM, ".4f")


GROUP_INDEX = Table["PathCalibration"](
    "group_index.csv",
    "refractometer.md",
    (
        Column("mjd_utc", "d", "time, Modified Julian Date", lambda c: np.asarray(c.readings.mjd_utc), ".8f"),
        Column(
            "section", "", "section without a loss of the phase, from 1", lambda c: np.asarray(c.followed.section) + 1
        ),
        Column("phase_rad", "rad", "phase, continuous within its section", lambda c: c.followed.phase, ".6f"),
        _ppm("group_refractivity", "group refractivity by the phase", lambda c: c.refractivity),
        _ppm("u_group_refractivity", "standard uncertainty of the group refractivity", lambda c: c.u_refractivity),
        Column(
            "temperature_c", "deg_C", "mean air temperature of the path by the phase", lambda c: c.temperature_c, ".4f"
        ),
        Column(
            "u_temperature_c", "deg_C", "standard uncertainty of the temperature", lambda c: c.u_temperature_c, ".4f"
        ),
        _ppm(
            "weather_refractivity",
            "group refractivity by the weather, mean of the thermometers",
            lambda c: c.weather.mean,
        ),
        _ppm("residual", "weather less path", lambda c: c.residual),
        Column("standardised", "", "standardised residual of the reading, w", lambda c: c.standardised, ".4f"),
        Column(
            "status",
            "",
            "`good`, `stray`, `left out`, `weather off`, `no weather` or `uncalibrated`",
            lambda c: c.status,
        ),
    ),
)


def series_csv(calibration: "PathCalibration") -> str:
    """Table of readings as CSV; empty cells for missing numbers."""
    return GROUP_INDEX.csv(calibration)
