"""Ciddor and Ciddor-Hill against two programs that others wrote, for 10 000 random states; their answers are frozen.

`tests/vectors/independent_air.toml` says which programs, how they were called, and what the columns are. To make the
table again, with both packages installed: python tests/atmosphere/index/test_independent_air.py tests/vectors

GeodePy's functions are a translation of RINDEX, the program of the University of New South Wales, written in 1995 with
the author of the formulas: phase and group, vapour from humidity by the same saturation formula. The other follows the
documentation of the calculator of the American standards institute: phase only, its group index is its phase
differentiated; saturation by IAPWS, over ice below 0 °C (ours is over water, so that it gets no humidity there);
the density of standard vapour rounded to six digits.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from catseye.atmosphere.index import air, ciddor_hill1999
from catseye.atmosphere.weather import humidity
from catseye.names import AIR_MODEL
from repository import ROOT, TESTS

TABLE = TESTS / "vectors" / "independent_air.npz"
STUDY = ROOT / "studies" / "lorentz_lorenz.py"
COUNT, SEED = 10_000, 1996
# whole numbers are stored, so many to a °C, hPa, %, um, ppm; the answers to the units that follow
STEPS = {"temperature_c": 100, "pressure_hpa": 10, "humidity_percent": 10, "wavelength_um": 10_000, "co2_ppm": 1}
GEODEPY_UNIT, NIST_UNIT = 1e-14, 1e-12


def random_states() -> dict[str, np.ndarray]:
    """States over the whole range of the model, as whole numbers of steps; vapour leaves a hundredth of room."""
    rng = np.random.default_rng(SEED)
    ends = {
        "temperature_c": (-40, 100), "pressure_hpa": (100, 1400), "humidity_percent": (0, 100),
        "wavelength_um": (0.30, 1.69), "co2_ppm": (0, 2000),
    }  # fmt: skip
    drawn = {name: np.rint(rng.uniform(*ends[name], COUNT) * steps) for name, steps in STEPS.items()}
    t, p = drawn["temperature_c"] / 100, drawn["pressure_hpa"] / 10
    room = 99.0 * p / (humidity.saturation(t, p, "iapws").pressure_hpa / 10)
    drawn["humidity_percent"] = np.floor(np.minimum(drawn["humidity_percent"], room))
    return {name: values.astype(np.int16) for name, values in drawn.items()}


def states(table) -> dict[str, np.ndarray]:
    return {name: table[name] / steps for name, steps in STEPS.items()}


def geodepy_answers(s: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Phase and group refractivity; its vapour pressure is in hPa (its text says Pa)."""
    from geodepy.survey import group_refractivity, humidity2part_water_vapour_press, phase_refractivity

    pairs = zip(s["humidity_percent"].tolist(), s["temperature_c"].tolist(), strict=True)
    vapour = np.array([humidity2part_water_vapour_press(h, t) for h, t in pairs])
    weather = (s["wavelength_um"], s["temperature_c"], s["pressure_hpa"], vapour, s["co2_ppm"])
    return phase_refractivity(*weather) * 1e-8, group_refractivity(*weather) * 1e-8


def nist_answers(s: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Phase refractivity, and n - wavelength dn/dwavelength - 1, the derivative by a step into the complex plane."""
    from ref_index import ciddor_ri, rh2mole_fraction

    found = []
    for t, p, h, wavelength, co2 in zip(*(s[name].tolist() for name in STEPS), strict=True):
        nm, x = 1e3 * wavelength, rh2mole_fraction(h if t >= 0.0 else 0.0, 100.0 * p, t)
        n = ciddor_ri(nm + 1e-30j, t, 100.0 * p, x, co2=co2)
        found.append((n.real - 1.0, n.real - nm * n.imag / 1e-30 - 1.0))
    phase, group = np.array(found).T
    return phase, group


def ours(s: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    weather = (s["temperature_c"], s["pressure_hpa"], s["humidity_percent"])
    light = {"wavelength_um": s["wavelength_um"], "co2_ppm": s["co2_ppm"]}
    return air.phase_refractivity(*weather, **light), air.group_refractivity(*weather, **light)


@pytest.fixture(scope="module")
def table():
    with np.load(TABLE) as stored:
        return dict(stored)


def without_ice(s):
    """No humidity where the second program would take it over ice."""
    return s | {"humidity_percent": np.where(s["temperature_c"] < 0.0, 0.0, s["humidity_percent"])}


def departures(table, name, unit, own):
    return [values - table[f"{name}_{kind}"] * unit for kind, values in zip(("phase", "group"), own, strict=True)]


def test_the_table_covers_the_whole_range_of_the_model(table):
    s, limits = states(table), air.MODELS["ciddor_hill1999"].limits
    for name, values in s.items():
        assert len(values) == COUNT
        assert np.ptp(values) > 0.99 * (limits[name].upper - limits[name].lower)


def test_geodepy_agrees_to_the_rounding_of_the_table_in_ten_thousand_states(table):
    for difference in departures(table, "geodepy", GEODEPY_UNIT, ours(states(table))):
        assert np.max(np.abs(difference)) < 0.501 * GEODEPY_UNIT


def test_the_standards_institutes_calculator_agrees_within_2e_10_up_to_40_degrees(table):
    s = without_ice(states(table))
    for difference in departures(table, "nist", NIST_UNIT, ours(s)):
        assert np.max(np.abs(difference[s["temperature_c"] <= 40.0])) < 2.1e-10
        assert np.max(np.abs(difference[s["temperature_c"] < 0.0])) < 0.6 * NIST_UNIT  # dry: the same formula
        assert 8e-9 < np.max(np.abs(difference)) < 1e-8  # 100 °C and saturated: what the saturation formulas differ


def test_all_of_that_difference_is_its_saturation_formula_and_its_rounded_density_of_vapour(table):
    s = without_ice(states(table))
    e = humidity.vapour_pressure_hpa(s["temperature_c"], s["pressure_hpa"], s["humidity_percent"], "iapws")
    density = ciddor_hill1999.densities(s["temperature_c"], s["pressure_hpa"], e)
    # theirs over ours: standard vapour at 20 °C, 1333 Pa with their gas constant and molar mass
    z = ciddor_hill1999.compressibility(20.0, 13.33, 1.0).z
    rounded = 1333.0 * 0.018015 / (z * 8.314472 * 293.15) / 0.00985938
    # of standard dry air too they round: its compressibility, to ten digits
    dry_z = ciddor_hill1999.compressibility(15.0, 1013.25, 0.0).z / 0.9995922115
    assert abs(rounded - 1.0) < 6e-6
    assert abs(dry_z - 1.0) < 1e-10
    own = []
    for kind in ("phase", "group"):
        dry, vapour = ciddor_hill1999.MODEL.coefficients(s["wavelength_um"], s["co2_ppm"], kind)
        own.append(dry * density.dry / dry_z + rounded * vapour * density.vapour)
    for difference in departures(table, "nist", NIST_UNIT, own):
        assert np.max(np.abs(difference)) < 0.6 * NIST_UNIT


def test_geodepy_itself_where_it_is_installed(table):
    pytest.importorskip("geodepy")
    s = states(table)
    for live, own in zip(geodepy_answers(s), ours(s), strict=True):
        assert np.max(np.abs(live - own)) < 1e-17


def test_the_calculators_translation_itself_where_it_is_installed(table):
    pytest.importorskip("ref_index")
    s = states(table)
    for kind, live in zip(("phase", "group"), nist_answers(s), strict=True):
        assert np.max(np.abs(live - table[f"nist_{kind}"] * NIST_UNIT)) < 0.501 * NIST_UNIT


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("lorentz_lorenz", STUDY)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def test_the_sum_in_proportion_to_density_gives_every_printed_digit_and_lorentz_lorenz_does_not(study):
    residuals = study.printed_residuals()
    assert np.max(np.abs(residuals.proportional)) < 0.05
    assert np.sum(np.abs(residuals.lorentz) > 0.05) == 4
    assert np.max(np.abs(residuals.lorentz)) == pytest.approx(0.22, abs=0.01)


def test_the_studys_proportional_sum_is_the_model(study):
    t, p, h = study.grid(9)
    for group, function in ((True, air.group_refractivity), (False, air.phase_refractivity)):
        assert np.max(np.abs(study.both(t, p, h, group=group).proportional - function(t, p, h))) < 1e-17


def test_the_lorentz_lorenz_group_index_is_its_phase_index_differentiated(study):
    t, p, h = study.grid(5)
    step = 1e-4  # um: the third derivative leaves 1e-12, rounding 1e-13
    low, high, phase = (
        study.both(t, p, h, wavelength_um=0.780 + d, group=False).lorentz for d in (-step, step, 0.0)
    )  # fmt: skip
    differentiated = phase - 0.780 * (high - low) / (2.0 * step)
    assert np.max(np.abs(study.both(t, p, h).lorentz - differentiated)) < 5e-12


def test_dry_air_departs_by_the_square_of_its_density(study):
    t, p = np.array([-20.0, 45.0]), np.array([1100.0, 600.0])
    sums = study.both(t, p, 0.0, group=False)
    standard = study.both(15.0, 1013.25, 0.0, group=False)
    assert float(standard.lorentz - standard.proportional) == pytest.approx(0.0, abs=1e-18)
    expected = sums.proportional * (sums.proportional - standard.proportional) / 6.0
    assert np.allclose(sums.lorentz - sums.proportional, expected, rtol=1e-3)
    assert expected[0] > 3.6e-9
    assert expected[1] < -3.0e-9


def test_the_page_states_the_differences_that_the_study_finds(study):
    page = (STUDY.parents[1] / "docs" / "studies" / "lorentz-lorenz.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    apart = study.models_apart()
    assert set(apart) == set(rows) == set(air.MODELS) - {AIR_MODEL}
    for name, found in apart.items():
        stated = [float(cell.replace("−", "-")) for cell in rows[name].split("|")[2:-1]]
        assert stated == pytest.approx(list(found.values()), abs=6e-4)
    for kind, (value, _) in study.largest().items():
        assert value == pytest.approx({"phase": 3.7e-9, "group": 3.8e-9}[kind], abs=0.06e-9)


def write(directory: str) -> None:
    """Make the frozen table from the packages that are installed."""
    drawn = random_states()
    answers = {}
    for name, unit, function in (("geodepy", GEODEPY_UNIT, geodepy_answers), ("nist", NIST_UNIT, nist_answers)):
        for kind, values in zip(("phase", "group"), function(states(drawn)), strict=True):
            answers[f"{name}_{kind}"] = np.rint(values / unit).astype(np.int64)
    np.savez_compressed(Path(directory) / TABLE.name, **drawn, **answers)


if __name__ == "__main__":
    write(sys.argv[1])
