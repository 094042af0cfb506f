"""Instrument reading of a length: scale and offset, known and estimated."""

from typing import Protocol

import numpy as np

from catseye.estimation.observations.kind import optional, value


class Scaled(Protocol):
    """Fields of a length observation; see `reading`."""

    @property
    def observed(self) -> np.ndarray: ...
    @property
    def scale(self) -> np.ndarray | float: ...
    @property
    def offset(self) -> np.ndarray | float: ...
    @property
    def nuisance(self) -> np.ndarray | None: ...
    @property
    def coefficient(self) -> np.ndarray | float: ...
    @property
    def scaling(self) -> np.ndarray | None: ...
    @property
    def scaling_coefficient(self) -> np.ndarray | float: ...


def reading_columns(group: Scaled) -> tuple[np.ndarray, np.ndarray]:
    """Columns (m, q) of a group's nuisance and (m, s) of its scaling parameters."""
    m = len(group.observed)
    first, second = (optional(c, m, 0) if c is None else c for c in (group.nuisance, group.scaling))
    return first, second


def reading(group: Scaled, x: np.ndarray, length: np.ndarray, *, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (m,) and Jacobian (m, w + q + s) of readings of a length.

    reading = (scale + sum c x[scaling]) length + offset + sum c x[nuisance].

    group    its scale, offset, nuisance (m, q), scaling (m, s) and their coefficients
    x        parameters
    length   (m,) m
    slope    (m, w) derivatives of the length
    """
    m = len(length)
    nuisance, scaling = reading_columns(group)
    factor: np.ndarray = np.broadcast_to(group.scale, (m,))
    values = group.offset
    extra = []
    if nuisance.shape[1]:
        coefficient = np.where(nuisance < 0, 0.0, group.coefficient)
        values = values + np.sum(coefficient * value(x, nuisance), axis=1)
        extra.append(np.broadcast_to(coefficient, (m, nuisance.shape[1])))
    if scaling.shape[1]:
        coefficient = np.where(scaling < 0, 0.0, group.scaling_coefficient)
        factor = factor + np.sum(coefficient * value(x, scaling), axis=1)
        extra.append(coefficient * length[:, None])
    return factor * length + values, np.concatenate([factor[:, None] * slope, *extra], axis=1)
