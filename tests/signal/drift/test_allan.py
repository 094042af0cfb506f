"""Allan deviations against the printed values of a handbook's own random series, and against scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.signal.drift.allan import allan_deviation, expected_variance, octaves


def handbook_series() -> np.ndarray:
    """The 1000 readings of [RILEY08] section 12: a multiplicative congruential generator, over its modulus."""
    values = [1234567890]
    for _ in range(999):
        values.append(16807 * values[-1] % 2147483647)
    return np.array(values) / 2147483647


def test_the_handbooks_thousand_readings_give_its_printed_overlapping_deviations():
    found = allan_deviation(handbook_series(), [1, 10, 100]).deviation
    assert found == pytest.approx([2.922319e-01, 9.159953e-02, 3.241343e-02], rel=2e-7)


def test_averages_of_m_readings_agree_with_the_plain_definition():
    y = np.random.default_rng(5).normal(size=60)
    for m in (1, 3, 20):
        average = np.convolve(y, np.full(m, 1.0 / m), mode="valid")
        plain = np.sqrt(0.5 * np.mean((average[m:] - average[:-m]) ** 2))
        assert allan_deviation(y, [m]).deviation[0] == pytest.approx(plain, rel=1e-12)


def test_white_noise_and_walks_have_the_expected_variance():
    rng = np.random.default_rng(6)
    sizes = np.array([1, 4, 16, 64])
    white = np.mean([allan_deviation(rng.normal(size=1024), sizes).deviation ** 2 for _ in range(300)], axis=0)
    walk = np.mean([allan_deviation(rng.normal(size=1024).cumsum(), sizes).deviation ** 2 for _ in range(300)], axis=0)
    assert white == pytest.approx(expected_variance(sizes, white=1.0), rel=0.06)
    assert walk == pytest.approx(expected_variance(sizes, walk=1.0), rel=0.12)  # few pairs at 64


@given(st.floats(0.01, 0.49), st.integers(1, 40), st.floats(0.1, 10.0))
@settings(max_examples=40)
def test_a_sine_has_the_variance_of_its_formula(frequency, m, amplitude):
    """[RILEY08] 6.2 has A^2 sin^4(x)/x^2, x = pi f m tau; readings that are points have m sin(pi f tau) below."""
    n = 20_000
    y = amplitude * np.sin(2 * np.pi * frequency * np.arange(n) + 0.3)
    found = allan_deviation(y, [m]).deviation[0] ** 2
    ends = amplitude**2 * 20.0 / n / np.sin(np.pi * frequency) ** 2  # what an unfinished period at the ends can do
    expected = (amplitude * np.sin(np.pi * frequency * m) ** 2 / (m * np.sin(np.pi * frequency))) ** 2
    assert abs(found - expected) < ends


@pytest.mark.parametrize(("kind", "rel"), [("white", 0.15), ("random walk", 0.2)])
def test_degrees_of_freedom_are_those_of_the_scatter(kind, rel):
    rng = np.random.default_rng(7)
    sizes = [1, 4, 16]
    squares, degrees = [], []
    for _ in range(2000):
        y = rng.normal(size=256)
        found = allan_deviation(y if kind == "white" else y.cumsum(), sizes)
        squares.append(found.deviation**2)
        if found.kind == (kind,) * 3:
            degrees.append(found.degrees)
    squares = np.array(squares)
    seen = 2.0 * squares.mean(axis=0) ** 2 / squares.var(axis=0)
    assert np.mean(degrees, axis=0) == pytest.approx(seen, rel=rel)


def test_an_interval_has_its_stated_coverage():
    rng = np.random.default_rng(8)
    held = 0
    for _ in range(1000):
        low, high = allan_deviation(rng.normal(size=256), [8]).interval(0.9)[0]
        held += low < np.sqrt(1.0 / 8.0) < high
    assert 870 < held < 930


def test_lengths_that_do_not_fit_and_gaps_are_refused():
    with pytest.raises(ValidityError, match=r"not whole numbers of 1 to 5"):
        allan_deviation(np.arange(10.0), [6])
    with pytest.raises(ValidityError, match="reading 2"):
        allan_deviation([1.0, 2.0, np.nan, 1.0, 2.0])
    with pytest.raises(ValidityError, match="at least 4"):
        octaves(3)


def test_degrees_of_freedom_of_flicker_are_those_of_the_scatter():
    rng, n, sizes = np.random.default_rng(9), 512, [1, 4, 16, 64]
    k = np.arange(1, 8 * n)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])  # a half integral of white noise
    filtered = np.fft.rfft(response, 16 * n)
    squares, degrees = [], []
    for _ in range(1500):
        y = np.fft.irfft(np.fft.rfft(rng.normal(size=8 * n), 16 * n) * filtered)[7 * n : 8 * n]
        found = allan_deviation(y, sizes)
        squares.append(found.deviation**2)
        degrees.append([d if kind == "flicker" else np.nan for d, kind in zip(found.degrees, found.kind, strict=True)])
    squares = np.array(squares)
    seen = 2.0 * squares.mean(axis=0) ** 2 / squares.var(axis=0)
    assert np.nanmean(degrees, axis=0) == pytest.approx(seen, rel=0.3)  # [RILEY08] has them to some 10 to 20 %
