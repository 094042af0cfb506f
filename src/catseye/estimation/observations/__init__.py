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
    covariance   (m, m) of the observed values, or (m,) variances where they are independent
    columns      (k,) indices of the parameters that the group depends on
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
        """Values (m,) and Jacobian (m, k) over `columns` at the parameters x."""
        ...
