"""Detection against the literal sums, the Fourier transform, and scatter; bad buffers; memory."""

import math
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.phase import detect

FRAMES = Path(__file__).parents[2] / "examples" / "night-01" / "frames.npy"


def literal(samples, n):
    """[PARKER04] eq. 5.1 to 5.4 as printed (with the quadrant), one term after the other."""
    length = len(samples)
    a = math.fsum(float(s) * math.cos(2 * math.pi * (j % n) / n) for j, s in enumerate(samples))
    b = math.fsum(float(s) * math.sin(2 * math.pi * (j % n) / n) for j, s in enumerate(samples))
    return 2 / length * math.hypot(a, b), math.atan2(b, a) % (2 * math.pi)


def waveform(n, m, amplitude=1.0, phase=0.0):
    return amplitude * np.cos(2 * np.pi * np.arange(m * n) / n - phase)


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.int64, np.float32, np.float64])
@pytest.mark.parametrize(("n", "m"), [(3, 5), (4, 1), (7, 9), (64, 128)])
def test_detection_is_the_literal_sum(dtype, n, m):
    samples = np.random.default_rng(n * m).integers(0, 100, size=m * n).astype(dtype)
    amplitude, phase = literal(samples, n)
    shot = detect(samples, n, 0.5)
    assert float(shot.amplitude) == pytest.approx(0.5 * amplitude, rel=1e-12)
    assert float(shot.phase) == pytest.approx(phase, abs=1e-11)
    assert float(shot.offset) == pytest.approx(0.5 * np.mean(samples, dtype=float), rel=1e-14)


def test_real_buffers_agree_with_the_fourier_transform():
    codes = np.load(FRAMES, mmap_mode="r")[:40]
    shots = detect(codes, 64, 10 / 32768)
    spectrum = np.fft.rfft(codes * (10 / 32768), axis=-1)[:, ::128] * (2 / 8192)
    np.testing.assert_allclose(shots.phasor, spectrum[:, 1].conj(), rtol=0, atol=1e-13)
    np.testing.assert_allclose(shots.harmonics, np.abs(spectrum[:, 2:4]), rtol=0, atol=1e-13)
    np.testing.assert_allclose(shots.offset, spectrum[:, 0].real / 2, rtol=0, atol=1e-13)
    amplitude, phase = literal(codes[7], 64)
    assert float(shots.amplitude[7]) == pytest.approx(amplitude * 10 / 32768, rel=1e-13)
    assert float(shots.phase[7]) == pytest.approx(phase, abs=1e-12)


def test_noise_is_the_scatter_about_the_folded_waveform():
    codes = np.load(FRAMES, mmap_mode="r")[:5].astype(float) * (10 / 32768)
    cycles = codes.reshape(5, 128, 64)
    expected = np.sqrt(np.mean(np.var(cycles, axis=1, ddof=1), axis=1))
    np.testing.assert_allclose(detect(codes, 64).noise, expected, rtol=1e-12)


def test_uncertainty_is_that_of_the_mean_of_the_cycles():
    codes = np.random.default_rng(3).normal(size=(4, 12 * 16)) + waveform(16, 12)
    single = detect(codes.reshape(4, 12, 16), 16).phasor
    pooled = (np.var(single.real, axis=1, ddof=1) + np.var(single.imag, axis=1, ddof=1)) / 2
    np.testing.assert_allclose(detect(codes, 16).u_phasor, np.sqrt(pooled / 12), rtol=1e-12)
    np.testing.assert_allclose(detect(codes, 16).phasor, single.mean(axis=1), rtol=0, atol=1e-14)


@pytest.mark.parametrize(("n", "m"), [(64, 32), (16, 2), (32, 1)])
def test_the_claimed_uncertainty_is_the_scatter_that_is_seen(n, m):
    sigma, count = 0.2, 20_000
    noise = np.random.default_rng(11).normal(scale=sigma, size=(count, m * n))
    shots = detect(waveform(n, m, 1.0, 0.7) + noise, n)
    error = shots.phasor - np.exp(0.7j)
    # root mean square over 20 000 buffers: 0.5 % at one sigma, here at four
    for part in (error.real, error.imag):
        assert np.sqrt(np.mean(part**2)) == pytest.approx(np.sqrt(np.mean(shots.u_phasor**2)), rel=0.02)
    assert np.sqrt(np.mean(shots.noise**2)) == pytest.approx(sigma, rel=0.02)


def test_a_single_cycle_of_few_samples_has_no_scatter_to_show():
    shot = detect(waveform(7, 1), 7)
    assert np.isnan(shot.u_phasor)
    assert np.isnan(shot.noise)


def test_a_pure_waveform_has_no_uncertainty():
    shot = detect(waveform(64, 8, 2.0, 5.0), 64)
    assert float(shot.u_phasor) < 1e-15
    assert float(detect(waveform(64, 1, 2.0, 5.0), 64).u_phasor) < 1e-15


def test_harmonics_are_reported_as_amplitudes():
    j = 2 * np.pi * np.arange(640) / 64
    shot = detect(np.cos(j) + 0.25 * np.cos(2 * j - 1) + 0.125 * np.sin(3 * j), 64)
    np.testing.assert_allclose(shot.harmonics, [0.25, 0.125], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("n", "seen"), [(3, [False, False]), (4, [True, False]), (5, [True, False]), (6, [True, True]), (7, [True, True])]
)
def test_harmonics_beyond_half_the_sampling_frequency_are_nan(n, seen):
    assert (~np.isnan(detect(waveform(n, 4), n).harmonics)).tolist() == seen


def test_a_harmonic_at_half_the_sampling_frequency_is_not_doubled():
    j = np.arange(24)
    assert float(detect(0.5 * np.cos(np.pi * j), 6).harmonics[1]) == pytest.approx(0.5, abs=1e-15)
    assert float(detect(0.5 * np.cos(np.pi * j), 4).harmonics[0]) == pytest.approx(0.5, abs=1e-15)


def test_clipped_samples_are_counted_at_both_ends():
    codes = np.zeros((3, 64), dtype=np.int16)
    codes[0, :5], codes[0, 60:], codes[2, 7] = 32767, -32768, 32766
    shots = detect(codes, 64, 10 / 32768)
    assert shots.clipped.tolist() == [9, 0, 0]
    np.testing.assert_allclose(shots.largest, [10.0, 0.0, 32766 * 10 / 32768], rtol=1e-15)
    assert detect(codes, 64, converter_ends=(-40000, 32766)).clipped.tolist() == [5, 0, 1]
    assert detect(codes.astype(float), 64).clipped.tolist() == [0, 0, 0]
    assert detect(codes.astype(float), 64, converter_ends=(-32768, 32767)).clipped.tolist() == [9, 0, 0]


def test_extreme_codes_do_not_overflow():
    for dtype in (np.int8, np.int16, np.int32):
        low = np.iinfo(dtype).min
        shot = detect(np.tile(np.array([low, 0, 0, 0], dtype=dtype), 4096), 4)
        assert float(shot.amplitude) == -low / 2  # eq. 5.3: half of one sample in four
        assert float(shot.largest) == -low


def test_shapes_broadcast_and_blocks_do_not_show():
    samples = np.random.default_rng(2).integers(-9000, 9000, size=(3, 50, 8192)).astype(np.int16)  # five blocks
    samples[::2, ::7, :3] = 32767
    together = detect(samples, 64)
    assert together.phasor.shape == (3, 50)
    assert together.harmonics.shape == (3, 50, 2)
    alone = [[detect(buffer, 64) for buffer in row] for row in samples]
    for name in ("u_phasor", "offset", "noise", "largest", "clipped", "amplitude", "phase"):
        one_by_one = [[getattr(shot, name) for shot in row] for row in alone]
        np.testing.assert_allclose(getattr(together, name), one_by_one, rtol=1e-12)
    assert detect(samples[:, ::2], 64).phasor.shape == (3, 25)
    assert detect(samples[:, :0], 64).phasor.shape == (3, 0)


def test_a_buffer_with_a_hole_is_nan_and_spoils_no_other():
    samples = np.stack([waveform(8, 4)] * 3)
    samples[1, 3], samples[2, 3] = np.nan, np.inf
    shots = detect(samples, 8)
    assert np.isfinite(shots.u_phasor).tolist() == [True, False, False]
    assert np.isfinite(shots.phasor).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("samples", "n", "volts", "text"),
    [
        (np.zeros(64), 2, 1.0, "2 samples a cycle do not show a phase; at least 3 do"),
        (np.zeros(64), 6.5, 1.0, "6.5 samples a cycle"),
        (np.zeros(65), 64, 1.0, "a buffer of 65 samples is not a whole number of cycles of 64 samples"),
        (np.zeros(0), 64, 1.0, "a buffer of 0 samples"),
        (np.float64(1.0), 64, 1.0, "a buffer of 0 samples"),
        (np.zeros(64), 64, 0.0, "volts per code 0.0 V is not above 0"),
        (np.zeros(64), 64, float("nan"), "volts per code nan V"),
        (np.zeros(64, dtype=complex), 64, 1.0, "samples are of type complex128"),
    ],
)
def test_what_is_no_buffer_is_refused(samples, n, volts, text):
    with pytest.raises(ValidityError) as caught:
        detect(samples, n, volts)
    assert text in str(caught.value)


def test_a_night_needs_little_memory():
    samples = np.random.default_rng(1).integers(-30000, 30000, size=(759, 8192), dtype=np.int16)
    tracemalloc.start()
    try:
        detect(samples, 64, 10 / 32768)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 10e6  # bytes beyond the samples: some blocks of 2 MB, a tenth of the whole night as floats


@pytest.mark.slow
def test_a_night_takes_well_under_half_a_second():
    samples = np.random.default_rng(1).integers(-30000, 30000, size=(759, 8192), dtype=np.int16)
    elapsed = []
    for _ in range(5):
        start = time.perf_counter()
        detect(samples, 64, 10 / 32768)
        elapsed.append(time.perf_counter() - start)
    assert min(elapsed) < 0.25  # s; 0.02 s where it was written
