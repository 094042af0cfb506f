"""The repeatability test's standard deviations scatter as their covariance says."""

import numpy as np
import pytest

from catseye.errors import InputError, ValidityError
from catseye.reduction.calibrations.ranging.repeatability import KIND, RepeatabilitySheet, measure_repeatability
from reduction.calibrations.length_scene import readings


def test_both_deviations_scatter_as_claimed():
    rng = np.random.default_rng(1)
    names = tuple(f"s{k}" for k in range(30) for _ in range(5))
    found, claimed = [], []
    for _ in range(400):
        value = 50.0 + np.repeat(2e-5 * rng.normal(size=30), 5) + 1e-5 * rng.normal(size=150)
        c = measure_repeatability(readings(RepeatabilitySheet, KIND, numbers={"range_m": value}, words={"set": names}))
        found.append([q.value for q in c.quantities])
        claimed.append(c.covariance)
    scatter, claim = np.cov(np.array(found).T), np.mean(claimed, axis=0)
    u = np.sqrt(np.diag(claim))
    assert np.all(np.abs(scatter - claim) / np.outer(u, u) < 0.3)
    assert np.mean(found, axis=0) == pytest.approx([10.0, 20.0, np.hypot(10.0, 20.0)], rel=0.03)


def test_sets_that_agree_have_no_scatter_between_them():
    value = [1.0, 1.00002, 1.00001, 1.00001]
    c = measure_repeatability(
        readings(RepeatabilitySheet, KIND, numbers={"range_m": value}, words={"set": ("a", "a", "b", "b")})
    )
    assert c.value("between_um") == 0.0
    assert c.decisions[0].passed
    assert c.value("repeatability_um") == pytest.approx(10.0)
    assert c.u("between_um") > 1.0  # zero was found, not known


def test_insufficient_readings_are_refused_and_an_omitted_set_is_no_warning():
    same = readings(RepeatabilitySheet, KIND, numbers={"range_m": [1.0] * 4}, words={"set": ("a", "a", "b", "b")})
    with pytest.raises(ValidityError, match="agree to the last digit"):
        measure_repeatability(same)
    named = readings(RepeatabilitySheet, KIND, numbers={"range_m": [1.0] * 3}, words={"set": ("a", "a", "")})
    with pytest.raises(InputError, match="line 4, set is empty"):
        measure_repeatability(named)
    out = readings(
        RepeatabilitySheet,
        KIND,
        numbers={"range_m": [1.0, 1.1, 1.2, 1.4, 9.0]},
        words={"set": ("a", "a", "b", "b", "c")},
        left_out=("", "", "", "", "bumped"),
    )
    found = measure_repeatability(out)
    assert found.states[-1] == "left out: bumped"
    assert found.decisions[0].limit == pytest.approx(18.51, abs=0.01)  # F of 1 and 2 degrees
