"""`catseye air`: every way in, and one line for what cannot be."""

import json

import pytest

MERCURY = ("air", "--temperature-c", 20, "--humidity-percent", 50, "--barometer-mmhg", 700, "--mercury-c", 20)
WEATHER = ("air", "--temperature-c", 20, "--pressure-hpa", 933)


def asked(catseye, *arguments):
    status, out, err = catseye("air", *arguments, "--json")
    assert (status, err) == (0, "")
    return json.loads(out)


@pytest.mark.parametrize(
    ("option", "value"),
    [("--humidity-percent", 50), ("--dew-point-c", 9.2670999), ("--vapour-pressure-hpa", 11.7323187)],
)
def test_each_way_to_the_vapour_gives_the_notes_index(catseye, option, value):
    found = asked(catseye, *WEATHER[1:], option, value, "--model", "rueger1990")
    assert found["group_index"] == pytest.approx(1.000253246815, abs=1e-12)
    assert found["group_wavelength"] == pytest.approx(0.199811037, abs=1e-9)
    assert found["humidity_percent"] == pytest.approx(50.0, abs=1e-5)


def test_wet_bulb_and_mercury(catseye):
    place = ("--mercury-c", 20, "--latitude-deg", 38.45, "--elevation-m", 797.3)
    found = asked(catseye, "--temperature-c", 20, "--wet-bulb-c", 14, "--barometer-mmhg", 700, *place)
    assert found["pressure_hpa"] == pytest.approx(929.382, abs=1e-3)
    assert found["vapour_pressure_hpa"] == pytest.approx(12.350, abs=1e-3)
    measured = ("--mercury-c", 20, "--gravity", 9.79784)
    again = asked(catseye, "--temperature-c", 20, "--wet-bulb-c", 14, "--barometer-mmhg", 700, *measured)
    assert again["pressure_hpa"] == pytest.approx(929.382, abs=1e-3)


def test_the_gravity_and_the_corrected_mercury_are_told(catseye):
    """[PARKER04] 1.8, 1.16: 697.72 mm and 979.784 gal; stations of section 1.4.2, +12.1 mgal above 1.13 at AA."""
    place = ("--latitude-deg", 38.45, "--elevation-m", 797.3)
    found = asked(catseye, *MERCURY[1:], *place)["barometer"]
    assert found["corrected_mmhg"] == pytest.approx(697.72, abs=5e-3)
    assert found["gravity"] == pytest.approx(9.79784, abs=5e-6)
    assert found["u_gravity"] == 3e-4
    measured = asked(catseye, *MERCURY[1:], "--gravity-station", "aa")
    assert measured["barometer"]["gravity"] == pytest.approx(9.79795654, abs=1e-12)
    assert (measured["barometer"]["u_gravity"], measured["barometer"]["gravity_anomaly"]) == (0.0, None)
    assert measured["pressure_hpa"] == pytest.approx(697.7206 * 9.79795654 / 9.80665 * 1.33322387415, abs=1e-3)
    lifted = asked(catseye, *MERCURY[1:], "--gravity-station", "Green Bank AA", *place)["barometer"]
    assert lifted["gravity_anomaly"] * 1e5 == pytest.approx(12.1, abs=0.05)
    fall = -3.086e-6 * (797.3 - 2622.0 * 0.3048)  # free air from the marker
    assert lifted["gravity"] == pytest.approx(9.79795654 + fall, abs=1e-12)
    assert "barometer" not in asked(catseye, *WEATHER[1:], "--humidity-percent", 50)
    _, out, _ = catseye(*MERCURY, "--gravity-station", "AB", "--latitude-deg", 38.45)
    assert "697.72 mm at 0 °C; gravity 9.7979215 m/s² by station Green Bank AB" in " ".join(out.split())


def test_humidity_over_ice_goes_in_and_comes_out(catseye):
    cold = ("--temperature-c=-10", "--pressure-hpa", 933)
    found = asked(catseye, *cold, "--humidity-over-ice-percent", 80, "--u-humidity-percent", 2)
    assert found["vapour_pressure_hpa"] == pytest.approx(0.8 * 2.6096, abs=1e-4)  # [PARKER04] eq. 1.4
    assert found["humidity_over_ice_percent"] == pytest.approx(80.0, abs=1e-9)
    assert found["uncertainty_of"] == ["humidity"]
    frost = asked(catseye, *cold, "--frost-point-c", found["frost_point_c"])
    assert frost["vapour_pressure_hpa"] == pytest.approx(found["vapour_pressure_hpa"], rel=1e-9)
    assert asked(catseye, *cold, "--humidity-over-ice-percent", 104)["humidity_percent"] < 100.0  # over water
    assert asked(catseye, *WEATHER[1:], "--humidity-percent", 50)["humidity_over_ice_percent"] is None
    status, out, _ = catseye("air", *cold, "--humidity-over-ice-percent", 80)
    assert (status, "over ice      80.00 %, frost point -12.49 °C" in out) == (0, True)


@pytest.mark.parametrize("model", ["ciddor_hill1999", "rueger1990", "iag1999_closed", "barrell_sears1963"])
def test_density_factors_and_coefficients_make_the_index(catseye, model):
    found = asked(catseye, *WEATHER[1:], "--humidity-percent", 50, "--model", model)
    density, coefficient = found["density_factors"], found["group_coefficients"]
    whole = sum(density[gas] * coefficient[gas] for gas in ("dry", "vapour"))
    assert 1.0 + whole == pytest.approx(found["group_index"], abs=1e-13)


def test_owens_factors_are_those_of_the_notes(catseye):
    """[PARKER04] eqs. 1.23 and 1.24 typed again, and 1.26 at 0.780 µm."""
    found = asked(catseye, *WEATHER[1:], "--humidity-percent", 50, "--model", "rueger1990")
    t, e = 293.15, found["vapour_pressure_hpa"]
    p = 933.0 - e
    d_s = p / t * (1 + p * (57.90e-8 - 9.3250e-4 / t + 0.25844 / t**2))
    q = -2.37321e-3 + 2.23366 / t - 710.792 / t**2 + 7.75141e4 / t**3
    d_w = e / t * (1 + e * (1 + 3.7e-4 * e) * q)
    assert found["density_factors"] == pytest.approx({"dry": d_s, "vapour": d_w}, rel=1e-12)
    assert found["group_coefficients"]["dry"] * 1e8 == pytest.approx(7969.183, abs=1e-3)


def test_a_clear_sky_cools_a_target_to_dew(catseye):
    cool = ("--temperature-c", 10, "--pressure-hpa", 933, "--dew-point-c", 5)
    found = asked(catseye, *cool, "--clear-sky")
    depression = found["radiative_depression_k"]
    assert depression == pytest.approx(8.1, abs=0.05)  # a hand-worked balance in `test_condensation`
    assert found["condensation"]["margin_k"] == pytest.approx(5.0 - depression, abs=0.02)
    assert found["condensation"]["u_margin_k"] == pytest.approx(depression / 3, rel=0.01)
    gold = asked(catseye, *cool, "--clear-sky", "--emissivity", 0.03, "--wind", 3)
    assert gold["radiative_depression_k"] < 0.3  # a thirtieth of glass, more wind
    assert gold["condensation"]["deposit"] == "none"
    assert asked(catseye, *cool, "--clear-sky", "--sky-view", 0)["radiative_depression_k"] == pytest.approx(0, abs=1e-9)


def test_the_barometers_own_uncertainty_reaches_the_index(catseye):
    given = ("--temperature-c", 20, "--humidity-percent", 50, "--barometer-mmhg", 700, "--mercury-c", 20)
    alone = asked(catseye, *given, "--gravity", 9.79784)["standard_uncertainty"]
    worse = asked(catseye, *given, "--gravity", 9.79784, "--u-mercury-c", 1)["standard_uncertainty"]
    # 1 °C of mercury is 1.61e-4 of 929 hPa, 0.150 hPa, and 0.272 ppm a hPa
    assert (worse**2 - alone**2) ** 0.5 * 1e6 == pytest.approx(0.150 * 0.272, rel=0.02)


def test_frost_and_ice_are_asked_for_by_name(catseye):
    cold = ("--temperature-c", -5, "--pressure-hpa", 933)
    frost = asked(catseye, *cold, "--frost-point-c", -5)["vapour_pressure_hpa"]
    dew = asked(catseye, *cold, "--dew-point-c", -5)["vapour_pressure_hpa"]
    assert frost / dew == pytest.approx(0.952, abs=0.002)  # ice holds 5 % less at -5 °C
    assert asked(catseye, *cold, "--ice-bulb-c", -5)["vapour_pressure_hpa"] == pytest.approx(frost, rel=1e-9)


def test_zero_degrees_and_zero_humidity_are_weather(catseye):
    found = asked(catseye, "--temperature-c", 0, "--pressure-hpa", 1013.25, "--humidity-percent", 0)
    assert found["vapour_pressure_hpa"] == 0.0
    assert found["dew_point_c"] is None


def test_a_cold_retroreflector_is_warned_of(catseye):
    cool = ("--temperature-c", 10, "--pressure-hpa", 933, "--humidity-percent", 75)
    found = asked(catseye, *cool, "--surface-c", 5, "--u-surface-c", 0.5)["condensation"]
    assert (found["deposit"], found["threat"]) == ("dew", "dew")
    assert found["margin_k"] == pytest.approx(5.0 - 5.78, abs=0.02)  # dew point of 75 % at 10 °C: 5.8 °C
    assert 0.9 < found["probability"] < 0.98
    assert "condensation" not in asked(catseye, *cool)
    damp = asked(catseye, *cool, "--surface-c", 5, "--u-humidity-percent", 5)["condensation"]
    assert damp["u_margin_k"] == pytest.approx(0.97, abs=0.03)  # 1 % of humidity is 0.19 K of dew point here
    status, out, _ = catseye("air", *cool, "--surface-c", 5)
    assert status == 0
    assert "surface       dew: 0.8 K below the dew point" in out
    dry = asked(catseye, "--temperature-c", 0, "--pressure-hpa", 933, "--humidity-percent", 0, "--surface-c", 0)
    assert dry["condensation"]["margin_k"] is None


@pytest.mark.parametrize("model", ["ciddor_hill1999", "rueger1990", "iag1999_closed", "barrell_sears1963"])
def test_every_model_of_the_contract(catseye, model):
    found = asked(catseye, *WEATHER[1:], "--humidity-percent", 50, "--model", model, "--co2-ppm", 450)
    assert found["model"] == model
    assert found["group_index"] == pytest.approx(1.0002533, abs=1.5e-7)
    assert set(found["sensitivity"]) >= {"temperature_c", "pressure_hpa", "humidity_percent"}
    assert found["co2_ppm"] == {"ciddor_hill1999": 450.0, "iag1999_closed": 375.0}.get(model, 300.0)


def test_uncertainties_of_the_instruments_add(catseye):
    alone = asked(catseye, *WEATHER[1:], "--humidity-percent", 50)
    both = asked(catseye, *WEATHER[1:], "--humidity-percent", 50, "--u-temperature-c", 0.3, "--u-co2-ppm", 100)
    assert alone["standard_uncertainty"] == alone["formula_uncertainty"] == 5e-8
    expected = (0.05**2 + (0.3 * 0.8921) ** 2 + 0.01338**2) ** 0.5
    assert both["standard_uncertainty"] * 1e6 == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("way", "its_u"),
    [
        ("--humidity-percent=50", "--u-humidity-percent=2"),
        ("--dew-point-c=9.267", "--u-dew-point-c=0.2"),
        ("--wet-bulb-c=14", "--u-wet-bulb-c=0.1"),
        ("--vapour-pressure-hpa=11.73", "--u-vapour-pressure-hpa=0.1"),
    ],
)
@pytest.mark.parametrize("above", [0, 100])
def test_no_way_to_the_index_counts_sensors_that_were_not_given(catseye, way, its_u, above):
    """The formulas of the instruments have their own parts, and are no sensors."""
    bare = (*WEATHER[1:], way, "--above-barometer-m", above)
    found = asked(catseye, *bare)
    assert found["uncertainty_of"] == []
    assert found["standard_uncertainty"] == found["formula_uncertainty"] >= 5e-8
    assert "u is that of the formula only" in found["verdict"]["why"]
    assert "that of the formula only" in " ".join(catseye("air", *bare)[1].split("uncertainty")[1].split())
    one = asked(catseye, *bare, "--u-temperature-c", 0.1)
    assert one["uncertainty_of"] == ["temperature"]
    assert one["formula_uncertainty"] == found["formula_uncertainty"]
    assert "the formula and temperature; not given: pressure, humidity" in one["verdict"]["why"]
    every = ("--u-temperature-c", 0.1, "--u-pressure-hpa", 0.1, its_u)
    assert "includes the formula and the sensors" in asked(catseye, *bare, *every)["verdict"]["why"]


def test_mercury_alone_counts_its_formula_and_no_sensor(catseye):
    found = asked(catseye, *MERCURY[1:], "--latitude-deg", 38.45, "--elevation-m", 797.3)
    assert found["uncertainty_of"] == []
    assert found["standard_uncertainty"] == found["formula_uncertainty"] > 5e-8  # gravity from a formula: 3e-4 m/s²
    read = asked(catseye, *MERCURY[1:], "--gravity", 9.79784, "--u-barometer-mmhg", 0.05)
    assert read["uncertainty_of"] == ["pressure"]


def test_a_latitude_in_radians_is_doubted_and_the_same_in_degrees_is_not(catseye):
    radians, degrees = (
        asked(catseye, *MERCURY[1:], "--latitude-deg", latitude, "--elevation-m", 797.3)["verdict"]
        for latitude in (0.6711, 38.45)
    )
    assert (radians["word"], degrees["word"]) == ("doubtful", "good")
    assert "as radians it is 38.45 degrees" in radians["why"]


def test_the_text_says_what_the_object_says(catseye):
    status, out, err = catseye(*WEATHER, "--humidity-percent", 50, "--model", "rueger1990")
    assert (status, err) == (0, "")
    assert "group index   1.000253247" in out
    assert "per hPa       +0.2720 ppm" in out
    assert "300 ppm of carbon dioxide" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((*WEATHER, "--humidity-percent", 120), "relative humidity 120 % is outside 0-100 %"),
        ((*WEATHER, "--humidity-percent", "nan"), "relative humidity is not a number"),
        ((*WEATHER[:4], 101325, "--humidity-percent", 50), "pressure 101325 hPa is outside 100-1400 hPa"),
        (("air", "--temperature-c", -300, *WEATHER[3:], "--humidity-percent", 50), "temperature -300 C is outside"),
        ((*WEATHER, "--humidity-percent", 50, "--wavelength-um", 10.6), "wavelength 10.6 um is outside"),
        ((*WEATHER, "--humidity-percent", 50, "--co2-ppm", -1), "carbon dioxide -1 ppm is outside"),
        ((*WEATHER, "--dew-point-c", 25), "over saturation"),
        ((*WEATHER, "--wet-bulb-c", 25), "above the dry bulb"),
        ((*WEATHER, "--frost-point-c", 5), "temperature of ice 5 °C is outside"),
        ((*WEATHER, "--vapour-pressure-hpa", -1), "vapour pressure -1 hPa"),
        ((*MERCURY, "--gravity-station", "AC"), "gravity station 'AC' is unknown; choose one of AA, B, AB"),
        ((*MERCURY, "--gravity-station", "AA", "--elevation-m", 1200), "elevation 1200 m is outside"),
        ((*WEATHER, "--humidity-over-ice-percent", 90), "temperature of ice 20 °C is outside"),
        ((*WEATHER, "--humidity-percent", 0, "--clear-sky"), "the air; this air is perfectly dry"),
        ((*WEATHER, "--humidity-percent", 50, "--clear-sky", "--wind", 9), "wind 9 m/s is outside"),
        ((*MERCURY, "--gravity", 979.784), "gravity 979.784 m/s² is outside"),
    ],
)
def test_what_cannot_be_is_one_line_and_status_1(catseye, arguments, said):
    status, out, err = catseye(*arguments)
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert said in err


@pytest.mark.parametrize(
    "arguments",
    [
        WEATHER,
        (*WEATHER, "--humidity-percent", 50, "--dew-point-c", 9),
        (*WEATHER, "--humidity-percent", 50, "--barometer-mmhg", 700),
        ("air", "--temperature-c", 20, "--humidity-percent", 50),
        ("air", "--temperature-c", 20, "--humidity-percent", 50, "--barometer-mmhg", 700),
        (*MERCURY, "--latitude-deg", 38),
        (*MERCURY, "--gravity", 9.798, "--latitude-deg", 0),
        (*WEATHER, "--humidity-percent", 50, "--u-surface-c", 0.5),
        (*WEATHER, "--humidity-percent", 50, "--gravity", 9.8),
        (*WEATHER, "--humidity-percent", 50, "--gravity-station", "AA"),
        (*MERCURY, "--gravity", 9.798, "--gravity-station", "AA"),
        (*WEATHER, "--humidity-percent", 50, "--wind", 2),
        (*WEATHER, "--humidity-percent", 50, "--surface-c", 5, "--clear-sky"),
        (*WEATHER, "--humidity-percent", 50, "--humidity-over-ice-percent", 50),
        (*WEATHER, "--humidity-percent", 50, "--u-dew-point-c", 0.2),
        (*WEATHER, "--humidity-percent", 50, "--u-temperature-c", -1),
        (*WEATHER, "--humidity-percent", 50, "--u-mercury-c", 1),
        (*WEATHER, "--humidity-percent", 50, "--model", "edlen"),
    ],
)
def test_what_was_asked_wrongly_is_status_2(catseye, arguments):
    status, out, _ = catseye(*arguments)
    assert (status, out) == (2, "")


def test_python_takes_every_instrument_of_the_command(catseye):
    """The command is one call: the same object, and arrays for the same instruments."""
    import catseye as face

    words = "--temperature-c 20 --wet-bulb-c 14 --barometer-mmhg 700 --mercury-c 20 --latitude-deg 38.45"
    status, out, _ = catseye("air", *words.split(), "--elevation-m", 797.3, "--surface-c", 5, "--json")
    result = face.air(
        20.0,
        wet_bulb_c=14.0,
        barometer_mmhg=700.0,
        mercury_c=20.0,
        latitude_deg=38.45,
        elevation_m=797.3,
        surface_c=5.0,
    )
    assert status == 0
    assert json.loads(out)["group_index"] == result.group_index
    assert json.loads(out)["condensation"]["deposit"] == str(result.condensation.deposit)
    both = face.air([20.0, 10.0], 933.0, dew_point_c=[9.0, 4.0], u_dew_point_c=0.2)
    assert both.group_index.shape == both.standard_uncertainty.shape == (2,)
    with pytest.raises(face.ArgumentError, match=r"^pressure: give pressure_hpa or barometer_mmhg, not both$"):
        face.air(20.0, 933.0, 50.0, barometer_mmhg=700.0)
    with pytest.raises(face.ArgumentError, match=r"^pressure: give pressure_hpa or barometer_mmhg$"):
        face.air(20.0, humidity_percent=50.0)
    with pytest.raises(face.ArgumentError, match="u_dew_point_c does not belong to humidity_percent"):
        face.air(20.0, 933.0, 50.0, u_dew_point_c=0.2)
