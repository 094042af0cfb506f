"""Noise of the receiver against textbook numbers, and the phase's bound against a simulated lock-in."""

import numpy as np
import pytest

from catseye.optics.receiver import noise_density, signal_current, u_phase


def test_a_milliampere_has_18_picoampere_of_shot_noise_and_50_ohm_18_of_thermal():
    assert np.sqrt(noise_density(1e-3, responsivity=1.0)) == pytest.approx(17.9e-12, rel=1e-3, abs=0.0)
    assert np.sqrt(noise_density(0.0, responsivity=1.0, load=50.0, temperature_k=290.0)) == pytest.approx(
        17.9e-12, rel=3e-3, abs=0.0
    )


def test_intensity_noise_grows_with_the_square_of_the_power_and_shot_noise_with_the_power():
    at = {"responsivity": 0.5, "intensity_noise_db_hz": -130.0}
    quiet = [noise_density(p, responsivity=0.5) for p in (1e-3, 2e-3)]
    excess = [noise_density(p, **at) - q for p, q in zip((1e-3, 2e-3), quiet, strict=True)]
    assert quiet[1] / quiet[0] == pytest.approx(2.0)
    assert excess[1] / excess[0] == pytest.approx(4.0)
    assert excess[0] == pytest.approx(1e-13 * (0.5e-3) ** 2, abs=0.0)
    assert signal_current(2e-3, depth=0.5, responsivity=0.5) == pytest.approx(0.5e-3)


def test_the_phase_of_a_tone_in_white_noise_scatters_by_the_bound():
    rng = np.random.default_rng(4)
    rate, n, sigma = 64_000.0, 512, 0.2
    wave = np.exp(2j * np.pi * np.arange(n) / 64)
    phase = np.angle((np.cos(2 * np.pi * np.arange(n) / 64 - 0.4) + sigma * rng.normal(size=(4000, n))) @ wave)
    assert phase.std() == pytest.approx(u_phase(1.0, 2.0 * sigma**2 / rate, n / rate), rel=0.04)


def test_daylight_and_dark_current_have_the_shot_noise_of_their_current_and_the_amplifier_its_square():
    milliampere = 2 * 1.602176634e-22
    assert noise_density(0.0, responsivity=0.5, background=2e-3) == pytest.approx(milliampere, rel=1e-12, abs=0.0)
    assert noise_density(0.0, responsivity=0.5, dark_current=1e-3) == pytest.approx(milliampere, rel=1e-12, abs=0.0)
    assert noise_density(0.0, responsivity=0.5, amplifier=3e-12) == pytest.approx(9e-24, rel=1e-12, abs=0.0)
