"""Amplitude-to-phase: sign, wrapping, leakage, the test of the line, against numpy's polynomials, scatter."""

import numpy as np
import pytest

from calibration_scene import RUNS
from catseye.errors import EstimationError
from catseye.reduction.calibrations.ranging.amplitude import LAYOUT, calibrate_amplitude

BASE = {"reference_amplitude_volt": 5.0, "u_leakage_volt": 0.0}
LEVELS = np.repeat(np.geomspace(0.15, 5.0, 8), 3)


def columns(level, coefficient, phase=1.0, quadratic=0.0):
    x = np.log(level / 5.0)
    return {
        "amplitude_target_volt": level,
        "phase_target_rad": np.mod(phase + coefficient * x + quadratic * x**2, 2 * np.pi),
    }


def test_a_phase_that_grows_with_amplitude_has_a_positive_coefficient(table):
    assert calibrate_amplitude(
        table(LAYOUT, columns(np.array([5.0 / np.e, 5.0]), 2e-3), **BASE, u_phase_rad=1e-4)
    ).value("amplitude_to_phase_rad") == pytest.approx(2e-3, abs=1e-12)


@pytest.mark.parametrize("phase", [0.0, 1.0, 3.1416, 6.2831])
def test_the_phase_origin_does_not_matter(table, phase):
    found = calibrate_amplitude(table(LAYOUT, columns(LEVELS, -3e-3, phase), **BASE, u_phasor_volt=3e-4))
    assert found.value("amplitude_to_phase_rad") == pytest.approx(-3e-3, abs=1e-12)


def test_it_is_numpys_polynomial_and_tests_the_next_power(table):
    rng = np.random.default_rng(0)
    numbers = columns(LEVELS, -1.8e-3)
    numbers["phase_target_rad"] = numbers["phase_target_rad"] + 3e-4 / LEVELS * rng.standard_normal(len(LEVELS))
    found = calibrate_amplitude(table(LAYOUT, numbers, **BASE, u_phasor_volt=3e-4))
    x, y, weight = np.log(LEVELS / 5.0), numbers["phase_target_rad"], LEVELS / 3e-4
    (slope, _), covariance = np.polyfit(x, y, 1, w=weight, cov="unscaled")
    assert found.value("amplitude_to_phase_rad") == pytest.approx(slope, rel=1e-9)
    assert found.u("amplitude_to_phase_rad") == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-9)
    (bend, _, _), covariance = np.polyfit(x, y, 2, w=weight, cov="unscaled")
    assert found.decisions[0].statistic == pytest.approx(abs(bend) / np.sqrt(covariance[0, 0]), rel=1e-6)


def test_the_reference_takes_the_drift_of_the_electronics(table):
    rng = np.random.default_rng(1)
    drift = np.cumsum(0.01 * rng.standard_normal(len(LEVELS)))
    numbers = columns(LEVELS, -1.8e-3)
    numbers["phase_target_rad"] = numbers["phase_target_rad"] + drift
    numbers |= {"phase_reference_rad": 0.4 + drift, "amplitude_reference_volt": np.full(len(LEVELS), 5.0)}
    found = calibrate_amplitude(table(LAYOUT, numbers, **BASE, u_phasor_volt=3e-4))
    assert found.value("amplitude_to_phase_rad") == pytest.approx(-1.8e-3, abs=1e-12)


def test_a_curve_is_not_taken_for_a_line(table):
    rng = np.random.default_rng(2)
    numbers = columns(LEVELS, -1.8e-3, quadratic=3e-4)
    numbers["phase_target_rad"] = numbers["phase_target_rad"] + 1e-4 / LEVELS * rng.standard_normal(len(LEVELS))
    line = calibrate_amplitude(table(LAYOUT, numbers, **BASE, u_phasor_volt=1e-4))
    assert line.decisions[0].passed is False
    curve = calibrate_amplitude(table(LAYOUT, numbers, **BASE, u_phasor_volt=1e-4, quadratic=True))
    assert curve.value("amplitude_to_phase_quadratic_rad") == pytest.approx(3e-4, abs=1e-4)
    assert curve.record == {}  # the ranger's record knows a line only


@pytest.mark.parametrize("runs", RUNS)
def test_the_test_of_the_line_raises_false_alarms_at_its_level(table, runs):
    rng, alarms = np.random.default_rng(3), 0
    for claimed in (3e-4, None):
        sheet = {**BASE, "u_phasor_volt": claimed}
        for _ in range(runs // 2):
            numbers = columns(LEVELS, -1.8e-3)
            noise = 3e-4 / LEVELS * rng.standard_normal(len(LEVELS))
            numbers["phase_target_rad"] = numbers["phase_target_rad"] + noise
            alarms += calibrate_amplitude(table(LAYOUT, numbers, **sheet)).decisions[0].passed is False
    assert alarms / runs == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / runs))


def test_residual_leakage_is_in_u_with_its_phasors_effect(table):
    # All of it along the quadrature: phase moves by left over / A, which looks like coupling.
    left = 2e-4
    light = LEVELS * np.exp(1j * (1.0 - 1.8e-3 * np.log(LEVELS / 5.0)))
    seen = light + left * np.exp(1j * (1.0 + np.pi / 2))
    numbers = {"amplitude_target_volt": np.abs(seen), "phase_target_rad": np.angle(seen)}
    blind = calibrate_amplitude(table(LAYOUT, numbers, **BASE, u_phase_rad=1e-4))
    aware = calibrate_amplitude(table(LAYOUT, numbers, **{**BASE, "u_leakage_volt": 4e-4}, u_phase_rad=1e-4))
    assert abs(blind.value("amplitude_to_phase_rad") + 1.8e-3) > 5 * blind.u("amplitude_to_phase_rad")
    assert aware.value("amplitude_to_phase_rad") == pytest.approx(-1.8e-3, abs=2 * aware.u("amplitude_to_phase_rad"))
    assert aware.u("amplitude_to_phase_rad") > blind.u("amplitude_to_phase_rad")


def test_one_attenuation_is_insufficient_and_a_wrong_reading_is_rejected(table):
    with pytest.raises(EstimationError, match="rank deficient"):
        calibrate_amplitude(table(LAYOUT, columns(np.full(5, 2.0), 1e-3), **BASE, u_phase_rad=1e-4))
    rng = np.random.default_rng(4)
    numbers = columns(LEVELS, -1.8e-3)
    numbers["phase_target_rad"] = numbers["phase_target_rad"] + 3e-4 / LEVELS * rng.standard_normal(len(LEVELS))
    numbers["phase_target_rad"][10] += 0.02
    found = calibrate_amplitude(table(LAYOUT, numbers, **BASE, u_phasor_volt=3e-4), reject=True)
    assert [k for k, row in enumerate(found.rows) if row[-1] == "rejected"] == [10]


@pytest.mark.parametrize("runs", RUNS)
def test_the_coefficient_scatters_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(5), [], []
    mjd = 61_280.0 + np.arange(len(LEVELS)) / 24 / 10
    sheet = {**BASE, "u_leakage_volt": 2e-4, "u_phasor_volt": 3e-4, "random_walk_rad_per_sqrt_hour": 2e-4}
    for _ in range(runs):
        left = 2e-4 * (rng.standard_normal() + 1j * rng.standard_normal())
        walk = np.cumsum(np.concatenate([[0.0], 2e-4 * np.sqrt(0.1) * rng.standard_normal(len(LEVELS) - 1)]))
        phase = 1.0 - 1.8e-3 * np.log(LEVELS / 5.0) + walk
        noise = 3e-4 * (rng.standard_normal(len(LEVELS)) + 1j * rng.standard_normal(len(LEVELS)))
        seen = LEVELS * np.exp(1j * phase) + left + noise
        numbers = {"amplitude_target_volt": np.abs(seen), "phase_target_rad": np.angle(seen), "mjd_utc": mjd}
        found = calibrate_amplitude(table(LAYOUT, numbers, **sheet))
        values.append([q.value for q in found.quantities])
        covariances.append(found.covariance)
    scatters_as_claimed(values, covariances, [-1.8e-3])
