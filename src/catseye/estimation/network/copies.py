"""Copies of a group of observations, each over a parameter vector of its own: many networks predicted at once.

A kind of observation knows one parameter vector. Copies are one group of the same kind whose columns point into as many
vectors laid end to end, so that one call predicts them all. Which fields hold columns follows from their types; the
result is compared with the group itself, and a group of which this is not true is predicted one vector at a time.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.observations.kinds import Joint, ObservationGroup

SAME = 1e-12  # relative difference of a copy's prediction from the group's: sums in another order
PROBE = 1e-6  # relative change of the parameters at which copies are compared

Predict = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def prediction(group: ObservationGroup, x: np.ndarray) -> Predict:
    """Function that predicts a group at many parameter vectors.

    group   any kind
    x       (n,) parameters at which the group is defined

    The function takes parameters (r, n) and observed values (r, m), which select the turn of angles, and returns values
    (r, m) and Jacobians (r, m, w), over the group's own columns.
    """
    try:
        together = _Together(group)
        if _agree(group, together, x):
            return together
    except (EstimationError, ValueError, IndexError, TypeError):  # fields of another meaning than their types say
        pass
    return partial(_one_by_one, group)


def _one_by_one(group: ObservationGroup, x: np.ndarray, observed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and Jacobians, one parameter vector after the other."""
    pairs = [_with(group, o).predict(row) for row, o in zip(x, observed, strict=True)]
    return np.stack([values for values, _ in pairs]), np.stack([jacobian for _, jacobian in pairs])


class _Together:
    """Prediction by copies of a group, which are kept for as many vectors again."""

    def __init__(self, group: ObservationGroup) -> None:
        self._group = group
        self._parts = tuple(_Together(part) for part in group.parts) if isinstance(group, Joint) else ()
        self._copies, self._fields = 0, dict[str, Any]()

    def __call__(self, x: np.ndarray, observed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, m = observed.shape
        if self._parts:
            cuts = np.cumsum([len(part._group.observed) for part in self._parts])[:-1]
            pairs = [part(x, o) for part, o in zip(self._parts, np.split(observed, cuts, axis=1), strict=True)]
            width = max(jacobian.shape[2] for _, jacobian in pairs)
            wide = [np.pad(j, ((0, 0), (0, 0), (0, width - j.shape[2]))) for _, j in pairs]
            return np.concatenate([values for values, _ in pairs], axis=1), np.concatenate(wide, axis=1)
        if r != self._copies:
            self._copies, self._fields = r, _fields(self._group, r, x.shape[1])
        copies = replace(self._group, observed=observed.ravel(), **self._fields)  # type: ignore[type-var]
        values, jacobian = copies.predict(x.ravel())
        return values.reshape(r, m), np.asarray(jacobian).reshape(r, m, -1)


def _fields(group: ObservationGroup, copies: int, size: int) -> dict[str, Any]:
    """Fields of a group that differ in its copies.

    copies   number of them
    size     n of the parameters of one
    """
    m = len(group.observed)
    every = {f.name: getattr(group, f.name) for f in fields(group)}  # type: ignore[arg-type]
    arrays = {k: v for k, v in every.items() if isinstance(v, np.ndarray) and k not in ("observed", "covariance")}
    columns = {k for k, v in arrays.items() if np.issubdtype(v.dtype, np.integer) and k != "axis"}
    lengths = {len(arrays[k]) for k in columns if arrays[k].ndim == 1 and m % len(arrays[k]) == 0} | {m}
    rows = min(lengths)  # one a row, a vector or a point
    offset = size * np.arange(copies)
    result: dict[str, Any] = {"covariance": np.ones(m * copies)}  # of no concern to a prediction
    for name, array in arrays.items():
        columns_of = array
        if name in columns and len(array) not in lengths:  # the same columns in every row
            columns_of = np.broadcast_to(array, (rows, array.shape[-1]))
        if len(columns_of) not in lengths and name not in columns:
            continue
        repeated = np.broadcast_to(columns_of, (copies, *columns_of.shape))
        if name in columns:
            shift = offset.reshape(-1, *(1,) * columns_of.ndim)
            repeated = np.where(columns_of < 0, columns_of, columns_of + shift)
        result[name] = repeated.reshape(-1, *columns_of.shape[1:])
    return result


def _agree(group: ObservationGroup, together: Predict, x: np.ndarray) -> bool:
    """True if two copies predict as the group does, at and near x."""
    near = x + PROBE * np.cos(np.arange(len(x))) * np.maximum(1.0, np.abs(x))
    at, observed = np.stack([x, near]), np.stack([group.observed] * 2)
    right, ours = _one_by_one(group, at, observed), together(at, observed)
    return all(
        a.shape == b.shape and np.allclose(a, b, rtol=SAME, atol=SAME * max(1.0, np.abs(a).max(initial=0.0)))
        for a, b in zip(right, ours, strict=True)
    )


def _with(group: ObservationGroup, observed: np.ndarray) -> ObservationGroup:
    """Group with other observed values."""
    return replace(group, observed=observed)  # type: ignore[type-var]
