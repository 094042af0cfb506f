"""A quantity of the air in height and time: against least squares, against a stochastic process, and as laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from catseye.atmosphere.path.mean import nodes_along
from catseye.atmosphere.path.profile import (
    HUMIDITY,
    MOST_READINGS,
    TEMPERATURE,
    Coefficient,
    Profile,
    ProfilePrior,
    ProfileReadings,
)
from catseye.atmosphere.path.suspect_readings import suspect_readings
from catseye.errors import EstimationError, ValidityError
from draws import draws, same_sigmas

STILL = Coefficient(0.0, 0.0, 3600.0)


def readings(seconds, heights, value):
    """One reading a station and second: `value` (seconds, stations)."""
    t, s = np.meshgrid(np.asarray(seconds, float), np.arange(len(heights)), indexing="ij")
    flat = np.asarray(value, float).ravel()
    return ProfileReadings(
        t.ravel(), np.asarray(heights, float)[s.ravel()], s.ravel(), flat, np.ones(flat.size, dtype=int)
    )


def matern_path(rng, coefficient, seconds):
    """A coefficient drawn by x'' = -2 q x' - q² x + noise, step by step, not by its covariance."""
    q = np.sqrt(3.0) / coefficient.time
    drift = np.array([[0.0, 1.0], [-(q**2), -2.0 * q]])
    still = np.diag([1.0, q**2])  # covariance of x and x' when the process has run for ever
    state = rng.multivariate_normal(np.zeros(2), still)
    out = [state[0]]
    for step in np.diff(seconds):
        carried = expm(drift * step)
        left = still - carried @ still @ carried.T
        state = carried @ state + rng.multivariate_normal(np.zeros(2), 0.5 * (left + left.T))
        out.append(state[0])
    return coefficient.steady * rng.normal() + coefficient.changing * np.array(out)


def walk_around(rng, size, time, seconds):
    """Local air at one place as a first-order autoregression."""
    out = [rng.normal()]
    for step in np.diff(seconds):
        keep = np.exp(-step / time)
        out.append(keep * out[-1] + np.sqrt(1.0 - keep**2) * rng.normal())
    return size * np.array(out)


def normalised(draws, seed):
    """Squares over claimed variances, (draws, 7): three asked values, the three jointly, the stations' offsets."""
    rng = np.random.default_rng(seed)
    prior = TEMPERATURE
    read, asked = np.arange(0.0, 3600.0, 240.0), np.array([-1800.0, 1900.0, 5400.0])
    z_asked = np.array([3.0, 100.0, 30.0])
    every = np.union1d(read, asked)
    heights, ground = np.array([2.0, 12.0, 48.0]), -0.5
    found = []
    for _ in range(draws):

        def basis(z):
            return np.stack([np.ones(np.shape(z)), z - ground, np.log(1.0 + z - ground)], axis=-1)

        draw = np.stack([matern_path(rng, c, every) for c in prior.coefficients], axis=1)

        def truth(t, z, draw=draw):
            return np.sum(draw[np.searchsorted(every, t)] * basis(z), axis=-1)

        offset = prior.offset * rng.normal(size=3)
        value = np.stack(
            [
                10.0 + truth(read, np.full(read.shape, h)) + offset[k]
                + walk_around(rng, prior.local, prior.local_time, read) + prior.noise * rng.normal(size=read.size)
                for k, h in enumerate(heights)
            ],
            axis=1,
        )  # fmt: skip
        profile = Profile.of(readings(read, heights, value), prior, ground=ground)
        wrong = profile.at(asked, z_asked) - 10.0 - truth(asked, z_asked)
        covariance = profile.covariance(asked, profile.basis(z_asked))
        found_offset, u_offset = profile.offsets()
        found.append(
            [
                *(wrong**2 / np.diag(covariance)),
                wrong @ np.linalg.solve(covariance, wrong) / 3,
                *((found_offset - offset) ** 2 / u_offset**2),
            ]
        )
    return np.array(found)


@draws(150)
def test_claimed_uncertainties_are_the_scatter_of_air_drawn_from_the_prior(runs):
    found = normalised(runs, 11).mean(axis=0)
    # 150 squares of a normal: 1 +- 0.115, joint of three +- 0.07; three of them
    np.testing.assert_allclose(found, 1.0, atol=same_sigmas(0.36, 150, runs))


@pytest.mark.slow
def test_claimed_uncertainties_are_the_scatter_in_a_long_run():
    np.testing.assert_allclose(normalised(2000, 12).mean(axis=0), 1.0, atol=0.1)


def test_without_time_and_offsets_it_is_the_weighted_straight_line():
    rng = np.random.default_rng(2)
    z, value = rng.uniform(1, 60, 20), rng.normal(15, 1, 20)
    count = rng.integers(1, 5, 20)
    prior = ProfilePrior(Coefficient(300, 0, 60), Coefficient(10, 0, 60), STILL, offset=0.0, noise=0.2)
    profile = Profile.of(ProfileReadings(np.zeros(20), z, np.arange(20), value, count), prior, ground=0.0)
    design, weight = np.stack([np.ones(20), z], axis=1), np.diag(count / 0.04)
    covariance = np.linalg.inv(design.T @ weight @ design)
    line = covariance @ design.T @ weight @ value
    asked = np.array([[1.0, 0.0], [1.0, 80.0]])
    np.testing.assert_allclose(profile.at([0.0, 0.0], asked[:, 1]), asked @ line, atol=1e-4)
    np.testing.assert_allclose(
        profile.covariance([0.0, 0.0], profile.basis(asked[:, 1])), asked @ covariance @ asked.T, rtol=1e-4
    )  # priors of 300 °C and 10 °C/m beside 0.1 °C and 0.003 °C/m


def test_one_station_leaves_the_gradient_to_the_prior():
    still = np.arange(0.0, 3600.0, 60.0)
    profile = Profile.of(readings(still, [2.0], np.full((60, 1), 15.0)), TEMPERATURE, ground=0.0)
    np.testing.assert_allclose(profile.at([1800.0] * 3, [2.0, 20.0, 52.0]), 15.0, atol=1e-3)  # prior: no gradient
    gradient, layer = np.hypot(0.02, 0.01) * 50.0, np.hypot(0.2, 0.1) * np.log(53.0 / 3.0)
    own = profile.u_at([1800.0], [2.0])[0]
    assert profile.u_at([1800.0], [52.0])[0] == pytest.approx(np.sqrt(own**2 + gradient**2 + layer**2), rel=1e-3)
    assert own == pytest.approx(0.3, abs=0.02)  # its offset, which no reading shows


def test_two_stations_at_one_height_are_averaged_and_show_no_gradient():
    profile = Profile.of(readings([0.0, 60.0], [10.0, 10.0], [[14.0, 16.0]] * 2), TEMPERATURE, ground=0.0)
    assert profile.at([30.0], [10.0])[0] == pytest.approx(15.0, abs=1e-3)
    assert profile.at([30.0], [60.0])[0] == pytest.approx(15.0, abs=1e-3)
    assert profile.u_at([30.0], [60.0])[0] > 1.0


def test_a_station_above_the_other_shows_the_lapse_with_the_right_sign():
    still = np.arange(0.0, 3600.0, 120.0)
    profile = Profile.of(readings(still, [2.0, 50.0], np.tile([20.0, 19.5], (30, 1))), TEMPERATURE, ground=0.0)
    low, middle, high = profile.at([1800.0] * 3, [2.0, 26.0, 50.0])
    assert low > middle > high
    assert low - high == pytest.approx(0.5, abs=0.1)  # both offsets of 0.3 °C take a share
    _, gradient, layer = profile.coefficients([1800.0])[0]
    assert gradient < 0.0  # per metre upwards
    assert layer < 0.0


def test_a_time_outside_the_readings_costs_more_and_more_until_only_the_prior_is_left():
    still = np.arange(0.0, 7200.0, 120.0)
    drifting = np.stack([15.0 - still / 3600.0, 14.5 - still / 3600.0], axis=1)
    profile = Profile.of(readings(still, [2.0, 50.0], drifting), TEMPERATURE, ground=0.0)
    later = 7200.0 + np.array([0.0, 600.0, 3600.0, 10_800.0, 1e6])
    u = profile.u_at(later, np.full(5, 2.0))
    assert np.all(np.diff(u) > 0)
    # the level's changing part twice: there, and in what two hours of it told of the steady part, a little less
    assert 3.9 < u[-1] < np.hypot(3.0, 3.0)
    assert profile.at(later[1:2], [2.0])[0] == pytest.approx(
        15.0 - 7800.0 / 3600.0, abs=0.15
    )  # it drifts on for a while


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_a_reading_more_never_makes_anything_less_certain(seed):
    rng = np.random.default_rng(seed)
    n = 12
    columns = rng.uniform(0, 7200, n), rng.uniform(1, 50, n), rng.integers(0, 4, n), rng.normal(15, 2, n)
    all_of = ProfileReadings(*columns, np.ones(n, dtype=int))
    less = ProfileReadings(*(c[:-1] for c in columns), np.ones(n - 1, dtype=int))
    asked = rng.uniform(-3600, 10_800, 5), rng.uniform(0, 120, 5)
    more, fewer = (Profile.of(r, TEMPERATURE, ground=0.0) for r in (all_of, less))
    basis = more.basis(asked[1])
    gain = fewer.covariance(asked[0], basis) - more.covariance(asked[0], basis)
    assert np.linalg.eigvalsh(gain).min() > -1e-9  # °C², in any combination; rounding beside variances of up to 400


def test_covariance_of_means_is_the_integral_of_the_covariance_between_heights():
    still = np.arange(0.0, 1800.0, 300.0)
    profile = Profile.of(readings(still, [2.0, 50.0], np.full((6, 2), 15.0)), TEMPERATURE, ground=-1.0)
    low, high = np.array([0.0, 5.0, 30.0]), np.array([60.0, 5.0, 110.0])
    z, share = nodes_along(low, high, 6)
    when = np.full(3, 900.0)
    direct = profile.covariance(when, np.einsum("mkj,k->mj", profile.basis(z), share))

    def between(one, other):
        one, other = np.broadcast_arrays(one, other)
        both = np.concatenate([one.ravel(), other.ravel()])
        whole = profile.covariance(np.full(both.size, 900.0), profile.basis(both))
        n = one.size
        return np.diagonal(whole[:n, n:]).reshape(one.shape)

    integral = np.einsum("k,mknl,l->mn", share, between(z[:, :, None, None], z[None, None]), share)
    np.testing.assert_allclose(integral, direct, rtol=1e-9)


def test_means_over_blocks_lose_nothing_but_a_little_certainty():
    rng = np.random.default_rng(8)
    still = np.arange(0.0, 7200.0, 30.0)
    every = readings(still, [2.0, 50.0], 15.0 + 0.05 * rng.normal(size=(240, 2)))
    few = every.averaged(120.0)
    assert len(few.value) == 120
    assert set(few.count) == {4}
    fine, coarse = (Profile.of(r, TEMPERATURE, ground=0.0) for r in (every, few))
    when, z = np.array([600.0, 3600.0, 7000.0]), np.array([5.0, 40.0, 80.0])
    np.testing.assert_allclose(coarse.at(when, z), fine.at(when, z), atol=0.02)
    assert np.all(coarse.u_at(when, z) < 1.05 * fine.u_at(when, z))
    assert np.all(coarse.u_at(when, z) > 0.999 * fine.u_at(when, z))


def scene(seed, wrong=None, heights=(2.0, 10.0, 25.0, 50.0)):
    """Four stations over two hours of a drifting, lapsing air, with offsets; `wrong` (seconds, stations) on top."""
    rng = np.random.default_rng(seed)
    still, z = np.arange(0.0, 7200.0, 120.0), np.asarray(heights)
    value = 12.0 - still[:, None] / 5000.0 + 0.01 * z + rng.normal(0, 0.3, z.size)
    value = value + np.stack([walk_around(rng, 0.15, 60.0, still) for _ in z], axis=1)
    value += rng.normal(0, 0.05, value.shape)
    return readings(still, heights, value + (0.0 if wrong is None else wrong))


def test_honest_stations_are_not_accused():
    accused = [suspect_readings(Profile.of(scene(seed), TEMPERATURE, ground=0.0)) for seed in range(40)]
    # 9600 readings at 7e-6 each, 160 stations at 5e-4 each: 0.14 expected
    assert sum(len(a.readings) + len(a.stations) for a in accused) <= 1


@pytest.mark.parametrize("liar", range(4))
def test_a_biased_station_is_named_with_its_bias(liar):
    wrong = np.zeros((60, 4))
    wrong[:, liar] = 4.0
    found = suspect_readings(Profile.of(scene(3, wrong), TEMPERATURE, ground=0.0))
    assert list(found.stations) == [liar]
    assert found.error[liar] == pytest.approx(4.0, abs=1.5)  # its own offset and what the profile allows
    assert len(found.readings) == 0


def test_two_stations_that_contradict_each_other_are_both_named_and_neither_accused():
    wrong = np.zeros((60, 2))
    wrong[:, 1] = 8.0
    found = suspect_readings(Profile.of(scene(4, wrong, (2.0, 50.0)), TEMPERATURE, ground=0.0))
    assert list(found.stations) == []
    assert list(found.undecided) == [0, 1]


def test_a_wild_reading_is_named_and_its_station_is_not():
    wrong = np.zeros((60, 4))
    wrong[17, 2], wrong[40, 0] = -6.0, 3.0
    found = suspect_readings(Profile.of(scene(5, wrong), TEMPERATURE, ground=0.0))
    assert list(found.readings) == [17 * 4 + 2, 40 * 4]
    assert found.w[17 * 4 + 2] < -10.0
    assert list(found.stations) == []


def test_leaving_out_wild_readings_by_turns_is_the_profile_without_them():
    wrong = np.zeros((60, 4))
    wrong[17, 2] = -6.0
    all_of = scene(5, wrong)
    kept = np.arange(240) != 17 * 4 + 2
    found = suspect_readings(Profile.of(all_of, TEMPERATURE, ground=0.0))
    rest = ProfileReadings(*(getattr(all_of, f)[kept] for f in ("seconds", "z", "station", "value", "count")))
    again = suspect_readings(Profile.of(rest, TEMPERATURE, ground=0.0))
    # the readings' mean moves by 6/240 °C beside a prior of 20 °C, and the mean height by 0.02 m
    np.testing.assert_allclose(found.w[kept], again.w, atol=0.02)


def test_invalid_values_are_refused():
    some = readings([0.0, 60.0], [2.0], [[15.0], [15.0]])
    with pytest.raises(EstimationError, match="no readings; priors alone"):
        Profile.of(ProfileReadings(*(np.zeros(0) for _ in range(5))), TEMPERATURE, ground=0.0)
    with pytest.raises(ValidityError, match="height above the ground -1 m"):
        Profile.of(some, TEMPERATURE, ground=3.0)
    with pytest.raises(ValidityError, match="height above the ground"):
        Profile.of(some, TEMPERATURE, ground=0.0).at([0.0], [-0.5])
    with pytest.raises(ValidityError, match="value of a reading is not finite"):
        Profile.of(readings([0.0], [2.0], [[np.nan]]), HUMIDITY, ground=0.0)
    many = np.zeros(MOST_READINGS + 1)
    with pytest.raises(EstimationError, match="average them over blocks"):
        Profile.of(ProfileReadings(many, many, many.astype(int), many, many + 1), TEMPERATURE, ground=0.0)
    with pytest.raises(ValidityError, match="block of 0"):
        some.averaged(0.0)
