"""Every instrument of humidity and pressure leads to the same air, with the uncertainty that it brings."""

import numpy as np
import pytest

from catseye.atmosphere.index.air import MODELS, air
from catseye.atmosphere.weather import humidity
from catseye.atmosphere.weather.psychrometer import vapour_pressure_of_wet_bulb_hpa, wet_bulb_c
from catseye.errors import ValidityError
from catseye.reduction.air.routes import HYGROMETERS, IndexFormula, Moisture, air_by, station_pressure, surface_of

DEGREE = np.pi / 180


def reading_of(kind, t, p, e, formula):
    """What each instrument shows in air with the vapour pressure e."""
    return {
        "humidity_percent": lambda: humidity.relative_humidity_percent(e, t, p, formula=formula),
        "humidity_over_ice_percent": lambda: humidity.relative_humidity_percent(e, t, p, over_ice=True),
        "dew_point_c": lambda: humidity.dew_point_c(e, p, formula),
        "frost_point_c": lambda: humidity.frost_point_c(e, p),
        "wet_bulb_c": lambda: wet_bulb_c(t, e, p),
        "ice_bulb_c": lambda: wet_bulb_c(t, e, p, over_ice=True),
        "vapour_pressure_hpa": lambda: e,
    }[kind]()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("kind", HYGROMETERS)
def test_every_instrument_gives_the_index_of_the_same_vapour(kind, model):
    t, p, e = -4.0, 933.0, 3.0
    shown = float(reading_of(kind, t, p, e, MODELS[model].vapour_formula))
    found, _ = air_by(t, p, Moisture(kind, shown), formula=IndexFormula(model=model))
    assert found.vapour_pressure_hpa == pytest.approx(e, rel=1e-9)
    expected = MODELS[model].refractivity(t, p, e, wavelength_um=0.78, co2_ppm=450.0)
    assert found.group_refractivity == pytest.approx(float(expected), rel=1e-12)
    assert (found.temperature_c, found.pressure_hpa, found.model) == (t, p, model)


@pytest.mark.parametrize("kind", ["humidity_percent", "dew_point_c", "frost_point_c", "wet_bulb_c", "ice_bulb_c"])
def test_the_uncertainty_is_the_scatter_of_the_index_over_readings_that_scatter_so(kind):
    t, p, model = -4.0, 933.0, "ciddor_hill1999"
    shown = float(reading_of(kind, t, p, 3.0, "ciddor"))
    u = {"u_temperature_c": 0.2, "u_pressure_hpa": 0.3}
    u_shown = 3.0 if kind == "humidity_percent" else 0.3
    _, claimed = air_by(t, p, Moisture(kind, shown, u_shown), formula=IndexFormula(model=model), **u)
    _, formula = air_by(t, p, Moisture(kind, shown), formula=IndexFormula(model=model))
    rng = np.random.default_rng(61)
    ts, ps = rng.normal(t, 0.2, 20_000), rng.normal(p, 0.3, 20_000)
    shown = rng.normal(shown, u_shown, 20_000)
    keep = np.full(20_000, True)  # readings that cannot be are refused one by one; few here
    if kind in ("wet_bulb_c", "ice_bulb_c"):
        keep = shown < ts - 0.02
    if kind in ("dew_point_c", "frost_point_c"):
        keep = shown < ts - 0.5
    found, _ = air_by(ts[keep], ps[keep], Moisture(kind, shown[keep]), formula=IndexFormula(model=model))
    scatter = np.std(found.group_refractivity)
    assert keep.mean() > 0.93
    # 20 000 draws know the scatter to 0.5 %; cutting a tail takes up to 2 % of a part that is a tenth
    assert np.sqrt(claimed**2 - formula**2) == pytest.approx(scatter, rel=0.02)


def test_a_thermometers_error_reaches_the_index_by_the_vapour_too_where_the_instrument_needs_it():
    """At 30 °C and 80 % relative humidity a degree is 5 % of vapour, which a mirror knows and a capacitor does not."""
    t, p = 30.0, 933.0
    state = air(t, p, 80.0)
    dew = float(state.dew_point_c)
    by_humidity = air_by(t, p, Moisture("humidity_percent", 80.0), u_temperature_c=1.0)[1]
    by_mirror = air_by(t, p, Moisture("dew_point_c", dew), u_temperature_c=1.0)[1]
    held = abs(state.sensitivity.temperature_c)
    assert by_humidity == pytest.approx(np.hypot(held, 5e-8), rel=1e-6)
    e_slope = 0.8 * humidity.saturation(t, p, "ciddor").per_c
    free = abs(state.sensitivity.temperature_c - state.sensitivity.vapour_pressure_hpa * e_slope)
    assert by_mirror == pytest.approx(np.hypot(free, 5e-8), rel=1e-3)
    assert by_mirror < 0.95 * by_humidity


def test_carbon_dioxide_counts_where_the_model_has_it():
    moist = Moisture("wet_bulb_c", 14.0)
    with_it = [air_by(20.0, 933.0, moist, u_co2_ppm=u)[1] for u in (0.0, 300.0)]
    assert np.sqrt(with_it[1] ** 2 - with_it[0] ** 2) == pytest.approx(3 * 0.01338e-6, rel=1e-2)
    assert air_by(20.0, 933.0, moist, u_co2_ppm=300.0, formula=IndexFormula(model="rueger1990"))[1] == pytest.approx(
        air_by(20.0, 933.0, moist, formula=IndexFormula(model="rueger1990"))[1], rel=1e-12
    )


def test_the_notes_barometer_and_psychrometer_give_their_air():
    """[PARKER04] eqs. 1.22 (929.37, truncated from 697.09 mm) and the psychrometer of the listing, typed again."""
    p, u = station_pressure(700.0, 20.0, latitude=38.45 * DEGREE, elevation=797.3)
    assert p == pytest.approx(929.382, abs=1e-3)
    measured, u_measured = station_pressure(700.0, 20.0, gravity=9.79784)
    assert measured == pytest.approx(p, abs=1e-3)
    # a formula knows gravity to 3e-4 of 9.8 m/s², a straight expansion of mercury 1e-5: 0.0285 and 0.0093 hPa
    assert (u, u_measured) == (pytest.approx(0.0299, abs=3e-4), pytest.approx(0.0093, abs=1e-4))
    saturated = (1.0007 + 3.46e-6 * p) * 6.1121 * np.exp(17.502 * 14.0 / (240.97 + 14.0))
    e = saturated - 0.000662 * p * (20.0 - 14.0)
    assert vapour_pressure_of_wet_bulb_hpa(20.0, 14.0, p) == pytest.approx(e, rel=1e-12)
    found, _ = air_by(20.0, p, Moisture("wet_bulb_c", 14.0), formula=IndexFormula(model="rueger1990"))
    assert found.vapour_pressure_hpa == pytest.approx(e, rel=1e-12)


def test_air_above_its_barometer_is_thinner():
    low, _ = air_by(20.0, 933.0, Moisture("humidity_percent", 50.0))
    high, _ = air_by(20.0, 933.0, Moisture("humidity_percent", 50.0), above_barometer=100.0)
    # 10.81 hPa by 0.02896 kg/mol x 9.807 m/s² / (8.314 x 293.15) of 933 hPa, less half its square, moist air lighter
    assert low.pressure_hpa - high.pressure_hpa == pytest.approx(10.76, abs=0.02)
    assert high.humidity_percent == low.humidity_percent


def test_air_far_from_its_barometer_has_a_larger_u_of_pressure():
    """A barometric formula typed again, draws of lapse and gravity: 1 km up the pressure is known to 1.1 hPa only."""
    moist, t, u_t = Moisture("vapour_pressure_hpa", 0.0), 10.0, 0.5
    formula = air_by(t, 933.0, moist)[1]
    rng = np.random.default_rng(62)
    lapse, g = rng.normal(0.0, 0.0065, 4000), rng.normal(9.80665, 0.02, 4000)
    ts, rise = rng.normal(t, u_t, 4000), 900.0
    mean = ts + 273.15 - lapse * rise / 2.0
    p = 933.0 * np.exp(-g * 0.0289635 * rise / (8.314510 * mean))  # mean of T for that of 1/T: 1e-4 of the fall
    scatter = np.std(air_by(ts, p, moist)[0].group_refractivity)
    _, claimed = air_by(t, 933.0, moist, above_barometer=rise, u_temperature_c=u_t)
    # 4000 draws know a scatter to 1.1 %; the formula's 4e-4 of the fall is 0.011 ppm of 0.47
    assert np.sqrt(claimed**2 - formula**2) == pytest.approx(scatter, rel=0.04)
    wet = Moisture("humidity_percent", 0.0)
    assert air_by(t, 933.0, wet, above_barometer=rise, u_temperature_c=u_t)[1] == pytest.approx(claimed, rel=1e-6)
    assert air_by(t, 933.0, moist, above_barometer=10.0)[1] == pytest.approx(formula, rel=1e-2)


def test_the_margin_of_a_surface_is_as_uncertain_as_the_instrument_makes_it():
    """Each reading moved by its uncertainty moves the dew point by its share; only some need the thermometer."""
    t, p, surface = 10.0, 933.0, 5.5
    for kind, shown, u in (("humidity_percent", 75.0, 5.0), ("dew_point_c", 5.78, 0.4), ("wet_bulb_c", 7.9, 0.2)):
        found = surface_of(
            air_by(t, p, Moisture(kind, shown, u))[0], Moisture(kind, shown, u), surface,
            u_surface_c=0.1, u_temperature_c=0.3,
        )  # fmt: skip

        def dew(kind=kind, shown=shown, t=t):
            return float(air_by(t, p, Moisture(kind, shown), formula=IndexFormula(model="rueger1990"))[0].dew_point_c)

        by_reading = (dew(shown=shown + 0.01) - dew(shown=shown - 0.01)) / 0.02
        by_air = (dew(t=t + 0.01) - dew(t=t - 0.01)) / 0.02
        expected = np.sqrt(0.1**2 + (by_reading * u) ** 2 + (by_air * 0.3) ** 2)
        # the formulas' own part: 0.1 % of vapour, or 1 % of the psychrometer's coefficient, is 0.05 K at most
        assert expected <= found.u_margin_k < np.hypot(expected, 0.06), kind
        assert 0.0 < found.probability < 1.0


def test_impossible_values_are_refused():
    with pytest.raises(ValidityError, match="height above the barometer 5000 m is outside -1000 to 1000 m"):
        air_by(20.0, 933.0, Moisture("dew_point_c", 10.0), above_barometer=5000.0)
    with pytest.raises(ValidityError, match="over saturation"):
        air_by(20.0, 933.0, Moisture("dew_point_c", 21.0))
    with pytest.raises(ValidityError, match="wet bulb 21 °C is above the dry bulb"):
        air_by(20.0, 933.0, Moisture("wet_bulb_c", 21.0))
    with pytest.raises(ValidityError, match="air model 'edlen' is unknown"):
        air_by(20.0, 933.0, Moisture("dew_point_c", 10.0), formula=IndexFormula(model="edlen"))
