"""Laws that sound in air obeys, with generated weather."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.path import bent_ray_excess, pair, straight_line_speed, travel_time
from catseye.atmosphere.sound.speed import MODELS, sound, temperature_of_speed_c

WIDE = sorted(set(MODELS) - {"cramer1993"})
models = st.sampled_from(WIDE)
temperatures, pressures, humidities = st.floats(-39.0, 44.0), st.floats(600.0, 1099.0), st.floats(0.0, 100.0)
winds = st.floats(-20.0, 20.0)


@given(temperatures, pressures, humidities, models, st.floats(0.01, 1.0))
def test_sound_is_faster_in_warmer_air(t, p, h, model, warming):
    assert sound(t + warming, p, h, model=model).speed > sound(t, p, h, model=model).speed


@given(temperatures, pressures, st.floats(0.0, 99.0), models)
def test_sound_is_faster_in_moister_air(t, p, h, model):
    moist = sound(t, p, h + 1.0, model=model)
    assert moist.speed > sound(t, p, h, model=model).speed
    assert moist.speed >= moist.dry_speed


@given(temperatures, pressures)
def test_dry_sound_of_the_notes_is_independent_of_pressure(t, p):
    state = sound(t, p, 0.0)
    assert state.speed == sound(t, 700.0, 0.0).speed
    assert state.sensitivity.pressure_hpa == 0.0


@given(temperatures, pressures, humidities, models)
def test_temperature_inverts_speed(t, p, h, model):
    assert temperature_of_speed_c(sound(t, p, h, model=model).speed, p, h, model=model) == pytest.approx(t, abs=1e-8)


@given(st.floats(-39.0, 43.0), st.floats(601.0, 1098.0), st.floats(1.0, 99.0), models)
def test_a_small_change_of_weather_moves_the_speed_by_its_sensitivity(t, p, h, model):
    slopes = sound(t, p, h, model=model).sensitivity
    for axis, slope in enumerate(slopes[:3]):
        step = np.eye(3)[axis] * 1e-3
        up, down = (sound(*(np.array([t, p, h]) + s), model=model).speed for s in (step, -step))
        # rounding of the speed, 6e-14, over 2e-3; the third derivative times 1e-6
        assert (up - down) / 2e-3 == pytest.approx(slope, abs=2e-10, rel=1e-7)


@given(temperatures, pressures, humidities, models)
def test_an_array_of_weather_gives_what_each_weather_gives(t, p, h, model):
    together = sound(np.array([t, 10.0]), np.array([p, 900.0]), np.array([h, 40.0]), model=model)
    assert together.speed[0] == pytest.approx(float(sound(t, p, h, model=model).speed), rel=1e-14)
    assert together.speed[1] == pytest.approx(float(sound(10.0, 900.0, 40.0, model=model).speed), rel=1e-14)


@given(st.floats(0.0, 30.0), st.floats(750.0, 1020.0), humidities)
def test_todays_models_agree_within_their_uncertainties(t, p, h):
    one, other = sound(t, p, h, model="cramer1993"), sound(t, p, h, model="real_gas")
    assert abs(one.speed - other.speed) < 2.0 * np.hypot(one.standard_uncertainty, other.standard_uncertainty)


@given(st.floats(0.1, 3000.0), st.floats(300.0, 360.0), winds, winds)
def test_a_pair_gives_wind_and_speed_exactly_for_any_wind(length, c, along, across):
    times = travel_time(length, c, along, across), travel_time(length, c, -along, across)
    found = pair(*times, length)
    assert found.wind == pytest.approx(along, abs=1e-10)
    assert straight_line_speed(found.speed_along, across, 0.0)[0] == pytest.approx(c, rel=1e-13)


@given(st.floats(300.0, 360.0), winds, winds)
def test_seen_from_the_other_end_the_wind_turns_its_sign_and_the_speed_stays(c, along, across):
    forth, back = travel_time(50.0, c, along, across), travel_time(50.0, c, -along, across)
    there, here = pair(forth, back, 50.0), pair(back, forth, 50.0)
    assert there.wind == -here.wind
    assert there.speed_along == here.speed_along


@given(st.floats(1.0, 500.0), st.floats(300.0, 360.0), st.floats(1e-6, 10.0))
def test_a_bent_ray_is_never_late_for_either_sign_of_the_gradient(length, c, gradient):
    early = bent_ray_excess(length, c, gradient)
    assert 0.0 <= early <= (gradient * length / c) ** 2 / 24.0 * (1.0 + 1e-12)
    assert early == bent_ray_excess(length, c, -gradient)


@given(temperatures, pressures, st.floats(0.0, 20.0), st.floats(0.0, 9e5), st.floats(1.0, 1e5))
def test_higher_frequencies_are_never_slower_and_the_envelope_runs_ahead(t, p, e, frequency, more):
    low, high = dispersion(t, p, e, frequency_hz=frequency), dispersion(t, p, e, frequency_hz=frequency + more)
    assert low.phase <= high.phase < 1.5e-3
    assert low.group >= low.phase
