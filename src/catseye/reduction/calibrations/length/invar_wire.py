"""Invar wire: distance between two marks, or calibration of the wire.

    distance = chord of the hanging wire (length, temperature, tension, weight, height difference) + scales

A known distance turns the same readings into a calibration of the wire.
"""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.geometry.catenary import expanded, span, unstretched
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.fit import (
    CalibrationFit,
    Effect,
    FitOptions,
    ObservedScatter,
    fit_readings,
)
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    quantities,
    residuals_by_number,
    scatter_notes,
)

KIND = "invar-wire"
TENSION, TEMPERATURE, HEIGHT, SCALE = Within(5, 2000), Within(-40, 60), Within(-20_000, 20_000), Within(-1000, 1000)
STEPS = {  # of the numerical derivatives: sizes over which the chord is straight to 1e-6 of its change
    "certified_mm": 0.1,
    "certified_tension_n": 0.1,
    "tension_n": 0.1,
    "temperature_c": 0.1,
    "height_difference_mm": 0.1,
    "weight_n_per_m": 1e-4,
    "stiffness_n": 1e3,
    "expansion_ppm_per_c": 0.1,
}
SHARED = {  # whose offset all readings share
    "certified_mm": ("certified length of the wire", "mm"),
    "tension_n": ("offset of the tension", "N"),
    "temperature_c": ("offset of the thermometer", "°C"),
    "height_difference_mm": ("offset of the height difference", "mm"),
    "weight_n_per_m": ("weight of the wire", "N/m"),
    "stiffness_n": ("stiffness of the wire", "N"),
    "expansion_ppm_per_c": ("expansion", "ppm/°C"),
    "scale_sum_mm": ("offset of the end scales", "mm"),
}


class WireSheet(Sheet):
    """Sheet of measurements with a wire.

    Every u_ key is of an offset that all readings share.

    certified_mm, u_certified_mm       length between its marks at 20 °C
    certified_tension_n                tension at its calibration
    hanging                            true if it was certified hanging (chord), false if supported
    weight_n_per_m, u_weight_n_per_m   weight per length of the wire
    stiffness_n, u_stiffness_n         modulus of elasticity times area
    expansion_ppm_per_c, u_expansion_ppm_per_c  coefficient of expansion of the wire
    tension_n, u_tension_n             tension in use; a column where it changed
    temperature_c, u_temperature_c     temperature of the wire in use, likewise
    height_difference_mm, u_height_difference_mm  height difference between the ends, likewise
    scale_sum_mm, u_scale_sum_mm       addition of the end scales to the chord; usually a column
    known_distance_mm, u_known_distance_mm  if given, the wire is calibrated instead
    u_reading_mm                       scatter of a reading, if known
    """

    certified_mm: Annotated[float, Within(500, 200_000)]
    u_certified_mm: Annotated[float, Within(0, 100)]
    certified_tension_n: Annotated[float, TENSION]
    hanging: bool
    weight_n_per_m: Annotated[float, Within(0, 10)]
    u_weight_n_per_m: Annotated[float, Within(0, 1)]
    stiffness_n: Annotated[float, Within(1e3, 1e9)]
    u_stiffness_n: Annotated[float, Within(0, 1e8)]
    expansion_ppm_per_c: Annotated[float, Within(-5, 50)]
    u_expansion_ppm_per_c: Annotated[float, Within(0, 50)]
    tension_n: Annotated[float, TENSION] | None = None
    u_tension_n: Annotated[float, Within(0, 100)]
    temperature_c: Annotated[float, TEMPERATURE] | None = None
    u_temperature_c: Annotated[float, Within(0, 20)]
    height_difference_mm: Annotated[float, HEIGHT] | None = None
    u_height_difference_mm: Annotated[float, Within(0, 1000)]
    scale_sum_mm: Annotated[float, SCALE] | None = None
    u_scale_sum_mm: Annotated[float, Within(0, 10)]
    known_distance_mm: Annotated[float, Within(500, 200_000)] | None = None
    u_known_distance_mm: Annotated[float, Within(0, 100)] = 0.0
    u_reading_mm: Uncertainty | None = None


LAYOUT = SheetLayout(
    KIND,
    WireSheet,
    required={},
    optional={
        "tension_n": TENSION,
        "temperature_c": TEMPERATURE,
        "height_difference_mm": HEIGHT,
        "scale_sum_mm": SCALE,
    },
)


def measure_with_wire(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Distance between two marks by a wire, or the wire's length.

    The latter where the sheet has the distance.

    readings   columns tension_n, temperature_c, height_difference_mm, scale_sum_mm where they changed; sheet WireSheet
    reject     leave out what the tests reject

    Raises InputError for a value in neither table nor sheet, ValidityError for a wire that does not reach.

    Source: [IRVINE81] section 1.4; systematic effects by numerical derivatives of it.
    """
    sheet, m = readings.sheet, len(readings)
    values = {name: readings.get(name) for name in (*STEPS, "scale_sum_mm")}
    distance = _distance_mm(values, sheet.hanging)
    effects = [
        Effect(label, _slope(values, name, sheet.hanging), getattr(sheet, f"u_{name}"), unit)
        for name, (label, unit) in SHARED.items()
        if not (name == "certified_mm" and sheet.known_distance_mm is not None)
    ]
    certified = sheet.known_distance_mm
    if certified is None:
        observed, design = distance, np.ones((m, 1))
    else:  # observed = excess of the wire over its certified length, times its slope
        observed, design = certified - distance, _slope(values, "certified_mm", sheet.hanging)[:, None]
        effects = [Effect(e.name, -e.column, e.u, e.unit) for e in effects]
        effects.append(Effect("known distance", np.ones(m), sheet.u_known_distance_mm, "mm"))
    scatter = ObservedScatter(np.zeros((m, m)), {"scatter of one reading": np.eye(m)})
    if sheet.u_reading_mm is not None:
        scatter = ObservedScatter(sheet.u_reading_mm**2 * np.eye(m))
    fit = fit_readings(
        observed,
        design,
        scatter,
        names=["distance" if certified is None else "wire"],
        effects=effects,
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    return _calibration(readings, fit, distance)


def _distance_mm(values: dict[str, np.ndarray], hanging: bool) -> np.ndarray:
    """Straight distance between the marks of every reading, mm."""
    free = np.array(
        [
            unstretched(certified * MILLIMETRE, tension=t, weight_per_metre=w, stiffness=ea, hanging=hanging)
            for certified, t, w, ea in zip(
                *(values[k] for k in ("certified_mm", "certified_tension_n", "weight_n_per_m", "stiffness_n")),
                strict=True,
            )
        ]
    )
    rise = values["height_difference_mm"] * MILLIMETRE
    across = span(
        expanded(free, values["temperature_c"], values["expansion_ppm_per_c"] * PPM),
        tension=values["tension_n"],
        weight_per_metre=values["weight_n_per_m"],
        stiffness=values["stiffness_n"],
        height_difference=rise,
    )
    return np.hypot(across, rise) / MILLIMETRE + values["scale_sum_mm"]


def _slope(values: dict[str, np.ndarray], name: str, hanging: bool) -> np.ndarray:
    """Derivative of the computed distance, mm, by a value."""
    if name == "scale_sum_mm":
        return np.ones(len(values[name]))

    def moved(by: float) -> np.ndarray:
        return _distance_mm({**values, name: values[name] + by}, hanging)

    step = STEPS[name]
    if name == "weight_n_per_m" and np.any(values[name] < step):  # a wire without weight has no lighter one
        return (moved(step) - moved(0.0)) / step
    return (moved(step) - moved(-step)) / (2.0 * step)


def _calibration(readings: SheetReadings, fit: CalibrationFit, distance: np.ndarray) -> Calibration:
    sheet = readings.sheet
    certified = sheet.known_distance_mm
    if certified is None:
        key, shift, meaning = "distance_mm", 0.0, "straight distance between the marks"
    else:
        key, shift, meaning = (
            "certified_mm",
            sheet.certified_mm,
            "length of the wire at 20 °C and certified tension",
        )
    value = float(fit.x[0]) + shift
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            *(float(column[k]) for column in readings.numbers.values()),
            float(distance[k]),
            float(1e3 * fit.residual[k]),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )
    return Calibration(
        kind=KIND,
        title=f"{'Distance by' if certified is None else 'Length of'} Invar wire {sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantities([(key, "mm", meaning)], np.array([value]), fit.covariance, fit=fit),
        covariance=fit.covariance,
        columns=(*readings.numbers, "distance_mm", "residual_um", fit.test, "state"),
        rows=rows,
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"the scatter of the readings alone gives {1e3 * np.sqrt(fit.scattered[0, 0]):.2g} µm; systematic effects "
            f"counted: {', '.join(fit.effects) or 'none'}",
            *scatter_notes(fit, "µm", 1e-3),
        ),
        curve=residuals_by_number(fit, 1e-3),
        axes=("reading", "residual (µm)"),
        method="The wire hangs as an elastic catenary between the marks; its length is the certificate's at 20 °C and "
        "certified tension, taken to the temperature and the tension of each reading, and the end scales are added. "
        "Offsets of all instruments and the wire's constants are parameters with priors that all readings share.",
        record={key: value, f"u_{key}": float(np.sqrt(fit.covariance[0, 0]))},
    )


RECIPE = CalibrationKind(
    "distance by a hanging Invar wire, or the wire by a distance",
    LAYOUT,
    measure_with_wire,
    plausible=Plausibility(
        scatter=ReadingScatter(100.0, "µm", 1e-3, "end scales of half millimetres are read to a fifth of one"),
        columns={"temperature_c": PlausibleSpan(-30.0, 45.0, "air in which people stretch a wire")},
    ),
)
