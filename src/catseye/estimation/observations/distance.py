"""Distances between two points, scaled, with an offset and linear nuisance terms: what a ranger reports."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Distances:
    """observed = scale |target - origin| + offset + sum over q of coefficient_q x[nuisance_q] + error.

    name          what the group is, for reports
    observed      (m,) metres
    covariance    (m, m) square metres, positive definite; or (m,) of independent ones
    origin        (m,) index of the x coordinate of the point measured from (y and z follow it)
    target        (m,) the same of the point measured to
    scale         (m,) what a metre of distance reads, e.g. the group index of the path
    offset        (m,) metres
    nuisance      (m, q) indices of parameters that act linearly (repeats allowed)
    coefficient   (m, q) their derivatives, metres per unit
    """

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    scale: np.ndarray
    offset: np.ndarray
    nuisance: np.ndarray
    coefficient: np.ndarray

    @cached_property
    def _layout(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        xyz = np.arange(3)
        where = np.concatenate([self.origin[:, None] + xyz, self.target[:, None] + xyz, self.nuisance], axis=1)
        columns, position = np.unique(where, return_inverse=True)
        position = position.reshape(where.shape)
        return columns, position[:, :3], position[:, 3:6], position[:, 6:]

    @property
    def columns(self) -> np.ndarray:
        """Indices of the parameters that these distances depend on, sorted."""
        return self._layout[0]

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, k) at the parameters x; nan where two points coincide.

        >>> one = np.ones(1)
        >>> d = Distances("d", one, np.eye(1), np.array([0]), np.array([3]), one, 0 * one,
        ...               np.zeros((1, 0), int), np.zeros((1, 0)))
        >>> d.predict(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 12.0]))[0]
        array([13.])
        """
        columns, at_origin, at_target, at_nuisance = self._layout
        m = len(self.observed)
        xyz = np.arange(3)
        along = x[self.target[:, None] + xyz] - x[self.origin[:, None] + xyz]
        distance = np.linalg.norm(along, axis=1)
        with np.errstate(invalid="ignore"):  # points that coincide have no direction: nan, which the solver reports
            slope = self.scale[:, None] * along / distance[:, None]
        values = self.scale * distance + self.offset + np.sum(self.coefficient * x[self.nuisance], axis=1)
        jacobian = np.zeros((m, len(columns)))
        row = np.arange(m)[:, None]
        np.add.at(jacobian, (row, at_target), slope)
        np.add.at(jacobian, (row, at_origin), -slope)
        np.add.at(jacobian, (row, at_nuisance), self.coefficient)
        return values, jacobian
