"""A twin's converter: what a plain Fourier sum of its codes finds of the return that was put in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.ranger.head import SamplingSettings
from catseye.simulator.twin.converter import Converter

VOLT = 10.0 / 32768.0
DEFAULT = SamplingSettings()
QUIET = Converter(offset=0.1, noise=1e-9)


def codes(phasors, at=None, sampling=DEFAULT, converter=QUIET, seed=1, gain=1.0):
    at = np.linspace(0.0, sampling.duration, len(phasors)) if at is None else at
    return converter.codes(
        at, np.asarray(phasors, complex), sampling=sampling, generator=np.random.default_rng(seed), gain=gain
    )


def order(samples, k=1, n=64):
    """Complex amplitude of the k-th order of each cycle, V: A e^{i phi} of A cos(k j - phi)."""
    turn = np.exp(2j * np.pi * k * np.arange(n) / n)
    return 2.0 / n * (samples.reshape(-1, n).astype(float) * VOLT) @ turn


def test_amplitude_phase_offset_and_harmonics_are_those_put_in():
    found = codes(np.full(25, 3.0 * np.exp(0.7j)))
    assert found.dtype == np.int16
    assert found.shape == (8192,)
    # Rounding is 0.29 codes a sample, over 64 samples of each cycle 0.05 codes = 16 uV.
    assert np.allclose(order(found), 3.0 * np.exp(0.7j), atol=1e-4)
    assert found.mean() * VOLT == pytest.approx(0.1, abs=2e-5)
    assert np.allclose(np.abs(order(found, 2)), 3.0 * 0.0020, atol=1e-4)
    assert np.allclose(np.abs(order(found, 3)), 3.0 * 0.0003, atol=1e-4)


@settings(max_examples=30)
@given(st.floats(-60.0, 60.0), st.floats(-3.0, 3.0))
def test_a_steady_range_rate_turns_the_phase_at_its_rate(rate, phase):
    """60 rad/s is 0.95 m/s: more than the rim of the dish does at slew."""
    at = np.linspace(0.0, 0.128, 25)
    each = order(codes(4.0 * np.exp(1j * (phase + rate * at)), at))
    middles = (np.arange(128) + 0.5 - 0.5 / 64) * 1e-3  # of the samples of each cycle
    # In a cycle the line leaves the arc by (rate 1 ms)^2/8 of the amplitude; the turn leaks by rate/omega/2 of it.
    assert np.max(np.abs(np.angle(each * np.exp(-1j * (phase + rate * middles))))) < 6e-3
    assert abs(np.angle(np.mean(each * np.exp(-1j * (phase + rate * middles))))) < 5e-3
    assert np.allclose(np.abs(each), 4.0, rtol=6e-3)


def test_a_return_that_comes_and_goes_is_followed():
    at = np.linspace(0.0, 0.128, 129)
    wanted = np.where((at > 0.04) & (at < 0.08), 0.0, 5.0)
    found = np.abs(order(codes(wanted, at)))
    assert np.all(found[42:78] < 1e-3)
    assert np.allclose(found[:38], 5.0, atol=1e-3)
    assert np.allclose(found[84:], 5.0, atol=1e-3)


def test_too_much_is_cut_at_the_converter_s_ends():
    found = codes(np.full(25, 5.0), gain=4.0)
    assert found.max() == 32_767
    assert found.min() == -32_768
    assert np.mean(np.abs(found.astype(int)) >= 32_767) == pytest.approx(2 / 3, abs=0.02)  # |20 cos| > 10


def test_noise_is_white_of_the_given_size_from_the_generator():
    loud = Converter(offset=0.0, noise=0.2)
    first, again, other = (codes(np.zeros(25), converter=loud, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    volts = first * VOLT
    assert volts.std() == pytest.approx(0.2, rel=5 / np.sqrt(2 * 8192))  # five sigma of a standard deviation
    assert abs(np.mean(volts[1:] * volts[:-1])) < 5 * 0.2**2 / np.sqrt(8192)


@pytest.mark.parametrize(
    "sampling",
    [
        SamplingSettings(3, 1, 1),
        SamplingSettings(10, 1, 10_000),
        SamplingSettings(64, 1024, 1000),
        SamplingSettings(1000, 5, 99),
    ],
)
def test_any_legal_sampling_gives_its_words(sampling):
    found = codes(np.full(9, 2.0 * np.exp(-1j)), sampling=sampling)
    assert found.shape == (sampling.samples * sampling.cycles,)
    each = order(found - np.int16(round(0.1 / VOLT)), n=sampling.samples)
    # Of three samples a cycle the second harmonic looks like the first.
    assert np.allclose(each, 2.0 * np.exp(-1j), atol=8e-3)


def test_a_return_that_turns_far_within_a_slow_cycle_is_sampled_as_it_is():
    sampling = SamplingSettings(1000, 2, 1)
    at = np.linspace(0.0, 2.0, 401)
    found = codes(3.0 * np.exp(1j * (0.4 + 15.0 * at)), at, sampling)
    t = np.arange(2000) / 1000.0
    wanted = 0.1 + 3.0 * np.cos(2 * np.pi * t - 0.4 - 15.0 * t)
    assert np.max(np.abs(found * VOLT - wanted)) < 3.0 * 0.0023 + VOLT  # both harmonics, and rounding


def test_slow_and_fast_cycles_are_sampled_alike():
    """A phase that turns straight: 99 Hz goes sample by sample, 100 Hz cycle by cycle."""
    found = []
    for hertz in (99, 100):
        sampling = SamplingSettings(64, 10, hertz)
        at = np.linspace(0.0, sampling.duration, 25)
        found.append(order(codes(3.0 * np.exp(2j * at * hertz / 100), at, sampling)))
    assert np.allclose(*found, atol=1e-3)


def test_rangers_differ_and_a_ranger_is_itself():
    first, again, other = Converter.of("ZY101", 4), Converter.of("ZY101", 4), Converter.of("ZY102", 4)
    assert first == again != other
    assert abs(first.offset) <= 0.25
    assert 0.165 <= first.noise <= 0.245
