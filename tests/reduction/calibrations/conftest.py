"""Tables of readings made in memory from a planted truth, by formulas written down here and not taken from catseye."""

import numpy as np
import pytest

from calibration_scene import PROVENANCE
from catseye.records.files.readings import SheetReadings


@pytest.fixture(scope="session")
def table():
    """Function (layout, numbers, words=..., left_out=..., **sheet) -> Readings."""

    def made(layout, numbers, words=None, left_out=None, **sheet):
        m = len(next(iter(numbers.values())))
        return SheetReadings(
            file="t.csv",
            sheet=layout.sheet.model_validate({"kind": layout.kind, **PROVENANCE, **sheet}),
            sheet_file="t.toml",
            numbers={name: np.asarray(v, dtype=float) for name, v in numbers.items()},
            words=words or {},
            where=tuple(f"line {k + 2}" for k in range(m)),
            left_out=left_out or ("",) * m,
        )

    return made


@pytest.fixture(scope="session")
def scatters_as_claimed():
    """Function (values (n, q), covariances (n, q, q), truth, slack): unbiased, and scatter equals the claim."""

    def check(values, covariances, truth, slack=4.0):
        values, claimed = np.asarray(values), np.mean(covariances, axis=0)
        n, q = values.shape
        off = values - truth
        u_mean = np.sqrt(np.diag(claimed) / n)
        assert np.all(np.abs(off.mean(axis=0)) < slack * u_mean), (off.mean(axis=0), u_mean)
        # Mahalanobis: the mean of q degrees of freedom each, with its own scatter sqrt(2 q / n).
        each = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariances), off)
        assert abs(each.mean() / q - 1.0) < slack * np.sqrt(2.0 / (q * n)) + 0.02, each.mean() / q
        found = off.T @ off / n
        scale = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
        assert np.all(np.abs(found - claimed) / scale < slack * np.sqrt(2.0 / n) + 0.02), found / scale

    return check
