"""The compiled forms of two air models against their plain forms, which are tested against printed tables."""

from importlib import import_module
from typing import NamedTuple

import numpy as np
import pytest

from catseye.atmosphere.index import air_kernel, ciddor_hill1999_kernel, rueger1990_kernel
from catseye.atmosphere.index.air import MODELS
from catseye.atmosphere.weather import humidity
from catseye.errors import ValidityError

KERNELS = {
    name: import_module(f"catseye.atmosphere.index.{name}_kernel").refractivity
    for name, model in MODELS.items()
    if model.is_compiled
}
SAME = 1e-15  # in the index: a ten-millionth of a micrometre in a kilometre
QUANTITIES = ("temperature_c", "pressure_hpa", "humidity_percent")


class Lit(NamedTuple):
    wavelength_um: float = 0.780
    co2_ppm: float = 410.0
    kind: str = "group"


def plain(name, weather, lit=Lit()):  # noqa: B008
    t, p, h = weather
    e = humidity.vapour_pressure_hpa(t, p, h, MODELS[name].vapour_formula)
    return MODELS[name].refractivity(t, p, e, **lit._asdict())


def compiled(name, weather, lit=Lit()):  # noqa: B008
    return KERNELS[name](*weather, *MODELS[name].coefficients(*lit))


def states(name, count, seed=6):
    """Random weather over the whole of a model's limits, but for air that would be mostly vapour."""
    rng = np.random.default_rng(seed)
    limits = [MODELS[name].limits[quantity] for quantity in QUANTITIES]
    t, p, h = (rng.uniform(limit.lower, limit.upper, count) for limit in limits)
    room = 0.99 * p / humidity.saturation(t, p, MODELS[name].vapour_formula).pressure_hpa
    return t, p, h * np.minimum(1.0, room)


@pytest.fixture(params=sorted(KERNELS))
def name(request):
    return request.param


def test_a_million_states_agree_with_the_plain_form_to_1e_15(name):
    weather = states(name, 1_000_000)
    found, inside = compiled(name, weather)
    assert inside
    assert np.max(np.abs(found - plain(name, weather))) < SAME


@pytest.mark.parametrize("lit", [Lit(0.633, 450.0, "phase"), Lit(1.55, 0.0, "group"), Lit(0.36, 2000.0, "phase")])
def test_other_light_enters_by_its_coefficients_alone(name, lit):
    weather = states(name, 5_000)
    found, inside = compiled(name, weather, lit)
    assert inside
    assert np.max(np.abs(found - plain(name, weather, lit))) < SAME
    assert np.max(np.abs(found - compiled(name, weather)[0])) > 1e-8


def test_every_corner_of_the_limits_is_inside_and_right(name):
    ends = [(limit.lower, limit.upper) for limit in (MODELS[name].limits[quantity] for quantity in QUANTITIES)]
    t, p, h = (corner.ravel() for corner in np.meshgrid(*ends, indexing="ij"))
    fits = humidity.vapour_pressure_hpa(t, p, h, MODELS[name].vapour_formula) < 0.999 * p
    weather = (t[fits], p[fits], h[fits])
    found, inside = compiled(name, weather)
    assert inside
    assert fits.sum() >= 6
    assert np.max(np.abs(found - plain(name, weather))) < SAME


def test_zero_degrees_and_dry_air_are_legal(name):
    weather = (np.array([0.0, -0.0]), np.array([933.0, 933.0]), np.array([0.0, -0.0]))
    found, inside = compiled(name, weather)
    assert inside
    assert np.max(np.abs(found - plain(name, weather))) < SAME


@pytest.mark.parametrize("at", [0, 1, 1000, air_kernel.BLOCK - 1, air_kernel.BLOCK, 4999])
@pytest.mark.parametrize("which", range(3))
def test_one_value_beyond_a_limit_or_not_a_number_is_seen_wherever_it_stands(name, which, at):
    weather = states(name, 5_000)
    limit = MODELS[name].limits[QUANTITIES[which]]
    before = weather[which][at]
    for bad in (
        np.nextafter(limit.lower, -np.inf), np.nextafter(limit.upper, np.inf), np.nan, np.inf, -np.inf, 1e300, -1e300,
    ):  # fmt: skip
        weather[which][at] = bad
        assert not compiled(name, weather)[1]
    weather[which][at] = before
    assert compiled(name, weather)[1]


def test_vapour_without_room_is_seen_before_the_plain_form_would_refuse_it():
    p = np.full(3000, 900.0)
    full = 100.0 * p / humidity.saturation(99.0, p, "ciddor").pressure_hpa
    for share, expected in ((0.999999, True), (1.0 - 1e-10, False), (1.0, False), (1.0 + 1e-9, False)):
        h = np.full(3000, 50.0)
        h[2500] = share * full[0]
        assert full[0] < 100.0
        assert compiled("ciddor_hill1999", (np.full(3000, 99.0), p, h))[1] is expected


@pytest.mark.parametrize(
    "count", [0, 1, 2, 3, 7, 8, 9, *(air_kernel.BLOCK + k for k in (-1, 0, 1)), 3 * air_kernel.BLOCK + 5]
)
def test_any_number_of_states_fills_every_place(name, count):
    weather = states(name, count)
    found, inside = compiled(name, weather)
    assert inside
    assert found.shape == (count,)
    assert np.max(np.abs(found - plain(name, weather)), initial=0.0) < SAME


@pytest.mark.parametrize("which", [(0,), (1,), (2,), (0, 1), (1, 2), (0, 2), (0, 1, 2)])
def test_a_single_value_stands_for_all_states(name, which):
    weather = list(states(name, 2 * air_kernel.BLOCK + 3))
    weather[0] = np.minimum(weather[0], 40.0)  # room for any humidity at any pressure
    for i in which:
        weather[i] = np.array([(15.0, 933.0, 40.0)[i]])
    found, inside = compiled(name, weather)
    assert inside
    assert np.max(np.abs(found - plain(name, weather))) < SAME
    assert found.shape == ((1,) if len(which) == 3 else (2 * air_kernel.BLOCK + 3,))
    weather[which[0]] = np.array([np.nan])
    assert not compiled(name, weather)[1]


def test_arrays_of_different_lengths_are_refused(name):
    with pytest.raises(ValidityError, match=r"weather of 5, 4, 1 states \(expected n or 1 each\)"):
        compiled(name, (np.zeros(5), np.full(4, 900.0), np.zeros(1)))


def test_columns_and_integers_are_taken_too(name):
    table = np.stack(states(name, 100), axis=1)
    assert np.array_equal(compiled(name, table.T)[0], compiled(name, [column.copy() for column in table.T])[0])
    whole = ([20, 21], [900, 950], [0, 100])
    assert np.max(np.abs(compiled(name, whole)[0] - plain(name, np.array(whole, float)))) < SAME


def test_threads_share_the_states_without_seams(name, monkeypatch):
    weather = states(name, 3 * air_kernel.BLOCK + 1)
    alone, _ = compiled(name, weather)
    monkeypatch.setattr(air_kernel, "PARALLEL_FROM", 1)
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    shared, inside = compiled(name, weather)
    assert inside
    assert np.max(np.abs(shared - alone)) < SAME
    for at in (0, 2100, len(weather[0]) - 1):  # one in the part of each thread
        spoilt = [each.copy() for each in weather]
        spoilt[2][at] = 100.5
        assert not compiled(name, spoilt)[1]


def test_the_saturation_polynomial_follows_its_formula_over_the_full_interval(name):
    found = (rueger1990_kernel if name == "rueger1990" else ciddor_hill1999_kernel).SATURATION
    limit = MODELS[name].limits["temperature_c"]
    t = np.linspace(limit.lower, limit.upper, 20_001)
    p = 700.0
    factor = humidity.BUCK_F0 + humidity.BUCK_FP * p if name == "rueger1990" else humidity.enhancement_factor(t, p)
    exact = humidity.saturation(t, p, MODELS[name].vapour_formula).pressure_hpa / factor
    values = air_kernel.saturation_value.py_func(t, *found)
    assert np.max(np.abs(values - exact)) < 1e-12 * exact[-1]  # 2e-16 in the index of air that is all vapour at 100 °C
