"""Fit of a structural model to targets in many postures.

Four things make the measured targets differ from the model: its free coefficients, the same in all postures; the
coefficients that stay fixed but have a covariance, the same in all postures too, hence parameters with a prior
that is not improved; the targets' places in their frames (the sheet), likewise with a prior; and the model's residual
in each posture anew (u of a motion), which is noise there, correlated between the targets of a posture.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import TypeVar

import numpy as np

from catseye.errors import EstimationError, InputError
from catseye.geometry.antenna.deformation import COMPONENTS
from catseye.records.site.structural_model import KEYS, FrameRecord, GroupRecord, MotionRecord, StructuralModel
from catseye.reduction.structure.antenna import UNITS, Antenna
from catseye.reduction.structure.corrections import (
    ITERATIONS,
    SETTLED,
    MeasuredPosture,
    ground_from_group,
    group_of,
    predicted_points,
    u_sheet,
)

Owner = TypeVar("Owner", FrameRecord, GroupRecord)

FLOATING = 1e-12  # of the normal matrix scaled to ones: an eigenvalue below it is an undetermined direction


@dataclass(frozen=True, eq=False)
class ModelFit:
    """Model coefficients from many postures.

    free                 (frame, component) in the order of the covariance, k coefficients each
    coefficients         frame: (6, k) m and rad, all of them
    covariance           of the free ones, m and rad
    places               target: (3,) m, correction of its place in its frame
    residuals            (n, 3) m of each posture, ground axes, observed less predicted
    pvv, degrees_of_freedom   of residuals with the model's scatter in each posture, places and priors
    """

    free: tuple[tuple[str, str], ...]
    coefficients: dict[str, np.ndarray]
    covariance: np.ndarray
    places: dict[str, np.ndarray]
    residuals: tuple[np.ndarray, ...]
    pvv: float
    degrees_of_freedom: int

    @property
    def variance_factor(self) -> float:
        """Ratio [pvv] / degrees of freedom, expectation 1."""
        return self.pvv / self.degrees_of_freedom


def fit_model(
    antenna: Antenna,
    epochs: Sequence[MeasuredPosture],
    *,
    free: Mapping[str, Sequence[str]],
) -> ModelFit:
    """Fit model coefficients to targets in many postures.

    antenna   the structural model to begin with
    epochs    postures with their targets
    free      frame or group: estimated components of shift_x, ..., turn_z; the others stay fixed

    A motion with a covariance brings it as the prior of its free coefficients; one without leaves them free. Each
    posture's scatter about the model (u of the motions on the way) and each target's place are modelled, see the
    module. Raises EstimationError where coefficients float, naming them, and InputError for an unknown frame or
    component.

    Source: [RAO73] section 4a (least squares with a full covariance); [JCGM102] for the covariance.
    """
    layout = _layout(antenna, free)
    targets = sorted({name for epoch in epochs for name in epoch.names})
    size = sum(len(antenna.motions[name].basis) for name, _ in layout)
    start, prior_normal = _priors(antenna, layout, size)
    theta, place = start.copy(), np.zeros(3 * len(targets))
    u = np.array([u_sheet(antenna, name) for name in targets])
    fixed, fixed_start = _fixed_coefficients(antenna, layout), size + len(place)
    for _ in range(ITERATIONS):
        normal = np.zeros((fixed_start + fixed.count, fixed_start + fixed.count))
        right, pvv, residuals, before = np.zeros(len(normal)), 0.0, [], []
        for epoch in epochs:
            design, misfit, spread = _rows(antenna, epoch, layout, targets, theta - start, place, fixed)
            weighted = np.linalg.solve(spread, np.column_stack([design, misfit]))
            normal += design.T @ weighted[:, :-1]
            right += design.T @ weighted[:, -1]
            pvv += float(misfit @ weighted[:, -1])
            residuals.append(misfit.reshape(-1, 3))
            before.append(design)
        normal[:size, :size] += prior_normal
        normal[size:fixed_start, size:fixed_start] += np.diag(np.repeat(u**-2, 3))
        normal[fixed_start:, fixed_start:] += np.eye(fixed.count)
        right[:size] -= prior_normal @ (theta - start)
        right[size:fixed_start] -= place * np.repeat(u**-2, 3)
        pvv += float((theta - start) @ prior_normal @ (theta - start) + place @ (place * np.repeat(u**-2, 3)))
        labels = [*_labels(antenna, layout), *(f"place of {n} {a}" for n in targets for a in "xyz")]
        inverse = _inverse(normal, [*labels, *(f"held {k}" for k in range(fixed.count))])
        step = inverse @ right
        theta, place = theta + step[:size], place + step[size:fixed_start]
        pvv -= float(
            right[fixed_start:] @ np.linalg.solve(normal[fixed_start:, fixed_start:], right[fixed_start:])
        )  # by the fixed ones
        if max(float(np.max(np.abs(design[:, :fixed_start] @ step[:fixed_start]))) for design in before) < SETTLED:
            break
    else:
        raise EstimationError(f"coefficients did not settle in {ITERATIONS} steps: a target is measured far off")
    rows = sum(3 * len(epoch.names) for epoch in epochs)
    priors = int(np.linalg.matrix_rank(prior_normal)) if prior_normal.any() else 0
    return ModelFit(
        free=layout,
        coefficients=_spread_out(antenna, layout, theta),
        covariance=inverse[:size, :size],
        places={name: place[3 * i : 3 * i + 3] for i, name in enumerate(targets)},
        residuals=tuple(residuals),
        pvv=pvv,
        degrees_of_freedom=rows + priors - size,
    )


def updated_model(
    record: StructuralModel, antenna: Antenna, fit: ModelFit, *, by: str, measured_on: date, report: str
) -> StructuralModel:
    """Structural model with fitted coefficients and their covariance.

    Ready for `structural_model_toml`.

    record        at the start of the fit
    antenna       of it
    fit           its new coefficients
    by            who measured
    measured_on   date
    report        its report

    Each motion keeps the covariance of its own coefficients; that between frames, and that with the targets' places
    (the sheet), is not in the file. A second fit from it on the same targets takes the sheet as
    independent: with the example's, two campaigns of 14 postures, its chi-squares are 1.2 where 1 is expected (u 10 %
    too small). Fit all postures at once instead.
    """
    named = sorted({name for name, _ in fit.free})
    changed = {name: _motion_record(_owner(record, name), antenna, fit, name) for name in named}

    def moved(owners: Sequence[Owner]) -> tuple[Owner, ...]:
        return tuple(
            owner.model_copy(update={"motion": changed[owner.name]}) if owner.name in changed else owner
            for owner in owners
        )

    values = {"frame": moved(record.frame), "group": moved(record.group)}
    who = {"by": by, "measured_on": measured_on, "report": report, "valid_until": None}
    copy = record.model_copy(update={**values, **who})
    return StructuralModel.model_validate(copy.model_dump())


def _motion_record(motion: MotionRecord, antenna: Antenna, fit: ModelFit, name: str) -> MotionRecord:
    """Motion with new values and covariance, in the file's units."""
    k = len(antenna.motions[name].basis)
    values = fit.coefficients[name] / UNITS[:, None]
    shaped: dict[str, tuple[float, ...] | tuple[tuple[float, ...], ...]] = {}
    for key, row in zip(KEYS, values, strict=True):
        cells = tuple(float(v) for v in row)
        width = len(motion.temperature_c) if motion.temperature_c is not None else 0
        shaped[key] = tuple(cells[i : i + width] for i in range(0, len(cells), width)) if width else cells
    covariance = np.array(antenna.motions[name].covariance)
    at, before = _indices(antenna, fit.free, name), 0
    for frame in dict.fromkeys(frame for frame, _ in fit.free):
        if frame == name:
            break
        before += len(_indices(antenna, fit.free, frame))
    columns = slice(before, before + len(at))
    covariance[at, :], covariance[:, at] = 0.0, 0.0
    covariance[np.ix_(at, at)] = fit.covariance[columns, columns]
    units = np.repeat(UNITS, k)
    rows = covariance / np.outer(units, units)
    rows = 0.5 * (rows + rows.T)
    return motion.model_copy(update={**shaped, "covariance": tuple(tuple(float(v) for v in row) for row in rows)})


def _owner(record: StructuralModel, name: str) -> MotionRecord:
    motion = next(entry.motion for entry in record.moving if entry.name == name)
    if motion is None:
        raise InputError(f"{name!r} has no motion in the structural model")
    return motion


def _rows(
    antenna: Antenna,
    epoch: MeasuredPosture,
    layout: tuple[tuple[str, str], ...],
    targets: list[str],
    change: np.ndarray,
    place: np.ndarray,
    fixed: "_FixedCoefficients",
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Design, misfit (3n,) and covariance of one posture.

    Design (3n, coefficients, places and fixed ones).
    """
    added: dict[str, np.ndarray] = {}
    row_of = {name: antenna.motions[name].basis.rows(epoch.posture) for name in {name for name, _ in layout}}
    first = 0
    for name, component in layout:
        k = row_of[name].shape[-1]
        six = added.setdefault(name, np.zeros(6))
        six[COMPONENTS.index(component)] += row_of[name] @ change[first : first + k]
        first += k
    places = {name: place[3 * i : 3 * i + 3] for i, name in enumerate(targets)}
    predicted, slopes = predicted_points(antenna, epoch, added, places=places)
    rows = 3 * len(epoch.names)
    columns = [
        np.outer(slopes[name][:, COMPONENTS.index(c)], row_of[name])
        if name in slopes
        else np.zeros((rows, row_of[name].shape[-1]))
        for name, c in layout
    ]
    by_place = np.zeros((rows, 3 * len(targets)))
    owners = [group_of(antenna, name) for name in epoch.names]
    out = {group: ground_from_group(antenna, epoch, group, added=added).rotation for group in set(owners)}
    spread = epoch.covariance.copy()
    for i, (name, group) in enumerate(zip(epoch.names, owners, strict=True)):
        at, column = slice(3 * i, 3 * i + 3), 3 * targets.index(name)
        by_place[at, column : column + 3] = out[group]
        fresh = antenna.u_points(group)[antenna.groups[group].names.index(name)] ** 2 - u_sheet(antenna, name) ** 2
        spread[at, at] += max(fresh, 0.0) * np.eye(3)
    by_fixed = np.zeros((rows, fixed.count))
    for name, slope in slopes.items():
        if name in antenna.motions:
            motion = antenna.motions[name]
            spread += slope @ np.diag(motion.u**2) @ slope.T
            if name in fixed.factors:
                begin, factor = fixed.factors[name]
                full = np.kron(np.eye(len(COMPONENTS)), motion.basis.rows(epoch.posture)[None])  # (6, 6 k)
                by_fixed[:, begin : begin + factor.shape[1]] = slope @ full @ factor
    misfit = (epoch.coordinates - predicted).ravel()
    return np.concatenate([*columns, by_place, by_fixed], axis=1), misfit, spread


@dataclass(frozen=True, eq=False)
class _FixedCoefficients:
    """Fixed coefficients with a covariance.

    Values off the model's = factor z, z standard normal, the same in all postures.

    factors   frame: its first z, and (6 k, m) m and rad
    count     of all z
    """

    factors: dict[str, tuple[int, np.ndarray]]
    count: int


def _fixed_coefficients(antenna: Antenna, layout: tuple[tuple[str, str], ...]) -> _FixedCoefficients:
    factors: dict[str, tuple[int, np.ndarray]] = {}
    first = 0
    for name, motion in antenna.motions.items():
        covariance = np.array(motion.covariance)
        if any(frame == name for frame, _ in layout):
            free = _indices(antenna, layout, name)
            covariance[free, :], covariance[:, free] = 0.0, 0.0
        size = np.sqrt(np.diag(covariance))
        scale = np.where(size > 0.0, size, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        real = values > FLOATING
        if real.any():
            factors[name] = (first, scale[:, None] * vectors[:, real] * np.sqrt(values[real]))
            first += int(real.sum())
    return _FixedCoefficients(factors, first)


def _layout(antenna: Antenna, free: Mapping[str, Sequence[str]]) -> tuple[tuple[str, str], ...]:
    for name, components in free.items():
        if name not in antenna.motions:
            raise InputError(f"{name!r} has no motion in the structural model (it has {', '.join(antenna.motions)})")
        for component in components:
            if component not in COMPONENTS:
                raise InputError(f"{name}: {component!r} is not a component (expected {', '.join(COMPONENTS)})")
    layout = tuple((name, c) for name, components in free.items() for c in COMPONENTS if c in components)
    if not layout:
        raise InputError("no coefficient is free: name a frame and its components")
    return layout


def _indices(antenna: Antenna, layout: tuple[tuple[str, str], ...], name: str) -> np.ndarray:
    """Positions of a frame's free coefficients among its own 6 k."""
    k = len(antenna.motions[name].basis)
    return np.concatenate([COMPONENTS.index(c) * k + np.arange(k) for frame, c in layout if frame == name])


def _priors(antenna: Antenna, layout: tuple[tuple[str, str], ...], size: int) -> tuple[np.ndarray, np.ndarray]:
    """Prior values (size,) and inverse covariance of the free coefficients.

    Zero without a covariance.
    """
    start, normal, first = np.zeros(size), np.zeros((size, size)), 0
    for name in dict.fromkeys(name for name, _ in layout):
        at = _indices(antenna, layout, name)
        rows = slice(first, first + len(at))
        start[rows] = antenna.motions[name].coefficients.ravel()[at]
        covariance = antenna.motions[name].covariance[np.ix_(at, at)]
        positive = np.diag(covariance) > 0.0
        if positive.any():
            size_of = np.sqrt(np.diag(covariance)[positive])
            scaled = covariance[np.ix_(positive, positive)] / np.outer(size_of, size_of)
            if np.linalg.eigvalsh(scaled)[0] < FLOATING:
                raise EstimationError(
                    f"the covariance of {name!r} ties free coefficients exactly: no prior can be "
                    "made of it; remove it from the file, or give each its own variance"
                )
            inverse = np.linalg.inv(scaled) / np.outer(size_of, size_of)
            where = first + np.flatnonzero(positive)
            normal[np.ix_(where, where)] = inverse
        first += len(at)
    return start, normal


def _spread_out(antenna: Antenna, layout: tuple[tuple[str, str], ...], theta: np.ndarray) -> dict[str, np.ndarray]:
    """Coefficients (6, k) of the frames that have free ones."""
    coefficients: dict[str, np.ndarray] = {}
    first = 0
    for name in dict.fromkeys(name for name, _ in layout):
        at = _indices(antenna, layout, name)
        values = np.array(antenna.motions[name].coefficients)
        values.ravel()[at] = theta[first : first + len(at)]
        coefficients[name] = values
        first += len(at)
    return coefficients


def _labels(antenna: Antenna, layout: tuple[tuple[str, str], ...]) -> list[str]:
    return [f"{name} {c} {i}" for name, c in layout for i in range(1, len(antenna.motions[name].basis) + 1)]


def _inverse(normal: np.ndarray, labels: list[str]) -> np.ndarray:
    """Inverse of a normal matrix.

    EstimationError with the parameters that float.
    """
    size = np.sqrt(np.diag(normal))
    if np.any(size == 0.0):
        raise EstimationError(f"{labels[int(np.argmin(size))]} floats: no measured target depends on it")
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    if values[0] < FLOATING:
        worst = np.argsort(-np.abs(vectors[:, 0]))[:3]
        some = ", ".join(labels[i] for i in worst)
        raise EstimationError(f"these coefficients float together: {some}; measure more postures or free fewer")
    return (vectors / values) @ vectors.T / np.outer(size, size)
