"""Actuator corrections from the measured prisms.

Interpolation with its uncertainty, and limits. An actuator whose travel is along the unit vector m raises the surface
at its place by m . n of its travel, n the surface's normal; a correction that brings a deviation d to zero is
-d / (m . n). Along the normal it is -d.

"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError, InputError
from catseye.estimation.shapes.paraboloid import cosine, design_rows
from catseye.estimation.shapes.surface_field import (
    FieldPrediction,
    MeasuredField,
    Roughness,
    estimate_roughness,
    foretell,
)
from catseye.optics.zernike import terms, zernike
from catseye.records.files.refusal import shown
from catseye.records.panels.actuators import LIMIT_MM, STEP_MM, ActuatorCorrection
from catseye.records.site.folder import SiteFolder
from catseye.reduction.surface.shape import LitAperture, SurfaceShape

NEAR = 1e-9  # of a trend's columns: relative remainder of one beside the others
TREND_TERMS = 10  # Zernike terms to the third order
SUPPORTS = 3

Travel = Literal["normal", "axis"]


@dataclass(frozen=True, eq=False)
class Actuators:
    """Corrections of m actuators.

    names, places     (m, 3) m, reflector frame, on the design paraboloid
    deviation         (m,) m, along the normal, against the fitted paraboloid
    covariance        (m, m) m^2, of predicted minus true
    correction        (m,) m, of the travel
    u_correction      (m,) m
    position          (m,) m, travel before
    weights           (m, k) of the measured prisms
    prisms            k names
    measured          (m,) True where the actuator's own prism was measured
    roughness         of the surface beside its trend
    """

    names: tuple[str, ...]
    places: np.ndarray
    deviation: np.ndarray
    covariance: np.ndarray
    correction: np.ndarray
    u_correction: np.ndarray
    position: np.ndarray
    weights: np.ndarray
    prisms: tuple[str, ...]
    measured: np.ndarray
    roughness: Roughness

    @property
    def within(self) -> np.ndarray:
        """True (m,) where the target is within the actuator's limits.

        Targets are not clipped to them.
        """
        return np.abs(self.position + self.correction) <= LIMIT_MM * MILLIMETRE


def actuators_of(site: SiteFolder) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and design places (m, 3), m, of a site's actuators.

    One under each prism of the reflector frame.

    Raises InputError for a site without any.
    """
    prisms = {n: t for n, t in sorted(site.targets.items()) if t.shapes_dish}
    if not prisms:
        raise InputError(f"{site.directory}: targets.toml has no prism in the reflector frame, so no actuator")
    return tuple(prisms), np.array([t.position_mm for t in prisms.values()]) * MILLIMETRE


def corrections(
    shape: SurfaceShape,
    names: tuple[str, ...],
    places: np.ndarray,
    *,
    positions: Mapping[str, float] | None = None,
    travel: Travel = "normal",
    roughness: Roughness | None = None,
) -> Actuators:
    """Corrections that bring every actuator onto the fitted paraboloid.

    shape       one epoch's surface
    names       of m actuators; one of a prism's name has that prism
    places      (m, 3) m, reflector frame
    positions   travel of each before, mm, by name; the middle without any
    travel      along the surface's "normal" or the paraboloid's "axis"
    roughness   of the surface; None: estimated from the prisms

    The model: ten Zernike terms and the paraboloid's own parameters, free; plus a smooth part and an independent part
    per point (`estimation.shapes.surface_field`). Raises InputError for a position without its actuator,
    EstimationError where the prisms are too few.
    """
    own_place = {name: row for row, name in enumerate(shape.prisms.names)}
    prism_rows = np.array([own_place.get(name, -1) for name in names])
    local, targets = shape.fit.local[:, :2], places[:, :2]
    trend, wanted_trend = _trend(shape, local, targets)
    values, noise = shape.fit.deviation, shape.fit.along
    rough = roughness or estimate_roughness(local, values, noise, trend=trend)
    nominal_design = _parameter_rows(shape, targets)
    foretold: FieldPrediction = foretell(
        MeasuredField(local, values, noise, trend),
        targets,
        wanted_trend,
        roughness=rough,
        same=prism_rows,
        design=shape.fit.design,
        gain=shape.fit.gain,
        wanted_design=nominal_design,
    )
    lean = np.ones(len(names)) if travel == "normal" else cosine(places, shape.fit.focal_length)
    return Actuators(
        names,
        places,
        foretold.value,
        foretold.covariance,
        -foretold.value / lean,
        np.sqrt(np.diag(foretold.covariance)) / lean,
        _positions(names, positions or {}),
        foretold.weights,
        shape.prisms.names,
        prism_rows >= 0,
        rough,
    )


def rows_of(actuators: Actuators) -> list[ActuatorCorrection]:
    """Table of corrections, a record per actuator, in mm.

    EstimationError for a number outside the table's range.
    """
    records = []
    u = np.sqrt(np.diag(actuators.covariance))
    within = actuators.within
    for row, name in enumerate(actuators.names):
        size = np.abs(actuators.weights[row])
        most = np.argsort(size)[::-1][:SUPPORTS]
        correction = float(actuators.correction[row] / MILLIMETRE)
        if not abs(correction) < 1000.0:
            raise EstimationError(f"actuator {name}: a correction of {correction:.4g} mm (expected below 1000)")
        steps = round(correction / STEP_MM)
        position = float(actuators.position[row] / MILLIMETRE)
        x, y, z = (round(float(v), 9) for v in actuators.places[row])
        records.append(
            ActuatorCorrection(
                actuator=name,
                x_m=x,
                y_m=y,
                z_m=z,
                deviation_mm=float(actuators.deviation[row] / MILLIMETRE),
                u_deviation_mm=float(u[row] / MILLIMETRE),
                correction_mm=correction,
                u_correction_mm=float(actuators.u_correction[row] / MILLIMETRE),
                steps=steps,
                left_mm=correction - steps * STEP_MM,
                position_mm=position,
                target_mm=position + correction,
                within_limits="yes" if within[row] else "no",
                how="measured" if actuators.measured[row] else "foretold",
                prisms=" ".join(actuators.prisms[k] for k in most),
                weight=float(size[most].sum() / size.sum()),
            )
        )
    return records


def _trend(shape: SurfaceShape, local: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the trend, at prisms and at actuators.

    They span the Zernike terms and the paraboloid's parameters.
    """
    aperture: LitAperture = shape.aperture
    low = terms(TREND_TERMS, "noll")
    at_prisms, at_targets = aperture.unit(local), aperture.unit(targets)
    one = np.column_stack([shape.fit.design, zernike(low, at_prisms[:, 0], at_prisms[:, 1])])
    two = np.column_stack([_parameter_rows(shape, targets), zernike(low, at_targets[:, 0], at_targets[:, 1])])
    size = np.linalg.norm(one, axis=0)
    orthogonal, triangle = np.linalg.qr(one / size)
    independent = np.abs(np.diag(triangle)) > NEAR
    if independent.all():
        return orthogonal, np.linalg.solve(triangle.T, (two / size).T).T
    return _trimmed(one / size, two / size, independent)


def _trimmed(one: np.ndarray, two: np.ndarray, independent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    orthogonal, triangle = np.linalg.qr(one[:, independent])
    return orthogonal, np.linalg.solve(triangle.T, two[:, independent].T).T


def _parameter_rows(shape: SurfaceShape, targets: np.ndarray) -> np.ndarray:
    """Rows (m, p) of `ParaboloidFit.design` at other places of the surface."""
    return design_rows(shape.fit, targets, shape.prisms.nominal)


def _positions(names: tuple[str, ...], typed: Mapping[str, float]) -> np.ndarray:
    for name in typed:
        if name not in names:
            raise InputError(f"actuator = {shown(name)} of the positions is unknown at this site")
    return np.array([typed.get(name, 0.0) for name in names]) * MILLIMETRE
