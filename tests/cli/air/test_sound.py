"""`catseye sound`: the notes' numbers by default, today's beside them, refusals."""

import json
from functools import partial

import pytest

NOTES = ["--temperature-c", 20, "--pressure-hpa", 933, "--humidity-percent", 50]


@pytest.fixture
def command(catseye):
    return partial(catseye, "sound")


def answer(command, *arguments):
    status, said, complaint = command(*arguments, "--json")
    assert (status, complaint) == (0, "")
    assert len(said.strip().splitlines()) == 1
    return json.loads(said, parse_constant=pytest.fail)


def test_the_default_is_the_notes_as_printed(command):
    found = answer(command, *NOTES)
    assert found["model"] == "parker2004"
    assert found["speed"] == pytest.approx(343.577, abs=5e-4)
    assert found["dry_speed"] == pytest.approx(343.37983, abs=5e-6)
    assert found["sensitivity"]["temperature_c"] == pytest.approx(0.598212, abs=5e-7)
    assert found["sensitivity"]["pressure_hpa"] == pytest.approx(-0.0002105, abs=5e-8)
    assert found["sensitivity"]["humidity_percent"] == pytest.approx(0.0039413, abs=5e-8)
    assert found["sensitivity"]["vapour_pressure_hpa"] == pytest.approx(0.0167967, abs=5.1e-8)
    assert "co2_ppm" not in found["sensitivity"]
    assert found["travel_time_per_m"] == pytest.approx(2.910558e-3, abs=5e-10)
    assert found["travel_time_per_m_per_c"] == pytest.approx(-5.06766e-6, abs=5e-12)
    assert found["vapour_pressure_hpa"] == pytest.approx(11.7323, abs=5e-5)
    assert found["standard_uncertainty"] == found["formula_uncertainty"] == 1.0


def test_todays_formulas_stand_beside_it_and_what_the_erratum_costs(command):
    found = answer(command, *NOTES)
    assert set(found["models"]) == {"parker2004", "cramer1993", "real_gas"}
    assert found["models"]["cramer1993"]["speed"] == pytest.approx(344.033, abs=5e-4)
    assert found["models"]["real_gas"]["speed"] == pytest.approx(344.003, abs=5e-4)
    cost = found["notes_gamma_w"]
    assert cost["slow_by"] == pytest.approx(0.504, abs=1e-3)
    assert cost["temperature_read_high_by_c"] == pytest.approx(0.86, abs=5e-3)


def test_a_model_outside_its_range_is_null_with_its_reason(command):
    found = answer(
        command, "--temperature-c=-10", "--pressure-hpa", 933, "--humidity-percent", 0, "--model", "real_gas"
    )
    beside = found["models"]["cramer1993"]
    assert beside["speed"] is None
    assert "temperature -10 C is outside 0-30 C" in beside["reason"]
    assert found["sensitivity"]["co2_ppm"] < 0.0
    assert found["speed"] == found["dry_speed"]


def test_uncertainties_of_the_inputs_are_added(command):
    found = answer(command, *NOTES, "--model", "real_gas", "--u-temperature-c", 0.3, "--u-humidity-percent", 4)
    slope = found["sensitivity"]
    squares = 0.035**2 + (0.3 * slope["temperature_c"]) ** 2 + (4 * slope["humidity_percent"]) ** 2
    assert found["standard_uncertainty"] == pytest.approx(squares**0.5, rel=1e-12)


@pytest.mark.parametrize("model", ["parker2004", "real_gas"])
def test_a_speed_gives_the_temperature_back(command, model):
    """[PARKER04] eqs. 4.6, 4.7: 343.5767 m/s at 933 hPa, 50 % is 20 °C; the other model by its own speed."""
    there = answer(command, *NOTES, "--model", model)
    speed = there["speed"]
    printed = answer(command, "--speed", 343.5767, *NOTES[2:])["temperature_c"]
    assert printed == pytest.approx(20.0, abs=1.7e-4)  # printed to 1e-4 m/s, 0.6 m/s a degree
    found = answer(command, "--speed", speed, *NOTES[2:], "--model", model, "--u-speed", 0.06)
    assert found["temperature_c"] == pytest.approx(20.0, abs=2e-6)
    slope, formula = there["sensitivity"]["temperature_c"], there["formula_uncertainty"]
    assert found["u_temperature_c"] == pytest.approx((formula**2 + 0.06**2) ** 0.5 / slope, rel=1e-6)
    assert found["uncertainty_of"] == ["speed"]
    assert found["temperatures"][model]["temperature_c"] == found["temperature_c"]
    assert set(found["temperatures"]) == {"parker2004", "cramer1993", "real_gas"}
    by_vapour = answer(
        command, "--speed", speed, *NOTES[2:4], "--vapour-pressure-hpa", there["vapour_pressure_hpa"], "--model", model
    )
    assert by_vapour["temperature_c"] == pytest.approx(20.0, abs=2e-6)
    assert by_vapour["humidity_percent"] == pytest.approx(50.0, abs=1e-4)


def test_the_uncertainty_of_a_temperature_by_sound_is_its_scatter():
    """Readings that scatter as stated, of humidity and of vapour pressure, through the inversion itself."""
    import numpy as np

    from catseye.atmosphere.sound.speed import temperature_of_speed_c, temperature_of_speed_of_vapour_c
    from catseye.reduction.air.sound_speed import MeasuredSound

    rng = np.random.default_rng(5)
    speed, p = rng.normal(344.0, 0.05, 20_000), rng.normal(933.0, 30.0, 20_000)
    spread = {"u_speed": 0.05, "u_pressure_hpa": 30.0}
    moist = MeasuredSound(344.0, 933.0, 50.0, u_humidity_percent=8.0, **spread).temperature("real_gas")
    vapour = MeasuredSound(344.0, 933.0, None, 11.7, u_vapour_pressure_hpa=2.0, **spread).temperature("real_gas")
    by_humidity = temperature_of_speed_c(speed, p, rng.normal(50.0, 8.0, 20_000), model="real_gas")
    by_vapour = temperature_of_speed_of_vapour_c(speed, p, rng.normal(11.7, 2.0, 20_000), model="real_gas")
    for (found, state), scatter in ((moist, by_humidity.std()), (vapour, by_vapour.std())):
        formula = state.standard_uncertainty / state.sensitivity.temperature_c
        # 20 000 draws know a scatter to 0.5 %
        assert np.sqrt(found.u_temperature_c**2 - formula**2) == pytest.approx(scatter, rel=0.03)


def test_people_read_the_same(command):
    status, said, complaint = command(*NOTES)
    assert (status, complaint) == (0, "")
    for part in ("343.577 m/s", "+0.598212 m/s", "2.910558 ms/m", "cramer1993 344.033", "slow by 0.504 m/s"):
        assert part in said
    assert max(len(line) for line in said.splitlines()) <= 100


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        (["--temperature-c", 20, "--pressure-hpa", 101325, "--humidity-percent", 50], 1, "pressure 101325 hPa"),
        (["--temperature-c=-300", "--pressure-hpa", 933, "--humidity-percent", 50], 1, "temperature -300 C"),
        ([*NOTES[:4], "--humidity-percent", 120], 1, "relative humidity 120 %"),
        (["--temperature-c", "nan", *NOTES[2:]], 1, "temperature is not a number"),
        ([*NOTES, "--model", "laplace"], 2, "'laplace' is not one of parker2004, cramer1993, real_gas"),
        ([*NOTES, "--u-temperature-c", -1], 2, "not a standard uncertainty"),
        (NOTES[:4], 2, "--humidity-percent is missing"),
        ([*NOTES, "--speed", 343], 2, "give --temperature-c or --speed, not both"),
        (NOTES[2:], 2, "give --temperature-c or --speed"),
        (["--speed", 343, "--pressure-hpa", 933], 2, "give --humidity-percent or --vapour-pressure-hpa"),
        ([*NOTES, "--u-speed", 0.1], 2, "--u-speed belongs to --speed"),
        (["--speed", 343, *NOTES[2:], "--u-temperature-c", 0.1], 2, "--u-temperature-c does not belong to --speed"),
        (["--speed", 34, *NOTES[2:]], 1, "speed of sound 34 m/s"),
    ],
)
def test_refusals(command, arguments, status, complaint):
    got, said, complained = command(*arguments)
    assert (got, said) == (status, "")
    assert complaint in " ".join(complained.split())
    if status == 1:
        assert len(complained.strip().splitlines()) == 1


def test_help_has_an_example(command):
    status, said, _ = command("--help")
    assert status == 0
    assert "Example: catseye sound --temperature-c 20" in said
