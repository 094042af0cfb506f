"""The Fourier estimators against scipy, against synchronous detection, and their scatter against the bounds."""

import numpy as np
import pytest
import scipy.fft

from catseye.errors import ValidityError
from catseye.signal.detection.phase import detect
from catseye.signal.detection.spectral import bin_phasor, strongest_tone


def turned(phase, other):
    """Difference of two phases in (-pi, pi]."""
    return np.angle(np.exp(1j * (np.asarray(phase) - other)))


@pytest.mark.parametrize(("n", "m"), [(3, 4), (16, 8), (64, 128), (7, 1)])
def test_the_bin_is_that_of_scipy_and_synchronous_detection(n, m):
    codes = np.random.default_rng(n).integers(-30_000, 30_000, size=(3, 5, m * n)).astype(np.int16)
    found = bin_phasor(codes, n)
    spectrum = scipy.fft.fft(codes.astype(float), axis=-1)[..., m]
    # 16-bit codes summed in floats
    np.testing.assert_allclose(found, spectrum.conj() * 2 / (m * n), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found, detect(codes, n).phasor, rtol=0, atol=1e-9)


def test_blocks_do_not_show():
    samples = np.random.default_rng(1).normal(size=(70, 8192)) + np.cos(2 * np.pi * np.arange(8192) / 64.3)
    together = strongest_tone(samples, 64e3)
    for k in (0, 31, 32, 69):
        alone = strongest_tone(samples[k], 64e3)
        assert float(alone.frequency_hz) == pytest.approx(float(together.frequency_hz[k]), abs=1e-9)
        assert float(turned(alone.phase, together.phase[k])) == pytest.approx(0.0, abs=1e-9)
        assert complex(bin_phasor(samples[k], 64)) == pytest.approx(complex(bin_phasor(samples, 64)[k]), abs=1e-12)


@pytest.mark.parametrize("frequency", [1000.0, 1003.9, 996.2, 1007.8125, 12_345.678])
def test_an_unlocked_signal_is_found_anywhere_between_the_bins(frequency):
    rate, length = 64e3, 8192
    t = np.arange(length) / rate
    wave = 0.8 + 2.5 * np.cos(2 * np.pi * frequency * t - 4.0)
    found = strongest_tone(wave, rate)
    # the tone's own image, 256 bins away and more: 1/256^3
    assert float(found.frequency_hz) == pytest.approx(frequency, abs=1e-6)
    assert float(found.amplitude) == pytest.approx(2.5, rel=1e-6)
    assert float(turned(found.phase, 4.0)) == pytest.approx(0.0, abs=1e-6)
    centre = 4.0 - 2 * np.pi * frequency * t.mean()
    assert float(turned(found.phase_centre, centre)) == pytest.approx(0.0, abs=1e-6)


def test_where_synchronous_detection_loses_the_lock_the_peak_does_not():
    rate, offset = 64e3, 2e-3  # IF off by 2 Hz of 1000
    wave = np.cos(2 * np.pi * 1000.0 * (1 + offset) * np.arange(8192) / rate - 1.0)
    assert abs(float(turned(detect(wave, 64).phase, 1.0))) > 0.5
    assert abs(float(turned(strongest_tone(wave, rate).phase, 1.0))) < 1e-6


def test_a_harmonic_barely_touches_the_peak():
    t = np.arange(8192) / 64e3
    wave = np.cos(2 * np.pi * 1001.0 * t - 1.0) + 0.1 * np.cos(2 * np.pi * 2002.0 * t - 0.3)
    assert abs(float(turned(strongest_tone(wave, 64e3).phase, 1.0))) < 1e-6  # 0.1/128^3, and through the frequency


@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_scatter_is_the_bound_times_the_price_of_the_window(noise):
    rng, length, count = np.random.default_rng(8), 1024, 3000
    phase, bins = rng.uniform(0, 2 * np.pi, count), rng.uniform(60, 61, count)
    wave = np.cos(2 * np.pi * bins[:, None] * np.arange(length) / length - phase[:, None])
    found = strongest_tone(wave + rng.normal(scale=noise, size=wave.shape), float(length))
    bound = 2 * noise**2 / length  # of the phase in the middle, and of the relative amplitude
    centre = phase - np.pi * bins * (length - 1) / length
    # 3000 buffers: 2.6 % of a variance at one sigma
    assert np.mean(turned(found.phase_centre, centre) ** 2) == pytest.approx(1.5 * bound, rel=0.11)
    assert np.var(found.amplitude) == pytest.approx(1.5 * bound, rel=0.11)
    radians = 2 * np.pi * (found.frequency_hz - bins) / length
    assert np.mean(radians**2) == pytest.approx(2.343 * 24 * noise**2 / length**3, rel=0.11)
    # at the first sample the frequency's part, (k/2)^2 times its variance, comes on top: 1.5 + 3 x 2.343
    assert np.mean(turned(found.phase, phase) ** 2) == pytest.approx((1.5 + 3 * 2.343) * bound, rel=0.11)


def test_the_price_of_the_hann_window_is_its_moments():
    t = (np.arange(100_000) + 0.5) / 100_000 - 0.5
    w = 0.5 + 0.5 * np.cos(2 * np.pi * t)
    assert np.mean(w**2) / np.mean(w) ** 2 == pytest.approx(1.5, abs=1e-6)
    assert np.mean(w**2 * t**2) * np.mean(t**2) / np.mean(w * t**2) ** 2 == pytest.approx(2.343, abs=1e-3)


def test_a_buffer_without_a_tone_is_nan_and_spoils_no_other():
    t = np.arange(512) / 512
    waves = np.stack([np.cos(2 * np.pi * 30.3 * t)] * 5)
    waves[1, 3], waves[2, 9], waves[3] = np.nan, np.inf, 0.1
    found = strongest_tone(waves, 512.0)
    for value in (found.frequency_hz, found.amplitude, found.phase, found.phase_centre):
        assert np.isfinite(value).tolist() == [True, False, False, False, True]
    assert np.isnan(strongest_tone(t, 512.0).phase)  # a ramp: its peak is at the low end
    assert np.isfinite(bin_phasor(waves, 16)).tolist() == [True, False, False, True, True]
    assert strongest_tone(waves[:0], 512.0).phase.shape == (0,)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: bin_phasor(np.zeros(64), 2), "2 samples a cycle do not determine a phase"),
        (lambda: bin_phasor(np.zeros(65), 64), "a buffer of 65 samples is not a whole number of cycles of 64"),
        (lambda: bin_phasor(np.float64(1.0), 64), "in 0 dimensions"),
        (lambda: strongest_tone(np.zeros(15), 1.0), "a buffer of 15 samples shows no tone of unknown frequency"),
        (lambda: strongest_tone(np.zeros(64), 0.0), "sample rate 0.0 Hz"),
        (lambda: strongest_tone(np.zeros(64, dtype="U1"), 1.0), "samples of type <U1"),
    ],
)
def test_invalid_buffers_are_refused(call, text):
    with pytest.raises(ValidityError) as caught:
        call()
    assert text in str(caught.value)
