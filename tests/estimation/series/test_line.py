"""A line through readings: by hand, by scatter, and without the prior that readings share."""

import numpy as np
import pytest

from catseye.estimation.series.line import fit_line, without_prior


def test_a_line_by_hand():
    """Weights 1, 1, 4 at the times 0, 1, 2: their mean is 1.5, that of the values 0, 0, 3 is 2."""
    line = fit_line([0.0, 1.0, 2.0], [0.0, 0.0, 3.0], [1.0, 1.0, 0.5])
    assert line.middle == pytest.approx((1.0 + 8.0) / 6.0)
    assert line.value == pytest.approx(2.0)
    spread = 1.5**2 + 0.5**2 + 4 * 0.5**2
    assert line.rate == pytest.approx((-1.5 * -2.0 + -0.5 * -2.0 + 4 * 0.5 * 1.0) / spread)
    assert line.u_rate == pytest.approx(spread**-0.5)
    assert line.u_at([line.middle])[0] == pytest.approx(6**-0.5)
    assert line.degrees_of_freedom == 1


def test_readings_of_one_time_have_a_mean_and_no_rate():
    line = fit_line([5.0, 5.0], [1.0, 3.0], [1.0, 1.0])
    assert (line.value, line.rate, line.u_rate, line.degrees_of_freedom) == (2.0, 0.0, np.inf, 1)
    assert line.u_at([5.0, 9.0]).tolist() == pytest.approx([0.5**0.5] * 2)


def test_the_claimed_uncertainty_of_a_rate_is_its_scatter():
    rng = np.random.default_rng(8)
    t, u = np.sort(rng.uniform(0, 3, 40)), rng.uniform(0.5, 2.0, 40)
    lines = [fit_line(t, 2.0 - 0.7 * t + u * rng.standard_normal(40), u) for _ in range(2000)]
    z = np.array([(line.rate + 0.7) / line.u_rate for line in lines])
    assert abs(z.mean()) < 4 / np.sqrt(2000)
    assert abs(z.std() - 1.0) < 4 / np.sqrt(2 * 2000)
    factors = np.array([line.factor for line in lines])
    assert abs(factors.mean() - 1.0) < 4 * np.sqrt(2 / 38 / 2000)


def test_an_estimate_without_its_prior_is_what_the_others_said():
    rng = np.random.default_rng(3)
    own, u_own = rng.normal(0, 1, 50), rng.uniform(0.1, 3.0, 50)
    prior, u_prior = 0.4, 0.8
    information = u_own**-2 + u_prior**-2
    value = (own * u_own**-2 + prior * u_prior**-2) / information
    found, u = without_prior(value, information**-0.5, prior, u_prior)
    assert found == pytest.approx(own, rel=1e-9)
    assert u == pytest.approx(u_own, rel=1e-9)


@pytest.mark.parametrize("u", [0.8, 0.81])
def test_an_estimate_that_is_its_prior_says_nothing(u):
    found, u_found = without_prior([0.4], [u], [0.4], [0.8])
    assert np.isnan(found[0])
    assert np.isnan(u_found[0])


def test_an_estimate_whose_prior_was_left_out_stays_as_it_is():
    found, u = without_prior([1.5], [0.2], [0.0], [np.inf])
    assert (found[0], u[0]) == pytest.approx((1.5, 0.2))
