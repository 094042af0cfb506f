"""Laws of synchronous detection and of whole cycles."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from catseye.signal.cycles.whole import fraction, unwrapped_length, whole_cycles
from catseye.signal.detection.phase import detect
from catseye.signal.systematics.leakage import subtract_leakage

phases = st.floats(0.0, 2 * np.pi, exclude_max=True)
any_angle = st.floats(-1e6, 1e6)
half_wavelengths = st.floats(0.01, 1.0)
amplitudes = st.floats(0.01, 10.0)
per_cycle = st.integers(3, 40)
cycles = st.integers(1, 12)
codes = st.tuples(per_cycle, cycles).flatmap(
    lambda nm: st.tuples(st.just(nm[0]), arrays(np.int16, nm[0] * nm[1], elements=st.integers(-32768, 32767)))
)


def waveform(n, m, amplitude, phase, order=1):
    return amplitude * np.cos(2 * np.pi * order * np.arange(m * n) / n - phase)


def turned(phase, other):
    """Distance of two phases round the circle."""
    return abs((phase - other + np.pi) % (2 * np.pi) - np.pi)


@given(per_cycle, cycles, amplitudes, phases)
def test_a_cosine_gives_its_own_amplitude_and_phase(n, m, amplitude, phase):
    shot = detect(waveform(n, m, amplitude, phase), n)
    assert abs(shot.amplitude - amplitude) <= 1e-13 * amplitude
    assert turned(shot.phase, phase) <= 1e-13


@given(codes)
def test_folding_first_is_the_literal_sum(case):
    n, samples = case
    j = np.arange(len(samples))
    a = np.sum(samples * np.cos(2 * np.pi * (j % n) / n))  # [PARKER04] 5.1
    b = np.sum(samples * np.sin(2 * np.pi * (j % n) / n))  # [PARKER04] 5.2
    # 480 roundings of numbers up to 32768
    assert abs(detect(samples, n).phasor - 2 / len(samples) * (a + 1j * b)) <= 1e-10


@given(codes)
def test_integers_and_floats_give_the_same(case):
    n, samples = case
    whole, real = detect(samples, n), detect(samples.astype(float), n)
    assert abs(whole.phasor - real.phasor) <= 1e-10
    assert abs(whole.largest - real.largest) == 0


@given(codes, st.floats(1e-6, 1e3))
def test_volts_scale_everything_but_the_phase(case, volts):
    n, samples = case
    one, scaled = detect(samples, n), detect(samples, n, volts)
    for name in ("amplitude", "u_phasor", "offset", "noise", "largest", "harmonics"):
        np.testing.assert_allclose(getattr(scaled, name), getattr(one, name) * volts, rtol=1e-14)
    assert scaled.clipped == one.clipped
    # where rounding alone makes an amplitude, its direction means nothing
    assert one.amplitude < 1e-6 or turned(scaled.phase, one.phase) <= 1e-14


@given(per_cycle, cycles, amplitudes, phases, st.integers(-50, 50))
def test_a_later_start_shifts_the_phase(n, m, amplitude, phase, late):
    samples = waveform(n, m, amplitude, phase)
    shifted = detect(np.roll(samples, late), n)
    assert turned(shifted.phase, phase + 2 * np.pi * late / n) <= 1e-12


@given(per_cycle, cycles, amplitudes, phases, st.floats(-10.0, 10.0))
def test_an_offset_does_not_move_the_phase(n, m, amplitude, phase, offset):
    shot = detect(waveform(n, m, amplitude, phase) + offset, n)
    assert turned(shot.phase, phase) <= 1e-14 * (1 + abs(offset) / amplitude) * 10
    assert abs(shot.offset - offset) <= 1e-13


@given(per_cycle, cycles, phases, st.integers(2, 60), st.floats(0.0, 1.0), phases)
def test_a_harmonic_does_not_move_the_phase_unless_the_sampling_aliases_it(n, m, phase, order, size, its_phase):
    shot = detect(waveform(n, m, 1.0, phase) + waveform(n, m, size, its_phase, order), n)
    if (order - 1) % n and (order + 1) % n:
        assert turned(shot.phase, phase) <= 1e-12
    else:
        assert abs(shot.phasor - np.exp(1j * phase)) <= size + 1e-12


@given(codes)
def test_phase_lies_in_one_turn_and_clipping_is_a_count(case):
    n, samples = case
    shot = detect(samples, n)
    assert 0.0 <= shot.phase < 2 * np.pi
    assert shot.clipped == np.count_nonzero((samples == 32767) | (samples == -32768))
    assert shot.largest == np.abs(samples.astype(int)).max()


@given(codes, st.integers(1, 5))
def test_cycle_order_does_not_matter(case, seed):
    n, samples = case
    shuffled = np.random.default_rng(seed).permutation(samples.reshape(-1, n)).reshape(-1)
    one, other = detect(samples, n), detect(shuffled, n)
    assert one.phasor == other.phasor
    np.testing.assert_allclose(other.u_phasor, one.u_phasor, rtol=1e-9, atol=1e-9)


@given(any_angle, any_angle)
def test_a_fraction_lies_in_one_turn_and_is_the_difference(target, reference):
    value = float(fraction(target, reference))
    assert 0.0 <= value < 2 * np.pi
    assert turned(value, target - reference) <= 1e-9


@given(st.integers(-100, 5000), phases, half_wavelengths, st.floats(-0.4999999, 0.4999999))
def test_any_coarse_range_within_a_quarter_wave_finds_the_right_cycle(n, phase, half, off):
    true = unwrapped_length(n, phase, half)
    found, margin = whole_cycles(true + off * half, phase, half)
    assert found == n
    # 5000 cycles rounded to 1e-12 of a cycle
    assert abs(margin - (0.5 - abs(off)) * half) <= 2e-12 * half + 1e-15


@given(st.floats(-1e4, 1e4), phases, half_wavelengths)
def test_the_margin_lies_between_nothing_and_a_quarter_wave(coarse, phase, half):
    assert 0.0 <= whole_cycles(coarse, phase, half)[1] <= half / 2


@given(st.floats(-500.0, 500.0), phases, half_wavelengths)
def test_a_step_beyond_the_margin_changes_the_cycle_and_a_step_within_does_not(coarse, phase, half):
    found, margin = whole_cycles(coarse, phase, half)
    assume(margin > 1e-6)
    sense = 1.0 if coarse > unwrapped_length(found, phase, half) else -1.0
    assert whole_cycles(coarse + sense * (margin - 1e-9), phase, half)[0] == found
    assert whole_cycles(coarse + sense * (margin + 1e-9), phase, half)[0] == found + sense


@given(st.floats(0.0, 500.0), half_wavelengths, any_angle)
def test_a_length_is_recovered_from_its_phase_and_itself(length, half, reference):
    phase = fraction(reference - 2 * np.pi * length / half, reference)
    found, _ = whole_cycles(length, phase, half)
    # phases of 3e5 rad are rounded to 1e-10 of a turn
    assert abs(unwrapped_length(found, phase, half) - length) <= 1e-9


@given(st.complex_numbers(max_magnitude=10.0), st.floats(0.0, 1.0), any_angle)
def test_subtracting_leakage_undoes_adding_it(light, amplitude, phase):
    assert abs(subtract_leakage(light + amplitude * np.exp(1j * phase), amplitude, phase) - light) <= 1e-14
