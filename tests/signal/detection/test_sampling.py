"""Frequencies against a mixer worked out in numbers, sampling against its limits, responses against brute force."""

import math

import mpmath
import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import ValidityError
from catseye.signal.cycles.whole import unwrapped_length, whole_cycles
from catseye.signal.detection.frequency_plan import FrequencyPlan
from catseye.signal.detection.phase import detect
from catseye.signal.detection.sampling import (
    SamplingPlan,
    aliasing_harmonics,
    buffer_mean,
    jitter_u_phase,
    modulation_response,
    motion_effect,
    tone_response,
)

N_AIR = 1.000253246815  # group index at 20 C, 933 hPa, 50 %: recomputed value of [PARKER04] 1.49


def turned(phase, other):
    """Difference of two phases in (-pi, pi]."""
    return np.angle(np.exp(1j * (np.asarray(phase) - other)))


def tone(sampling, frequency_hz, phase, amplitude=1.0):
    """Samples of one tone, from its definition."""
    t = np.arange(sampling.samples) / sampling.sample_rate_hz
    return amplitude * np.cos(2 * np.pi * frequency_hz * t - phase)


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.37, 0.8])
def test_the_sign_of_phase_is_that_of_a_mixer(side, share):
    """Carrier 3000 Hz, IF 10 Hz: product, ideal low pass, samples, synchronous detection; tau in carrier periods."""
    plan = FrequencyPlan(reference_hz=200.0, multiple=15, oscillator=side)
    carrier, intermediate, fine = plan.modulation_hz, 10.0, 64_000
    t = np.arange(fine) / fine  # 1 s: whole periods of everything
    received = np.cos(2 * np.pi * carrier * (t - share / carrier))
    mixed = received * np.cos(2 * np.pi * plan.local_oscillator_hz(intermediate) * t)
    spectrum = np.fft.rfft(mixed)
    spectrum[1000:] = 0.0  # Hz: the mixer's filter
    samples = np.fft.irfft(spectrum, fine)[::100]  # 64 a cycle, ten cycles
    distance = share / carrier * SPEED_OF_LIGHT / 2
    assert turned(detect(samples, 64).phase, plan.phase(distance)) == pytest.approx(0.0, abs=1e-9)
    assert plan.phase_sign == (-1 if side == "above" else 1)


def test_the_notes_numbers_come_out():
    plan = FrequencyPlan()
    assert plan.modulation_hz == 1_500_000_000.0
    assert plan.local_oscillator_hz(1000.0) == 1_500_001_000.0  # 5.1.1 and 5.3
    assert FrequencyPlan(oscillator="below").local_oscillator_hz(1000.0) == 1_499_999_000.0
    assert plan.half_wavelength() == pytest.approx(0.09993081933, abs=5e-12)  # the memo's HWLV
    assert 2 * plan.half_wavelength(N_AIR) == pytest.approx(0.199811037, abs=5e-10)  # 1.30
    assert plan.range_per_radian(N_AIR) * math.atan(1e-3) == pytest.approx(15.900e-6, abs=5e-10)  # 5.8
    assert plan.phase_gradient() == pytest.approx(-4 * math.pi * 1.5e9 / SPEED_OF_LIGHT, rel=1e-14)  # 5.9 and 5.14


def test_a_distance_is_recovered_through_the_reduction():
    plan, distance = FrequencyPlan(), 123.456789
    half = plan.half_wavelength(N_AIR)
    phase = plan.phase(distance, N_AIR)
    cycles, margin = whole_cycles(distance + 0.03, phase, half)
    assert float(unwrapped_length(cycles, phase, half)) == pytest.approx(distance, abs=1e-11)
    assert float(margin) == pytest.approx(half / 2 - 0.03, abs=1e-11)


def test_a_fast_reference_makes_ranges_too_long():
    nominal, true = FrequencyPlan(), FrequencyPlan(reference_hz=100e6 * (1 + 2e-6))
    distance = 100.0
    read = unwrapped_length(*_cycles(distance, true, nominal))
    assert (float(read) / distance - 1) / 1e-6 == pytest.approx(nominal.range_scale_ppm(2.0), abs=1e-6)
    shifted = FrequencyPlan(reference_hz=1.5e9 + 600.0, multiple=1)
    read = unwrapped_length(*_cycles(distance, shifted, nominal))
    assert (float(read) / distance - 1) / 1e-6 == pytest.approx(
        nominal.range_scale_ppm(modulation_offset_hz=600.0), abs=1e-6
    )


def _cycles(distance, true, nominal):
    """Whole cycles, phase of the true modulation, half wavelength of the nominal one."""
    phase, half = true.phase(distance), nominal.half_wavelength()
    return whole_cycles(distance, phase, half)[0], phase, half


def test_beats_follow_light_and_oscillator():
    above, below = FrequencyPlan(), FrequencyPlan(oscillator="below")
    assert above.beat_hz(1000.0) == below.beat_hz(1000.0) == 1000.0
    assert above.beat_hz(1000.0, received_offset_hz=3.0) == 997.0
    assert below.beat_hz(1000.0, received_offset_hz=3.0) == 1003.0
    assert above.beat_hz(1000.0, oscillator_offset_hz=3.0) == 1003.0
    assert below.beat_hz(1000.0, oscillator_offset_hz=3.0) == 997.0
    receding = -2 * 0.25 / SPEED_OF_LIGHT * above.modulation_hz  # Hz, Doppler at 0.25 m/s
    for plan in (above, below):
        rate = float(motion_effect(plan, SamplingPlan(), range_rate=0.25).phase_rate)
        assert plan.beat_hz(1000.0, received_offset_hz=receding) == pytest.approx(1000 - rate / (2 * np.pi), abs=1e-9)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: FrequencyPlan(reference_hz=0.0), "reference frequency 0.0 Hz is not above 0"),
        (lambda: FrequencyPlan(reference_hz=float("nan")), "reference frequency nan Hz"),
        (lambda: FrequencyPlan(multiple=1.5), "multiple of the reference 1.5 is not a whole number of at least 1"),
        (lambda: FrequencyPlan(oscillator="beside"), "local oscillator 'beside' is neither 'above' nor 'below'"),
        (lambda: SamplingPlan().with_(cycles=1200), "1200 cycles of 64 samples are 76800, the buffer holds 65536"),
        (
            lambda: SamplingPlan().with_(intermediate_hz=2000.0),
            "128000 samples/s, the converter takes 100000; at most 1562.5",
        ),
        (lambda: SamplingPlan(cycles=0), "cycles 0 is not a whole number of at least 1"),
        (lambda: SamplingPlan(cycles=1.0), "cycles 1.0 is not a whole number"),
        (lambda: SamplingPlan(cycles=True), "cycles True is not a whole number"),
        (lambda: SamplingPlan(samples_per_cycle=2), "samples a cycle 2 is not a whole number of at least 3"),
        (lambda: SamplingPlan(samples_per_cycle=70_000, intermediate_hz=1.0), "take fewer samples a cycle"),
        (
            lambda: SamplingPlan(samples_per_cycle=8, intermediate_hz=10_001.0),
            "10001.0 Hz is not above 0 and at most 10000",
        ),
        (lambda: SamplingPlan(intermediate_hz=float("nan")), "intermediate frequency nan Hz"),
        (lambda: SamplingPlan(intermediate_hz=0.0), "intermediate frequency 0.0 Hz"),
        (lambda: SamplingPlan().ranges_per_second(-1.0), "overhead -1.0 s"),
        (lambda: aliasing_harmonics(2, 9), "samples a cycle 2"),
        (
            lambda: motion_effect(FrequencyPlan(), SamplingPlan(), range_rate=1.0),
            "turns 1.28 cycles within a buffer of 0.128 s",
        ),
    ],
)
def test_settings_beyond_the_instrument_are_refused_in_one_line(make, text):
    with pytest.raises(ValidityError) as caught:
        make()
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_refused_change_leaves_the_sampling_as_it_was():
    sampling = SamplingPlan()
    with pytest.raises(ValidityError):
        sampling.with_(cycles=1025)
    assert sampling == SamplingPlan(64, 128, 1000.0)
    assert sampling.with_(cycles=1024).samples == 65_536  # the limit itself is allowed
    assert sampling.with_(intermediate_hz=1562.5).sample_rate_hz == 100_000.0
    assert sampling.with_(samples_per_cycle=10, intermediate_hz=10_000.0).sample_rate_hz == 100_000.0
    # together they fit, one after the other the first would be refused
    assert sampling.with_(cycles=4096, samples_per_cycle=16).samples == 65_536


def test_narrow_integers_do_not_overflow():
    with pytest.raises(ValidityError, match="76800"):
        SamplingPlan(samples_per_cycle=np.int16(64), cycles=np.int16(1200))
    assert SamplingPlan(samples_per_cycle=np.int8(64), cycles=np.int8(100)).samples == 6400


def test_durations_and_rates():
    usual = SamplingPlan()
    assert usual.duration == 0.128
    assert usual.ranges_per_second() == 7.8125  # "below 7.8 ranges a second" with any overhead
    assert usual.ranges_per_second(0.1) == pytest.approx(1 / 0.228)
    assert usual.centre == pytest.approx(0.064 - 0.5 / 64_000, rel=1e-14)


@pytest.mark.parametrize(("n", "m"), [(3, 1), (4, 7), (16, 5), (64, 20)])
def test_the_mean_over_a_buffer_agrees_with_mpmath(n, m):
    sampling = SamplingPlan(n, m, 10.0)
    for x in (0.0, 1e-9, 0.057, 0.5, 1.0, 2.25, n - 1.0, n - 1e-7, float(n), n + 0.3, -7.3, 100.125):
        with mpmath.workdps(40):
            exact = complex(mpmath.fsum(mpmath.expjpi(2 * mpmath.mpf(x) * j / n) for j in range(m * n)) / (m * n))
        # rounding of x turns the sum's phase by 1e-16 of the turns in the buffer
        assert abs(complex(buffer_mean(x, sampling)) - exact) <= 1e-15 * (10 + abs(x) * m)


@pytest.mark.parametrize(("n", "m"), [(3, 2), (4, 9), (16, 8), (64, 128)])
def test_any_tone_is_detected_with_its_predicted_response(n, m):
    sampling = SamplingPlan(n, m, 1000.0)
    rng = np.random.default_rng(n)
    for f in (0.0, 57.0, 999.9, 1000.0, 1000.37, 2000.0, 31_999.0, 63_000.0, 65_017.0, *rng.uniform(0, 1e5, 10)):
        phase = rng.uniform(0, 2 * np.pi)
        found = detect(tone(sampling, f, phase, 0.7), n).phasor
        assert abs(found - tone_response(sampling, f).phasor(0.7, phase)) <= 1e-11


def test_a_signal_off_its_lock_has_the_phase_of_the_middle_and_a_cyclic_bias():
    sampling, offset = SamplingPlan(), 1e-4
    phases = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    found = np.array([detect(tone(sampling, 1000 * (1 + offset), p), 64).phase for p in phases])
    middle = phases - 2 * np.pi * offset * 1000.0 * sampling.centre
    bias = turned(found, middle)
    assert np.max(np.abs(bias)) == pytest.approx(offset / 2, rel=0.01)  # 0.8 um of range
    spectrum = np.abs(np.fft.rfft(bias)) / 24
    assert spectrum[2] == pytest.approx(offset / 2, rel=0.01)
    assert np.max(np.delete(spectrum, 2)) < 1e-8  # two periods a turn and nothing else, to first order
    response = tone_response(sampling, 1000 * (1 + offset))
    assert float(np.abs(response.direct)) == pytest.approx(np.sinc(128 * offset), rel=1e-6)
    exact = float(np.arcsin(np.abs(response.image) / np.abs(response.direct)))
    assert np.max(np.abs(bias)) == pytest.approx(exact, rel=0.01)


def test_harmonics_vanish_or_alias_as_documented():
    for n in (3, 4, 5, 16, 64):
        sampling = SamplingPlan(n, 4, 100.0)
        seen = [k for k in range(2, 200) if abs(detect(tone(sampling, 100.0 * k, 0.3), n).phasor) > 1e-9]
        assert seen == aliasing_harmonics(n, 199)
    sampling = SamplingPlan(16, 4)
    above = detect(tone(sampling, 17_000.0, 0.3), 16).phasor
    below = detect(tone(sampling, 15_000.0, 0.3), 16).phasor
    assert abs(above - np.exp(0.3j)) < 1e-12
    assert abs(below - np.exp(-0.3j)) < 1e-12


def test_the_bound_of_a_spur_is_reached_and_never_passed():
    sampling = SamplingPlan(16, 8)
    response = tone_response(sampling, 1060.0)
    signal = tone(sampling, 1000.0, 1.0)
    phases = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    for own in np.linspace(0, np.pi, 60):
        spurs = np.array([tone(sampling, 1060.0, p, 0.02) for p in phases])
        rotated = tone(sampling, 1000.0, 1.0 + own)
        bias = np.max(np.abs(turned(detect(rotated + spurs, 16).phase, 1.0 + own)))
        assert bias <= float(response.phase_bias_bound(0.02)) + 1e-12
        if own == 0.0:
            largest = bias
        largest = max(largest, bias)
    assert largest == pytest.approx(float(response.phase_bias_bound(0.02)), rel=2e-3)  # phases in steps
    assert float(tone_response(sampling, 1000.0).phase_bias_bound(1.5)) == np.pi
    assert detect(signal, 16).phase == pytest.approx(1.0)


def test_a_line_in_the_phase_is_averaged_as_predicted():
    depth, n = 1e-3, 64
    for m, line in ((128, 57.0), (128, 60.0), (16, 57.0), (1000, 57.0)):
        sampling = SamplingPlan(n, m)
        t = np.arange(sampling.samples) / sampling.sample_rate_hz
        response = complex(modulation_response(sampling, line))
        for psi in (0.0, 1.0, 2.5):
            wave = np.cos(2 * np.pi * 1000 * t - 0.4 - depth * np.cos(2 * np.pi * line * t - psi))
            seen = float(turned(detect(wave, n).phase, 0.4))
            expected = depth * (np.exp(-1j * psi) * response).real
            # the image's share, and second order in the depth
            assert abs(seen - expected) <= depth * abs(response) * line / 2000 * 1.05 + depth**2
    assert abs(modulation_response(SamplingPlan(cycles=1000), [50.0, 57.0, 60.0])).max() < 1e-12


@pytest.mark.parametrize(("n", "phase"), [(3, 0.4), (4, 0.0), (5, 1.0), (16, 2.0)])
@pytest.mark.parametrize("radians", [0.02, 0.4])
def test_jitter_makes_the_scatter_that_is_claimed(n, phase, radians):
    sampling = SamplingPlan(n, 120 // n)
    u_trigger = radians / (2 * np.pi * 1000.0)
    rng = np.random.default_rng(n)
    t = np.arange(sampling.samples) / sampling.sample_rate_hz + rng.normal(
        scale=u_trigger, size=(20_000, sampling.samples)
    )
    phasors = detect(np.cos(2 * np.pi * 1000 * t - phase), n).phasor * np.exp(-1j * phase)
    # 20 000 buffers give a standard deviation to 0.5 %, here at four sigma
    scatter = np.std(np.angle(phasors))
    # at 0.4 rad the phase is not quite linear in the phasor: 1/mn of its variance
    assert scatter == pytest.approx(float(jitter_u_phase(sampling, u_trigger)), rel=0.02 + 0.02 * radians)


def test_jitter_of_four_samples_a_cycle_depends_on_the_phase():
    sampling, u = SamplingPlan(4, 64), 0.02 / (2 * np.pi * 1000.0)
    rng = np.random.default_rng(1)
    t = np.arange(256) / 4000.0 + rng.normal(scale=u, size=(10_000, 256))
    scatter = [np.std(detect(np.cos(2 * np.pi * 1000 * t - p), 4).phase - p) for p in (np.pi / 4, np.pi / 2)]
    largest = float(jitter_u_phase(sampling, u))
    assert scatter[1] == pytest.approx(largest, rel=0.03)
    assert scatter[0] == pytest.approx(largest / np.sqrt(2), rel=0.03)


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize(("speed", "acceleration"), [(0.01, 0.0), (-0.05, 0.0), (0.3, 0.0), (0.002, 0.05)])
def test_a_moving_target_reads_as_predicted(side, speed, acceleration):
    plan, sampling = FrequencyPlan(oscillator=side), SamplingPlan()
    effect = motion_effect(plan, sampling, range_rate=speed, acceleration=acceleration, group_index=N_AIR)
    t = np.arange(sampling.samples) / sampling.sample_rate_hz
    after = t - t.mean()
    distance = 42.0 + speed * after + 0.5 * acceleration * after**2
    wave = np.cos(2 * np.pi * 1000.0 * t - plan.phase(distance, N_AIR))
    shot = detect(wave, 64)
    assert effect.epoch == pytest.approx(t.mean(), abs=1e-15)
    assert float(effect.range_since_trigger) == pytest.approx(42.0 - distance[0], abs=1e-12)
    expected = 42.0 + float(effect.range_of_acceleration)
    read = 42.0 + float(turned(shot.phase, plan.phase(42.0, N_AIR))) / plan.phase_gradient(N_AIR)
    allowed = float(effect.phase_bias_bound) * plan.range_per_radian(N_AIR)
    assert abs(read - expected) <= allowed + 0.02 * abs(float(effect.range_of_acceleration)) + 1e-10
    assert float(shot.amplitude) == pytest.approx(
        float(effect.amplitude_factor), abs=2 * float(effect.phase_bias_bound) + 1e-5
    )
    # the middle is the right epoch: half the duration early or late would show by far
    assert abs(speed * sampling.duration / 2) > 10 * allowed


def test_a_target_at_rest_has_no_effect():
    effect = motion_effect(FrequencyPlan(), SamplingPlan(), range_rate=[0.0, 0.0])
    assert effect.amplitude_factor.tolist() == [1.0, 1.0]
    assert np.max(effect.phase_bias_bound) < 1e-15
    assert effect.range_since_trigger.tolist() == [0.0, 0.0]
