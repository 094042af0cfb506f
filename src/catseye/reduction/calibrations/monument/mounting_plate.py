"""Mounting plate: circle reading towards the v-block, from references of known direction and repeated seatings.

    direction = plate zero - v_block + half a turn on face right + collimation (left) or - collimation (right)

all clockwise. The plate with the instrument on it is lifted off the Kelvin mount and set back between seatings: what
changes then is part of each later use. The v-block lies `v_block_deg` clockwise from a reference, which a laboratory
measures once; its uncertainty is common to all sights at it. By hand: a reference reads 10 deg, the v-block lies 30 deg
clockwise of it: the circle reads 40 deg towards the v-block.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from catseye.constants import ARCSECOND, DEGREE, TWO_PI
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.fit import CalibrationFit, Effect, FitOptions, ObservedScatter, fit_readings
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
from catseye.reduction.calibrations.monument.azimuth_sheet import Reference

KIND = "mounting-plate"
FACES = {"left": 1.0, "right": -1.0}
SEATING, READING = "scatter of a seating", "scatter of one reading"


class MountingPlateSheet(Sheet):
    """Sheet of a Kelvin plate with its circle.

    u_direction_arcsec   scatter of one pointing and reading, if known
    reference            tables [[reference]]
    """

    u_direction_arcsec: Annotated[float, Within(0, 3600, above=True)] | None = None
    reference: Annotated[tuple[Reference, ...], Field(strict=False, min_length=1)]


LAYOUT = SheetLayout(
    KIND,
    MountingPlateSheet,
    required={"target": TEXT, "face": TEXT, "direction_deg": Within(-360, 720), "seating": TEXT},
)


def calibrate_mounting_plate(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Circle reading of a plate towards the v-block, with collimation and the scatter of a seating.

    readings   columns target, face ("left", "right"), direction_deg, seating (a word for each); sheet
               MountingPlateSheet
    reject     leave out what the tests reject

    Raises InputError for an unknown target or face, a single face, and fewer than three seatings.

    Source: [PARKER04] section 7.1.5, which has its heading alone; the plate's use in section 7.2.2.
    """
    sheet, m = readings.sheet, len(readings)
    places = {reference.name: reference for reference in sheet.reference}
    for row in range(m):
        if readings.words["target"][row] not in places:
            expected = ", ".join(places)
            raise readings.refuse(row, f"target = {readings.words['target'][row]!r} (expected one of {expected})")
        if readings.words["face"][row] not in FACES:
            raise readings.refuse(row, f"face = {readings.words['face'][row]!r} (expected 'left' or 'right')")
    side = np.array([FACES[word] for word in readings.words["face"]])
    seats = list(dict.fromkeys(np.array(readings.words["seating"])[readings.active].tolist()))
    if len(set(side[readings.active])) < 2:
        raise refusal(readings.file, "column 'face': one face only (expected both: the collimation is unknown)")
    if len(seats) < 3:
        raise refusal(readings.file, f"column 'seating': {len(seats)} seatings (expected 3 or more, for their scatter)")
    target = np.array(readings.words["target"])
    block = np.array([places[name].v_block_deg for name in target]) * DEGREE
    toward = readings.get("direction_deg") * DEGREE + block - np.where(side < 0.0, np.pi, 0.0)
    start = float(toward[np.argmax(readings.active)])
    off = np.mod(toward - start + np.pi, TWO_PI) - np.pi
    seat = np.array(readings.words["seating"])
    fit = fit_readings(
        off,
        np.column_stack([np.ones(m), side]),
        _scatter(sheet, seat),
        names=["plate zero", "collimation"],
        effects=[
            Effect(f"v-block from {name}", 1.0 * (target == name), place.u_v_block_arcsec * ARCSECOND, "rad")
            for name, place in places.items()
        ],
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    return _calibration(readings, fit, start)


def _scatter(sheet: MountingPlateSheet, seat: np.ndarray) -> ObservedScatter:
    """Scatter of the seatings, unknown, and that of a reading, claimed or unknown."""
    eye, together = np.eye(len(seat)), 1.0 * (seat[:, None] == seat)
    if sheet.u_direction_arcsec is None:
        return ObservedScatter(np.zeros_like(eye), {READING: eye, SEATING: together}, size=TWO_PI)
    return ObservedScatter((sheet.u_direction_arcsec * ARCSECOND) ** 2 * eye, {SEATING: together}, size=TWO_PI)


def _calibration(readings: SheetReadings, fit: CalibrationFit, start: float) -> Calibration:
    sheet = readings.sheet
    turn = np.diag([1.0 / DEGREE, 1.0 / ARCSECOND])
    covariance = turn @ fit.covariance @ turn.T
    values = np.array([np.mod((start + fit.x[0]) / DEGREE, 360.0), fit.x[1] / ARCSECOND])
    keys = [
        ("plate_zero_deg", "degrees", "circle reading towards the v-block"),
        ("collimation_arcsec", "arcsec", "by which face left reads too high"),
    ]
    seating = fit.components[SEATING] / ARCSECOND
    in_use = float(np.hypot(np.sqrt(covariance[0, 0]) * DEGREE / ARCSECOND, seating))
    words = readings.words
    rows = tuple(
        (words["target"][k], words["face"][k], words["seating"][k], float(readings.get("direction_deg")[k]),
         float(fit.residual[k] / ARCSECOND), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    return Calibration(
        kind=KIND,
        title=f"Mounting plate of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantities(keys, values, covariance, fit=fit, turn=turn),
        covariance=covariance,
        columns=("target", "face", "seating", "direction_deg", "residual_arcsec", fit.test, "state"),
        rows=rows,
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f'a seating scatters by {seating:.2g}": u_plate_zero_arcsec of the record holds one seating to come',
            *scatter_notes(fit, "arcsec", ARCSECOND),
        ),
        curve=residuals_by_number(fit, ARCSECOND),
        axes=("reading", "residual (arcsec)"),
        method="Circle readings at references of known direction from the v-block, on both faces and over several "
        "seatings of the plate, are the reading towards the v-block and the collimation. The scatter of the seatings "
        "and, if not stated, of the readings is estimated from them; the directions of the references are parameters "
        "with their priors.",
        record={"plate_zero_deg": float(values[0]), "u_plate_zero_arcsec": in_use},
    )


RECIPE = CalibrationKind(
    "circle reading of a Kelvin plate towards the v-block, from references and seatings",
    LAYOUT,
    calibrate_mounting_plate,
    plausible=Plausibility(
        scatter=ReadingScatter(
            15.0, "arcsec", ARCSECOND, "a theodolite reads to 2 arcsec, a Kelvin mount reseats to 5"
        ),
        sizes={"collimation_arcsec": PlausibleSpan(-300.0, 300.0, "an adjusted theodolite's is below a minute")},
    ),
)
