"""Weather carried to other heights, and the mean along a line."""

import numpy as np
import pytest
from mpmath import mp

from catseye.atmosphere.index.air import group_refractivity
from catseye.atmosphere.path import mean as path


def test_the_notes_lapse_is_the_hydrostatic_one_at_the_site():
    fall = 933.0 - path.hydrostatic_pressure_hpa(933.0, 20.0, 0.0, z_to=1.0)
    assert float(fall) == pytest.approx(0.11, abs=0.005)  # [PARKER04] prints two digits


@pytest.mark.parametrize(("temperature_c", "within"), [(20.0, 0.2), (0.0, 0.7), (30.0, 0.6), (-20.0, 1.6)])
def test_the_constant_lapse_has_its_documented_accuracy(temperature_c, within):
    apart = path.pressure_at(933.0, 0.0, 100.0) - path.hydrostatic_pressure_hpa(933.0, temperature_c, 0.0, z_to=100.0)
    assert abs(float(apart)) < within


def test_hydrostatic_pressure_solves_the_balance_of_weight():
    # dp/dz = -rho g with rho = (p - e) M_a/(R T) + e M_w/(R T); the vapour keeps its share of the pressure
    p0, e0, kelvin = 933.0, 11.7, 293.15
    molar = (28.9641e-3 * (p0 - e0) + 18.015e-3 * e0) / p0
    expected = float(p0 * mp.exp(-9.80665 * molar * 140 / (8.314462618 * kelvin)))
    got = path.hydrostatic_pressure_hpa(p0, 20.0, 800.0, z_to=940.0, vapour_pressure_hpa=e0)
    assert float(got) == pytest.approx(expected, abs=1e-4)  # the rounding of the ratio of molar masses


def test_moist_air_is_lighter():
    dry, moist = (
        path.hydrostatic_pressure_hpa(933.0, 20.0, 0.0, z_to=140.0, vapour_pressure_hpa=e) for e in (0.0, 20.0)
    )
    assert moist > dry


def test_five_nodes_are_enough_for_the_air_over_the_telescope():
    def real_air(z):
        return group_refractivity(20.0 - 0.0098 * z, path.pressure_at(933.0, 0.0, z), 50.0)

    # checked against ourselves with more nodes: the quadrature alone, not the air
    fine = path.mean_over_height(real_air, 0.0, 200.0, nodes=40)
    assert float(path.mean_over_height(real_air, 0.0, 200.0)) == pytest.approx(float(fine), abs=1e-12)


def test_the_mean_of_an_exponential_air_is_its_closed_form():
    got = path.mean_over_height(lambda z: 250e-6 * np.exp(-z / 8000.0), 0.0, 140.0)
    assert float(got) == pytest.approx(250e-6 * 8000.0 / 140.0 * -np.expm1(-140.0 / 8000.0), rel=1e-14)


def test_a_level_path_takes_the_value_at_its_height():
    assert float(path.mean_over_height(lambda z: 250e-6 - 25e-9 * z, 40.0, 40.0)) == pytest.approx(249e-6, rel=1e-14)


def test_stations_may_differ_from_path_to_path():
    lower, upper = np.array([250e-6, 260e-6, 270e-6]), np.array([248e-6, 257e-6, 266e-6])
    got = path.mean_over_height(lambda z: lower[:, None] + z / 100.0 * (upper - lower)[:, None], np.zeros(3), 50.0)
    np.testing.assert_allclose(got, lower + 0.25 * (upper - lower), rtol=1e-14)
