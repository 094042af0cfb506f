"""The process in time between stations and paths: knots, and what is known of them before a shot is fired."""

import dataclasses

import numpy as np
import pytest

from catseye.reduction.epoch.air.process import (
    ACROSS_TIME,
    FAST_TIME,
    LEAST,
    LEVEL_TIME,
    MOST,
    PARTS,
    USUAL,
    WIDE,
    AirKnots,
    AirStrength,
    hats,
)


@dataclasses.dataclass
class Known:
    """A record known at all times by independent errors of some variance."""

    variance: float

    def covariance(self, seconds):
        return self.variance * np.isclose(seconds[:, None], seconds)


@dataclasses.dataclass
class Common:
    """A record that is off by one error at all times."""

    variance: float

    def covariance(self, seconds):
        return np.full((len(seconds),) * 2, self.variance)


TWO = (Known(0.04), Known(0.01))


def knots(*, shots=600, span=(0.0, 3600.0), temperatures=TWO, others=(), zeta=(-1.0, 1.0)):
    where = None if zeta is None else np.array(zeta)
    return AirKnots.of(span, shots, temperatures, others, zeta=where)


def test_hats_find_the_knot_before_and_the_position_to_the_next():
    at = np.array([0.0, 10.0, 30.0])
    first, share = hats(at, np.array([-5.0, 0.0, 2.5, 10.0, 25.0, 30.0, 99.0]))
    assert first.tolist() == [0, 0, 0, 1, 1, 1, 1]  # never the last
    np.testing.assert_allclose(share, [0.0, 0.0, 0.25, 0.0, 0.75, 1.0, 1.0])


def own_knots(made, part):
    return {"level": made.level, "slope": made.slope}.get(part, made.across)


@pytest.mark.parametrize("shots", [1, 90, 600])
def test_columns_and_shares_interpolate_each_part_between_its_own_knots(shots):
    made = knots(shots=shots)
    rng = np.random.default_rng(shots)
    x, seconds = rng.standard_normal(made.count), rng.uniform(-100.0, 3700.0, 50)
    columns, share = made.columns(seconds)
    assert columns.shape == (50, 8)
    assert share.shape == (50, 4)
    at = x[columns].reshape(50, 4, 2)
    found = at[:, :, 0] * (1.0 - share) + at[:, :, 1] * share
    by_label = dict(zip(made.labels, x, strict=True))
    for i, part in enumerate(PARTS):
        own = own_knots(made, part)
        values = [by_label[part, str(k)] for k in range(len(own))]
        np.testing.assert_allclose(found[:, i], np.interp(seconds, own, values), atol=1e-12)


def test_labels_name_every_parameter_once_in_the_order_of_the_columns():
    made = knots(shots=5000)
    k, m, j = len(made.level), len(made.slope), len(made.across)
    assert j < m < k  # with height air changes more slowly than as a whole, across a site still more
    assert len(set(made.labels)) == len(made.labels) == made.count
    first = [made.labels.index((part, "0")) for part in PARTS]
    assert first == [0, k, k + m, k + m + j]
    columns, _ = made.columns(made.level[:1])
    assert columns[0, ::2].tolist() == first
    assert np.all(columns[0, 1::2] == columns[0, ::2] + 1)


@pytest.mark.parametrize(
    ("shots", "span", "count"),
    [
        (0, 3600.0, (2, 2, 2)),
        (90, 3600.0, (3, 2, 2)),  # one of the level a thirty shots, of the others a sixty
        (5000, 3600.0, (49, 25, 13)),  # none closer than 75, 150 and 300 s
        (50_000, 36_000.0, (400, 200, 121)),  # as many as can be inverted in good time
        (100, 0.0, (2, 2, 2)),  # all shots at one time
    ],
)
def test_shots_and_time_limit_the_number_of_knots(shots, span, count):
    made = knots(shots=shots, span=(100.0, 100.0 + span))
    assert (len(made.level), len(made.slope), len(made.across)) == count
    for own in (made.level, made.slope, made.across):
        assert own[[0, -1]].tolist() == [100.0, 100.0 + span]
    assert np.all(np.isfinite(made.columns(np.array([100.0]))[1]))


def at_same_times(made):
    """Pairs of a level's and a slope's number whose knots are at one time, and all other pairs."""
    return np.isclose(made.level[:, None], made.slope)


def test_two_stations_covariance_is_that_of_mean_and_half_difference():
    """Level is (a + b) / 2 and slope (b - a) / 2 of independent errors of 0.2 and 0.1 °C."""
    made = knots(shots=5000)
    k, m = len(made.level), len(made.slope)
    same = at_same_times(made)
    assert same.sum() == m  # every other level's knot is a slope's
    mean, cross = (0.04 + 0.01) / 4.0, (0.01 - 0.04) / 4.0
    expected = np.block([[mean * np.eye(k), cross * same], [cross * same.T, mean * np.eye(m)]])
    np.testing.assert_allclose(made.record, expected, atol=1e-16)


def test_of_three_stations_the_line_by_least_squares_counts():
    zeta = np.array([-1.0, 0.2, 1.0])
    variance = np.array([0.04, 0.01, 0.09])
    made = knots(temperatures=[Common(v) for v in variance], zeta=zeta)
    # numpy's own fit of a line to a station's error of one
    lines = np.array([np.polyfit(zeta, unit, 1)[::-1] for unit in np.eye(3)])  # (stations, level and slope)
    expected = np.einsum("s,sa,sb->ab", variance, lines, lines)
    part = np.repeat([0, 1], [len(made.level), len(made.slope)])
    np.testing.assert_allclose(made.record, expected[part[:, None], part], atol=1e-15)


def test_stations_at_one_height_leave_the_slope_to_the_process():
    made = knots(zeta=None)
    k = len(made.level)
    np.testing.assert_allclose(made.record[:k, :k], (0.04 + 0.01) / 4.0 * np.eye(k), atol=1e-16)
    assert not made.record[k:].any()


def test_pressure_and_humidity_count_as_the_degrees_that_they_are_worth():
    """By hand: half of 0.3 hPa^2 at -0.3 °C a hPa, squared, is common to level; the slope knows no pressure."""
    without, made = knots(), knots(others=[(Common(0.09), -0.3), (Known(1.0), 0.01)])
    k = len(made.level)
    more = (0.3 / 2.0) ** 2 * 0.09 * np.ones((k, k)) + (0.01 / 2.0) ** 2 * np.eye(k)
    np.testing.assert_allclose(made.record[:k, :k] - without.record[:k, :k], more, atol=1e-16)
    np.testing.assert_array_equal(made.record[k:], without.record[k:])


@pytest.mark.parametrize("strength", [USUAL, WIDE, LEAST, MOST, AirStrength(0.0, 0.0, 0.0, 0.0, 1e-4)])
@pytest.mark.parametrize("shots", [1, 600, 9000])
def test_the_prior_is_positive_definite(strength, shots):
    made = knots(shots=shots, temperatures=[Common(0.0), Common(0.0)])
    for prior in made.covariances(strength):
        np.testing.assert_allclose(prior, prior.T, rtol=1e-12)
        np.linalg.cholesky(prior)
        # 1e-12 of the largest: what inverting it in double precision asks for, with digits left
        values = np.linalg.eigvalsh(prior)
        assert values[0] > 1e-12 * values[-1]


def test_a_prior_is_the_records_share_and_each_strengths_forgetting():
    made = knots(span=(0.0, 1200.0), shots=5000)
    strength = AirStrength(0.1, 0.03, 0.04, 0.02, 0.005)
    between, across = made.covariances(strength)
    k, (i, j) = len(made.level), (1, 4)
    apart, slope_apart = made.level[j] - made.level[i], made.slope[j] - made.slope[i]
    level = 0.1**2 * np.exp(-apart / LEVEL_TIME) + 0.04**2 * np.exp(-apart / FAST_TIME)
    slope = 0.03**2 * np.exp(-slope_apart / LEVEL_TIME) + 0.02**2 * np.exp(-slope_apart / FAST_TIME)
    assert between[i, j] == pytest.approx(level)
    assert between[k + i, k + j] == pytest.approx(slope)
    assert between[i, k + j] == 0.0  # the stations' errors are independent from time to time here
    # 1e-8 °C^2: what keeps it positive definite
    assert between[i, i] == pytest.approx(0.0125 + 0.1**2 + 0.04**2, abs=2e-8)
    assert between[k + i, k + i] == pytest.approx(0.0125 + 0.03**2 + 0.02**2, abs=2e-8)
    assert between[0, k] == pytest.approx(-0.0075)
    far = made.across[1] - made.across[0]
    assert across[0, 1] == pytest.approx(0.005**2 * np.exp(-far / ACROSS_TIME))
    assert across[0, 0] == pytest.approx(0.005**2)
