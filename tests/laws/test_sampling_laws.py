"""Laws of sampling, and of the estimators beside synchronous detection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.signal.detection.frequency_plan import FrequencyPlan
from catseye.signal.detection.phase import detect
from catseye.signal.detection.sampling import (
    SamplingPlan,
    aliasing_harmonics,
    buffer_mean,
    motion_effect,
    tone_response,
)
from catseye.signal.detection.spectral import bin_phasor, strongest_tone
from catseye.signal.detection.zero_crossing import crossing_phase

phases = st.floats(0.0, 2 * np.pi, exclude_max=True)
per_cycle = st.integers(3, 40)
cycles = st.integers(1, 12)
samplings = st.builds(SamplingPlan, per_cycle, cycles, st.floats(1.0, 2000.0))
sides = st.sampled_from(["above", "below"])


def turned(phase, other):
    """Distance of two phases round the circle."""
    return abs((phase - other + np.pi) % (2 * np.pi) - np.pi)


@given(st.integers(-5, 70_000), st.integers(-5, 70_000), st.floats(-10.0, 20_000.0))
def test_a_sampling_keeps_the_instruments_limits_or_is_refused(n, m, f):
    allowed = n >= 3 and m >= 1 and 0 < f <= 10_000 and n * m <= 65_536 and n * f <= 100_000
    usual = SamplingPlan()
    if allowed:
        assert usual.with_(samples_per_cycle=n, cycles=m, intermediate_hz=f) == SamplingPlan(n, m, f)
    else:
        with pytest.raises(ValidityError):
            usual.with_(samples_per_cycle=n, cycles=m, intermediate_hz=f)
    assert usual == SamplingPlan(64, 128, 1000.0)


@given(samplings, st.floats(-100.0, 100.0), phases, st.floats(0.01, 10.0))
def test_a_tone_of_any_frequency_is_detected_with_its_predicted_response(sampling, x, phase, amplitude):
    turns = x * np.arange(sampling.samples) / sampling.samples_per_cycle
    found = detect(amplitude * np.cos(2 * np.pi * turns - phase), sampling.samples_per_cycle).phasor
    response = tone_response(sampling, x * sampling.intermediate_hz)
    # rounding of up to 100 x 12 turns
    assert abs(found - response.phasor(amplitude, phase)) <= 1e-11 * amplitude
    assert abs(found) <= amplitude * (float(response.bound) + 1e-11)


@given(samplings, st.integers(2, 100))
def test_a_harmonic_is_seen_whole_or_not_at_all(sampling, order):
    bound = float(tone_response(sampling, order * sampling.intermediate_hz).bound)
    seen = order in aliasing_harmonics(sampling.samples_per_cycle, 100)
    assert bound == pytest.approx(1.0 if seen else 0.0, abs=1e-11)


@given(samplings, st.floats(-200.0, 200.0))
def test_a_mean_of_turning_arrows_is_never_longer_than_one_and_turns_the_other_way_when_they_do(sampling, x):
    mean = complex(buffer_mean(x, sampling))
    assert abs(mean) <= 1.0 + 1e-12
    assert abs(complex(buffer_mean(-x, sampling)) - mean.conjugate()) <= 1e-12


@given(sides, st.floats(1.0, 1000.0), st.floats(1e-4, 0.04))
def test_phase_falls_with_distance_above_and_grows_below(side, distance, step):
    plan = FrequencyPlan(oscillator=side)
    change = np.angle(np.exp(1j * (plan.phase(distance + step) - plan.phase(distance))))
    # phases of 6e4 rad are rounded to 1e-11
    assert change == pytest.approx(plan.phase_sign * 4 * np.pi * 1.5e9 / 299_792_458.0 * step, abs=1e-9)


@given(sides, samplings, st.floats(-0.4, 0.4), phases)
def test_a_steadily_moving_target_reads_its_phase_in_the_middle(side, sampling, share, phase):
    """`share` is the part of a cycle that the phase turns in the buffer."""
    plan = FrequencyPlan(oscillator=side)
    speed = share * plan.half_wavelength() / sampling.duration
    effect = motion_effect(plan, sampling, range_rate=speed)
    t = np.arange(sampling.samples) / sampling.sample_rate_hz
    moving = phase + float(effect.phase_rate) * (t - effect.epoch)
    found = detect(np.cos(2 * np.pi * sampling.intermediate_hz * t - moving), sampling.samples_per_cycle)
    assert turned(found.phase, phase) <= float(effect.phase_bias_bound) + 1e-9
    assert np.sign(effect.phase_rate) == plan.phase_sign * np.sign(speed)


@given(per_cycle, cycles, st.integers(0, 1000))
def test_the_bin_of_a_fourier_transform_is_synchronous_detection(n, m, seed):
    samples = np.random.default_rng(seed).normal(size=(2, m * n))
    assert np.max(np.abs(bin_phasor(samples, n) - detect(samples, n).phasor)) <= 1e-13


@given(st.integers(32, 64), st.integers(2, 8), phases, st.floats(0.1, 10.0), st.floats(-5.0, 5.0))
def test_crossings_know_neither_size_nor_constant_of_a_wave(n, m, phase, size, constant):
    wave = np.cos(2 * np.pi * np.arange(n * m) / n - phase)
    one, other = crossing_phase(wave, n), crossing_phase(size * wave + constant, n)
    assert turned(one.phase, other.phase) <= 1e-9
    # straight lines between samples, on a wave whose halves alike begin at any place between two (n odd: not alike)
    assert turned(one.phase, phase) <= 0.0161 * (2 * np.pi / n) ** 3 + 1e-12


@settings(max_examples=40)
@given(st.floats(0.0, 1.5), st.floats(0.0, 1.5), st.integers(0, 4095))
def test_the_average_of_both_edges_forgives_any_clipping_of_a_pure_wave(top, bottom, start):
    """Cut at cos(top) and -cos(bottom): the level moves, rising and falling edges move apart by the same."""
    fine = 4096
    wave = np.clip(np.cos(2 * np.pi * np.arange(2 * fine) / fine), -np.cos(bottom), np.cos(top))
    level = -(np.sin(top) - top * np.cos(top) - np.sin(bottom) + bottom * np.cos(bottom)) / np.pi
    found = crossing_phase(np.roll(wave, start), fine)
    phase = 2 * np.pi * start / fine
    if abs(level) < min(np.cos(top), np.cos(bottom)) - 0.01:  # an edge there is, away from the corners
        assert turned(found.phase, phase) <= 1e-9
        # corners of the clipped wave fall between points: 1e-6 of its mean
        assert turned(found.rising, phase + np.arcsin(level)) <= 1e-6
        assert turned(found.falling, phase - np.arcsin(level)) <= 1e-6


@settings(max_examples=50)
@given(st.floats(5.0, 100.0), phases, st.floats(0.01, 10.0), st.floats(-3.0, 3.0))
def test_a_tone_of_unknown_frequency_gives_frequency_amplitude_and_phase(bins, phase, amplitude, constant):
    length = 512
    wave = amplitude * np.cos(2 * np.pi * bins * np.arange(length) / length - phase) + constant
    found = strongest_tone(wave, float(length))
    leak = 1.0 / (2 * bins - 2) ** 3  # of the tone's own image, and of the constant as the window leaves it
    assert abs(found.frequency_hz - bins) <= leak + 1e-9
    assert abs(found.amplitude / amplitude - 1) <= 2 * leak + 1e-9
    middle = phase - np.pi * bins * (length - 1) / length
    assert turned(found.phase_centre, middle) <= 2 * leak + 1e-9
