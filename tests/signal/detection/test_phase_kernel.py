"""The compiled form against the plain one, which the other tests hold to the literal sums."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.detection.phase import detect, phasors

SHAPES = [(64, 128), (16, 8), (7, 33), (200, 5), (3, 2), (1000, 17), (4, 20_000), (128, 3), (129, 18)]


def codes(n, m, count=12):
    """Returns of all sizes: strong, weak, dark, half dark, overdriven, constant, with slow and fast noise."""
    rng = np.random.default_rng(1000 * n + m)
    wave = np.cos(2 * np.pi * np.arange(m * n) / n - rng.uniform(0, 6.3, (count, 1)))
    size = np.geomspace(20_000, 3, count)[:, None]
    drift = np.repeat(np.cumsum(rng.normal(size=(count, m)), axis=1), n, axis=1)
    samples = size * wave * (1 + 0.01 * drift / np.sqrt(m)) + 3.0 * rng.normal(size=wave.shape) + 5.0
    samples[1, : m * n // 2] = 0
    samples[2] *= 10
    samples[3] = -32768
    return np.clip(np.rint(samples), -32768, 32767).astype(np.int16)


@pytest.mark.parametrize(("n", "m"), SHAPES)
def test_the_compiled_form_agrees_with_the_plain_form(n, m):
    samples = codes(n, m)
    plain, fast = (detect(samples, n, 1e-3, harmonics=(2, 5), compiled=choice) for choice in (False, True))
    scale = 32.768
    for name in ("phasor", "offset", "overtones"):  # sums of exact integers, rounded differently
        np.testing.assert_allclose(getattr(fast, name), getattr(plain, name), rtol=0, atol=1e-13 * scale, err_msg=name)
    for name in ("largest", "clipped"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(plain, name))
    np.testing.assert_array_equal(fast.scatter.dropped, plain.scatter.dropped)
    np.testing.assert_array_equal(fast.degrees, plain.degrees)
    # single precision about the mean cycle; relative to the larger of the two quadratures' scatter
    np.testing.assert_allclose(fast.noise, plain.noise, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(fast.u_phasor, plain.u_phasor, rtol=1e-6, atol=1e-12)
    loose = 1e-5 * plain.u_phasor.max()
    np.testing.assert_allclose(fast.u_amplitude, plain.u_amplitude, rtol=1e-5, atol=loose * 1e-3)
    np.testing.assert_allclose(
        fast.u_phase * fast.amplitude, plain.u_phase * plain.amplitude, rtol=1e-5, atol=loose * 1e-3
    )
    np.testing.assert_allclose(phasors(samples, n, 1e-3, compiled=True), plain.phasor, rtol=0, atol=1e-13 * scale)


def test_a_repeating_cycle_has_no_noise_in_either_form():
    samples = np.tile(np.arange(-20, 20, dtype=np.int16) * 1000, 30)[None]
    for choice in (False, True):
        shot = detect(samples, 40, compiled=choice)
        assert shot.noise[0] < 1e-10
        assert shot.u_phasor[0] < 1e-10


def test_layouts_that_are_not_contiguous_are_the_same():
    samples = codes(16, 20, 24).reshape(2, 12, 320)
    cut = np.concatenate([samples, samples], axis=-1)[:, ::2, :320]
    fast, plain = detect(cut, 16, compiled=True), detect(samples[:, ::2], 16, compiled=False)
    np.testing.assert_allclose(fast.phasor, plain.phasor, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(fast.clipped, plain.clipped)
    assert phasors(cut, 16, compiled=True).shape == (2, 6)


@pytest.mark.parametrize(
    "samples", [np.zeros((2, 64)), np.zeros((2, 16), dtype=np.int16), np.zeros((2, 64), dtype=">i2")]
)
def test_unsupported_samples_are_refused_by_the_compiled_form(samples):
    with pytest.raises(ValidityError, match="the compiled form serves native int16 buffers of two cycles and more"):
        detect(samples, 16, compiled=True)


def test_large_lots_are_compiled_without_asking(monkeypatch):
    from catseye.signal.detection import phase, phase_kernel

    asked = []
    monkeypatch.setattr(phase_kernel, "phasors", lambda *arguments: asked.append(arguments[0].shape))
    monkeypatch.setattr(phase, "COMPILED_FROM", 640)
    phasors(np.zeros((9, 64), dtype=np.int16), 16)
    assert asked == []
    phasors(np.zeros((10, 64), dtype=np.int16), 16)
    assert asked == [(10, 64)]
