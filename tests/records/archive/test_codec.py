"""Codec of samples: exact for any samples, and near the entropy of their noise for a signal."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from catseye.records.archive.codec import decoded, encoded


@given(st.data())
def test_any_samples_come_back_bit_for_bit(data):
    width = data.draw(st.integers(1, 40))
    shape = (data.draw(st.integers(1, 4)), width)
    samples = data.draw(arrays.arrays(np.int16, shape, elements=st.integers(-32768, 32767)))
    period = data.draw(st.integers(1, width))
    cycles = data.draw(st.integers(1, width // period))
    mean, departures = encoded(samples, period, cycles)
    assert (mean.shape, departures.dtype) == ((shape[0], period), np.uint16)
    assert np.array_equal(decoded(mean, departures), samples)


def test_departures_by_hand():
    """Cycles (10, 0), (12, 1), (14, -1): mean (12, 0); departures -2, 0, 0, 1, 2, -1 in zigzag 3, 0, 0, 2, 4, 1."""
    samples = np.array([[10, 0, 12, 1, 14, -1]], np.int16)
    mean, departures = encoded(samples, 2, 3)
    assert mean.tolist() == [[12, 0]]
    assert departures.tolist() == [[3, 0, 0, 2, 4, 1]]


def test_a_difference_beyond_sixteen_bits_wraps_and_comes_back():
    samples = np.array([[32767, 32767, -32768, 32767]], np.int16)
    mean, departures = encoded(samples, 1, 4)
    assert mean.tolist() == [[16383]]
    assert np.array_equal(decoded(mean, departures), samples)


def test_what_is_left_of_a_signal_is_its_noise():
    rng = np.random.default_rng(5)
    cycle = np.rint(20000 * np.sin(2 * np.pi * np.arange(64) / 64))
    samples = np.rint(np.tile(cycle, 128) + rng.normal(0.0, 100.0, (8, 64 * 128))).astype(np.int16)
    departures = encoded(samples, 64, 128)[1]
    signed = (departures >> 1).astype(int) ^ -(departures & 1).astype(int)
    assert np.std(signed) < 1.01 * 100.0  # 1/128 of the variance went into the mean
    assert np.std(samples.astype(float)) > 14000
