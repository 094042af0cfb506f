"""Calibrations from tables of readings: one kind is one file with a RECIPE, and one line here."""

from pathlib import Path

from catseye.errors import InputError
from catseye.records.readings import read_readings
from catseye.reduction.calibration import Calibration
from catseye.reduction.calibrations import (
    amplitude,
    gauge_blocks,
    glass_constants,
    invar_wire,
    leakage,
    leakage_lit,
    linearity,
    oscillator,
    reference_distance,
    repeatability,
    retroreflector,
)
from catseye.reduction.calibrations.kind import Kind

KINDS: dict[str, Kind] = {
    "reference-distance": reference_distance.RECIPE,
    "leakage": leakage.RECIPE,
    "leakage-lit": leakage_lit.RECIPE,
    "linearity": linearity.RECIPE,
    "retroreflector": retroreflector.RECIPE,
    "amplitude-to-phase": amplitude.RECIPE,
    "oscillator": oscillator.RECIPE,
    "repeatability": repeatability.RECIPE,
    "prism-constant": glass_constants.PRISM_RECIPE,
    "ball-constant": glass_constants.BALL_RECIPE,
    "gauge-blocks": gauge_blocks.BLOCKS_RECIPE,
    "spacers": gauge_blocks.SPACERS_RECIPE,
    "invar-wire": invar_wire.RECIPE,
}


def calibrate(kind: str, path: Path | str, sheet: Path | str | None = None, *, reject: bool = False) -> Calibration:
    """A calibration from a table of readings and the sheet beside it.

    kind     a name in KINDS
    path     of the table
    sheet    of the sheet; the table's with the ending .toml if None
    reject   leave out the readings that the tests reject; they stay in the table

    Raises InputError for an unknown kind or a bad file, EstimationError where the readings do not hold what is sought.
    """
    if kind not in KINDS:
        raise InputError(f"calibration {kind!r} is unknown (expected one of {', '.join(KINDS)})")
    chosen = KINDS[kind]
    return chosen.recipe(read_readings(path, chosen.layout, sheet), reject)
