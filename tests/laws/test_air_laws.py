"""Laws that the air obeys, with generated weather."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.atmosphere.index.air import MODELS, air, group_refractivity, phase_refractivity
from catseye.atmosphere.path import mean as path
from catseye.atmosphere.weather import humidity

temperatures = st.floats(-40.0, 49.0)
pressures = st.floats(600.0, 1099.0)
humidities = st.floats(0.0, 100.0)
wavelengths = st.floats(0.36, 1.69)
models = st.sampled_from(sorted(MODELS))
formulas = st.sampled_from(sorted(humidity.FORMULAS))
heights = st.floats(-50.0, 200.0)
refractivities = st.floats(1e-4, 4e-4)


@given(temperatures, pressures, humidities, models, st.floats(0.01, 1.0))
def test_refractivity_falls_as_the_air_warms(t, p, h, model, warming):
    assert group_refractivity(t + warming, p, h, model=model) < group_refractivity(t, p, h, model=model)
    assert phase_refractivity(t + warming, p, h, model=model) < phase_refractivity(t, p, h, model=model)


@given(temperatures, pressures, humidities, models, st.floats(0.01, 1.0))
def test_refractivity_grows_with_pressure(t, p, h, model, rise):
    assert group_refractivity(t, p + rise, h, model=model) > group_refractivity(t, p, h, model=model)


@given(temperatures, pressures, st.floats(0.0, 99.0), models)
def test_moister_air_delays_near_infrared_light_less(t, p, h, model):
    assert group_refractivity(t, p, h + 1.0, model=model) < group_refractivity(t, p, h, model=model)


@given(temperatures, pressures, humidities, wavelengths, models)
def test_the_group_index_exceeds_the_phase_index_which_exceeds_one(t, p, h, wavelength, model):
    group = group_refractivity(t, p, h, wavelength_um=wavelength, model=model)
    assert group > phase_refractivity(t, p, h, wavelength_um=wavelength, model=model) > 0.0


@given(temperatures, pressures, humidities, st.floats(0.37, 1.68), models)
def test_the_group_index_is_the_phase_index_less_wavelength_times_its_slope(t, p, h, wavelength, model):
    step = 1e-4  # um; the difference is good to step² n''' and 1e-16/step: 1e-9 of the refractivity and better
    longer, shorter = (phase_refractivity(t, p, h, wavelength_um=wavelength + s, model=model) for s in (step, -step))
    phase = phase_refractivity(t, p, h, wavelength_um=wavelength, model=model)
    expected = phase - wavelength * (longer - shorter) / (2 * step)
    assert group_refractivity(t, p, h, wavelength_um=wavelength, model=model) == pytest.approx(expected, abs=1e-11)


@given(st.floats(-39.0, 49.0), pressures, st.floats(1.0, 99.0), models)
def test_a_small_change_of_weather_moves_the_index_by_its_sensitivity(t, p, h, model):
    slopes = air(t, p, h, model=model).sensitivity
    for axis, slope in enumerate(slopes[:3]):
        step = np.eye(3)[axis] * 1e-3
        up, down = (group_refractivity(*(np.array([t, p, h]) + s), model=model) for s in (step, -step))
        # rounding of the refractivity, 1e-19, over 2e-3
        assert (up - down) / 2e-3 == pytest.approx(slope, abs=1e-14, rel=1e-7)


@given(temperatures, pressures, formulas)
def test_the_dew_point_of_saturated_air_is_its_temperature(t, p, formula):
    e = humidity.vapour_pressure_hpa(t, p, 100.0, formula)
    assert humidity.dew_point_c(e, p, formula) == pytest.approx(t, abs=1e-9)


@given(temperatures, pressures, st.floats(0.1, 99.9), models)
def test_unsaturated_air_has_its_dew_point_below_its_temperature(t, p, h, model):
    assert air(t, p, h, model=model).dew_point_c < t


@given(st.lists(st.tuples(temperatures, pressures, humidities), min_size=1, max_size=5), models)
def test_an_array_of_weather_gives_what_each_weather_gives(weather, model):
    together = air(*np.array(weather).T, model=model)
    for i, one in enumerate(weather):
        alone = air(*one, model=model)
        for name in ("group_refractivity", "phase_refractivity", "vapour_pressure_hpa", "dew_point_c"):
            got, expected = getattr(together, name)[i], getattr(alone, name)
            assert got == pytest.approx(float(expected), rel=1e-14, abs=1e-12, nan_ok=True)
        for got, expected in zip(together.sensitivity, alone.sensitivity, strict=True):
            assert got[i] == pytest.approx(float(expected), rel=1e-12)


@given(models)
def test_arguments_broadcast_against_each_other(model):
    got = air(
        np.zeros((4, 1, 1)),
        np.full((3, 1), 933.0),
        np.array([0.0, 50.0]),
        wavelength_um=np.array([0.78, 0.85]),
        model=model,
    )
    assert got.group_refractivity.shape == (4, 3, 2)
    assert all(np.broadcast_shapes(slope.shape, (4, 3, 2)) == (4, 3, 2) for slope in got.sensitivity)


@given(heights, heights, refractivities, st.integers(1, 12))
def test_the_mean_over_a_constant_profile_is_the_constant(a, b, constant, nodes):
    got = path.mean_over_height(lambda z: np.full_like(z, constant), a, b, nodes=nodes)
    assert got == pytest.approx(constant, rel=1e-13)


@given(heights, heights, refractivities, st.floats(-1e-7, 1e-7), st.integers(1, 12))
def test_the_mean_over_a_straight_profile_is_its_value_midway(a, b, ground, slope, nodes):
    got = path.mean_over_height(lambda z: ground + slope * z, a, b, nodes=nodes)
    assert got == pytest.approx(ground + slope * (a + b) / 2, rel=1e-12)


@given(heights, heights, st.integers(1, 12))
def test_the_mean_is_the_same_seen_from_either_end(a, b, nodes):
    def profile(z):
        return 250e-6 * np.exp(-z / 8000.0) + 1e-6 * np.sin(z / 30.0)

    there, back = path.mean_over_height(profile, a, b, nodes=nodes), path.mean_over_height(profile, b, a, nodes=nodes)
    assert there == pytest.approx(back, rel=1e-13)


@given(heights, heights, heights, st.floats(-40.0, 50.0))
def test_pressure_carried_by_way_of_a_third_height_is_the_pressure_carried_at_once(a, b, c, t):
    for carry in (path.pressure_at, lambda p, z1, z2: path.hydrostatic_pressure_hpa(p, t, z1, z_to=z2)):
        assert carry(carry(933.0, a, b), b, c) == pytest.approx(carry(933.0, a, c), rel=1e-13)
