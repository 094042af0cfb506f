"""Temperature from travel times: two directions against the wind, claims against scatter, refusals."""

from dataclasses import fields

import numpy as np
import pytest

from catseye.atmosphere.index.air import MODELS, group_refractivity
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.path import bent_ray_excess, travel_time
from catseye.atmosphere.sound.real_gas import speed
from catseye.atmosphere.sound.speed import sound
from catseye.errors import ValidityError
from catseye.names import AIR_MODEL
from catseye.reduction.air.acoustic import (
    NO_TIME,
    NO_WIND,
    OUTSIDE,
    USED,
    PathTemperatures,
    PathWind,
    SoundLine,
    StationAir,
    path_temperatures,
)

LENGTH, P, H = 100.0, 933.0, 50.0
STATION = {"pressure_hpa": P, "u_pressure_hpa": 0.3, "humidity_percent": H, "u_humidity_percent": 3.0}
PATH = {"length": LENGTH, "u_length": 1e-3, **STATION}


def temperatures(time_ab, time_ba, u_time, **given) -> PathTemperatures:
    """`path_temperatures` with the fields of its line, station and wind as one row of keywords."""
    line, station, wind = (
        kind(**{field.name: given.pop(field.name) for field in fields(kind) if field.name in given})
        for kind in (SoundLine, StationAir, PathWind)
    )
    return path_temperatures(time_ab, time_ba, u_time, line=line, station=station, wind=wind, **given)


def times(t, wind=0.0, crosswind=0.0, *, length=LENGTH, p=P, h=H):
    c = sound(t, p, h, model="real_gas").speed
    return travel_time(length, c, wind, crosswind), travel_time(length, c, -np.asarray(wind), crosswind)


def test_a_pair_recovers_a_tenth_of_a_degree_in_five_metres_of_wind():
    t = np.array([-15.0, 0.0, 10.0, 20.0, 35.0])
    found = temperatures(*times(t, 5.0), 5e-6, **PATH, u_crosswind=0.0)
    assert found.status == (USED,) * 5
    assert found.temperature_c == pytest.approx(t, abs=1e-6)
    assert found.wind == pytest.approx(5.0, abs=1e-6)
    assert np.all(found.u_temperature_c[:4] < 0.1)  # at 35 °C the 3 % of humidity alone are 0.14 °C


def test_the_second_order_of_the_wind_is_as_large_as_what_is_sought():
    forth, back = times(20.0, 5.0)
    mean = 0.5 * (forth + back)  # the mean of times is not the time of the mean speed
    naive = temperatures(mean, mean, 0.0, **PATH, u_crosswind=0.0).temperature_c[0]
    # (5/343)² of the speed is 0.073 m/s; 0.62 m/s a degree with relative humidity held
    assert naive == pytest.approx(20.0 - 0.073 / 0.624, abs=3e-3)
    one_way = temperatures(forth, None, 0.0, **PATH, u_crosswind=0.0, wind=0.0, u_wind=0.0).temperature_c[0]
    assert one_way - 20.0 == pytest.approx(5.0 / 0.624, rel=0.02)


def test_a_crosswind_that_an_anemometer_gives_is_taken_off():
    pairs = times(20.0, 3.0, 5.0)
    without = temperatures(*pairs, 0.0, **PATH, u_crosswind=0.0)
    assert without.temperature_c[0] == pytest.approx(20.0 - 0.0364 / 0.624, abs=1e-3)
    with_it = temperatures(*pairs, 0.0, **PATH, crosswind=5.0, u_crosswind=0.3)
    assert with_it.temperature_c[0] == pytest.approx(20.0, abs=1e-3)
    assert with_it.parts_c["crosswind"][0] == pytest.approx(5.0 * 0.3 / 344.0 / 0.624, rel=0.02)
    unknown = temperatures(*pairs, 0.0, **PATH, u_crosswind=5.0)
    assert unknown.temperature_c[0] == pytest.approx(20.0, abs=1e-3)  # 5 m/s is its rms
    assert unknown.parts_c["crosswind"][0] == pytest.approx(0.0515 / 0.624, rel=0.01)


def test_a_wind_that_changes_along_the_path_leaves_its_variance():
    s = (np.arange(20_000) + 0.5) / 20_000
    t, wind = 20.0 + 1.0 * np.sin(9.0 * s), 5.0 + 1.0 * np.sin(23.0 * s)
    e = float(sound(np.mean(t), P, H, model="real_gas").vapour_pressure_hpa)  # vapour mixes, relative humidity does not
    c = speed(t, P, e)
    forth, back = LENGTH * np.mean(1.0 / (c + wind)), LENGTH * np.mean(1.0 / (c - wind))
    found = temperatures(forth, back, 0.0, **PATH, u_crosswind=0.0)
    low = np.mean(t) - found.temperature_c[0]
    expected = 0.75 * np.var(t) / 293.15 + 2.0 * 293.15 / 343.0**2 * np.var(wind)  # second order, derived in `path`
    assert expected > 0.003
    # with relative humidity held a degree is 6 % more speed than with the vapour held
    assert low == pytest.approx(expected * 0.586 / 0.624, rel=0.05)
    mean_of_index = np.mean(MODELS[AIR_MODEL].refractivity(t, P, e, wavelength_um=0.78, co2_ppm=450.0))
    assert found.group_refractivity[0] == pytest.approx(mean_of_index, abs=6e-9)


def test_a_bent_ray_and_its_frequency_are_taken_off():
    forth, back = times(20.0, 2.0)
    early = 1.0 - bent_ray_excess(LENGTH, 343.0, 0.3)
    bent = temperatures(forth * early, back * early, 0.0, **PATH, u_crosswind=0.0, speed_gradient=0.3)
    assert bent.temperature_c[0] == pytest.approx(20.0, abs=1e-4)
    e = sound(20.0, P, H, model="real_gas").vapour_pressure_hpa
    fast = 1.0 + dispersion(20.0, P, e, frequency_hz=4000.0).of_a_pulse()[0]
    chirp = temperatures(*times(20.0), 0.0, **{**PATH, "length": LENGTH * fast}, u_crosswind=0.0, frequency_hz=4e3)
    assert chirp.temperature_c[0] == pytest.approx(20.0, abs=1e-6)


def test_every_cause_moves_the_temperature_by_its_part():
    forth, back = times(20.0, 5.0)
    spreads = {"u_delay": 2e-5, "u_crosswind": 0.2, "crosswind": 2.0}
    base = temperatures(forth, back, 1e-5, **PATH, **spreads)

    def moved(change=None, **other):
        given = {**PATH, **spreads, **other}
        return abs(temperatures(forth + (change or 0.0), back + (change or 0.0), 1e-5, **given).temperature_c[0] - t0)

    t0 = base.temperature_c[0]
    parts = {k: v[0] for k, v in base.parts_c.items()}
    # finite steps of one standard uncertainty: second order is 1e-3 of them
    assert moved(length=LENGTH + 1e-3) == pytest.approx(parts["length"], rel=2e-3)
    assert moved(delay=2e-5) == pytest.approx(parts["delay"], rel=2e-3)
    assert moved(pressure_hpa=P + 0.3) == pytest.approx(parts["pressure"], rel=2e-3)
    assert moved(humidity_percent=H + 3.0) == pytest.approx(parts["humidity"], rel=6e-3)  # its second order is larger
    assert moved(co2_ppm=470.0) == pytest.approx(parts["carbon dioxide"], rel=2e-3)
    one, other = abs(moved(1e-5)), parts["time"]  # both times late together: twice the one, noise adds in squares
    assert one == pytest.approx(other * np.sqrt(2.0), rel=2e-3)


def scatter(runs, seed):
    """Whole nights of six pairs each, everything drawn from its claim."""
    rng = np.random.default_rng(seed)
    t = np.array([8.0, 10.0, 11.0, 14.0, 18.0, 24.0])
    u = {"u_length": 2e-3, "u_delay": 1e-5, "u_pressure_hpa": 0.5, "u_humidity_percent": 5.0, "u_crosswind": 0.5}
    zt, zw, zn = [], [], []
    for _ in range(runs):
        length = LENGTH + u["u_length"] * rng.standard_normal()
        p, h = P + 0.5 * rng.standard_normal(), H + 5.0 * rng.standard_normal()
        wind, across = 4.0 * rng.standard_normal(6), 3.0 + 0.5 * rng.standard_normal()
        model = 0.035 * rng.standard_normal()
        c = sound(t, p, h, model="real_gas").speed + model
        late = 1e-5 * rng.standard_normal()
        noise = 8e-6 * rng.standard_normal((2, 6))
        forth = travel_time(length, c, wind, across) + late + 1e-3 + noise[0]
        back = travel_time(length, c, -wind, across) + late + 1e-3 + noise[1]
        found = temperatures(
            forth,
            back,
            8e-6,
            length=LENGTH,
            delay=1e-3,
            pressure_hpa=P,
            humidity_percent=H,
            crosswind=3.0,
            u_co2_ppm=0.0,
            **u,
        )
        zt.append(np.linalg.solve(np.linalg.cholesky(found.covariance_c2), found.temperature_c - t))
        zw.append((found.wind - wind) / found.u_wind)
        light = group_refractivity(t, p, h) + 5e-8 * rng.standard_normal()
        zn.append(np.linalg.solve(np.linalg.cholesky(found.covariance_group), found.group_refractivity - light))
    return np.array(zt), np.array(zw), np.array(zn)


def check_scatter(runs, seed):
    for z in scatter(runs, seed):
        # six values a run; 4 standard deviations of the mean square of independent ones
        assert np.mean(z**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (6 * runs)))


def test_claims_hold_against_scatter():
    check_scatter(80, 11)


@pytest.mark.slow
def test_claims_hold_against_much_scatter():
    check_scatter(3000, 12)


def test_common_errors_do_not_average_out():
    found = temperatures(*times(np.full(4, 20.0)), 5e-6, **PATH, u_crosswind=0.0)
    u = found.u_temperature_c
    correlation = found.covariance_c2 / np.outer(u, u)
    assert correlation[0, 1] > 0.9  # length, station and formula are one for all
    mean = np.full(4, 0.25)
    assert np.sqrt(mean @ found.covariance_c2 @ mean) > 0.9 * u[0]  # and do not average out


def test_a_humidity_read_high_raises_the_index_through_the_temperature():
    forth, back = times(20.0)
    low, high = (
        temperatures(forth, back, 0.0, **{**PATH, "humidity_percent": h}, u_crosswind=0.0) for h in (50.0, 60.0)
    )
    assert high.temperature_c[0] < low.temperature_c[0]
    assert high.group_refractivity[0] > low.group_refractivity[0]
    assert group_refractivity(20.0, P, 60.0) < group_refractivity(20.0, P, 50.0)


@pytest.mark.parametrize(("name", "u"), [("pressure_hpa", 0.5), ("humidity_percent", 2.0)])
def test_weather_moves_the_index_through_the_temperature_and_directly(name, u):
    forth, back = times(20.0)

    def found(shift, spread):
        given = {**PATH, name: PATH[name] + shift, f"u_{name}": spread}
        return temperatures(forth, back, 0.0, **given, u_crosswind=0.0)

    moved = found(0.5 * u, 0.0).group_refractivity[0] - found(-0.5 * u, 0.0).group_refractivity[0]
    part = found(0.0, u).covariance_group[0, 0] - found(0.0, 0.0).covariance_group[0, 0]
    assert part == pytest.approx(moved**2, rel=1e-3, abs=0.0)


def test_one_direction_carries_the_winds_uncertainty():
    forth, _ = times(20.0, 3.0)
    found = temperatures(forth, None, 5e-6, **PATH, u_crosswind=0.0, wind=3.0, u_wind=0.5)
    assert found.temperature_c[0] == pytest.approx(20.0, abs=1e-6)
    assert found.parts_c["wind"][0] == pytest.approx(0.5 / 0.624, rel=0.01)
    assert found.wind[0] == 3.0
    assert found.u_wind[0] == 0.5


def test_a_bad_time_is_a_status_and_spoils_no_other():
    forth, back = (np.tile(x, 4) for x in times(20.0, 1.0))
    forth[1], back[2], forth[3], back[3] = np.nan, -1.0, 0.2, 0.2
    found = temperatures(forth, back, 5e-6, **PATH, u_crosswind=0.0)
    assert found.status == (USED, NO_TIME, NO_TIME, OUTSIDE)
    assert found.temperature_c[0] == pytest.approx(20.0, abs=1e-6)
    for values in (found.temperature_c, found.u_temperature_c, found.group_refractivity, found.u_group_refractivity):
        assert np.isfinite(values).tolist() == [True, False, False, False]


def test_two_times_of_a_hurricane_are_a_status_and_leave_no_wind():
    found = temperatures([LENGTH / 443.0, 0.2, 0.29], [LENGTH / 243.0, 0.2, 0.29], 5e-6, **PATH, u_crosswind=0.0)
    assert found.status == (NO_WIND, OUTSIDE, USED)
    for values in (found.temperature_c, found.u_temperature_c, found.wind, found.u_wind, found.group_refractivity):
        assert np.isfinite(values).tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"length": 0.0}, "length of the path 0 m is outside 0.1-10000.0 m"),
        ({"pressure_hpa": 93300.0}, "pressure 93300 hPa is outside 500-1100 hPa"),
        ({"humidity_percent": 101.0}, "relative humidity 101 %"),
        ({"u_length": -1.0}, "u_length -1"),
        ({"u_crosswind": float("nan")}, "u_crosswind is not a number"),
        ({"wind": 1.0, "u_wind": 1.0}, "two directions measure the wind"),
        ({"model": "laplace"}, "model of sound 'laplace' is unknown"),
        ({"delay": 3.0}, "delay 3 s is outside"),
    ],
)
def test_refusals(change, complaint):
    forth, back = times(20.0)
    with pytest.raises(ValidityError) as caught:
        temperatures(forth, back, 5e-6, **{**PATH, "u_crosswind": 0.0, **change})
    assert complaint in str(caught.value)


def test_one_direction_without_a_wind_is_refused():
    with pytest.raises(ValidityError, match="give wind and u_wind"):
        temperatures(times(20.0)[0], None, 5e-6, **PATH, u_crosswind=0.0)
