"""The twin of a refractometer path: light that is under way, sensors that read, and nothing but seeds."""

import numpy as np
import pytest

from reduction.air.refractometer_scene import D0, PathPlan, simulate_path_night

STILL = PathPlan(phase_noise=0.0, walk_mrad_per_root_hour=0.0, hours=1.0, patch_c=0.0)


def test_the_phase_is_minus_the_periods_of_the_flight_less_the_cubes():
    night = simulate_path_night(1, STILL)
    periods = 2.0 * (1.0 + night.index) * (100.0 + D0) / 299792458.0 * 1.5e9
    cube = 2.0 * (1.0 + night.index) * D0 / 299792458.0 * 1.5e9  # the air at the cube differs by 0.1 ppm of 0.18 m
    apart = np.angle(np.exp(1j * (night.phase + 2.0 * np.pi * (periods - cube))))
    assert np.max(np.abs(apart)) < 1e-4


def test_air_in_the_middle_is_seen_by_the_light_in_its_share():
    """A warm place of 3 °C and a tenth of the path as its sigma: 0.1 sqrt(2 pi) of 3 °C, 0.95 ppm a degree."""
    warm = simulate_path_night(2, PathPlan(hours=1.0, patch_c=3.0))
    plain = simulate_path_night(2, PathPlan(hours=1.0, patch_c=0.0))
    assert np.mean(warm.index - plain.index) == pytest.approx(-0.95e-6 * 3.0 * 0.1 * np.sqrt(2 * np.pi), rel=0.05)


def test_a_target_that_moves_away_lowers_the_phase():
    moved = simulate_path_night(3, PathPlan(jumps={4.0: 0.001}))
    plain = simulate_path_night(3)
    after = moved.mjd_utc >= moved.mjd_utc[0] + 4.0 / 24.0 - 1e-9
    change = np.angle(np.exp(1j * (moved.phase - plain.phase)))
    assert np.allclose(change[~after], 0.0)
    assert np.mean(change[after]) == pytest.approx(-2 * np.pi * 0.001 / 0.0999, rel=1e-3)


def test_one_seed_is_one_night_and_gaps_are_gaps():
    a, b, c = simulate_path_night(4), simulate_path_night(4), simulate_path_night(5)
    np.testing.assert_array_equal(a.phase, b.phase)
    assert not np.array_equal(a.phase, c.phase)
    gap = simulate_path_night(4, PathPlan(gaps=((2.0, 3.0),), weather_gaps=((5.0, 6.0),)))
    hours = (gap.mjd_utc - gap.mjd_utc[0]) * 24.0
    assert len(hours) == 420
    assert np.max(np.diff(hours)) == pytest.approx(61 / 60, abs=1e-5)
    assert np.isnan(gap.pressure_hpa).sum() == 60


def test_sensors_scatter_and_lie_as_planned():
    nights = [simulate_path_night(seed, PathPlan(hours=2.0, u_thermometer_c=0.2)) for seed in range(30)]
    offsets = np.concatenate([n.offsets_c for n in nights])
    assert offsets.std() == pytest.approx(0.2, rel=0.2)  # 150 draws: 6 %
    quiet = np.concatenate([np.diff(n.temperature_c[:, 0]) for n in nights])
    # white 0.10, and eddies of 0.15 that lose 0.39 of themselves in a minute
    assert quiet.std() == pytest.approx(np.sqrt(2 * (0.10**2 + 0.15**2 * 0.393)), rel=0.08)
