"""Instruments against gauge blocks, and spacers by an instrument.

    reads = zero + (1 + scale) L,   L = (sum of the blocks + films) (1 + expansion (t - 20 °C))

A block that stands in several stacks brings its certificate's uncertainty into all of them, as one effect.
"""

from typing import Annotated, TypedDict

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import PPM
from catseye.geometry.catenary import expanded
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings, Words
from catseye.records.files.record import Record, Uncertainty, Within, broken_rule
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
    PlausibleSpan,
    ReadingScatter,
    provenance,
    quantities,
    residuals_by_number,
    scatter_notes,
)

BLOCKS, SPACERS = "gauge-blocks", "spacers"
LENGTH, TEMPERATURE = Within(0.1, 10_000), Within(-40, 60)
Coefficient = Annotated[float, Within(-5, 50)]


class Block(Record):
    """Gauge block: name in the table, certified length at 20 °C, u.

    name        name of the block, as in the table
    length_mm   certified length at 20 °C
    u_mm        standard uncertainty of the length
    """

    name: Words
    length_mm: Annotated[float, LENGTH]
    u_mm: Uncertainty


class LengthSheet(Sheet):
    """Common keys of both kinds' sheets.

    expansion_ppm_per_c, u_expansion_ppm_per_c  coefficient of expansion of blocks or spacers: 11.5 for steel
    temperature_c     temperature of blocks or spacers; a column where it changed
    u_temperature_c   of the thermometer's offset, common to all readings
    u_reading_mm      scatter of a reading, if known
    """

    expansion_ppm_per_c: Coefficient
    u_expansion_ppm_per_c: Annotated[float, Within(0, 50)]
    temperature_c: Annotated[float, TEMPERATURE] | None = None
    u_temperature_c: Annotated[float, Within(0, 20)]
    u_reading_mm: Uncertainty | None = None


class BlocksSheet(LengthSheet):
    """Sheet of an instrument's calibration against gauge blocks.

    block                certificates, one table a block
    film_um, u_film_um   thickness of each film where two blocks are wrung together
    estimate_scale       estimate the instrument's scale beside its zero
    """

    block: Annotated[tuple[Block, ...], Field(strict=False, min_length=1)]
    film_um: Annotated[float, Within(-1, 10)] = 0.0
    u_film_um: Annotated[float, Within(0, 10)] = 0.0
    estimate_scale: bool = True

    @model_validator(mode="after")
    def _check_block_names(self) -> "BlocksSheet":
        names = [block.name for block in self.block]
        for name in names:
            if names.count(name) > 1:
                raise broken_rule(f"block name = {name!r} stands twice (expected each block once)")
        return self


class SpacersSheet(LengthSheet):
    """Sheet of spacers measured by a calibrated instrument.

    true = (reads - zero) / (1 + scale).

    zero_mm, u_zero_mm       zero of the instrument, from its own calibration
    scale_ppm, u_scale_ppm   scale error of the instrument, from its own calibration
    """

    zero_mm: Annotated[float, Within(-100, 100)] = 0.0
    u_zero_mm: Annotated[float, Within(0, 10)]
    scale_ppm: Annotated[float, Within(-1000, 1000)] = 0.0
    u_scale_ppm: Annotated[float, Within(0, 1000)]


OPTIONAL = {"temperature_c": TEMPERATURE}
READS = Within(-10_000, 10_000)
BLOCKS_LAYOUT = SheetLayout(BLOCKS, BlocksSheet, required={"blocks": TEXT, "reads_mm": READS}, optional=OPTIONAL)
SPACERS_LAYOUT = SheetLayout(SPACERS, SpacersSheet, required={"spacer": TEXT, "reads_mm": READS}, optional=OPTIONAL)


def calibrate_against_blocks(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Zero and scale of an instrument from stacks of gauge blocks.

    readings   columns blocks ("100+25+1.005", names of the sheet's blocks) and reads_mm; sheet BlocksSheet
    reject     leave out what the tests reject

    Source: [ISO98] for what a block's length means; wrung lengths add.
    """
    sheet, m = readings.sheet, len(readings)
    used = _stacks(readings)
    films = np.maximum(used.sum(axis=1) - 1.0, 0.0)
    cold = used @ np.array([block.length_mm for block in sheet.block]) + films * sheet.film_um * 1e-3
    temperature = readings.get("temperature_c")
    expansion = expanded(1.0, temperature, sheet.expansion_ppm_per_c * PPM)
    length = cold * expansion
    fit = fit_readings(
        readings.get("reads_mm") - length,
        np.column_stack([np.ones(m), length * PPM][: 1 + sheet.estimate_scale]),
        _scatter(sheet, m),
        names=["zero", "scale"][: 1 + sheet.estimate_scale],
        effects=[  # of reads - L: a longer stack makes it smaller
            *(
                Effect(f"block {block.name}", -used[:, k] * expansion, block.u_mm, "mm")
                for k, block in enumerate(sheet.block)
            ),
            Effect("film", -films * expansion * 1e-3, sheet.u_film_um, "µm"),
            *_temperature_effects(sheet, -cold, temperature),
        ],
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    on, line = fit.active, np.argsort(length)
    keys = [
        ("zero_mm", "mm", "what it reads on a length of zero"),
        ("scale_ppm", "ppm", "by which it reads too long"),
    ][: len(fit.x)]
    return Calibration(
        kind=BLOCKS,
        title=f"{sheet.instrument} against gauge blocks",
        quantities=quantities(keys, fit.x, fit.covariance, fit=fit),
        covariance=fit.covariance,
        curve={
            "readings": (length[on], 1e3 * (fit.predicted + fit.residual)[on]),
            "left out": (length[~on], 1e3 * (fit.predicted + fit.residual)[~on]),
            "fit": (length[line], 1e3 * fit.predicted[line]),
        },
        axes=("length of the stack (mm)", "reads minus length (µm)"),
        method="What the instrument reads on stacks of gauge blocks, less the stacks' lengths at their temperature, is "
        "a zero and a scale. Each block's certificate is one parameter with a prior, whatever stacks it stands in; "
        "so are the films, the thermometer and the expansion.",
        record={key: float(value) for (key, *_), value in zip(keys, fit.x, strict=True)},
        **_common(readings, fit, length),
    )


def calibrate_spacers(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Lengths of spacers at 20 °C, with joint covariance.

    Instrument and thermometer are common to all.

    readings   columns spacer (its name) and reads_mm; sheet SpacersSheet
    reject     leave out what the tests reject
    """
    sheet, m = readings.sheet, len(readings)
    names = list(dict.fromkeys(readings.words["spacer"]))
    if "" in names:
        raise readings.refuse(readings.words["spacer"].index(""), "spacer is empty (expected its name)")
    design = np.array([[float(name == spacer) for name in names] for spacer in readings.words["spacer"]])
    temperature = readings.get("temperature_c")
    expansion = expanded(1.0, temperature, sheet.expansion_ppm_per_c * PPM)
    true = (readings.get("reads_mm") - sheet.zero_mm) / (1.0 + sheet.scale_ppm * PPM)
    observed = true / expansion
    fit = fit_readings(
        observed,
        design,
        _scatter(sheet, m),
        names=names,
        effects=[
            Effect("zero of the instrument", -np.ones(m), sheet.u_zero_mm, "mm"),
            Effect("scale of the instrument", -observed * PPM, sheet.u_scale_ppm, "ppm"),
            *_temperature_effects(sheet, observed, temperature),
        ],
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    keys = [(f"{name}_mm", "mm", f"length of {name} at 20 °C") for name in names]
    return Calibration(
        kind=SPACERS,
        title=f"Spacers {', '.join(names)}" if len(names) < 5 else f"{len(names)} spacers",
        quantities=quantities(keys, fit.x, fit.covariance, fit=fit),
        covariance=fit.covariance,
        curve=residuals_by_number(fit, 1e-3),  # lengths differ: residuals alone share an axis
        axes=("reading", "residual (µm)"),
        method="Readings corrected for the instrument's zero and scale are taken to 20 °C and averaged for each. "
        "Zero, scale, thermometer and expansion are parameters with priors that all spacers share.",
        record={key: float(value) for (key, *_), value in zip(keys, fit.x, strict=True)},
        **_common(readings, fit, observed),
    )


def _stacks(readings: SheetReadings) -> np.ndarray:
    """Incidence (m, blocks) of blocks in stacks: 0 or 1."""
    positions = {block.name: k for k, block in enumerate(readings.sheet.block)}
    used = np.zeros((len(readings), len(positions)))
    for row, stack in enumerate(readings.words["blocks"]):
        for name in (part.strip() for part in stack.split("+")):
            if name not in positions:
                raise readings.refuse(row, f"blocks = {stack!r}: {name!r} has no [[block]] in {readings.sheet_file}")
            used[row, positions[name]] += 1.0
            if used[row, positions[name]] > 1.0:
                raise readings.refuse(row, f"blocks = {stack!r}: {name!r} stands twice (expected each block once)")
    return used


def _scatter(sheet: LengthSheet, m: int) -> ObservedScatter:
    if sheet.u_reading_mm is not None:
        return ObservedScatter(sheet.u_reading_mm**2 * np.eye(m))
    return ObservedScatter(np.zeros((m, m)), {"scatter of one reading": np.eye(m)})


def _temperature_effects(sheet: LengthSheet, length: np.ndarray, temperature: np.ndarray) -> list[Effect]:
    """Effects of thermometer and expansion.

    `length`, with its sign, is multiplied by 1 + expansion (t - 20).

    A thermometer that reads u too high, or an expansion taken too large: the true length is smaller than computed, the
    observed value that holds it (with the sign of `length`) moves accordingly; only the size matters to a prior.
    """
    return [
        Effect("offset of the thermometer", length * sheet.expansion_ppm_per_c * PPM, sheet.u_temperature_c, "°C"),
        Effect("expansion", length * (temperature - 20.0) * PPM, sheet.u_expansion_ppm_per_c, "ppm/°C"),
    ]


class CommonParts(TypedDict):
    """Common parts of calibrations by blocks and of spacers.

    See `Calibration` for the terms.
    """

    provenance: dict[str, object]
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    decisions: tuple[CheckOutcome, ...]
    fit: CalibrationFit
    variance_factor: float
    degrees_of_freedom: int
    notes: tuple[str, ...]


def _common(readings: SheetReadings, fit: CalibrationFit, length: np.ndarray) -> CommonParts:
    """Common parts of both kinds' results."""
    word = next(iter(readings.words))
    rows = tuple(
        (readings.words[word][k], float(readings.get("reads_mm")[k]), float(length[k]),
         float(1e3 * fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    return {
        "provenance": provenance(readings),
        "columns": (word, "reads_mm", "length_mm", "residual_um", fit.test, "state"),
        "rows": rows,
        "decisions": fit.decisions(),
        "fit": fit,
        "variance_factor": fit.variance_factor,
        "degrees_of_freedom": round(fit.degrees_of_freedom),
        "notes": scatter_notes(fit, "µm", 1e-3),
    }


BLOCKS_RECIPE = CalibrationKind(
    "zero and scale of an instrument against gauge blocks",
    BLOCKS_LAYOUT,
    calibrate_against_blocks,
    plausible=Plausibility(
        scatter=ReadingScatter(
            10.0, "µm", 1e-3, "a height gauge or comparator is read to 1 µm [PARKER04] section 2.2.2"
        ),
        sizes={
            "zero_mm": PlausibleSpan(-1.0, 1.0, "an instrument is set to zero before it is calibrated"),
            "scale_ppm": PlausibleSpan(-1e3, 1e3, "a steel scale off by 85 °C reads 1000 ppm wrong"),
        },
        columns={
            "temperature_c": PlausibleSpan(10.0, 30.0, "blocks are true at 20 °C [ISO98], in a room where people work")
        },
    ),
)
SPACERS_RECIPE = CalibrationKind(
    "lengths of spacers by a calibrated instrument",
    SPACERS_LAYOUT,
    calibrate_spacers,
    plausible=Plausibility(
        scatter=ReadingScatter(
            10.0, "µm", 1e-3, "a height gauge or comparator is read to 1 µm [PARKER04] section 2.2.2"
        ),
        sizes={"*_mm": PlausibleSpan(0.0, 2000.0, "a length, as long as a gauge reaches")},
        columns={
            "temperature_c": PlausibleSpan(10.0, 30.0, "lengths hold at 20 °C [ISO22], in a room where people work")
        },
    ),
)
