"""Monument azimuth: direction of z^, and alpha1, by directions.

Directions on a Kelvin mount to known points, stars and references.

The circle is tied to the mount in one of three ways: a Kelvin plate whose circle reads a known direction of z^
(`plate_zero_deg`), references in the lab before and after the instrument was carried to the field with its circle
unlocked, or a reference on the mount itself, such as a target over the v-block. Model and signs: directions.py.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, TWO_PI
from catseye.records.files.readings import SheetReadings
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, Cell
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import CalibrationFit, Effect, FitOptions, ObservedScatter, fit_readings
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    ReadingScatter,
    provenance,
    quantities,
    scatter_notes,
)
from catseye.reduction.calibrations.monument.azimuth_sheet import KIND, LAYOUT, AzimuthSheet
from catseye.reduction.calibrations.monument.directions import (
    AFTER,
    BEFORE,
    FIELD,
    DirectionSights,
    SightConditions,
    geometry_of,
    leaning,
    sights_of,
    wrapped,
)

ROUNDS, ENOUGH = 12, 1e-11  # rad; the offset of the instrument over the length of a sight is the rate, 1e-2 at worst
CLOSURE_FACTOR = 3.0  # of its standard uncertainty, beyond which a closure is named
STEPS = {"angle": ARCSECOND, "length": 1e-4, "time": 1.0}


@dataclass(frozen=True, eq=False)
class LinearisedDirections:
    """Circle readings linearised about an azimuth and zeros.

    observed = design x + effects, rad.

    observed   (m,)
    design     (m, p) by the azimuth of z^ and, where the plate does not tell it, the zero of each set
    effects    systematic, with priors
    """

    observed: np.ndarray
    design: np.ndarray
    effects: list[Effect]


def calibrate_azimuth(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Azimuth of a mount's line fixed point to v-block, and alpha1.

    In the ground frame.

    readings   columns target, direction_deg, perhaps face, place, set, zenith_deg, mjd_utc; sheet AzimuthSheet
    reject     leave out what the tests reject

    Raises InputError for targets missing in the sheet or a circle without a connection to the mount,
    EstimationError where nothing in the field determines the azimuth.

    Source: [PARKER04] sections 2.2.1 and 2.5, eq. 2.6 (its example turns x^ to 32° 11' 50", z^ looks 90° further);
    [JCGM100] 5.1.3 (propagation); geometry/frames/plumb.py (convergence and Laplace's equation), geometry/sky/star.py.
    """
    sights = sights_of(readings)
    tied = _tied(sights)
    start = _start(sights, tied)
    at, active = start, readings.active
    for turn in range(ROUNDS):
        linear = _linear(sights, at, tied)
        fit = _fitted(sights, linear, active, reject=reject and turn > 0)
        active = fit.active
        moved, at = abs(wrapped(fit.x[0] - at[0])), fit.x
        if turn > 0 and moved < ENOUGH:
            break
    else:
        raise refusal(readings.file, f"the azimuth does not settle ({moved:.1e} rad in the last round): is a point at "
                                     "the instrument itself?")  # fmt: skip
    return _calibration(sights, fit, linear)


def _tied(sights: DirectionSights) -> bool:
    """True if the plate determines the circle's zero.

    Else each set of circle readings must see a reference.
    """
    readings = sights.readings
    sheet, on = readings.sheet, readings.active
    for k, name in enumerate(sights.sets):
        rows = on & (sights.of_set == k)
        lab = np.isin(sights.place, (BEFORE, AFTER))
        if sheet.plate_zero_deg is None and not (rows & sights.are("reference")).any():
            raise refusal(
                readings.file,
                f"set {name} sees no reference: nothing ties the circle to the mount (expected a reference, or "
                f"plate_zero_deg in {readings.sheet_file})",
            )
        if (rows & lab).any() and sheet.u_transport_arcsec is None:
            raise refusal(
                readings.sheet_file, "u_transport_arcsec is missing (needed as the instrument was carried from the lab)"
            )
    if not (on & ~sights.are("reference") & (sights.place == FIELD)).any():
        raise refusal(readings.file, "no known point and no star was seen in the field (expected one at least)")
    return sheet.plate_zero_deg is not None


def _start(sights: DirectionSights, tied: bool) -> np.ndarray:
    """Azimuth of z^ and the circle's zeros, from one reading each."""
    sheet, on = sights.readings.sheet, sights.readings.active
    plain, _ = geometry_of(sights, 0.0, SightConditions())
    zeros = []
    for k in range(len(sights.sets)):
        rows = on & (sights.of_set == k) & sights.are("reference")
        first = int(np.argmax(rows))
        zeros.append(sheet.plate_zero_deg * DEGREE if tied else sights.observed[first] - plain[first])
    row = int(np.argmax(on & ~sights.are("reference") & (sights.place == FIELD)))
    azimuth = plain[row] - (sights.observed[row] - zeros[sights.of_set[row]])
    return np.array([azimuth, *([] if tied else zeros)])


def _linear(sights: DirectionSights, at: np.ndarray, tied: bool) -> LinearisedDirections:
    """Readings linearised about the latest (azimuth, zeros).

    The parameters themselves, not their changes, are estimated, so that the priors of the effects stay about zero.
    """
    sheet = sights.readings.sheet
    m = len(sights.observed)

    def predicted(azimuth: float, changed: SightConditions) -> np.ndarray:
        turned, zenith = geometry_of(sights, azimuth, changed)
        lean = leaning(
            sights, turned, zenith, lean_x=sheet.lean_x_arcsec * ARCSECOND, lean_z=sheet.lean_z_arcsec * ARCSECOND
        )
        return turned + lean

    def slope(step: float, up: tuple[float, SightConditions], down: tuple[float, SightConditions]) -> np.ndarray:
        return wrapped(predicted(*up) - predicted(*down)) / (2.0 * step)

    base = SightConditions()
    column = slope(STEPS["angle"], (at[0] + STEPS["angle"], base), (at[0] - STEPS["angle"], base))
    sets = np.eye(len(sights.sets))[sights.of_set]
    zeros = sets @ (np.full(len(sights.sets), sheet.plate_zero_deg * DEGREE) if tied else at[1:])
    model = predicted(at[0], base) + zeros
    off = wrapped(sights.observed - model)
    design = column[:, None] if tied else np.column_stack([column, sets])
    turned, zenith = geometry_of(sights, at[0], base)
    effects = _instrument_effects(sights, turned, zenith)
    if tied:
        effects.append(Effect("circle's zero of the plate", np.full(m, ARCSECOND), sheet.u_plate_zero_arcsec, "arcsec"))
    for name, unit, u, step, change in _changes(sights):
        effects.append(Effect(name, slope(step, (at[0], change(step)), (at[0], change(-step))), u, unit))
    return LinearisedDirections(off + design @ at, design, effects)


def _instrument_effects(sights: DirectionSights, turned: np.ndarray, zenith: np.ndarray) -> list[Effect]:
    """Effects of the instrument, references and transport.

    Collimation, trunnion axis, lean of the vertical axis, the known directions of references, the transport.
    """
    sheet = sights.readings.sheet
    per = ARCSECOND
    effects = [
        Effect("collimation", per * sights.face / np.sin(zenith), sheet.u_collimation_arcsec, "arcsec"),
        Effect("trunnion axis", per * sights.face / np.tan(zenith), sheet.u_trunnion_arcsec, "arcsec"),
        Effect(
            "lean of the axis to x^",
            leaning(sights, turned, zenith, lean_x=per, lean_z=0.0),
            sheet.u_lean_arcsec,
            "arcsec",
        ),
        Effect(
            "lean of the axis to z^",
            leaning(sights, turned, zenith, lean_x=0.0, lean_z=per),
            sheet.u_lean_arcsec,
            "arcsec",
        ),
    ]
    for k, reference in enumerate(sheet.reference):
        rows = sights.are("reference") & (sights.which == k)
        effects.append(Effect(f"v-block from {reference.name}", -per * rows, reference.u_v_block_arcsec, "arcsec"))
    if sheet.u_transport_arcsec is None:
        return effects
    for k, name in enumerate(sights.sets):
        rows = sights.of_set == k
        if not (rows & np.isin(sights.place, (BEFORE, AFTER))).any():
            continue
        # A walk of the circle between the two visits to the lab: what the closure shares in proportion, and the bridge.
        u = sheet.u_transport_arcsec
        effects.append(Effect(f"closure of set {name}", per * rows * sights.share, u, "arcsec"))
        bridge = np.sqrt(sights.share * (1.0 - sights.share))
        effects.append(Effect(f"transport of set {name} beyond its closure", per * rows * bridge, u, "arcsec"))
    return effects


def _changes(sights: DirectionSights) -> list[tuple[str, str, float, float, Callable[[float], SightConditions]]]:
    """Changes of the geometry's inputs.

    (name, unit, u, step, change of a step -> conditions); u in the unit of the step.
    """
    sheet = sights.readings.sheet
    angle, length = STEPS["angle"], STEPS["length"]

    def offset_along(axis: np.ndarray) -> Callable[[float], SightConditions]:
        return lambda s: SightConditions(offset=s * axis)

    def points_along(shape: np.ndarray) -> Callable[[float], SightConditions]:
        return lambda s: SightConditions(points=s * shape)

    changes: list[tuple[str, str, float, float, Callable[[float], SightConditions]]] = [
        ("xi", "rad", sheet.u_deflection_arcsec * ARCSECOND, angle, lambda s: SightConditions(xi=s)),
        ("eta", "rad", sheet.u_deflection_arcsec * ARCSECOND, angle, lambda s: SightConditions(eta=s)),
    ]
    if sights.are("star").any():
        late = float(np.hypot(sheet.u_ut1_utc_s, sheet.u_clock_s))
        u_pole = sheet.u_pole_arcsec * ARCSECOND
        changes += [
            ("time and UT1", "s", late, STEPS["time"], lambda s: SightConditions(time=s)),
            ("pole x", "rad", u_pole, angle, lambda s: SightConditions(pole=(s, 0.0))),
            ("pole y", "rad", u_pole, angle, lambda s: SightConditions(pole=(0.0, s))),
        ]
    u_offset = sheet.u_instrument_mm * MILLIMETRE
    for k, axis in enumerate(("x", "y", "z")):
        changes.append((f"instrument d{axis}", "m", u_offset, length, offset_along(np.eye(3)[k])))
    for number, column in enumerate(_coordinate_columns(sheet)):
        size = float(np.abs(column).max())
        shape = column.reshape(-1, 3) / size
        changes.append((f"coordinates, component {number + 1}", "m", size, length, points_along(shape)))
    return changes


def _coordinate_columns(sheet: AzimuthSheet) -> list[np.ndarray]:
    """Columns (3 n,), m, of the coordinates' covariance.

    Their products with independent unit effects have it.
    """
    if sheet.covariance_mm2:
        values, vectors = np.linalg.eigh(np.array(sheet.covariance_mm2))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
    else:
        sigmas = [sheet.u_x_mm, sheet.u_y_mm, sheet.u_z_mm]
        root = np.diag([*sigmas, *(u for p in sheet.point for u in (p.u_x_mm, p.u_y_mm, p.u_z_mm))])
    return [column * MILLIMETRE for column in root.T if np.abs(column).max() > 1e-9]


def _fitted(
    sights: DirectionSights, linear: LinearisedDirections, active: np.ndarray, *, reject: bool
) -> CalibrationFit:
    sheet, m = sights.readings.sheet, len(sights.observed)
    scatter = ObservedScatter(np.zeros((m, m)), {"scatter of one direction": np.eye(m)}, size=TWO_PI)
    if sheet.u_direction_arcsec is not None:
        scatter = ObservedScatter((sheet.u_direction_arcsec * ARCSECOND) ** 2 * np.eye(m))
    names = ["azimuth of z^", *(f"circle's zero, set {name}" for name in sights.sets)]
    return fit_readings(
        linear.observed,
        linear.design,
        scatter,
        names=names[: linear.design.shape[1]],
        effects=linear.effects,
        options=FitOptions(active=active, reject=reject, level=sheet.level),
    )


def _closures(sights: DirectionSights, fit: CalibrationFit, effects: list[Effect]) -> list[tuple[str, float, float]]:
    """Closure of each set: lab after minus before (rad), with u.

    u: scatter of readings, transport, errors that both visits do not share.
    """
    closures = []
    plain = sights.observed - geometry_of(sights, float(fit.x[0]), SightConditions())[0]
    for k, name in enumerate(sights.sets):
        rows = [fit.active & (sights.of_set == k) & (sights.place == end) for end in (BEFORE, AFTER)]
        if not (rows[0].any() and rows[1].any()):
            continue
        weight = np.zeros(len(plain))
        for one, sign in zip(rows, (-1.0, 1.0), strict=True):
            faces = np.unique(sights.face[one])
            for f in faces:  # faces have one mean each, so that the collimation goes out where both were read
                face_rows = one & (sights.face == f)
                weight[face_rows] = sign / (len(faces) * np.count_nonzero(face_rows))
        closure = float(weight @ wrapped(plain - plain[np.argmax(rows[0])]))
        shared = sum((float(weight @ e.column) * e.u) ** 2 for e in effects)
        closures.append((name, closure, float(np.sqrt(np.sum((weight * fit.sigma) ** 2) + shared))))
    return closures


def _rows(sights: DirectionSights, fit: CalibrationFit, azimuth: float) -> tuple[tuple[Cell, ...], ...]:
    """Table of sights: azimuth, zenith angle (degrees), and residual.

    About the plumb line.

    azimuth   rad, of z^
    """
    readings = sights.readings
    turned, zenith = geometry_of(sights, float(fit.x[0]), SightConditions())
    bearing = np.degrees(np.mod(turned + azimuth, TWO_PI))
    residual = fit.residual / ARCSECOND
    return tuple(
        (
            str(sights.sets[sights.of_set[k]]),
            str(sights.place[k]),
            readings.words["target"][k],
            "left" if sights.face[k] > 0.0 else "right",
            float(readings.get("direction_deg")[k]),
            float(bearing[k]),
            float(zenith[k] / DEGREE),
            float(residual[k]),
            float(fit.statistic[k]),
            state,
        )
        for k, state in enumerate(fit.state(readings.left_out))
    )


def _closure_decisions(sights: DirectionSights, fit: CalibrationFit, effects: list[Effect]) -> list[CheckOutcome]:
    """Check of the closure of each set with two visits to the lab.

    Against three of its u.
    """
    return [
        CheckOutcome(
            f"closure of set {name}, size in arcsec",
            abs(closure) / ARCSECOND,
            CLOSURE_FACTOR * u / ARCSECOND,
            bool(abs(closure) <= CLOSURE_FACTOR * u),
            "circle against the mount, lab after less before; limit three standard uncertainties",
        )
        for name, closure, u in _closures(sights, fit, effects)
    ]


def _calibration(sights: DirectionSights, fit: CalibrationFit, linear: LinearisedDirections) -> Calibration:
    readings, sheet = sights.readings, sights.readings.sheet
    azimuth = float(np.mod(fit.x[0], TWO_PI))
    alpha1 = float(wrapped(np.array(np.pi - azimuth)))
    turn = np.zeros((2, len(fit.x)))
    turn[:, 0] = [1.0 / DEGREE, -1.0]
    covariance = turn @ fit.covariance @ turn.T
    keys = [
        ("azimuth_deg", "degrees", "azimuth of the line fixed point to v-block (z^), clockwise from the frame's north"),
        ("alpha1_rad", "rad", "pi - azimuth, turn of the mount about y^"),
    ]
    residual = fit.residual / ARCSECOND
    number = np.arange(1, len(readings) + 1)
    on = fit.active
    return Calibration(
        kind=KIND,
        title=f"Azimuth of monument {sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantities(keys, np.array([azimuth / DEGREE, alpha1]), covariance, fit=fit, turn=turn),
        covariance=covariance,
        columns=("set", "place", "target", "face", "direction_deg", "azimuth_deg", "zenith_deg", "residual_arcsec",
                 fit.test, "state"),
        rows=_rows(sights, fit, azimuth),
        decisions=(*_closure_decisions(sights, fit, linear.effects), *fit.decisions()),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"x^ looks to the azimuth {_dms(azimuth - 0.5 * np.pi)}, z^ to {_dms(azimuth)}",
            f"the scatter of the readings alone gives {np.sqrt(fit.scattered[0, 0]) / ARCSECOND:.2g}\", all together "
            f"{np.sqrt(fit.covariance[0, 0]) / ARCSECOND:.2g}\"; largest: {_largest(fit, linear)}",
            "azimuth_deg of a sight is about the plumb line, counted from the ground frame's north at z^",
            "stars: UT1 - UTC = "
            f"{sheet.ut1_utc_s:g} s, u {sheet.u_ut1_utc_s:g} s, as the sheet states" if sights.are("star").any()
            else "no star was seen",
            *scatter_notes(fit, "arcsec", ARCSECOND, sought=1),
        ),
        curve={
            "readings": (number[on], residual[on]),
            "left out": (number[~on], residual[~on]),
            "fit": (number, np.zeros(len(number))),
        },
        axes=("reading", "residual (arcsec)"),
        method="Circle readings on the Kelvin mount are adjusted to known points, stars and references about the plumb "
        "line at the monument: azimuth of the v-block and zero of the circle, with collimation, trunnion axis, lean of "
        "the vertical axis, transport, coordinates, deflection, time and pole as parameters with priors. The azimuth "
        "is that in the ground frame: convergence of the meridians and Laplace's equation are in the rotation.",
        record={
            "azimuth_deg": azimuth / DEGREE,
            "alpha1_rad": alpha1,
            "u_alpha1_rad": float(np.sqrt(covariance[1, 1])),
        },
    )  # fmt: skip


def _largest(fit: CalibrationFit, linear: LinearisedDirections) -> str:
    """Three effects with the largest shares of the azimuth's u, arcseconds.

    Gain times column times u.
    """
    on, acting = fit.active, [e for e in linear.effects if e.u > 0.0]
    columns = np.column_stack([np.zeros(int(on.sum())), *(e.column[on] * e.u for e in acting)])
    design = linear.design[on]
    weight = np.linalg.inv(np.diag(fit.sigma[on] ** 2) + columns @ columns.T)
    gain = np.linalg.solve(design.T @ weight @ design, design.T @ weight)[0]
    parts = np.abs(gain @ columns[:, 1:]) / ARCSECOND
    most = np.argsort(-parts)[:3]
    return "; ".join(f'{acting[k].name} {parts[k]:.2g}"' for k in most) or "none"


def _dms(angle: float) -> str:
    """Degrees, minutes, seconds with a decimal.

    >>> print(_dms(np.radians(32 + 11 / 60 + 50 / 3600)))
    32° 11' 50.0"
    """
    tenths = round(np.degrees(np.mod(angle, TWO_PI)) * 36_000.0) % (360 * 36_000)
    degrees, remainder = divmod(tenths, 36_000)
    minutes, seconds = divmod(remainder, 600)
    return f"{degrees}° {minutes:02d}' {seconds / 10:04.1f}\""


CIRCLE = ReadingScatter(10.0, "arcsec", ARCSECOND, "a theodolite reads to 2 arcsec, a star is timed to 1 s")
RECIPE = CalibrationKind(
    "azimuth of a Kelvin mount from directions to known points, stars and references",
    LAYOUT,
    calibrate_azimuth,
    Plausibility(scatter=CIRCLE),
)
