"""Noise of the receiver against textbook numbers, and the phase's bound against a simulated lock-in."""

import numpy as np
import pytest

from catseye.optics.abcd import thick_lens
from catseye.optics.glass import group_index, phase_index
from catseye.optics.receiver import (
    lens_group_lag,
    lens_group_range,
    noise_density,
    signal_current,
    traced_lens,
    u_phase,
)


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


LENSES = ((0.1022374, np.inf), (0.2, -0.2), (np.inf, -0.1022374), (0.06, 0.3))
N_P, N_G = 1.511187, 1.527464


@pytest.mark.parametrize(("r1", "r2"), LENSES)
def test_exact_rays_have_the_group_lag_of_the_closed_form(r1, r2):
    heights = np.array([0.001, 0.005, 0.010])
    wave, modulation, _ = traced_lens(heights, r1=r1, r2=r2, thickness=0.008, phase=N_P, group=N_G)
    power = -float(thick_lens(r1, r2, thickness=0.008, index=N_P)[1, 0])
    found = lens_group_lag(heights, power, N_P, group=N_G)
    # its own fourth order and the thickness, a few per cent at f/5
    assert modulation - wave == pytest.approx(found, rel=0.03)
    assert np.all(modulation < wave)  # the middle is late, not the edge


def test_a_lens_of_one_index_has_no_lag_and_its_wave_error_grows_with_the_fourth_power():
    wave, modulation, _ = traced_lens([0.005, 0.010], r1=np.inf, r2=-0.1, thickness=0.005, phase=N_P, group=N_P)
    assert modulation == pytest.approx(wave)
    assert wave[1] / wave[0] == pytest.approx(16.0, rel=0.03)


def test_an_achromat_for_the_wavelength_has_no_lag():
    light, crown, flint = 0.78, "N-BK7", "S-LAH79"

    def focal_power(wavelength, shares):
        return sum(s * (float(phase_index(wavelength, g)) - 1.0) for s, g in zip(shares, (crown, flint), strict=True))

    step = 1e-4
    slopes = [(float(phase_index(light + step, g)) - float(phase_index(light - step, g))) for g in (crown, flint)]
    shares = np.array([1.0, -slopes[0] / slopes[1]]) * 12.0  # curvatures: the power has no slope at 780 nm
    assert focal_power(light + step, shares) == pytest.approx(focal_power(light - step, shares), abs=1e-9)
    n_p = np.array([float(phase_index(light, g)) for g in (crown, flint)])
    n_g = np.array([float(group_index(light, g)) for g in (crown, flint)])
    left = lens_group_lag(0.025, shares * (n_p - 1.0), n_p, group=n_g)
    assert abs(left) < 1e-9  # against 76 um of the crown alone
    assert lens_group_lag(0.025, 12.0 * (n_p[0] - 1.0), n_p[0], group=n_g[0]) == pytest.approx(-62e-6, abs=2e-6)


def test_a_parabolic_mirror_delays_no_ring_against_another():
    """Plane wave to focus by geometry: z = h^2/4f, path -z + distance to (0, f)."""
    focal, h = 0.2, np.linspace(0.0, 0.05, 6)
    sag = h**2 / (4.0 * focal)
    path = -sag + np.hypot(h, focal - sag)
    assert path == pytest.approx(np.full(6, focal), abs=1e-16)
    assert lens_group_lag(h, 1.0 / focal, 1.5, group=1.5) == pytest.approx(np.zeros(6))


@pytest.mark.parametrize("light", [0.004, 0.012, 0.2, np.inf])
def test_the_range_of_a_lens_is_the_phase_of_the_light_summed_over_it(light):
    edge, wave = 0.025, 0.199811
    lens = {"powers": 5.0, "phase": N_P, "group": N_G}
    node, weight = np.polynomial.legendre.leggauss(200)
    h = 0.5 * edge * (node + 1.0)
    power = weight * h * np.exp(-2.0 * (h / light) ** 2)
    summed = np.sum(power * np.exp(-2j * np.pi * lens_group_lag(h, 5.0, N_P, group=N_G) / wave))
    exact = -np.angle(summed) * wave / (4.0 * np.pi)
    assert lens_group_range(edge, light, **lens) == pytest.approx(exact, rel=1e-4)
