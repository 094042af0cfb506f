"""D0 from known distances: against the definition, by hand, by scatter; signs, whole cycles and what u holds."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration_scene import HALF, RUNS, WEATHER
from catseye.atmosphere.index.air import MODELS
from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.ranging.leftover import leakage_effects
from catseye.reduction.calibrations.ranging.reference_distance import LAYOUT, calibrate_reference_distance

D0 = 0.180685
FORMULA = float(MODELS["rueger1990"].uncertainty(20.0, 933.0, 11.7323))  # of the index itself, at 20 °C, 933 hPa, 50 %
BASE = {**WEATHER, "d0_nominal_mm": 185.0, "u_d0_nominal_mm": 1.0, "u_distance_common_mm": 0.0, "u_distance_ppm": 0.0}
PLACES = np.concatenate([3.0 + 0.0111 * np.arange(9), np.linspace(5.0, 60.0, 9)])


def phases(distance, d0=D0, constant=0.0, half=HALF, electronics=0.7):
    """Target and reference as the notes' eq. 5.11 has them: both fall as the distance grows."""
    reference = electronics - 2 * np.pi * d0 / half
    target = electronics - 2 * np.pi * (distance - constant) / half
    return np.mod(target, 2 * np.pi), np.full(len(distance), np.mod(reference, 2 * np.pi))


def columns(distance, **more):
    target, reference = phases(distance, **more)
    return {"distance_m": distance, "phase_target_rad": target, "phase_reference_rad": reference}


def test_exact_phases_give_d0_exactly(table):
    found = calibrate_reference_distance(table(LAYOUT, columns(PLACES), **BASE, u_distance_mm=0.01))
    # The planted index is good to 1e-12, at 60 m that is 6e-8 mm; the rest is rounding.
    assert found.value("d0_mm") == pytest.approx(D0 * 1e3, abs=2e-7)
    assert found.record["d0_mm"] == found.value("d0_mm")


def test_one_reading_by_mpmath(table):
    mpmath.mp.dps = 40
    distance, target, reference = 17.25, 1.234, 4.321
    half = mpmath.mpf(299792458) / (2 * mpmath.mpf("1.000253246815") * 1500000000)
    phi = mpmath.fmod(mpmath.mpf(target) - mpmath.mpf(reference) + 2 * mpmath.pi, 2 * mpmath.pi)
    n = mpmath.nint((mpmath.mpf(distance) + mpmath.mpf("0.0335") - mpmath.mpf("0.185")) / half + phi / (2 * mpmath.pi))
    by_hand = mpmath.mpf(distance) + mpmath.mpf("0.0335") - (n - phi / (2 * mpmath.pi)) * half
    row = {"distance_m": [distance], "phase_target_rad": [target], "phase_reference_rad": [reference]}
    nominal = {**BASE, "d0_nominal_mm": float(by_hand) * 1e3}
    found = calibrate_reference_distance(table(LAYOUT, row, **nominal, pc_mm=-33.5, u_distance_mm=0.01))
    assert found.value("d0_mm") == pytest.approx(float(by_hand) * 1e3, abs=2e-8)
    assert found.degrees_of_freedom == 0


def test_a_glass_constant_and_d0_are_both_added_to_the_length(table):
    constant = -0.0335
    found = calibrate_reference_distance(
        table(LAYOUT, columns(PLACES, constant=constant), **BASE, pc_mm=constant * 1e3, u_distance_mm=0.01)
    )
    assert found.value("d0_mm") == pytest.approx(D0 * 1e3, abs=2e-7)


@given(
    d0=st.floats(0.15, 0.22), off=st.floats(-0.04, 0.04), electronics=st.floats(-3.0, 3.0), step=st.floats(0.003, 0.02)
)
def test_any_nominal_value_within_four_centimetres_finds_d0(table, d0, off, electronics, step):
    distance = 4.0 + step * np.arange(8)
    sheet = {**BASE, "d0_nominal_mm": (d0 + off) * 1e3}
    found = calibrate_reference_distance(
        table(LAYOUT, columns(distance, d0=d0, electronics=electronics), **sheet, u_distance_mm=0.01)
    )
    assert found.value("d0_mm") == pytest.approx(d0 * 1e3, abs=1e-6)


def test_a_ranger_that_reads_long_has_a_positive_scale(table):
    # Ranges come out too long by 20 ppm where the true half wavelength is shorter than the one computed with.
    numbers = columns(PLACES, half=HALF / (1 + 20e-6))
    free = calibrate_reference_distance(table(LAYOUT, numbers, **BASE, u_distance_mm=0.01, estimate_scale=True))
    assert free.value("scale_ppm") == pytest.approx(20.0, abs=0.01)
    assert free.value("d0_mm") == pytest.approx(D0 * 1e3, abs=1e-4)
    held = calibrate_reference_distance(table(LAYOUT, numbers, **BASE, u_distance_mm=0.01))
    assert held.value("d0_mm") < D0 * 1e3 - 0.1


def test_u_is_that_of_a_mean_plus_the_common_errors(table):
    n, u, common = 7, 0.012, 0.005
    sheet = {**BASE, "u_distance_common_mm": common, "u_pc_mm": 0.003}
    found = calibrate_reference_distance(table(LAYOUT, columns(np.full(n, 4.0)), **sheet, u_distance_mm=u))
    formula = FORMULA * (4.0 - D0) * 1e3
    assert found.u("d0_mm") == pytest.approx(np.sqrt(u**2 / n + common**2 + 0.003**2 + formula**2), rel=1e-6)


def test_frequency_and_thermometer_act_through_the_distance(table):
    near, far = np.full(4, 5.0), np.full(4, 50.0)
    for where, u in ((near, 5.0), (far, 50.0)):
        sheet = {**BASE, "u_modulation_ppm": 0.2}
        found = calibrate_reference_distance(table(LAYOUT, columns(where), **sheet, u_distance_mm=1e-5))
        length = (u - D0) * 1e3
        assert found.u("d0_mm") == pytest.approx(np.hypot(0.2e-6, FORMULA) * length, rel=1e-3)
        sheet = {**BASE, "u_temperature_c": 0.3}
        found = calibrate_reference_distance(table(LAYOUT, columns(where), **sheet, u_distance_mm=1e-5))
        # P 1.50: 0.895887e-6 of index a degree.
        assert found.u("d0_mm") == pytest.approx(np.hypot(0.3 * 0.895887e-6, FORMULA) * length, rel=1e-3)


def test_air_warmer_than_read_biases_d0_by_the_index(table):
    # True air is 1 °C warmer than read: true index lower, true lengths longer than computed, D - L too large.
    numbers = columns(np.full(6, 40.0), half=HALF * (1 + 0.895887e-6))
    found = calibrate_reference_distance(table(LAYOUT, numbers, **BASE, u_distance_mm=0.01))
    assert (found.value("d0_mm") - D0 * 1e3) == pytest.approx(40e3 * 0.895887e-6, rel=0.02)


def test_leakage_left_over_acts_as_a_phasor_on_target_and_reference(table):
    left, half = 3e-4 * np.exp(1j * 0.4), HALF
    target, reference = phases(PLACES)
    amplitude = np.full(len(PLACES), 2.0)
    seen = [a * np.exp(1j * p) + left for a, p in ((amplitude, target), (5.0, reference))]
    numbers = {
        "distance_m": PLACES,
        "phase_target_rad": np.mod(np.angle(seen[0]), 2 * np.pi),
        "phase_reference_rad": np.mod(np.angle(seen[1]), 2 * np.pi),
        "amplitude_target_volt": np.abs(seen[0]),
        "amplitude_reference_volt": np.abs(seen[1]),
    }
    blind = calibrate_reference_distance(table(LAYOUT, numbers, **BASE, u_distance_mm=1e-5))
    aware = calibrate_reference_distance(table(LAYOUT, numbers, **BASE, u_distance_mm=1e-5, u_leakage_volt=1e-3))
    assert abs(blind.value("d0_mm") / 1e3 - D0) > 3e-7
    # The spread over a half wavelength tells it: second order of leakage over amplitude is what remains.
    assert aware.value("d0_mm") / 1e3 == pytest.approx(D0, abs=half / (2 * np.pi) * (3e-4 / 2.0) ** 2)


def test_leakage_left_over_at_one_place_in_closed_form(table):
    # One leakage on both phasors: d phi~ = Im(dL (e^-i phi_t / A_t - e^-i phi_r / A_r)), each quadrature alike.
    target, reference = phases(np.full(3, 4.02))
    row = {"distance_m": np.full(3, 4.02), "phase_target_rad": target, "phase_reference_rad": reference}
    row |= {"amplitude_target_volt": np.full(3, 2.0), "amplitude_reference_volt": np.full(3, 5.0)}
    sheet = {**BASE, "u_leakage_volt": 1e-3, "u_distance_mm": 1e-5}
    found = calibrate_reference_distance(table(LAYOUT, row, **sheet))
    slope = np.abs(np.exp(-1j * target[0]) / 2.0 - np.exp(-1j * reference[0]) / 5.0)
    leakage = HALF / (2 * np.pi) * 1e-3 * slope * 1e3
    assert found.u("d0_mm") == pytest.approx(np.hypot(leakage, FORMULA * (4.02 - D0) * 1e3), rel=1e-4)


def test_leakage_effects_equal_those_of_a_small_phasor(table):
    target, reference = phases(PLACES)
    row = columns(PLACES) | {"amplitude_target_volt": PLACES, "amplitude_reference_volt": np.full(len(PLACES), 5.0)}
    effects = leakage_effects(table(LAYOUT, row, **BASE), 1e-3)
    for effect, small in zip(effects, (1e-7, 1e-7j), strict=True):
        moved = [np.angle(a + small * np.exp(-1j * p)) for a, p in ((PLACES, target), (5.0, reference))]
        np.testing.assert_allclose(effect.column, (moved[0] - moved[1]) / 1e-7, atol=1e-6)


def test_one_wrong_reading_is_named_and_rejected_only_on_request(table):
    rng = np.random.default_rng(1)
    numbers = columns(PLACES)
    numbers["phase_target_rad"] = numbers["phase_target_rad"] + 2e-4 * rng.standard_normal(len(PLACES))
    numbers["phase_target_rad"][5] += 0.01
    readings = table(LAYOUT, numbers, **BASE, u_phase_rad=2e-4)
    plain, without = calibrate_reference_distance(readings), calibrate_reference_distance(readings, reject=True)
    assert [row[-1] for row in plain.rows].count("suspect") >= 1
    assert "rejected" not in [row[-1] for row in plain.rows]
    assert {d.name.split(":")[0]: d.passed for d in plain.decisions}["scatter"] is False
    assert [k for k, row in enumerate(without.rows) if row[-1] == "rejected"] == [5]
    assert without.value("d0_mm") == pytest.approx(D0 * 1e3, abs=4 * without.u("d0_mm"))
    reason = ["" if k != 5 else "stepped on the cable" for k in range(len(PLACES))]
    said = calibrate_reference_distance(table(LAYOUT, numbers, None, tuple(reason), **BASE, u_phase_rad=2e-4))
    assert said.value("d0_mm") == pytest.approx(without.value("d0_mm"), abs=1e-12)
    assert said.rows[5][-1] == "left out: stepped on the cable"


def test_a_thin_margin_of_whole_cycles_is_a_failed_decision(table):
    sheet = {**BASE, "d0_nominal_mm": D0 * 1e3 + 47.0}
    found = calibrate_reference_distance(table(LAYOUT, columns(PLACES), **sheet, u_distance_mm=0.01))
    decision = found.decisions[0]
    assert decision.passed is False
    assert decision.statistic == pytest.approx(HALF * 500 - 47.0, abs=1e-3)


def test_missing_input_is_reported(table):
    numbers = columns(PLACES)
    with pytest.raises(InputError, match=r"t\.csv: line 1, column 'amplitude_target_volt' is missing"):
        calibrate_reference_distance(table(LAYOUT, numbers, **BASE, u_leakage_volt=1e-3))
    blank = {k: v for k, v in BASE.items() if k != "humidity_percent"}
    with pytest.raises(InputError, match=r"t\.toml: humidity_percent is missing \(expected a value, or a column"):
        calibrate_reference_distance(table(LAYOUT, numbers, **blank))
    with pytest.raises(EstimationError, match="1 values for 1 parameters show no scatter"):
        calibrate_reference_distance(table(LAYOUT, {k: v[:1] for k, v in numbers.items()}, **BASE))


@pytest.mark.parametrize("runs", RUNS)
def test_d0_and_scale_scatter_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(2), [], []
    sheet = {**BASE, "u_distance_common_mm": 0.004, "u_distance_ppm": 0.3, "u_modulation_ppm": 0.1}
    for _ in range(runs):
        true = PLACES * (1 + 0.3e-6 * rng.standard_normal()) + 4e-6 * rng.standard_normal()
        true = true + 5e-6 * rng.standard_normal(len(PLACES))
        numbers = columns(true, half=HALF / (1 + 0.1e-6 * rng.standard_normal()))
        numbers["distance_m"] = PLACES
        numbers["phase_target_rad"] = numbers["phase_target_rad"] + 2e-4 * rng.standard_normal(len(PLACES))
        found = calibrate_reference_distance(
            table(LAYOUT, numbers, **sheet, u_distance_mm=0.005, u_phase_rad=2e-4, estimate_scale=True)
        )
        values.append([q.value for q in found.quantities])
        covariances.append(found.covariance)
    scatters_as_claimed(values, covariances, [D0 * 1e3, 0.0])


def test_whole_cycles_are_judged_by_the_used_readings_and_their_total_u(table):
    distance = np.append(PLACES, 20.0)
    rows = columns(distance)
    rows["distance_m"] = np.append(PLACES, 20.047)  # a typing error, nearly half a wavelength
    left_out = ("",) * len(PLACES) + ("typing error",)
    good = calibrate_reference_distance(table(LAYOUT, rows, left_out=left_out, **BASE, u_distance_mm=0.01))
    assert good.decisions[0].passed
    assert good.decisions[0].limit == pytest.approx(5.0, rel=1e-3)
    doubted = {**BASE, "u_distance_ppm": 200.0, "u_pc_mm": 3.0}
    bad = calibrate_reference_distance(table(LAYOUT, columns(PLACES), **doubted, u_distance_mm=0.01))
    assert not bad.decisions[0].passed  # 200 ppm of 60 m are 12 mm, five times that is more than half a half wavelength
    assert bad.decisions[0].limit == pytest.approx(5.0 * np.sqrt(1.0 + 9.0 + 144.0), rel=1e-4)
