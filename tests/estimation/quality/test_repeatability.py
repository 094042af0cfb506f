"""Analysis of variance: a table worked by scipy, scatter of both components, sizes of the test."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.estimation.quality.repeatability import repeatability
from draws import draws, same_sigmas


def test_f_ratio_matches_scipy_analysis_of_variance():
    from scipy.stats import f_oneway

    sets = [[6.0, 8.0, 4.0, 5.0, 3.0], [8.0, 12.0, 9.0, 11.0], [13.0, 9.0, 11.0, 8.0, 7.0, 12.0]]
    names = [k for k, values in enumerate(sets) for _ in values]
    assert repeatability(np.concatenate(sets), names).f == pytest.approx(f_oneway(*sets).statistic, rel=1e-12)


@draws(2000)
def test_components_and_mean_scatter_as_claimed(runs):
    rng = np.random.default_rng(2)
    names = np.repeat(np.arange(12), [3, 4, 5, 3, 4, 5, 3, 4, 5, 3, 4, 5])
    within, between, off = [], [], []
    for _ in range(runs):
        y = 10.0 + 0.5 * rng.normal(size=12)[names] + 0.2 * rng.normal(size=names.size)
        found = repeatability(y, names.tolist())
        within.append(found.within**2)
        between.append(found.between**2)
        off.append((found.mean - 10.0) / found.u_mean)
    assert np.mean(within) == pytest.approx(0.04, rel=same_sigmas(0.02, 2000, runs))
    assert np.mean(between) == pytest.approx(0.25, rel=same_sigmas(0.05, 2000, runs))
    # Student's t of 11 degrees of freedom: root of 11/9
    assert np.std(off) == pytest.approx(1.1, abs=same_sigmas(0.08, 2000, runs))


def test_the_alarm_rate_is_the_level():
    rng = np.random.default_rng(3)
    names = np.repeat(np.arange(6), 4).tolist()
    alarms = sum(repeatability(rng.normal(size=24), names, level=0.05).sets_differ for _ in range(2000))
    assert 70 < alarms < 132  # 100 expected, binomial


def test_readings_that_cannot_separate_the_two_are_refused():
    with pytest.raises(ValidityError, match="2 readings in 2 sets"):
        repeatability([1.0, 2.0], ["a", "b"])
    with pytest.raises(ValidityError, match="3 set labels"):
        repeatability([1.0, 2.0], ["a", "b", "b"])
