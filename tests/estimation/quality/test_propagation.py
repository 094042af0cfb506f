"""Budgets and Monte Carlo against the guides' own printed examples, closed forms, and laws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from catseye.errors import ValidityError
from catseye.estimation.quality.propagation import (
    SAMPLERS,
    Input,
    agreement,
    agrees,
    draw_inputs,
    effective_degrees_of_freedom,
    monte_carlo,
    numerical_tolerance,
    propagate,
)

finite = st.floats(-1e3, 1e3)
positive = st.floats(1e-3, 1e3)


def rng(seed=1):
    return np.random.default_rng(seed)


def drawing(inputs, correlation=None):
    return lambda generator, n: draw_inputs(inputs, generator, n, correlation=correlation)


def test_end_gauge_example_of_the_guide_is_reproduced():
    """JCGM 100 annex H.1, nanometres: u 32, 16.7 degrees of freedom, U99 93 (with t of 16, 2.92)."""
    inputs = [
        Input("standard", 50_000_623.0, 25.0, "t", 18.0),
        Input("difference", 215.0, 9.7, "t", 25.6),
        Input("expansion difference, 1/°C", 0.0, 0.58e-6, "rectangular", 50.0),
        Input("temperature difference, °C", 0.0, 0.029, "rectangular", 2.0),
        Input("expansion, 1/°C", 11.5e-6, 1.2e-6, "rectangular"),
        Input("temperature, °C", -0.1, 0.41),
    ]
    length = 50_000_623.0

    def model(x):
        standard, difference, da, dt, a, t = x.T
        return standard + difference - standard * (da * t + a * dt)

    slopes = np.array([1.0, 1.0, length * 0.1, -length * 11.5e-6, 0.0, 0.0])
    budget = propagate(inputs, slopes, value=float(model(np.array([[i.value for i in inputs]]))[0]), probability=0.99)
    assert budget.value == 50_000_838.0
    assert round(budget.u) == 32
    assert round(budget.degrees_of_freedom, 1) == 16.7
    assert budget.expanded == pytest.approx(93.0, abs=1.0)  # the guide truncates to 16 degrees and rounds u to 32


def test_ten_resistors_calibrated_alike_add_their_uncertainties():
    """JCGM 100 clause 5.2.2, example: 10 times 1000 ohm, u 100 mohm each, all correlated: 1 ohm, not 0.32."""
    ten = [Input(f"R{k}", 1000.0, 0.1) for k in range(10)]
    joined = propagate(ten, np.ones(10), value=1e4, correlation=np.ones((10, 10)))
    assert joined.u == pytest.approx(1.0, rel=1e-12)
    assert propagate(ten, np.ones(10), value=1e4).u == pytest.approx(np.sqrt(0.1), rel=1e-12)
    scattered = monte_carlo(lambda x: x.sum(axis=1), drawing(ten, np.ones((10, 10))), draws=100_000, generator=rng(2))
    assert scattered.u == pytest.approx(1.0, rel=0.01)  # four standard uncertainties of 1 / sqrt(2 draws)


@pytest.mark.parametrize(
    ("widest", "u", "budgets", "draws", "same"),
    [(1.0, 2.00, 3.92, 3.88, True), (10.0, 10.1, 19.9, 17.0, False)],
)
def test_sums_of_rectangles_match_the_supplement(widest, u, budgets, draws, same):
    """JCGM 101 tables 3 and 4: half widths of both intervals; with one wide rectangle the budget's is too long."""
    inputs = [Input(f"x{k}", 0.0, s, "rectangular") for k, s in enumerate((1.0, 1.0, 1.0, widest))]
    budget = propagate(inputs, np.ones(4), value=0.0)
    found = monte_carlo(lambda x: x.sum(axis=1), drawing(inputs), draws=1_000_000, generator=rng(3))
    assert budget.u == pytest.approx(u, abs=0.06)  # the supplement prints 10.1 and 10.2 for sqrt(103)
    assert found.u == pytest.approx(budget.u, rel=0.004)
    assert budget.expanded == pytest.approx(budgets, abs=0.06)
    assert (found.low, found.high) == pytest.approx((-draws, draws), abs=0.06)  # three units of the last digit
    assert agrees(budget, found, digits=1 if same else 2) == same


@pytest.mark.parametrize(
    ("x1", "r", "mean", "u", "high"),
    [(0.000, 0.0, 50.0, 50.0, 150.0), (0.010, 0.0, 150.0, 112.0, 367.0), (0.010, 0.9, 150.0, 121.0, None)],
)
def test_mismatch_loss_of_the_supplement_is_reproduced(x1, r, mean, u, high):
    """JCGM 101 clause 9.4, in 1e-6: a model so bent that the budget is useless; the shortest interval starts at 0."""
    inputs = [Input("x1", x1, 0.005), Input("x2", 0.0, 0.005)]
    joined = np.array([[1.0, r], [r, 1.0]])
    budget = propagate(inputs, np.array([2.0 * x1, 0.0]), value=x1**2, correlation=joined)
    assert budget.u * 1e6 == pytest.approx(1e4 * x1, abs=1e-9)  # 0 and 100 as printed
    found = monte_carlo(lambda x: np.sum(x**2, axis=1), drawing(inputs, joined), draws=1_000_000, generator=rng(4))
    assert found.mean * 1e6 == pytest.approx(mean, abs=0.6)
    assert found.u * 1e6 == pytest.approx(u, abs=0.8)
    if high is not None:
        assert found.shortest[0] * 1e6 == pytest.approx(0.0, abs=1.0)
        assert found.shortest[1] * 1e6 == pytest.approx(high, abs=2.5)
    assert not agrees(budget, found)


@pytest.mark.parametrize("name", SAMPLERS)
def test_every_distribution_has_mean_zero_and_the_standard_deviation_it_claims(name):
    drawn = draw_inputs([Input("a", 5.0, 0.2, name)], rng(5), 400_000)[:, 0]
    assert drawn.mean() == pytest.approx(5.0, abs=4.0 * 0.2 / np.sqrt(400_000))
    assert drawn.std() == pytest.approx(0.2, rel=0.005)
    ends = {"rectangular": np.sqrt(3.0), "triangular": np.sqrt(6.0), "arcsine": np.sqrt(2.0)}.get(name)
    if ends is not None:
        assert np.abs(drawn - 5.0).max() == pytest.approx(0.2 * ends, rel=0.01)


def test_a_mean_of_few_readings_is_drawn_from_students_distribution():
    drawn = draw_inputs([Input("a", 1.0, 2.0, "t", 3.0)], rng(6), 200_000)[:, 0]
    assert stats.kstest((drawn - 1.0) / 2.0, "t", args=(3.0,)).pvalue > 1e-3


def test_correlated_inputs_are_drawn_with_their_correlation():
    joined = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, 0.0], [0.0, 0.0, 1.0]])
    inputs = [Input("a", 0.0, 1.0), Input("b", 0.0, 3.0), Input("c", 0.0, 2.0, "rectangular")]
    drawn = draw_inputs(inputs, rng(7), 400_000, correlation=joined)
    assert np.corrcoef(drawn.T) == pytest.approx(joined, abs=0.007)
    assert drawn.std(axis=0) == pytest.approx([1.0, 3.0, 2.0], rel=0.006)


@given(st.lists(st.tuples(finite, positive), min_size=1, max_size=6), st.floats(0.5, 0.999))
def test_without_correlation_u_squared_is_the_sum_of_squares_and_the_shares_are_its_parts(parts, probability):
    inputs = [Input(f"x{k}", 0.0, u) for k, (_, u) in enumerate(parts)]
    slopes = np.array([c for c, _ in parts])
    budget = propagate(inputs, slopes, value=0.0, probability=probability)
    squares = [(c * u) ** 2 for c, u in parts]
    assert budget.u**2 == pytest.approx(sum(squares), rel=1e-12, abs=1e-300)
    if budget.u > 1e-100:
        assert budget.share.sum() == pytest.approx(1.0, rel=1e-12)
        assert budget.share * budget.u**2 == pytest.approx(squares, rel=1e-9, abs=1e-300)
    assert budget.coverage_factor == pytest.approx(stats.norm.ppf(0.5 + 0.5 * probability), rel=1e-9)


@given(st.lists(st.tuples(finite, positive), min_size=2, max_size=4), st.floats(-0.9, 0.9))
def test_with_correlation_u_squared_is_the_quadratic_form_and_the_shares_sum_to_one(parts, r):
    inputs = [Input(f"x{k}", 0.0, u) for k, (_, u) in enumerate(parts)]
    joined = np.eye(len(parts))
    joined[0, 1] = joined[1, 0] = r
    slopes, u = np.array(parts).T
    budget = propagate(inputs, slopes, value=0.0, correlation=joined)
    covariance = joined * np.outer(u, u)
    assert budget.u**2 == pytest.approx(float(slopes @ covariance @ slopes), rel=1e-9, abs=1e-12)
    if budget.u > 1e-6:
        assert budget.share.sum() == pytest.approx(1.0, rel=1e-9)


@given(st.lists(st.tuples(positive, st.floats(1.0, 1e3)), min_size=1, max_size=6))
def test_effective_degrees_of_freedom_lie_between_the_smallest_and_the_sum(parts):
    """JCGM 100 annex G.4.1."""
    u, degrees = np.array(parts).T
    found = effective_degrees_of_freedom(u, degrees)
    assert degrees.min() * (1 - 1e-9) <= found <= degrees.sum() * (1 + 1e-9)


def test_few_degrees_of_freedom_widen_the_interval_and_the_interval_keeps_its_promise():
    """A mean of four readings, many times: 95 % of the intervals hold the truth, with the normal factor only 85 %."""
    readings = rng(8).normal(10.0, 2.0, (20_000, 4))
    mean, u = readings.mean(axis=1), readings.std(axis=1, ddof=1) / 2.0
    budget = propagate([Input("mean", 10.0, 1.0, "t", 3.0)], np.ones(1), value=10.0)
    inside = np.mean(np.abs(mean - 10.0) <= budget.coverage_factor * u)
    assert inside == pytest.approx(0.95, abs=0.007)  # four and a half sigma of 20 000 trials
    assert np.mean(np.abs(mean - 10.0) <= 1.96 * u) < 0.88


def test_a_monte_carlo_repeats_itself_and_its_interval_is_the_quantiles():
    inputs = [Input("a", 1e3, 1e-5)]
    one, two = (monte_carlo(lambda x: x[:, 0], drawing(inputs), draws=50_001, generator=rng(9)) for _ in range(2))
    assert np.array_equal(one.values, two.values)
    assert len(one.values) == 50_001
    low, high = np.quantile(one.values - 1e3, [0.025, 0.975])
    assert (one.low - 1e3, one.high - 1e3) == pytest.approx((low, high), rel=3e-3)
    assert one.shortest[1] - one.shortest[0] <= one.high - one.low
    assert one.u == pytest.approx(1e-5, rel=0.013)  # small beside the value: nothing is lost to rounding


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Input("a", 0.0, -1.0), "u 0 or more"),
        (lambda: Input("a", np.nan, 1.0), "finite"),
        (lambda: Input("a", 0.0, 1.0, "gauss"), "expected one of normal"),
        (lambda: Input("a", 0.0, 1.0, "t"), "finite for a t distribution"),
        (lambda: Input("a", 0.0, 1.0, "normal", 0.0), "above 0"),
        (lambda: propagate([Input("a", 0.0, 1.0)], np.ones(1), value=0.0, probability=1.0), "between 0 and 1"),
        (lambda: joined([[1.0, 2.0], [2.0, 1.0]]), "eigenvalue below 0"),
        (lambda: joined([[1.0, 0.5], [0.4, 1.0]]), "symmetric"),
        (lambda: joined([[1.0, 0.5], [0.5, 1.0]], "rectangular"), "expected normal"),
        (lambda: monte_carlo(lambda x: x[:, 0], drawing([]), draws=1, generator=rng()), "2 or more"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(make, words):
    with pytest.raises(ValidityError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def joined(correlation, second="normal"):
    inputs = [Input("a", 0.0, 1.0), Input("b", 0.0, 1.0, second)]
    return propagate(inputs, np.ones(2), value=0.0, correlation=np.array(correlation))


def test_a_result_without_any_uncertainty_has_no_shares():
    budget = propagate([Input("a", 1.0, 0.0)], np.ones(1), value=1.0)
    assert (budget.u, budget.expanded) == (0.0, 0.0)
    assert np.isnan(budget.share).all()
    assert numerical_tolerance(0.0) == 0.0


def test_too_few_draws_give_no_decision():
    """A linear normal model, whose budget is exact: a thousand draws would have said that it is wrong."""
    inputs = [Input("x", 0.0, 70.0)]
    budget = propagate(inputs, np.ones(1), value=0.0)
    said = {
        draws: [
            agreement(budget, monte_carlo(lambda x: x[:, 0], drawing(inputs), draws=draws, generator=rng(seed)), 1)
            for seed in range(20)
        ]
        for draws in (1_000, 100_000)
    }
    assert said[1_000] == [None] * 20
    assert said[100_000] == [True] * 20
    wrong = propagate([Input("x", 0.0, 60.0)], np.ones(1), value=0.0)
    far = monte_carlo(lambda x: x[:, 0], drawing(inputs), draws=100_000, generator=rng(1))
    assert agreement(wrong, far, 1) is False
