"""Adjustment of a station's 13 parameters to search results.

A campaign in the field against the laboratory.

Each target of known coordinates was found at some counts. The monument's and the mirror's records give the station's
parameters with their standard uncertainties; these are priors, and the counts decide as much as they can. What they
cannot tell apart stays as the laboratory had it, and is named: alpha and beta turn nearly the same way, na0 turns with
alpha1 about an upright axis, the fixed point moves with dx, dy, dz.

In units of the priors the covariance falls from 1 to C; the eigenvalues of 1 - C say how much of each combination the
counts decided: 1 all, 0 nothing. The change from the laboratory's values is normal with the covariance 1 - C where
both are right; that is tested as a whole (chi-square) and for each parameter.

Source: [PARKER04] section 7.2.3.
"""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field, field_serializer

from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.quality.reliability import global_test, single_level, w_critical
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN, HALF_TURN
from catseye.geometry.mirror.imperfect import Imperfections, imperfect_counts
from catseye.geometry.mirror.pointing import PARAMETERS, MirrorStation
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.calibrations.calibration import Calibration, RecordValue
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved, row_ends
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    ReadingScatter,
    provenance,
    residuals_by_number,
)
from catseye.reduction.calibrations.mirror.both_faces import POINTINGS
from catseye.reduction.site.stations import imperfections_of, station_covariance, station_of

KIND = "search-results"
COUNTS, PLACE = Within(-1_000_000, 1_000_000), Within(-10_000, 10_000)
UNCERTAIN = Within(0, 1000, above=True)
P = len(PARAMETERS)
STEPS = (*[1e-4] * 3, *[1e-6] * 3, *[1e-4] * 3, *[1e-6] * 2, *[0.1] * 2)
UNITS = (*["m"] * 3, *["rad"] * 3, *["m"] * 3, *["rad"] * 2, *["counts"] * 2)  # of the parameters and their steps
IN_FILES = {  # name -> key of the records, its unit, size of the unit, record
    **{k: (f"{k}_mm", "mm", MILLIMETRE, "monument") for k in ("x", "y", "z")},
    **{k: (f"{k}_rad", "rad", 1.0, "monument") for k in ("alpha1", "alpha2", "alpha3")},
    **{k: (f"{k}_mm", "mm", MILLIMETRE, "mirror") for k in ("dx", "dy", "dz")},
    **{k: (f"{k}_rad", "rad", 1.0, "mirror") for k in ("beta1", "beta2")},
    **{k: (k, "counts", 1.0, "mirror") for k in ("na0", "ne0")},
}
NEEDED = ("u_alpha1_rad", "u_alpha2_rad", "u_alpha3_rad", "u_beta_rad", "u_zero_counts")
DECIDED = 0.5  # share of a combination's variance removed by the counts: more is theirs, less is the laboratory's
INDETERMINATE = 1e-6  # of the largest singular value: a combination that no count depends on
INFORMED = 1e-3  # share below which a change is rounding
NAMED_PART = 0.3  # of a unit combination: parameters named in it


class SearchSheet(Sheet):
    """Sheet of a campaign's search results.

    u_counts           of each count: the resolution of the search; the columns u_azimuth_counts and
                       u_elevation_counts state it for each target instead
    u_target_mm        of each coordinate of each target; a target seen more than once keeps its error
    monument, mirror   the station's records as tables, with the u_... keys of angles and zeros
    """

    u_counts: Annotated[float, UNCERTAIN] | None = None
    u_target_mm: Annotated[float, Within(0, 1000)]
    monument: Annotated[MonumentGeometry, Field()]
    mirror: Annotated[MirrorGeometry, Field()]

    @field_serializer("monument", "mirror")
    def _as_typed(self, record: MonumentGeometry | MirrorGeometry) -> dict[str, object]:
        return record.model_dump(exclude_unset=True)


LAYOUT = SheetLayout(
    KIND,
    SearchSheet,
    required={
        "target": TEXT,
        "x_m": PLACE,
        "y_m": PLACE,
        "z_m": PLACE,
        "azimuth_counts": COUNTS,
        "elevation_counts": COUNTS,
    },
    optional={"pointing": TEXT, "u_azimuth_counts": UNCERTAIN, "u_elevation_counts": UNCERTAIN},
)


def calibrate_search_results(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Station's parameters from targets in the field.

    Compared with the laboratory's.

    readings   columns target (its name), x_m, y_m, z_m (ground frame), azimuth_counts, elevation_counts, perhaps
               pointing ("direct" if missing, "prime"), u_azimuth_counts, u_elevation_counts; sheet SearchSheet
    reject     leave out what the tests reject, both counts of a target together

    Raises InputError for records without the standard uncertainties that weigh them, EstimationError where the targets
    decide nothing.

    Source: [PARKER04] section 2.2 (transformations 1 to 6); [FOERSTNER16] chapter 4 (priors, tests).
    """
    sheet, m = readings.sheet, len(readings)
    covariance, lacking = station_covariance(sheet.monument, sheet.mirror)
    for key in NEEDED:
        if key in lacking:
            record = "monument" if "alpha" in key else "mirror"
            raise refusal(
                readings.sheet_file, f"{record}.{key} is missing (expected: it weighs the laboratory's value)"
            )
    names = list(dict.fromkeys(readings.words["target"]))
    which = np.array([names.index(word) for word in readings.words["target"]])
    place = np.column_stack([readings.get(f"{axis}_m") for axis in "xyz"])
    prime = _prime(readings)
    imperfections = imperfections_of(sheet.mirror) or Imperfections(
        np.zeros(4), np.zeros(3), np.zeros((2, 0)), np.zeros((2, 0))
    )
    observed = np.column_stack([readings.get("azimuth_counts"), readings.get("elevation_counts")])
    turns = np.zeros((m, 2))
    start = station_of(sheet.monument, sheet.mirror).parameters
    u = np.sqrt(np.diag(covariance))
    parameters = [ModelParameter(*parameter) for parameter in zip(PARAMETERS, start, STEPS, u, UNITS, strict=True)]
    parameters += [
        ModelParameter(f"{name} {axis}", 0.0, 1e-4, sheet.u_target_mm * MILLIMETRE, "m")
        for name in names
        for axis in "xyz"
    ]

    def predict(values: np.ndarray) -> np.ndarray:
        station = MirrorStation.of_parameters(values[:P])
        return (
            imperfect_counts(station, imperfections, place + values[P:].reshape(-1, 3)[which], prime=prime) + turns
        ).ravel()

    first = predict(np.array([p.start for p in parameters])).reshape(m, 2)
    if not np.isfinite(first).all():
        row = int(np.argmin(np.isfinite(first).all(axis=1)))
        raise readings.refuse(
            row, "x_m, y_m, z_m cannot be pointed at from this station (expected a target off its axis)"
        )
    turns[:, 0] = COUNTS_PER_TURN * np.round((observed[:, 0] - first[:, 0]) / COUNTS_PER_TURN)
    _refuse_far(readings, observed - first - turns)
    solution = fit_curved(
        observed.ravel(),
        predict,
        parameters,
        scatter=ObservedScatter(np.diag(_u_counts(readings).ravel() ** 2)),
        options=FitOptions(
            active=np.repeat(readings.active, 2), together=np.repeat(np.arange(m), 2), reject=reject, level=sheet.level
        ),
    )
    return _calibration(readings, solution, predict)


def _u_counts(readings: SheetReadings) -> np.ndarray:
    """Standard uncertainty (m, 2) of the counts, azimuth and elevation.

    The columns', else the sheet's.
    """
    columns = []
    for name in ("u_azimuth_counts", "u_elevation_counts"):
        if name in readings.numbers:
            columns.append(readings.get(name))
        elif readings.sheet.u_counts is None:
            raise refusal(readings.sheet_file, f"u_counts is missing (expected here, or a column {name})")
        else:
            columns.append(np.full(len(readings), readings.sheet.u_counts))
    return np.column_stack(columns)


def _prime(readings: SheetReadings) -> np.ndarray:
    words = readings.words.get("pointing", ("direct",) * len(readings))
    for row, word in enumerate(words):
        if word not in POINTINGS:
            raise readings.refuse(row, f"pointing = {word!r} is unknown (expected 'direct', 'prime')")
    return np.array([word == "prime" for word in words])


def _refuse_far(readings: SheetReadings, off: np.ndarray) -> None:
    """Raise InputError for counts a quarter turn off the records.

    Another target, pointing or station.
    """
    far = np.any(np.abs(off) > 0.5 * HALF_TURN, axis=1) & readings.active
    if far.any():
        row = int(np.argmax(far))
        raise readings.refuse(
            row,
            f"azimuth_counts, elevation_counts lie {off[row, 0]:+.0f}, {off[row, 1]:+.0f} from where the records point "
            "(expected less than a quarter turn: another pointing, target or station?)",
        )


class _Compared:
    """Parameters decided by the counts, in units of the priors.

    Only parameters that are not held.
    """

    def __init__(self, solution: CurvedFit) -> None:
        prior = np.array([p.u for p in solution.parameters[:P]])
        self.free = np.flatnonzero(prior > 0.0)
        u = prior[self.free]
        start = np.array([p.start for p in solution.parameters])[self.free]
        self.change = (solution.values[self.free] - start) / u
        self.left = solution.covariance[np.ix_(self.free, self.free)] / np.outer(u, u)
        values, vectors = np.linalg.eigh(np.eye(len(u)) - self.left)
        self.share, self.vectors = np.clip(values[::-1], 0.0, 1.0), vectors[:, ::-1]
        self.decided = int(np.count_nonzero(self.share > DECIDED))

    def total(self, level: float) -> CheckOutcome:
        """Joint test of laboratory and field.

        In all combinations that the counts determine.
        """
        informed = self.share > INFORMED
        along = self.vectors[:, informed].T @ self.change
        statistic, degrees = float(np.sum(along**2 / self.share[informed])), int(informed.sum())
        test = global_test(statistic, degrees, 2.0 * level)  # one side: agreeing too well is no fault
        passed = bool(statistic <= test.upper * degrees)
        text = (
            "laboratory and field agree"
            if passed
            else "the field contradicts the laboratory: look at the single changes"
        )
        return CheckOutcome(
            f"laboratory against field: chi-square, {degrees} combinations",
            statistic,
            test.upper * degrees,
            passed,
            text,
        )

    def single(self, level: float) -> list[CheckOutcome]:
        """Test of each parameter's change over its own standard uncertainty."""
        limit = w_critical(single_level(level, len(self.free)))
        outcomes = []
        for k, j in enumerate(self.free):
            share, name = 1.0 - self.left[k, k], PARAMETERS[j]
            if share <= INFORMED:
                outcomes.append(
                    CheckOutcome(
                        f"{name}: change over its u", float("nan"), float("nan"), None, "the counts say nothing of it"
                    )
                )
                continue
            ratio = float(self.change[k] / np.sqrt(share))
            remaining = np.sqrt(self.left[k, k])
            text = f"changed by {self.change[k]:+.2f} of the laboratory's u, of which {remaining:.2f} is left"
            outcomes.append(CheckOutcome(f"{name}: change over its u", abs(ratio), limit, abs(ratio) <= limit, text))
        return outcomes

    def combination(self, k: int) -> str:
        """Combination by its leading parameters, in units of their priors."""
        vector = self.vectors[:, k] * np.sign(self.vectors[np.argmax(np.abs(self.vectors[:, k])), k])
        order = [i for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > NAMED_PART]
        return " ".join(f"{vector[i]:+.2f} {PARAMETERS[self.free[i]]}" for i in order)


def _inseparable(solution: CurvedFit, predict: Callable[[np.ndarray], np.ndarray]) -> tuple[int, list[str]]:
    """Rank of the counts in the free parameters, and undetermined parameters.

    Parameters that no number of counts would determine.
    """
    free = [k for k, p in enumerate(solution.parameters[:P]) if p.u > 0.0]
    columns = []
    for k in free:
        aside = np.zeros(len(solution.values))
        aside[k] = solution.parameters[k].step
        columns.append((predict(solution.values + aside) - predict(solution.values - aside))[solution.fit.active])
    scaled = np.column_stack(columns)
    scaled = scaled / np.maximum(np.linalg.norm(scaled, axis=0), 1e-300)
    _, size, turned = np.linalg.svd(scaled)
    rank = int(np.count_nonzero(size > INDETERMINATE * size[0]))
    part = np.sum(turned[rank:] ** 2, axis=0)
    return rank, [PARAMETERS[k] for k, share in zip(free, part, strict=True) if share > INDETERMINATE]


def _calibration(
    readings: SheetReadings, solution: CurvedFit, predict: Callable[[np.ndarray], np.ndarray]
) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    compared = _Compared(solution)
    if not len(compared.free) or compared.share[0] <= INFORMED:
        raise EstimationError(
            "the counts decide nothing of the station: u_counts is far above what its records leave open"
        )
    free = [PARAMETERS[k] for k in compared.free]
    meaning = "lab and field together"
    calibrated, covariance = solution.quantities(
        [(name, *IN_FILES[name][:2], meaning, IN_FILES[name][2]) for name in free]
    )
    rank, loose = _inseparable(solution, predict)
    notes = [
        f"the counts decide {compared.decided} of {len(free)} combinations; strongest: "
        + "; ".join(compared.combination(k) for k in range(min(compared.decided, 5))),
        f"without the laboratory they would hold {rank} of {len(free)}"
        + (f"; these cannot be told apart by any counts: {', '.join(loose)}" if loose else ""),
    ]
    fixed = [name for k, name in enumerate(PARAMETERS) if k not in compared.free]
    if fixed:
        notes.append(f"held as the records have them, without a u: {', '.join(fixed)}")
    residual = fit.residual.reshape(-1, 2)
    words = readings.words.get("pointing", ("direct",) * len(readings))
    rows = tuple(
        (readings.words["target"][k], words[k], float(readings.get("azimuth_counts")[k]),
         float(readings.get("elevation_counts")[k]), float(residual[k, 0]), float(residual[k, 1]),
         statistic, state)
        for k, (statistic, state) in enumerate(row_ends(fit, readings.left_out, 2))
    )  # fmt: skip
    return Calibration(
        kind=KIND,
        title=f"{sheet.instrument} on {sheet.monument.monument}: laboratory against field",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=("target", "pointing", "azimuth_counts", "elevation_counts", "residual_azimuth_counts",
                 "residual_elevation_counts", fit.test, "state"),
        rows=rows,
        decisions=(compared.total(sheet.level), *compared.single(sheet.level), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=tuple(notes),
        curve=residuals_by_number(fit, 1.0),
        axes=("count: azimuth, elevation of each target", "residual (counts)"),
        method="The station's 13 parameters, with the records' standard uncertainties as priors, and the targets' "
        "coordinates with theirs, are adjusted to the counts at which the targets were found. Tilts, offsets and "
        "encoder waves of the mirror's record are counted exactly.",
        record=_records(solution, free),
    )  # fmt: skip


def _records(solution: CurvedFit, free: list[str]) -> dict[str, RecordValue]:
    """Keys of the monument's and of the mirror's record."""
    records: dict[str, dict[str, float]] = {"monument": {}, "mirror": {}}
    for name in free:
        key, _, size, record = IN_FILES[name]
        records[record][key] = solution.value(name) / size
        if record == "monument":
            records[record][f"u_{key}"] = solution.u(name) / size
    if "alpha1" in free:
        records["monument"]["azimuth_deg"] = float(np.mod(180.0 - solution.value("alpha1") / DEGREE, 360.0))
    for key, members, size in (
        ("u_offset_mm", ("dx", "dy", "dz"), MILLIMETRE),
        ("u_beta_rad", ("beta1", "beta2"), 1.0),
        ("u_zero_counts", ("na0", "ne0"), 1.0),
    ):
        u = max(solution.u(name) for name in members) / size
        if u > 0.0:  # none where the record has none
            records["mirror"][key] = u
    return {**records}


RECIPE = CalibrationKind(
    "a station's angles and zeros from targets found in the field, against the laboratory",
    LAYOUT,
    calibrate_search_results,
    plausible=Plausibility(
        scatter=ReadingScatter(20.0, "counts", 1.0, "a spiral search steps by some counts [PARKER04] section 2.4"),
        explained=0.99,
    ),
)
