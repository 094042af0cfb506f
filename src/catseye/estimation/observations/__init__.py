"""Kinds of observation, one file each: what is predicted from the parameters, its derivatives, its covariance.

The solver knows only the protocol below. A new kind is a new file and one line here.
"""

from typing import Protocol

import numpy as np

from catseye.estimation.observations.distance import Distances
from catseye.estimation.observations.linear import Linear

__all__ = ["Distances", "Linear", "Observations"]


class Observations(Protocol):
    """A group of m observations whose errors may be correlated with each other, but not with another group's.

    name         what the group is, for reports
    observed     (m,) values
    covariance   of the observed values: (m,) variances of independent ones; (m, m); or (b, r, r), b blocks of r rows
                 that follow each other, b r = m
    columns      indices of the parameters that the group depends on: (k,) shared by all rows, without repeats; or
                 (m, w), each row its own, where repeats add up and -1 stands for none
    """

    @property
    def name(self) -> str: ...
    @property
    def observed(self) -> np.ndarray: ...
    @property
    def covariance(self) -> np.ndarray: ...
    @property
    def columns(self) -> np.ndarray: ...

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian, (m, k) or (m, w) as `columns` is, at the parameters x."""
        ...
