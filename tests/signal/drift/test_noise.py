"""Noise spectra: parts and lines found in made series, with the scatter that they claim."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.drift.allan import allan_deviation, expected_variance
from catseye.signal.drift.noise import noise_spectrum
from draws import draws


def made(rng, n, white, flicker, walk):
    """White, flicker and walk; the flicker by fractional differencing of order one half over eight lengths."""
    k = np.arange(8 * n)
    response = np.cumprod(np.concatenate([[1.0], (k[1:] - 0.5) / k[1:]]))
    size = 16 * n
    drive = np.fft.rfft(rng.normal(size=8 * n), size) * np.fft.rfft(response, size)
    pink = np.fft.irfft(drive, size)[: 8 * n][-n:] * np.sqrt(np.pi)
    return white * rng.normal(size=n) + flicker * pink + walk * rng.normal(size=n).cumsum()


def scatter(runs, white, flicker, walk):
    rng = np.random.default_rng(11)
    found = [noise_spectrum(made(rng, 2048, white, flicker, walk), 1.0) for _ in range(runs)]
    squares = np.array([f.squares for f in found])
    covariance = np.mean([f.covariance for f in found], axis=0)
    return squares, covariance, sum(len(f.spurs) for f in found)


def check_scatter(runs, rel):
    truth = np.array([1.0, 0.3, 0.2]) ** 2
    squares, covariance, _ = scatter(runs, 1.0, 0.3, 0.2)
    u = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(squares.mean(axis=0) - truth) < 4.0 * u / np.sqrt(runs) + 0.06 * truth)
    assert squares.std(axis=0) == pytest.approx(u, rel=rel)


def test_parts_of_a_mixture_scatter_as_their_covariance():
    check_scatter(100, 0.25)


@pytest.mark.slow
def test_parts_of_a_mixture_scatter_as_their_covariance_in_a_thousand_runs():
    check_scatter(1000, 0.10)


def test_absent_parts_are_zero_and_noise_is_not_a_spur():
    squares, _, spurs = scatter(200, 1.0, 0.0, 0.0)
    assert squares[:, 0].mean() == pytest.approx(1.0, abs=0.01)
    assert squares[:, 2].mean() < 1e-4
    assert spurs <= 2  # one in a thousand is asked for


@draws(60)
def test_a_57_hz_line_is_found_among_all_three_noises_and_claims_its_scatter(runs):
    rng = np.random.default_rng(12)
    time = np.arange(4096) * 1e-3
    off = []
    for k in range(runs):
        phase = 0.1 * k
        y = made(rng, 4096, 1.0, 0.1, 0.02) + 0.3 * np.sin(2 * np.pi * 57.123 * time + phase)
        spur = noise_spectrum(y, 1e-3).spurs[0]
        middle = phase + 2 * np.pi * 57.123 * time[[0, -1]].mean()
        turned = np.angle(np.exp(1j * (spur.phase - middle))) * spur.amplitude
        off.append(
            [
                (spur.frequency_hz - 57.123) / spur.u_frequency_hz,
                (spur.amplitude - 0.3) / spur.u_amplitude,
                turned / spur.u_amplitude,
            ]
        )
    off = np.array(off)
    assert np.all(np.abs(off.mean(axis=0)) < 0.5)
    assert np.all((off.std(axis=0) > 0.7) & (off.std(axis=0) < 1.35))  # 60 runs: u of a standard deviation is 9 %


def test_two_lines_come_strongest_first_and_the_rest_is_the_noise():
    rng = np.random.default_rng(13)
    k = np.arange(8192)
    y = rng.normal(size=8192) + 0.5 * np.sin(0.3 * k) + 1.5 * np.sin(1.1 * k + 1.0)
    found = noise_spectrum(y, 0.5)
    assert [round(s.amplitude, 1) for s in found.spurs] == [1.5, 0.5]
    assert [s.frequency_hz for s in found.spurs] == pytest.approx([1.1 / np.pi, 0.3 / np.pi], abs=1e-4)
    assert found.white == pytest.approx(1.0, abs=0.03)
    assert all(s.false_alarm < 1e-6 for s in found.spurs)


def test_spectrum_and_allan_deviation_agree():
    rng = np.random.default_rng(14)
    k = np.arange(2**16)
    y = made(rng, 2**16, 1.0, 0.2, 0.01) + 0.4 * np.sin(2 * np.pi * 0.057 * k)
    spectrum, sizes = noise_spectrum(y, 1e-3), np.array([1, 8, 64, 512])
    spur = spectrum.spurs[0]
    expected = expected_variance(sizes, white=spectrum.white, flicker=spectrum.flicker, walk=spectrum.walk)
    turn = np.pi * spur.frequency_hz * 1e-3
    expected = expected + (spur.amplitude * np.sin(sizes * turn) ** 2 / (sizes * np.sin(turn))) ** 2
    seen = allan_deviation(y, sizes)
    allowed = 4.0 * np.sqrt(2.0 / seen.degrees) * expected  # of one series; that of the spectrum is as large at most
    assert np.all(np.abs(seen.deviation**2 - expected) < allowed)


def test_parts_and_lines_are_in_the_unit_of_the_series():
    y = np.random.default_rng(15).normal(size=1024).cumsum() + np.sin(np.arange(1024))
    one, small = noise_spectrum(y, 1.0), noise_spectrum(1e-6 * y, 1.0)
    assert small.walk == pytest.approx(1e-6 * one.walk, rel=1e-4)
    assert small.spurs[0].amplitude == pytest.approx(1e-6 * one.spurs[0].amplitude, rel=1e-4)


def test_series_without_noise_or_with_gaps_are_refused():
    with pytest.raises(ValidityError, match="dead channel"):
        noise_spectrum(np.full(100, 2.0), 1.0)
    with pytest.raises(ValidityError, match="at least 64"):
        noise_spectrum(np.arange(10.0), 1.0)
    with pytest.raises(ValidityError, match="reading 7"):
        noise_spectrum(np.where(np.arange(100) == 7, np.inf, np.sin(np.arange(100))), 1.0)
    with pytest.raises(ValidityError, match="interval"):
        noise_spectrum(np.sin(np.arange(100.0)), 0.0)


def test_a_steady_drift_is_neither_a_walk_nor_a_spur():
    noise = 0.012 * np.random.default_rng(16).normal(size=4096)
    still = noise_spectrum(noise, 0.001)
    for drift in (1e-4, 3e-3, 0.1):  # of a reading: up to 400 in all, tens of thousands of standard deviations
        found = noise_spectrum(noise + drift * np.arange(4096), 0.001)
        assert not found.spurs
        assert found.squares == pytest.approx(still.squares, rel=1e-4, abs=1e-12)
        assert found.drift - still.drift == pytest.approx(drift / 0.001, rel=1e-9)


def test_spurs_are_distinct_and_rounding_is_not_a_spur():
    turn = np.arange(256)
    bent = 1e-4 * (turn - 128.0) ** 2 + 1e-3 * np.random.default_rng(17).normal(size=256)
    for y in (bent, np.sin(2 * np.pi * turn / 16), (turn // 2 % 2) * 1e-3):
        found = noise_spectrum(y, 1.0)
        places = np.sort([s.frequency_hz for s in found.spurs])
        assert np.all(np.diff(places) >= 1.0 / 256)
        assert all(s.amplitude > 1e-12 * np.ptp(y) for s in found.spurs)
    with pytest.raises(ValidityError, match="straight line"):
        noise_spectrum(0.01 * np.arange(256.0), 1.0)


def test_the_density_times_its_band_is_the_variance():
    y = np.random.default_rng(18).normal(size=8192)
    found = noise_spectrum(y, 0.01)
    for density in (found.density, found.model):
        assert density.mean() * 50.0 == pytest.approx(1.0, rel=0.05)  # up to half of 100 Hz
