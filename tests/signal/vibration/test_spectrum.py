"""Spectra: against scipy's, against variances, against known shapes; what hides behind a peak."""

import numpy as np
import pytest
from scipy import signal
from scipy.stats import chi2

from catseye.errors import ValidityError
from catseye.signal.vibration.spectrum import Spectrum, aliases, likely_alias, peaks, shape_at, spectrum
from draws import draws

RATE = 7.8


def test_even_samples_give_welchs_estimate_and_cross_densities_as_scipy():
    rng, t = np.random.default_rng(1), np.arange(2048) / RATE
    y = np.cumsum(rng.normal(size=(2, 2048)), axis=1) * 1e-5 + rng.normal(size=(2, 2048)) * 1e-4
    found = spectrum([t, t], list(y), stretch=256 / RATE)
    f, welch = signal.welch(y, RATE, window="hann", nperseg=256, detrend="constant")
    np.testing.assert_allclose(found.frequency_hz, f[1:], rtol=1e-12)
    np.testing.assert_allclose(found.density, welch[:, 1:].T, rtol=1e-9)
    _, cross = signal.csd(y[0], y[1], RATE, window="hann", nperseg=256, detrend="constant")
    np.testing.assert_allclose(found.cross[:, 0, 1], cross[1:], rtol=1e-8, atol=1e-22)
    np.testing.assert_allclose(found.coherence(0, 1), signal.coherence(y[0], y[1], RATE, nperseg=256)[1][1:], rtol=1e-8)


def test_the_integral_of_the_density_is_the_variance():
    """Parseval: exact without a taper, even times; within a percent with one and at uneven times."""
    rng = np.random.default_rng(2)
    for n in (500, 501):
        y = rng.normal(size=n) * 1e-4
        found = spectrum([np.arange(n) / RATE], [y], tapered=False)
        assert found.density.sum() * found.frequency_hz[0] == pytest.approx(np.var(y), rel=1e-9)
    # a long record: the estimate's own scatter is sqrt(2 / 20000)
    t = np.sort(rng.uniform(0.0, 20000 / RATE, 20000))
    y = rng.normal(size=20000) * 1e-4
    for when in (t, np.arange(20000) / RATE):
        found = spectrum([when], [y], stretch=60.0)
        assert found.density.sum() * found.frequency_hz[0] == pytest.approx(1e-8, rel=0.03)


def test_confidence_bands_have_their_stated_coverage():
    rng, t, inside, levels = np.random.default_rng(3), np.arange(1024) / RATE, [], []
    truth = 2.0 * 1e-8 / RATE
    for _ in range(60):
        found = spectrum([t], [rng.normal(size=1024) * 1e-4], stretch=128 / RATE)
        low, high = np.moveaxis(found.interval(0.9)[3:-3, 0], -1, 0)
        inside.append(np.mean((low < truth) & (truth < high)))
        levels.append(found.density[3:-3, 0])
    assert np.mean(inside) == pytest.approx(0.9, abs=0.015)
    spread = 2.0 * np.mean(levels) ** 2 / np.var(levels)
    assert spread == pytest.approx(found.degrees, rel=0.08)


def test_a_buffers_mean_is_undone_where_it_can_be():
    window, f = 0.128, 2.0
    t = np.arange(4000) / RATE
    within = (np.arange(400) + 0.5) / 400 * window - window / 2
    y = np.mean(1e-4 * np.cos(2 * np.pi * f * (t[:, None] + within)), axis=1)
    found = spectrum([t], [y], stretch=100.0)
    power = [s.density[:, 0][np.abs(s.frequency_hz - f) < 0.1].sum() * s.frequency_hz[0]
             for s in (found, found.without_averaging(window))]  # fmt: skip
    assert power[1] == pytest.approx(0.5e-8, rel=2e-3)
    assert power[0] / power[1] == pytest.approx(np.sinc(f * window) ** 2, rel=2e-3)
    high = Spectrum(np.array([7.8]), np.ones((1, 1, 1), complex), 2.0, 0.1, np.array([20.0])).without_averaging(window)
    assert np.isnan(high.density).all()


def test_peaks_are_found_and_seldom_made_of_noise():
    rng, t, false = np.random.default_rng(4), np.arange(4096) / RATE, 0
    for _ in range(25):
        false += len(peaks(spectrum([t], [rng.normal(size=4096)], stretch=512 / RATE), probability=0.99))
    assert false <= 2  # 0.25 expected
    y = 3e-5 * np.cos(2 * np.pi * 1.2345 * t) + 2e-5 * np.cos(2 * np.pi * 2.9 * t + 1) + 5e-5 * rng.normal(size=4096)
    found = peaks(spectrum([t], [y], stretch=1024 / RATE))
    assert [round(p.frequency_hz, 2) for p in found] == [1.23, 2.9]
    assert found[0].over > 10.0


def test_a_wave_above_half_the_rate_is_named_with_all_it_may_be_and_other_rhythms_decide():
    rng = np.random.default_rng(5)
    true = 5.0
    t = [np.arange(1500) / RATE + offset for offset in (0.0, 0.02, 0.075)]
    y = [g * np.cos(2 * np.pi * true * x + 0.4) * 1e-4 + 2e-5 * rng.normal(size=1500)
         for g, x in zip((1.0, -0.6, 0.3), t, strict=True)]  # fmt: skip
    top = peaks(spectrum(t, y, stretch=40.0))[0]
    assert top.frequency_hz == pytest.approx(RATE - true, abs=0.01)  # it appears where it is not
    asked = aliases(top.frequency_hz, RATE, 12.0)
    best, share = likely_alias(t, y, asked, stretch=40.0)
    assert best == pytest.approx(true, abs=0.01)
    assert share.max() > 0.9
    assert np.sort(share)[-2] < 0.9
    _, alone = likely_alias(t[:1], y[:1], asked, stretch=40.0)
    np.testing.assert_allclose(alone, 1.0)  # one rhythm knows nothing


@draws(60)
def test_a_shape_is_recovered_with_its_claimed_scatter(runs):
    rng, t = np.random.default_rng(6), np.arange(2000) / RATE
    truth, off = np.array([1.0, -0.5, 0.2, 0.0]), []
    for _ in range(runs):
        band = signal.sosfilt(signal.butter(2, [0.75, 0.85], "bandpass", fs=RATE, output="sos"), rng.normal(size=2400))
        y = truth[:, None] * band[400:] + 0.05 * rng.normal(size=(4, 2000))
        found = shape_at(spectrum([t] * 4, list(y), stretch=250 / RATE), 0.8)
        off.append((np.abs(found.shape[1:3]) - np.abs(truth[1:3])) / found.u_shape[1:3])
        assert np.abs(np.angle(found.shape[1])) > 3.0
        assert np.abs(np.angle(found.shape[2])) < 0.5
    assert found.first_share > 0.9
    spread = np.sqrt(np.mean(np.array(off) ** 2, axis=0))
    assert np.all(spread < 1.6)
    assert np.all(spread > 0.5)
    assert found.rms[0] == pytest.approx(np.std(band), rel=0.3)


def test_invalid_series_are_refused():
    t = np.arange(20.0)
    for times, samples, more, expected in (
        ([t], [t[:5]], {}, "expected both"),
        ([t], [], {}, "channels"),
        ([t[::-1]], [t], {}, "do not increase"),
        ([t], [np.full(20, np.nan)], {}, "not finite"),
        ([t], [t], {"stretch": 100.0}, "no longer"),
        ([t], [t], {"stretch": 4.0}, "holds 8 samples"),
        ([t], [t], {"highest_hz": 0.01}, "no frequency"),
    ):
        with pytest.raises(ValidityError, match=expected):
            spectrum(times, samples, **more)
    found = spectrum([t], [np.sin(t)])
    with pytest.raises(ValidityError, match="no frequency of the spectrum"):
        shape_at(found, 3.0, half_width_hz=0.01)
    assert chi2.cdf(1.0, found.degrees) > 0.0
