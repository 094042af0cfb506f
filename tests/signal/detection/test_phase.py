"""Detection against the literal sums, the Fourier transform, and scatter; bad buffers; memory."""

import math
import tracemalloc

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.detection.folding import fold
from catseye.signal.detection.phase import detect, phasors
from repository import ROOT

FRAMES = ROOT / "examples" / "night-01" / "frames.npy"


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


@pytest.mark.parametrize(("n", "m"), [(64, 8), (16, 2), (32, 1)])
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
        (np.zeros(64), 2, 1.0, "2 samples a cycle do not determine a phase; at least 3 do"),
        (np.zeros(64), 6.5, 1.0, "6.5 samples a cycle"),
        (np.zeros(65), 64, 1.0, "a buffer of 65 samples is not a whole number of cycles of 64 samples"),
        (np.zeros(0), 64, 1.0, "a buffer of 0 samples"),
        (np.float64(1.0), 64, 1.0, "a buffer of 0 samples"),
        (np.zeros(64), 64, 0.0, "volts per code 0.0 V is not above 0"),
        (np.zeros(64), 64, float("nan"), "volts per code nan V"),
        (np.zeros(64, dtype=complex), 64, 1.0, "samples are of type complex128"),
    ],
)
def test_invalid_buffers_are_refused(samples, n, volts, text):
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


# --- what reaches the phasor, and what does not


@pytest.mark.parametrize("n", [5, 16, 64])
def test_every_harmonic_and_offset_is_rejected_but_the_mirror_images_of_the_fundamental(n):
    j = np.arange(6 * n)
    for k in range(2 * n + 2):
        shot = detect(waveform(n, 6, 1.0, 0.6) + 0.3 * np.cos(2 * np.pi * k * j / n - 1.1), n)
        seen = shot.phasor - np.exp(0.6j)
        # order k is order 1 or -1 at these times: B exp(i psi) or B exp(-i psi) by its own definition
        expected = 0.3 * ((k % n == 1) * np.exp(1.1j) + (k % n == n - 1) * np.exp(-1.1j))
        assert abs(seen - expected) < 1e-15 * k + 1e-14, k  # the test's own angles are rounded


@pytest.mark.parametrize("cycles_of_the_line", [1, 2, 5, 11, 13, 30])
def test_a_line_that_fits_the_buffer_is_rejected(cycles_of_the_line):
    n, m = 16, 12
    j = np.arange(m * n)
    line = 0.5 * np.cos(2 * np.pi * cycles_of_the_line * j / (m * n) - 0.2)
    assert abs(detect(waveform(n, m, 1.0, 2.0) + line, n).phasor - np.exp(2.0j)) < 1e-14


def test_the_mirror_harmonic_moves_the_phase_by_its_share():
    """k = n - 1 at a hundredth of the amplitude, in quadrature: asin(0.01), the extreme case of [PARKER04] eq. 5.7."""
    n, phase = 64, 1.0
    psi = -phase - math.pi / 2  # its image B exp(-i psi) then stands at phase + pi/2
    j = np.arange(4 * n)
    shot = detect(waveform(n, 4, 1.0, phase) + 0.01 * np.cos(2 * np.pi * (n - 1) * j / n - psi), n)
    assert float(shot.phase) - phase == pytest.approx(math.atan(0.01), rel=1e-9)


def fundamental_of_clipped(level):
    """Fourier integral of a unit sine clipped at +-level: closed form."""
    return 2 / math.pi * (math.asin(level) + level * math.sqrt(1 - level**2))


def test_clipping_makes_the_amplitude_smaller_by_fouriers_integral():
    n, level = 1024, 0.7
    wave = waveform(n, 2, 1.0, 0.3)
    both, top = detect(np.clip(wave, -level, level), n), detect(np.minimum(wave, level), n)
    # harmonics about n fold back: some 1/n^2
    assert float(both.amplitude) == pytest.approx(fundamental_of_clipped(level), abs=2e-6)
    assert float(top.amplitude) == pytest.approx((1 + fundamental_of_clipped(level)) / 2, abs=2e-6)
    assert float(both.phase) == pytest.approx(0.3, abs=2e-6)
    assert float(top.phase) == pytest.approx(0.3, abs=2e-6)
    assert float(top.offset) < -0.05  # this is what leads a zero crossing astray


@pytest.mark.parametrize("n", [16, 64])
def test_clipping_moves_the_phase_only_by_aliased_harmonics(n):
    """The phasor from the harmonics p n - 1 and p n + 1 of the clipped wave, by numpy's FFT of 2^16 points."""
    dense = np.fft.rfft(np.minimum(np.cos(2 * np.pi * np.arange(2**16) / 2**16), 0.7)).real * 2 / 2**16
    phases = np.linspace(0.0, 2 * np.pi, 401, endpoint=False)
    shot = detect(np.minimum(np.cos(2 * np.pi * np.arange(2 * n) / n - phases[:, None]), 0.7), n)
    expected = dense[1] * np.exp(1j * phases)
    for k in range(n, 200 * n, n):
        expected += dense[k + 1] * np.exp(1j * (k + 1) * phases) + dense[k - 1] * np.exp(-1j * (k - 1) * phases)
    np.testing.assert_allclose(shot.phasor, expected, rtol=0, atol=1 / (200 * n**2))  # what lies beyond 200 n
    error = np.angle(shot.phasor * np.exp(-1j * phases))
    assert 0.1 / n**2 < np.abs(error).max() < 1 / n**2


# --- harmonics


def test_harmonics_come_with_their_phases():
    j = 2 * np.pi * np.arange(640) / 64
    wave = np.cos(j - 0.4) + 0.2 * np.cos(2 * j - 1.0) + 0.1 * np.cos(5 * j + 2.0) + 0.05 * np.cos(31 * j - 3.0)
    shot = detect(wave + 7.0, 64, harmonics=(5, 2, 31))
    np.testing.assert_allclose(
        shot.overtones, [0.1 * np.exp(-2.0j), 0.2 * np.exp(1.0j), 0.05 * np.exp(3.0j)], rtol=0, atol=1e-14
    )
    assert float(shot.distortion) == pytest.approx(math.sqrt(0.1**2 + 0.2**2 + 0.05**2), rel=1e-13)
    assert float(detect(wave, 64, harmonics=()).distortion) == 0.0


@pytest.mark.parametrize("orders", [(1,), (0, 2), (2.5,), (-2,)])
def test_invalid_harmonics_are_refused(orders):
    with pytest.raises(ValidityError, match=r"harmonics .* are not whole numbers of at least 2"):
        detect(waveform(8, 2), 8, harmonics=orders)


def test_no_light_has_no_distortion_and_no_phase():
    shot = detect(np.zeros(64), 16)
    assert np.isinf(shot.distortion)
    assert np.isinf(shot.u_phase)


# --- uncertainty along and across


def test_along_and_across_are_the_scatter_of_amplitude_and_phase():
    rng = np.random.default_rng(8)
    n, m, amplitude, phase = 16, 12, 3.0, 2.2
    single = (amplitude + 0.02 * rng.normal(size=m)) * np.exp(1j * (phase + 0.001 * rng.normal(size=m)))
    wave = (single[:, None] * np.exp(-2j * np.pi * np.arange(n) / n)).real.ravel()
    shot = detect(wave, n)
    # to first order in the scatter: 0.02/3 and 0.001 squared
    assert float(shot.u_amplitude) == pytest.approx(np.std(np.abs(single), ddof=1) / math.sqrt(m), rel=1e-3)
    assert float(shot.u_phase) == pytest.approx(np.std(np.angle(single), ddof=1) / math.sqrt(m), rel=2e-2)
    assert shot.degrees.tolist() == [m - 1, m - 1]
    both = shot.u_amplitude**2 + (shot.amplitude * shot.u_phase) ** 2
    assert float(both) == pytest.approx(2 * float(shot.u_phasor) ** 2, rel=1e-12)


def test_a_single_cycle_has_equal_uncertainty_along_and_across():
    shot = detect(waveform(32, 1, 2.0) + 0.1 * np.random.default_rng(4).normal(size=32), 32)
    assert float(shot.u_amplitude) == pytest.approx(float(shot.u_phasor), rel=1e-14)
    assert float(shot.u_phase) == pytest.approx(float(shot.u_phasor / shot.amplitude), rel=1e-14)
    assert np.isnan(shot.degrees).all()


# --- phasors alone


@pytest.mark.parametrize("dtype", [np.int8, np.uint16, np.int16, ">i2", np.int32, np.int64, np.float32, np.float64])
@pytest.mark.parametrize(("n", "m"), [(3, 1), (7, 50), (16, 9), (64, 128), (200, 3)])
def test_phasors_are_those_of_detect(dtype, n, m):
    samples = np.random.default_rng(m).integers(0, 100, size=(2, 3, m * n)).astype(dtype)
    np.testing.assert_allclose(phasors(samples, n, 0.5), detect(samples, n, 0.5).phasor, rtol=0, atol=1e-12)


def test_sums_of_very_long_buffers_do_not_overflow():
    """70 000 rows of 128 lowest codes each are -2.3e9, beyond 32 bits."""
    codes = np.zeros((1, 70_000 * 128), dtype=np.int16)
    codes[:, ::4] = -32768
    for compiled in (False, True):
        assert abs(phasors(codes, 4, compiled=compiled)[0] + 32768 / 2) < 1e-9  # half of one sample in four
    high = np.full((1, 70_000 * 128), 65535, dtype=np.uint16)
    assert fold(high.reshape(1, -1, 4)).tolist() == [[70_000 * 32 * 65535] * 4]


# --- files


def test_a_memory_map_needs_little_memory(tmp_path):
    path = tmp_path / "codes.i2"
    np.resize(np.rint(9000 * waveform(64, 128, 1.0, 0.5)).astype(np.int16), (2000, 8192)).tofile(path)
    codes = np.memmap(path, dtype=np.int16, mode="r").reshape(2000, 8192)
    tracemalloc.start()
    try:
        shots, seen = detect(codes, 64), phasors(codes, 64)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 10e6  # bytes; the file has 33e6
    np.testing.assert_allclose(shots.phase, 0.5, rtol=0, atol=1e-4)
    np.testing.assert_allclose(seen, shots.phasor, rtol=1e-12)


@pytest.mark.slow
def test_two_gigabytes_need_little_memory(tmp_path):
    count = 2_000_000_000 // 16_384
    codes = np.memmap(tmp_path / "codes.i2", dtype=np.int16, mode="w+", shape=(count, 8192))
    codes[-1] = np.rint(9000 * waveform(64, 128, 1.0, 0.5))
    tracemalloc.start()
    try:
        shots = detect(codes, 64)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 400 * count + 50e6  # bytes: the answers, and numba when it is loaded here first
    assert float(shots.phase[-1]) == pytest.approx(0.5, abs=1e-4)
    assert not shots.phasor[:-1].any()


@pytest.mark.parametrize("n", [8, 9, 16, 64])
def test_clipping_moves_the_phase_within_the_stated_bound(n):
    phases = np.linspace(0.0, 2 * np.pi, 721)
    wave = np.cos(2 * np.pi * np.arange(n) / n - phases[:, None])
    worst = {}
    for level in (0.5, 0.6, 0.7, 0.8, 0.9, 1e-6):
        for side, clipped in (("one", np.minimum(wave, level)), ("both", np.clip(wave, -level, level))):
            error = np.abs(np.angle(detect(clipped, n).phasor * np.exp(-1j * phases))).max()
            worst[side, level >= 0.5] = max(worst.get((side, level >= 0.5), 0.0), error)
    assert worst["one", True] < 1.5 / n**2
    assert worst["both", True] < 4.0 / n**2
    assert worst["both", False] < 1.01 * np.pi / n
    if n % 2 == 0:
        assert worst["both", True] > 2.0 / n**2
        assert worst["both", False] > 2.0 / n
