"""How far the notes' model lies from today's: the numbers that the documentation states."""

import numpy as np
import pytest

from catseye.atmosphere import ciddor_hill1999, rueger1990


def departure(*weather, **light):
    return rueger1990.group_refractivity(*weather, **light) - ciddor_hill1999.group_refractivity(*weather, **light)


def test_owens_is_two_tenths_of_a_ppm_low_when_hot_and_very_humid():
    assert float(departure(30.0, 933.0, 80.0)) * 1e6 == pytest.approx(-0.19, abs=0.02)


def test_in_standard_dry_air_the_two_agree_within_5e_9_at_all_our_lasers():
    lasers = np.array([0.633, 0.780, 0.850, 1.55])
    assert np.all(np.abs(departure(15.0, 1013.25, 0.0, wavelength_um=lasers)) < 5e-9)


def test_over_green_banks_weather_the_departure_justifies_the_uncertainty_that_rueger1990_states():
    weather = np.meshgrid(np.linspace(-25, 35, 31), np.linspace(860, 960, 6), np.linspace(0, 100, 21), indexing="ij")
    difference = departure(*weather)
    assert np.all(difference < 0.0)
    assert np.sqrt(np.mean(difference**2)) == pytest.approx(7.4e-8, abs=0.3e-8)
    assert np.sqrt(np.mean(difference**2)) < rueger1990.MODEL.standard_uncertainty
    assert difference.min() == pytest.approx(-3.1e-7, abs=0.1e-7)
