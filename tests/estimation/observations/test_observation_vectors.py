"""The hand-worked values of observations*.toml, each to its tolerance; every kind has two at least."""

import tomllib
from collections import Counter

import numpy as np
import pytest

from catseye.estimation.observations import kinds as observations
from repository import TESTS

TABLES = sorted((TESTS / "vectors").glob("observations*.toml"))
VECTORS = [v for table in TABLES for v in tomllib.loads(table.read_text(encoding="utf-8"))["vector"]]
ABOUT = {"kind", "name", "x", "expected", "expected_deg", "observed_deg", "tolerance", "source"}


def group(vector):
    expected = np.atleast_1d(vector.get("expected", np.radians(vector.get("expected_deg", 0.0))))
    observed = np.radians(vector["observed_deg"]) if "observed_deg" in vector else np.zeros(len(expected))
    fields = {k: v if isinstance(v, bool) else np.array(v) for k, v in vector.items() if k not in ABOUT}
    made = getattr(observations, vector["kind"])
    return made(name=vector["name"], observed=observed, covariance=np.ones(len(expected)), **fields), expected


@pytest.mark.parametrize("vector", [pytest.param(v, id=f"{v['kind']}: {v['name']}") for v in VECTORS])
def test_the_hand_worked_value_is_predicted(vector):
    one, expected = group(vector)
    values, jacobian = one.predict(np.array(vector["x"], dtype=float))
    np.testing.assert_allclose(values, expected, rtol=0, atol=vector["tolerance"])
    assert jacobian.shape[0] == len(expected)
    assert jacobian.shape[-1] == one.columns.shape[-1]


def test_every_kind_has_two_vectors():
    count = Counter(v["kind"] for v in VECTORS)
    kinds = {
        name
        for name in observations.__all__
        if name
        not in ("ObservationKind", "Joint", "ObservationGroup", "Reported")  # Joint only stacks others: test_kinds.py
    }
    assert set(count) == kinds
    assert min(count.values()) >= 2
