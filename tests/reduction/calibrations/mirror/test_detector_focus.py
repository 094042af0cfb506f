"""Detector focus: light integrated over the detector, derived numbers by hand, symmetry, the sign of the range."""

import numpy as np
import pytest
from scipy.stats import norm, poisson

from catseye.errors import InputError
from catseye.reduction.calibrations.mirror.detector_focus import RECIPE
from draws import draws
from lab_scene import table, through_focus

TRUTH = {"focus": 0.31, "rayleigh": 1.4}
SHEET = {"installed_mm": 0.8, "u_installed_mm": 0.05, "u_amplitude_share": 0.01}


def calibrated(truth=TRUTH, rng=None, reject=False, made=None, **sheet):
    return RECIPE.recipe(table(RECIPE, through_focus(truth, rng, **(made or {})), **{**SHEET, **sheet}), reject)


@pytest.mark.parametrize("fill", [0.0, 0.7, 3.0])
def test_light_caught_by_a_disc_gives_back_the_focus(fill):
    found = calibrated({**TRUTH, "fill": fill}, fill=fill)
    assert found.value("best_focus_mm") == pytest.approx(0.31, abs=1e-6)
    # near the top A falls by (z/depth)^2; a second difference of the integral says how
    top, beside = (through_focus({**TRUTH, "fill": fill}, places=[0.31 + h])["amplitude_volt"][0] for h in (0.0, 0.01))
    assert found.value("depth_mm") == pytest.approx(0.01 / np.sqrt(1 - beside / top), rel=1e-3)


def test_defocus_share_and_range_by_hand():
    found = calibrated(amplitude_to_phase_rad=2e-3, u_amplitude_to_phase_rad=4e-4)
    x = (0.8 - 0.31) / 1.4
    assert found.value("detector_defocus_mm") == pytest.approx(0.49, abs=1e-6)
    assert found.value("amplitude_share") == pytest.approx(1 / (1 + x**2), abs=1e-6)
    # phase 2 mrad ln(share) too high, which is too low: a range too long, half a wavelength a turn
    long = 99.93e3 / (2 * np.pi) * 2e-3 * np.log(1 + x**2)
    assert found.value("range_change_um") == pytest.approx(long, rel=1e-5)
    assert long > 0.0
    assert found.u("detector_defocus_mm") == pytest.approx(np.hypot(0.05, found.u("best_focus_mm")), rel=1e-6)
    by_place = 99.93e3 / (2 * np.pi) * 2e-3 * 2 * x / (1 + x**2) / 1.4 * 0.05
    assert found.u("range_change_um") == pytest.approx(np.hypot(long * 0.2, by_place), rel=0.05)
    assert found.record == {
        "detector_defocus_mm": found.value("detector_defocus_mm"),
        "u_detector_defocus_mm": found.u("detector_defocus_mm"),
    }


def test_a_lopsided_fall_fails_the_beam_and_fits_the_curve():
    numbers = through_focus(TRUTH)
    y = (np.array(numbers["position_mm"]) - 0.31) / 4.0
    numbers["amplitude_volt"] = 3.0 * np.exp(-(y**2) + 0.5 * y**3)
    beam = RECIPE.recipe(table(RECIPE, numbers, **SHEET), False)
    assert next(d for d in beam.decisions if d.name.startswith("odd term")).passed is False
    curve = RECIPE.recipe(table(RECIPE, numbers, **SHEET, model="curve", degree=3), False)
    assert curve.value("best_focus_mm") == pytest.approx(0.31, abs=1e-6)
    assert curve.value("depth_mm") == pytest.approx(4.0, abs=1e-5)


@draws(150)
def test_an_even_fall_is_seldom_called_lopsided_by_few_readings(runs):
    wrong = 0
    for seed in range(runs):
        rng = np.random.default_rng([11, seed])
        numbers = through_focus(TRUTH, rng, places=np.linspace(-1.5, 2.1, 6))
        found = RECIPE.recipe(table(RECIPE, numbers, **{**SHEET, "u_amplitude_share": None}), False)
        wrong += next(d for d in found.decisions if d.name.startswith("odd term")).passed is False
    # 0.27 % of 150 are 0.4, and more than 4 of them a chance of 1e-4;
    # with three standard uncertainties of so few readings it is 10 %
    assert wrong <= poisson.isf(1e-4, runs * 2 * norm.sf(3.0))


def test_a_curve_is_not_extrapolated():
    with pytest.raises(InputError, match=r"installed_mm = 10 lies outside of the run, -?[\d.]+ to [\d.]+ mm"):
        calibrated(model="curve", installed_mm=10.0)
    share = calibrated(installed_mm=10.0).value("amplitude_share")  # a beam is known beyond it
    assert share == pytest.approx(1 / (1 + (9.69 / 1.4) ** 2), rel=1e-6)


def test_a_run_that_does_not_reach_the_focus_is_reported():
    found = calibrated(made={"places": np.linspace(1.0, 3.0, 15)})
    assert found.value("best_focus_mm") == pytest.approx(0.31, abs=1e-4)
    assert found.decisions[0].passed is False


def test_scatter_is_estimated_and_a_wrong_amplitude_found():
    numbers = through_focus(TRUTH, np.random.default_rng(4))
    numbers["amplitude_volt"][3] *= 1.2
    found = RECIPE.recipe(table(RECIPE, numbers, **{**SHEET, "u_amplitude_share": None}), True)
    assert [k for k, s in enumerate(found.states) if s == "rejected"] == [3]
    assert abs(found.value("best_focus_mm") - 0.31) < 4 * found.u("best_focus_mm")
    assert any("no amplitude_to_phase_rad" in note for note in found.notes)
