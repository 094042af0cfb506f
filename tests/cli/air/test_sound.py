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
        (NOTES[:4], 2, "Missing option"),
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
