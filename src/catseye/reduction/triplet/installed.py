"""Laboratory's numbers in the record of a unit on the telescope: H_corr, L_MPBC, with whom and when.

H_corr belongs to the glass constants of the sheet: with other ones for the prisms in use the same ranges give another
mid-point, and the errors of both no longer cancel. So a record keeps its glass only where it is the sheet's.
"""

import math
from collections.abc import Iterator
from datetime import date

from catseye.constants import MILLIMETRE
from catseye.records.files.refusal import refusal
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.triplet.notes import CONSTANT_MM
from catseye.reduction.triplet.result import TripletReduction

DIGITS = 9  # of a length in mm: 1 pm
SPACING_MM = 0.15  # of d12_mm against the sheet's: the tolerance of fabrication
Place = tuple[str, str]  # table, "" for the top; key
Written = str | int | float | date | None


def refuse_foreign_sheet(reduction: TripletReduction, record: TripletRecord, file: str) -> None:
    """Raise InputError unless a sheet is of the record's unit, with its glass.

    reduction   of the sheet
    record      of the unit on the telescope
    file        of the record, for the message
    """
    measured = reduction.measurement
    if record.triplet != measured.triplet:
        raise refusal(file, f"is the record of {record.triplet}, the sheet is of {measured.triplet}")
    for key, value, expected, most in _comparable(measured, record):
        if abs(value - expected) > most:
            raise refusal(
                file,
                f"{key} = {value:g} is not the sheet's {expected:g} (expected within {most:g} mm: H_corr belongs to "
                "the sheet's glass; given as replaces it gets the sheet's glass, too)",
            )


def _comparable(m: TripletMeasurement, record: TripletRecord) -> Iterator[tuple[str, float, float, float]]:
    """Key, value in the record and in the sheet, and the largest difference."""
    for side, installed, measured in (
        ("left_prism", record.left_prism, m.left_prism),
        ("right_prism", record.right_prism, m.right_prism),
    ):
        for key in ("hrp_mm", "pc_mm"):
            yield f"{side}.{key}", getattr(installed, key), getattr(measured, key), CONSTANT_MM
    yield "ball.pc_b_mm", record.ball.pc_b_mm, m.ball.pc_b_mm, CONSTANT_MM
    yield "d12_mm", record.d12_mm, m.d12_mm, SPACING_MM


def laboratory_values(reduction: TripletReduction, file: str, digest: str) -> dict[Place, Written]:
    """Values of a unit's record from its sheet: both heights and their provenance; None removes a key.

    reduction   of the sheet
    file        name of the sheet
    digest      its SHA-256

    Raises InputError for a unit that was not accepted.

    Source: [GOLDMAN00] sections 1.2, step 6, and 3.3.
    """
    if not (reduction.accepted and math.isfinite(reduction.h_corr)):
        raise refusal(file, f"{reduction.verdict.why} (expected an accepted unit for the record of a site)")
    m = reduction.measurement
    heights = {
        "h_corr_mm": reduction.h_corr,
        "u_h_corr_mm": reduction.u_h_corr,
        "l_mpbc_mm": reduction.l_mpbc,
        "u_l_mpbc_mm": reduction.u_l_mpbc,
    }
    report = f"{m.report}; " if m.report else ""
    return {
        **{("", key): round(value / MILLIMETRE, DIGITS) for key, value in heights.items()},
        ("", "measured_on"): m.measured_on,
        ("", "by"): m.by,
        ("", "valid_until"): m.valid_until,
        ("", "report"): f"{report}catseye triplet {file}, SHA-256 {digest[:16]}",
    }


def replacing_values(reduction: TripletReduction, replaced: TripletRecord) -> dict[Place, Written]:
    """Further values for a unit that takes another's place: name, spacing, glass.

    reduction   of the new unit's sheet
    replaced    record of the unit whose place, orientation and frame it takes

    The ball's place in the plate keeps the sheet's uncertainty; 0 there is refused by the record.
    """
    m = reduction.measurement
    values: dict[Place, Written] = {
        ("", "triplet"): m.triplet,
        ("", "d12_mm"): m.d12_mm,
        ("", "u_d12_mm"): m.u_d12_mm,
        ("", "u_lateral_mm"): m.u_lateral_mm,
    }
    for side, prism in zip(("left_prism", "right_prism"), m.prisms, strict=True):
        numbers = ("serial", "height_mm", "u_height_mm", "hrp_mm", "pc_mm")
        values |= {(side, key): getattr(prism, key) for key in numbers}
    values |= {("ball", key): getattr(m.ball, key) for key in ("r1_mm", "r2_mm", "u_r_mm", "pc_b_mm")}
    for table, target in zip(("left_prism", "right_prism", "ball"), replaced.targets, strict=True):
        if target.startswith(replaced.triplet):
            values[table, "target"] = m.triplet + target.removeprefix(replaced.triplet)
    return values
