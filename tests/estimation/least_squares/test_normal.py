"""Normal equations whose products cancel: a covariance of parameters that meet in a row, whatever the sums are."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from catseye.estimation.least_squares.adjustment import SolverSettings, adjust
from catseye.estimation.observations.kind import ObservationKind


@dataclass(frozen=True, eq=False)
class Sums(ObservationKind):
    """Each row a sum of its own parameters."""

    kind: ClassVar[str] = "linear"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    columns: np.ndarray
    coefficient: np.ndarray

    def predict(self, x):
        return np.sum(self.coefficient * x[self.columns], axis=1), self.coefficient


@pytest.mark.parametrize("within", [True, False])
def test_parameters_whose_products_cancel_have_their_covariance_and_tests(within):
    """A square's corners: height, and its two tilts, which the design keeps apart; in one group of rows, or in two."""
    rng = np.random.default_rng(1)
    places = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    columns = np.tile([0, 1, 2], (4, 1))
    factor = np.column_stack([np.ones(4), places])
    observed = factor @ [1.0, 0.2, -0.3] + 1e-3 * rng.normal(size=4)
    groups = [slice(0, 4)] if within else [slice(0, 2), slice(2, 4)]
    rows = [Sums(f"g{k}", observed[g], np.full(4, 1e-6)[g], columns[g], factor[g]) for k, g in enumerate(groups)]
    found = {form: adjust(np.zeros(3), rows, solver=SolverSettings(sparse=form)) for form in (True, False)}
    np.testing.assert_allclose(found[True].x, found[False].x, rtol=0, atol=1e-15)
    for one, other in zip(found[True].fits, found[False].fits, strict=True):
        np.testing.assert_allclose(one.redundancy, other.redundancy, rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.standardised, other.standardised, rtol=0, atol=1e-9)
        assert np.isfinite(one.standardised).all()
    np.testing.assert_allclose(found[True].covariance, 2.5e-7 * np.eye(3), rtol=0, atol=1e-18)
