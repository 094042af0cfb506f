"""Kinds of calibrations: one file with a RECIPE and one line here each."""

from dataclasses import replace
from pathlib import Path

from catseye.errors import InputError
from catseye.records.files.readings import SheetReadings, read_readings
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.kind import CalibrationKind
from catseye.reduction.calibrations.length import gauge_blocks, height_gauge, invar_wire
from catseye.reduction.calibrations.mirror import (
    alignment,
    autocollimation,
    both_faces,
    both_faces_pointing,
    detector_focus,
    encoder,
    limits,
    reference_cube,
    search_results,
)
from catseye.reduction.calibrations.monument import azimuth as monument_azimuth
from catseye.reduction.calibrations.monument import hydrostatic_level, inclinometer, mounting_plate, plate_levels
from catseye.reduction.calibrations.monument import place as monument_place
from catseye.reduction.calibrations.plausibility import judged
from catseye.reduction.calibrations.ranging import (
    amplitude,
    feedback,
    glass_constants,
    leakage,
    leakage_lit,
    linearity,
    oscillator,
    reference_distance,
    repeatability,
    retroreflector,
    second_pass,
)

WEATHER = ("temperature_c", "pressure_hpa", "humidity_percent")
KINDS: dict[str, CalibrationKind] = {
    "reference-distance": reference_distance.RECIPE,
    "leakage": leakage.RECIPE,
    "leakage-lit": leakage_lit.RECIPE,
    "linearity": linearity.RECIPE,
    "retroreflector": retroreflector.RECIPE,
    "amplitude-to-phase": amplitude.RECIPE,
    "second-pass": second_pass.RECIPE,
    "feedback": feedback.RECIPE,
    "oscillator": oscillator.RECIPE,
    "repeatability": repeatability.RECIPE,
    "prism-constant": glass_constants.PRISM_RECIPE,
    "ball-constant": glass_constants.BALL_RECIPE,
    "gauge-blocks": gauge_blocks.BLOCKS_RECIPE,
    "spacers": gauge_blocks.SPACERS_RECIPE,
    "invar-wire": invar_wire.RECIPE,
    "autocollimation": autocollimation.RECIPE,
    "height-gauge": height_gauge.RECIPE,
    "both-faces": both_faces.RECIPE,
    "both-faces-pointing": both_faces_pointing.RECIPE,
    "encoder": encoder.RECIPE,
    "limits": limits.RECIPE,
    "alignment": alignment.RECIPE,
    "detector-focus": detector_focus.RECIPE,
    "search-results": search_results.RECIPE,
    "monument-azimuth": monument_azimuth.RECIPE,
    "plate-levels": plate_levels.RECIPE,
    "monument-place": monument_place.RECIPE,
    "inclinometer": inclinometer.RECIPE,
    "hydrostatic-level": hydrostatic_level.RECIPE,
    "reference-cube": reference_cube.RECIPE,
    "mounting-plate": mounting_plate.RECIPE,
}


def calibrate(kind: str, path: Path | str, sheet: Path | str | None = None, *, reject: bool = False) -> Calibration:
    """Calibration from a table of readings and its sheet.

    kind     a name in KINDS
    path     of the table
    sheet    of the sheet; the table's with the ending .toml if None
    reject   leave out the readings that the tests reject; they stay in the table

    Raises InputError for an unknown kind or a bad file, EstimationError where the readings do not determine the
    quantities.
    """
    if kind not in KINDS:
        raise InputError(f"calibration {kind!r} is unknown (expected one of {', '.join(KINDS)})")
    chosen = KINDS[kind]
    readings = read_readings(path, chosen.layout, sheet)
    found = judged(chosen, readings, chosen.recipe(readings, reject))
    return replace(found, conditions=_conditions(readings))


def _conditions(readings: SheetReadings) -> dict[str, tuple[float, float]]:
    """Lowest and highest weather of the readings in use, where table or sheet has it."""
    used = readings.active
    spans = {name: readings.get(name)[used] for name in WEATHER if readings.has(name)}
    return {name: (float(values.min()), float(values.max())) for name, values in spans.items()}
