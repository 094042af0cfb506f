"""Noise as a function of time: its statistics over many draws against the processes that it stands for."""

import numpy as np
import pytest

from catseye.simulator.twin.waves import band, correlated, joined, walk

CHANNELS = 1500  # draws: a variance is then good to sqrt(2 / 1500) = 3.7 %, and 10 % leaves room for the bands' steps


@pytest.mark.parametrize("lag", [60.0, 1200.0, 3600.0, 36_000.0])
@pytest.mark.parametrize("since", [0.0, 5000.0, 100_000.0])
def test_a_walk_spreads_with_the_root_of_time(lag, since):
    step = 0.010 / 60.0  # 10 mrad in the root of an hour
    found = np.mean(
        [
            np.var(np.diff(walk(np.random.default_rng(seed), step, shortest=5.0, channels=CHANNELS)(at), axis=0))
            for seed in range(6)
            for at in [np.array([since, since + lag])]
        ]
    )
    assert found == pytest.approx(step**2 * lag, rel=0.1)


def test_a_walk_begins_at_zero_and_is_smooth_below_its_shortest_period():
    waves = walk(np.random.default_rng(1), 1.0, shortest=5.0, channels=CHANNELS)
    assert waves([0.0])[0] == pytest.approx(np.zeros(CHANNELS), abs=1e-12)
    quick = np.var(np.diff(waves([100.0, 100.05]), axis=0))
    assert quick < 0.2 * 0.05  # a true walk would spread by 0.05


@pytest.mark.parametrize(
    ("lag", "correlation"), [(0.0, 1.0), (1.0, np.exp(-0.25)), (4.0, np.exp(-1)), (12.0, np.exp(-3))]
)
def test_correlated_noise_forgets_exponentially(lag, correlation):
    products = []
    for seed in range(6):
        a, b = correlated(np.random.default_rng(seed), 0.3, 4.0, channels=CHANNELS)([77.0, 77.0 + lag])
        products.append(np.mean(a * b))
    assert np.mean(products) == pytest.approx(0.09 * correlation, abs=0.09 * 0.06)


def test_a_band_keeps_to_its_frequencies():
    rng = np.random.default_rng(3)
    waves = band(rng, 2.0, 0.8, high=1.2, channels=CHANNELS)
    values = waves(np.linspace(0.0, 50.0, 11))
    assert np.var(values) == pytest.approx(4.0, rel=0.05)
    rate = (waves([7.0 + 1e-4]) - waves([7.0 - 1e-4])) / 2e-4
    # mean square of 2 pi f between 0.8 and 1.2 Hz
    assert np.var(rate) == pytest.approx(4.0 * 4 * np.pi**2 * (1.2**3 - 0.8**3) / 3 / 0.4, rel=0.12)


def test_parts_joined_are_the_parts_side_by_side():
    rng = np.random.default_rng(4)
    a, b = walk(rng, 1.0, shortest=5.0, channels=2), correlated(rng, 1.0, 3.0)
    t = np.linspace(0.0, 1e4, 7)
    assert joined(a, b)(t) == pytest.approx(np.column_stack([a(t), b(t)]), abs=1e-12)
    assert a.scaled([2.0, 0.0])(t) == pytest.approx(a(t) * [2.0, 0.0], abs=1e-12)
