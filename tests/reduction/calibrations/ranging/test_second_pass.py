"""Second pass: signs by hand, a claim that scatter confirms, and readings that cannot tell it."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.ranging.second_pass import KIND, SecondPassSheet, calibrate_second_pass
from reduction.calibrations.length_scene import readings

PLACES = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)


def table(share, angle, *, coupling=0.0, rng=None, x=PLACES, full=5.0, ratio=3.0, leakage=0.0, glass=0.0):
    """Readings of a light whose passes are added one after the other."""
    columns = {"phase_reference_rad": np.zeros(len(x))}
    for level, volts in (("full", full), ("attenuated", full / ratio)):
        light = volts * np.exp(1j * (x + coupling * np.log(volts / 5.0)))
        seen = sum(light * (volts * share * np.exp(1j * (x - angle))) ** k for k in range(5)) + leakage
        if level == "attenuated":
            seen = seen * np.exp(-1j * glass)  # the delay of the attenuator's glass
        if rng is not None:
            seen = seen + 3e-4 * (rng.standard_normal(len(x)) + 1j * rng.standard_normal(len(x)))
        columns[f"phase_{level}_rad"] = np.angle(seen)
        columns[f"amplitude_{level}_volt"] = np.abs(seen)
    return columns


def calibrated(columns, **sheet):
    keys = {"u_phasor_volt": 3e-4, "u_leakage_volt": 0.0} | sheet
    return calibrate_second_pass(readings(SecondPassSheet, KIND, numbers=columns, **keys))


def test_a_pass_a_quarter_turn_late_is_all_cosine():
    """At x = 0 the second pass lags by a quarter: the phase falls, the range is long, cosine is above 0."""
    columns = table(1e-4, np.pi / 2)
    assert columns["phase_full_rad"][0] < columns["phase_attenuated_rad"][0] < 0.0
    found = calibrated(columns)
    assert found.value("second_pass_cosine_per_volt") == pytest.approx(1e-4, rel=1e-3)
    assert found.value("second_pass_sine_per_volt") == pytest.approx(0.0, abs=1e-7)
    assert found.value("offset_rad") == pytest.approx(0.0, abs=1e-6)


def test_values_scatter_as_claimed_with_leakage_left_over():
    """300 tables, each with a leakage of its own: a mean square over its claim scatters by the root of 2/300, 0.082."""
    rng, errors = np.random.default_rng(11), []
    truth = np.array([-1e-3 * np.log(3.0) + 0.06, 5e-4 * np.sin(0.7), -5e-4 * np.cos(0.7)])
    for _ in range(300):
        leakage = 2e-4 * complex(*rng.standard_normal(2))
        found = calibrated(table(5e-4, 0.7, coupling=-1e-3, rng=rng, leakage=leakage, glass=0.06), u_leakage_volt=2e-4)
        errors.append((np.array([q.value for q in found.quantities]) - truth) / np.sqrt(np.diag(found.covariance)))
    np.testing.assert_allclose(np.mean(np.square(errors), axis=0), 1.0, atol=4 * 0.082)


def test_places_that_repeat_one_phase_are_refused():
    with pytest.raises(EstimationError, match="the slide move over half a modulation wavelength"):
        calibrated(table(5e-4, 0.7, x=np.full(16, 0.3)))


def test_an_attenuator_that_does_too_little_is_refused():
    with pytest.raises(InputError, match=r"amplitudes differ by a factor of 1\.3 \(expected 1\.5 or more\)"):
        calibrated(table(5e-4, 0.7, ratio=1.3))
