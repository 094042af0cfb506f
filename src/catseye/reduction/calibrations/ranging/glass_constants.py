"""Constants of prisms and balls from their dimensions.

The range's end inside the glass.

    prism   h_rp = h / n,   Pc = -(n - 1/n) h        ball   Pc = -(n (R1 + R2) - R1)

n is the group index of the glass over that of the air. Dimensions are those at 20 °C.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from catseye.constants import PPM
from catseye.geometry.catenary import expanded
from catseye.optics.retroreflector import cats_eye, prism
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.check_outcome import CheckOutcome
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
    ReadingScatter,
    provenance,
    quantities,
    residuals_by_number,
    scatter_notes,
)

PRISM, BALL = "prism-constant", "ball-constant"
PARTS = ("r1", "r2")
OUT_OF_FOCUS = 0.15  # of the shell; index of phase for that of groups makes 0.03, least blur 0.02
TEMPERATURE = Within(-40, 60)


class GlassSheet(Sheet):
    """Sheet of a target's dimensions.

    index_ratio, u_index_ratio   group index of the glass over that of the air: 1.527077 for old BK 7 at 0.780 µm
    expansion_ppm_per_c, u_expansion_ppm_per_c   coefficient of expansion of the glass: 7.1 for BK 7
    temperature_c, u_temperature_c   temperature of the glass; a column where it changed
    u_gauge_mm                   of the gauge, an offset that all readings share
    u_reading_mm                 scatter of a reading, if known
    """

    index_ratio: Annotated[float, Within(1.3, 2.5)]
    u_index_ratio: Annotated[float, Within(0, 0.1)]
    expansion_ppm_per_c: Annotated[float, Within(0, 50)]
    u_expansion_ppm_per_c: Annotated[float, Within(0, 50)] = 0.0
    temperature_c: Annotated[float, TEMPERATURE] | None = None
    u_temperature_c: Annotated[float, Within(0, 20)]
    u_gauge_mm: Annotated[float, Within(0, 10)]
    u_reading_mm: Uncertainty | None = None


PRISM_LAYOUT = SheetLayout(
    PRISM, GlassSheet, required={"height_mm": Within(5, 500)}, optional={"temperature_c": TEMPERATURE}
)
BALL_LAYOUT = SheetLayout(
    BALL,
    GlassSheet,
    required={"part": TEXT, "radius_mm": Within(5, 1000)},
    optional={"temperature_c": TEMPERATURE},
)


def calibrate_prism(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Height, reference depth and range constant of a cube-corner prism.

    readings   column height_mm, entry face to corner; sheet GlassSheet
    reject     leave out what the tests reject

    Source: [GOLDMAN00] eqs. 3.9 and 3.10.
    """
    fit = _dimensions(readings, readings.get("height_mm"), np.ones((len(readings), 1)), ["height"], reject)
    n, h = readings.sheet.index_ratio, fit.x[0]
    values = np.array([h, float(prism.reference_depth(h, n)), float(prism.range_constant(h, n))])
    by_size = np.array([1.0, 1.0 / n, -(n - 1.0 / n)])
    by_index = np.array([0.0, -h / n**2, -(1.0 + 1.0 / n**2) * h])
    keys = [
        ("height_mm", "mm", "of the prism at 20 °C, entry face to corner"),
        ("hrp_mm", "mm", "reference point below the entry face"),
        ("pc_mm", "mm", "range constant at normal incidence, added to the measured length"),
    ]
    return _calibration(
        readings, fit, GlassConstants(keys, values, by_size[:, None], by_index), kind=PRISM, what="Prism",
        record={"height_mm": values[0], "u_height_mm": float(np.sqrt(fit.covariance[0, 0])), "hrp_mm": values[1],
                "pc_mm": values[2]},
    )  # fmt: skip


def calibrate_ball(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Radii and range constant of a cat's-eye.

    A small ball and a large shell about one centre.

    readings   columns part ("r1" small ball, "r2" silvered shell) and radius_mm; sheet GlassSheet
    reject     leave out what the tests reject

    Source: [GOLDMAN00] eq. 3.14.
    """
    design = np.zeros((len(readings), 2))
    for row, part in enumerate(readings.words["part"]):
        if part not in PARTS:
            raise readings.refuse(row, f"part = {part!r} is not known (expected 'r1', small ball, or 'r2', shell)")
        design[row, PARTS.index(part)] = 1.0
    fit = _dimensions(readings, readings.get("radius_mm"), design, ["radius r1", "radius r2"], reject)
    n, (r1, r2) = readings.sheet.index_ratio, fit.x
    values = np.array([r1, r2, float(cats_eye.range_constant(r1, r2, n))])
    by_size = np.array([[1.0, 0.0], [0.0, 1.0], [-(n - 1.0), -n]])
    by_index = np.array([0.0, 0.0, -(r1 + r2)])
    keys = [
        ("r1_mm", "mm", "radius of the small ball at 20 °C"),
        ("r2_mm", "mm", "radius of the silvered shell at 20 °C"),
        ("pc_b_mm", "mm", "range constant, added to the measured length"),
    ]
    return _calibration(
        readings, fit, GlassConstants(keys, values, by_size, by_index), kind=BALL, what="Ball",
        record={"r1_mm": r1, "r2_mm": r2, "u_r_mm": float(np.sqrt(fit.covariance.diagonal().max())),
                "pc_b_mm": values[2]},
        decisions=(_in_focus(float(r1), float(r2), n),),
    )  # fmt: skip


def _in_focus(r1: float, r2: float, n: float) -> CheckOutcome:
    """Check that the shell is near the small ball's focus.

    Otherwise nothing returns.
    """
    off = abs(r2 * (n - 1.0) / r1 - 1.0)
    text = "the shell lies near the small ball's focus"
    if off > OUT_OF_FOCUS:
        text = f"r2 is {r2 / r1:.3f} r1, a focus lies at {1.0 / (n - 1.0):.3f}: the words in the column part, or a size"
    return CheckOutcome("shell off the focus, share of its radius", off, OUT_OF_FOCUS, bool(off <= OUT_OF_FOCUS), text)


def _dimensions(
    readings: SheetReadings, measured: np.ndarray, design: np.ndarray, names: list[str], reject: bool
) -> CalibrationFit:
    """Sizes at 20 °C, mm, from readings at their temperature."""
    sheet, m = readings.sheet, len(readings)
    temperature = readings.get("temperature_c")
    expansion = sheet.expansion_ppm_per_c * PPM
    observed = measured / expanded(1.0, temperature, expansion)
    scatter = ObservedScatter(np.zeros((m, m)), {"scatter of one reading": np.eye(m)})
    if sheet.u_reading_mm is not None:
        scatter = ObservedScatter(sheet.u_reading_mm**2 * np.eye(m))
    return fit_readings(
        observed,
        design,
        scatter,
        names=names,
        effects=[
            Effect("offset of the gauge", np.ones(m), sheet.u_gauge_mm, "mm"),
            Effect("offset of the thermometer", observed * expansion, sheet.u_temperature_c, "°C"),
            Effect("expansion", observed * (temperature - 20.0) * PPM, sheet.u_expansion_ppm_per_c, "ppm/°C"),
        ],
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )


@dataclass(frozen=True, eq=False)
class GlassConstants:
    """Constants by p sizes of the glass and its index ratio.

    The ratio of its group index over the air's.

    keys       (q,) key, unit and meaning of each
    values     (q,) in their units
    by_size    (q, p) derivatives by the sizes, mm
    by_index   (q,) derivatives by the ratio
    """

    keys: list[tuple[str, str, str]]
    values: np.ndarray
    by_size: np.ndarray
    by_index: np.ndarray


def _calibration(
    readings: SheetReadings,
    fit: CalibrationFit,
    constants: GlassConstants,
    *,
    kind: str,
    what: str,
    record: dict[str, float],
    decisions: tuple[CheckOutcome, ...] = (),
) -> Calibration:
    sheet, by_size, by_index = readings.sheet, constants.by_size, constants.by_index
    index = SharedInput("index ratio of glass and air", sheet.u_index_ratio, "1", by_index)
    covariance = by_size @ fit.covariance @ by_size.T + index.covariance
    covariance = 0.5 * (covariance + covariance.T)
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (*(words[k] for words in readings.words.values()), float(fit.predicted[k] + fit.residual[k]),
         float(1e3 * fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    return Calibration(
        kind=kind,
        title=f"{what} constants of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantities(constants.keys, constants.values, covariance, fit=fit, turn=by_size, inputs=[index]),
        covariance=covariance,
        columns=(*readings.words, "size_at_20_c_mm", "residual_um", fit.test, "state"),
        rows=rows,
        decisions=(*decisions, *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"the index ratio {sheet.index_ratio} alone contributes "
            f"{1e3 * sheet.u_index_ratio * abs(by_index[-1]):.2g} µm to the range constant",
            *scatter_notes(fit, "µm", 1e-3),
        ),
        curve=residuals_by_number(fit, 1e-3),
        axes=("reading", "residual (µm)"),
        method="Readings of the glass are taken to 20 °C and averaged with the offsets of gauge and thermometer and "
        "the expansion as parameters with priors. The constants follow from the dimensions and the ratio of the group "
        "indices of glass and air.",
        record={key: float(value) for key, value in record.items()},
    )


PRISM_RECIPE = CalibrationKind(
    "constants of a glass prism from its measured height",
    PRISM_LAYOUT,
    calibrate_prism,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "µm", 1e-3, "a micrometer or measuring machine repeats to some µm"),
    ),
)
BALL_RECIPE = CalibrationKind(
    "constants of a ball cat's-eye from its measured radii",
    BALL_LAYOUT,
    calibrate_ball,
    plausible=Plausibility(
        scatter=ReadingScatter(50.0, "µm", 1e-3, "a micrometer or measuring machine repeats to some µm"),
    ),
)
