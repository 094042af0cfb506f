"""Rail table: interferometer lengths in air, phases, common effects."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.records.files.readings import TIME, SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.fit import Effect, ObservedScatter
from catseye.reduction.calibrations.ranging.air import (
    WEATHER,
    AirSheet,
    formula_effect,
    group_air,
    half_wavelength,
    phase_air,
    sensor_effects,
)

KIND = "linearity"
LENGTH = Within(-10_000, 10_000)
SCATTER = "scatter of one reading"


class LinearitySheet(AirSheet):
    """Sheet of a comparison with an interferometer.

    d0_mm, pc_mm                      D0 and range constant in the ranges, needed to recover the phase
    interferometer_wavelength_um      vacuum wavelength; needed for the column interferometer_vacuum_m
    dead_path_m                       length between interferometer and target at its zero
    u_interferometer_ppm              of its scale: wavelength, alignment
    u_abbe_mm                         of each position: pitch of the carriage times the offset of the beams
    start_m, u_start_mm               distance from scan point to target where the interferometer reads zero, if known
    u_range_mm                        of one range by itself, if known
    random_walk_mm_per_sqrt_hour      random walk of the ranger's drift; needs the column mjd_utc
    max_order, orders                 highest cyclic order tried; the number of orders, if it is not to be tested
    u_cyclic_mm                       of each cyclic term where the rail is too short to find it
    """

    d0_mm: Annotated[float, Within(0, 1000)]
    pc_mm: Annotated[float, Within(-2000, 0)] = 0.0
    interferometer_wavelength_um: Annotated[float, Within(0.3, 1.7)] | None = None
    dead_path_m: Annotated[float, Within(0, 1000)] = 0.0
    u_interferometer_ppm: Annotated[float, Within(0, 1000)]
    u_abbe_mm: Annotated[float, Within(0, 10)]
    start_m: Annotated[float, Within(0, 10_000)] | None = None
    u_start_mm: Uncertainty | None = None
    u_range_mm: Uncertainty | None = None
    random_walk_mm_per_sqrt_hour: Annotated[float, Within(0, 10)] = 0.0
    max_order: Annotated[int, Within(0, 8)] = 4
    orders: Annotated[int, Within(0, 8)] | None = None
    u_cyclic_mm: Annotated[float, Within(0, 1)] = 0.0


LAYOUT = SheetLayout(
    KIND,
    LinearitySheet,
    required={"range_m": Within(0.05, 10_000)},
    optional={
        "interferometer_m": LENGTH,
        "interferometer_vacuum_m": LENGTH,
        "u_range_mm": Within(0, 100, above=True),
        **WEATHER,
    },
)


@dataclass(frozen=True, eq=False)
class Rail:
    """Rail table in metres and radians.

    length      (m,) interferometer's length from its zero, in air
    observed    (m,) range less length
    phase       (m,) x, phase after the electronics', [0, 2 pi)
    path        (m,) length of the ranger's path beyond its internal cube
    half        m, half the modulation's wavelength in air, mean
    scatter     of the observed
    effects     systematic, on the observed
    """

    length: np.ndarray
    observed: np.ndarray
    phase: np.ndarray
    path: np.ndarray
    half: float
    scatter: ObservedScatter
    effects: list[Effect]


def rail_of(readings: SheetReadings) -> Rail:
    """Rail of a table; InputError for a mismatch of table and sheet."""
    sheet = readings.sheet
    group = group_air(readings)
    range_ = readings.get("range_m")
    path = range_ - (sheet.d0_mm + sheet.pc_mm) * MILLIMETRE
    half = half_wavelength(readings, group)
    effects = [formula_effect(group, path)]  # the sensors follow
    stretch = group.slopes * path / group.index  # per sensor: ranger reads long by it
    if ("interferometer_m" in readings.numbers) == ("interferometer_vacuum_m" in readings.numbers):
        raise refusal(readings.file, "line 1, expected one of the columns interferometer_m and interferometer_vacuum_m")
    if "interferometer_m" in readings.numbers:
        length = readings.get("interferometer_m")
    else:
        length, sensed, formula = _in_air(readings)
        stretch = stretch - sensed  # one thermometer serves both: most of its offset cancels
        effects.append(formula)
    effects += sensor_effects(readings, stretch)
    effects.append(Effect("interferometer: scale", length * PPM, sheet.u_interferometer_ppm, "ppm"))
    if sheet.start_m is not None:
        if sheet.u_start_mm is None:
            raise refusal(readings.sheet_file, "u_start_mm is missing (expected a value beside start_m)")
        effects.append(Effect("start of the interferometer", np.full(len(range_), MILLIMETRE), sheet.u_start_mm, "mm"))
        length = length + sheet.start_m
    return Rail(
        length=length,
        observed=range_ - length,
        phase=np.mod(-TWO_PI * path / half, TWO_PI),
        path=path,
        half=float(np.mean(half)),
        scatter=_scatter(readings),
        effects=effects,
    )


def _in_air(readings: SheetReadings) -> tuple[np.ndarray, np.ndarray, Effect]:
    """Length in air of a vacuum length V, with effects.

    The sensors' effect on it, (3, m) m; and the formula's own effect.

    V = n (L + d) - n_0 d with the dead path d and the index n_0 at the first reading: L = V/n + d (n_0/n - 1).
    Range less length moves against the length: a length too short, as by an index too high, is an observed too long.
    """
    sheet = readings.sheet
    wavelength = sheet.interferometer_wavelength_um
    if wavelength is None:
        raise refusal(
            readings.sheet_file,
            f"interferometer_wavelength_um is missing (needed for the column interferometer_vacuum_m of "
            f"{readings.file})",
        )
    air = phase_air(readings, wavelength)
    first = int(np.argmin(readings.get(TIME))) if TIME in readings.numbers else 0
    vacuum, dead = readings.get("interferometer_vacuum_m"), sheet.dead_path_m
    length = vacuum / air.index + dead * (air.index[first] / air.index - 1.0)
    by_index = vacuum / air.index**2 + dead * (air.index[first] / air.index**2)
    by_start = dead / air.index
    sensed = air.slopes * by_index - air.slopes[:, [first]] * by_start
    return length, sensed, Effect("formula for the phase index", -(by_index - by_start), air.u_model, "1")


def _scatter(readings: SheetReadings) -> ObservedScatter:
    """Scatter by range, position and the ranger's drift in time."""
    sheet, m = readings.sheet, len(readings)
    claimed = np.zeros((m, m))
    if sheet.random_walk_mm_per_sqrt_hour > 0.0:
        hours = readings.hours()
        claimed += (sheet.random_walk_mm_per_sqrt_hour * MILLIMETRE) ** 2 * np.minimum(hours[:, None], hours)
    if readings.has("u_range_mm"):
        variance = (np.hypot(readings.get("u_range_mm"), sheet.u_abbe_mm) * MILLIMETRE) ** 2
        return ObservedScatter(claimed + np.diag(variance))
    return ObservedScatter(claimed, {SCATTER: np.eye(m)}, size=float(np.max(readings.get("range_m"))))
