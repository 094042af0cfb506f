"""Leakage, beam blocked and lit: against the analysis of variance, against numpy's least squares, by scatter."""

import numpy as np
import pytest

from calibration_scene import RUNS
from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.ranging import leakage, leakage_lit
from catseye.signal.systematics.leakage import circle_leakage

TRUE = 0.031 * np.exp(4.3574j)
POLAR = np.array([0.031, 4.3574])
INDEX = 1.00025
HALF = 299_792_458.0 / (2 * INDEX * 1.5e9)


def noise(rng, *shape):
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def blocked(table, z, session, **sheet):
    numbers = {"real_volt": z.real, "imaginary_volt": z.imag}
    return table(leakage.LAYOUT, numbers, {"session": tuple(map(str, session))}, **sheet)


def lit(table, z, distance=None, **sheet):
    numbers = {"amplitude_volt": np.abs(z), "phase_rad": np.angle(z)}
    if distance is not None:
        numbers["distance_m"] = distance
        sheet["group_index"] = INDEX
    return table(leakage_lit.LAYOUT, numbers, u_session_volt=0.0, **sheet)


def test_balanced_sessions_give_the_mean_of_their_means(table):
    rng = np.random.default_rng(0)
    z = (TRUE + 4e-4 * noise(rng, 7, 1) + 2e-4 * noise(rng, 7, 5)).ravel()
    session = np.repeat(np.arange(7), 5)
    found = leakage.calibrate_leakage(blocked(table, z, session))
    means = z.reshape(7, 5).mean(axis=1)
    value = found.value("leakage_amplitude_volt") * np.exp(1j * found.value("leakage_phase_rad"))
    assert value == pytest.approx(means.mean(), abs=1e-12)
    # Alike in both quadratures: the mean of their two variances is ours.
    scatter = 0.5 * (means.real.var(ddof=1) + means.imag.var(ddof=1))
    assert found.u("leakage_amplitude_volt") ** 2 == pytest.approx(scatter / 7, rel=1e-6)
    within = np.sum(np.abs(z.reshape(7, 5) - means[:, None]) ** 2) / (2 * 7 * 4)
    between = np.sum(np.abs(means - means.mean()) ** 2) / (2 * 6) - within / 5
    expected = np.sqrt(between + found.u("leakage_amplitude_volt") ** 2)
    assert found.record["u_leakage_volt"] == pytest.approx(expected, rel=1e-6)


def test_amplitude_and_phase_columns_agree_with_real_and_imaginary(table):
    rng = np.random.default_rng(1)
    z = TRUE + 3e-4 * noise(rng, 12)
    parts = leakage.calibrate_leakage(blocked(table, z, np.arange(12) // 4))
    polar = leakage.calibrate_leakage(
        table(
            leakage.LAYOUT,
            {"amplitude_volt": np.abs(z), "phase_rad": np.angle(z)},
            {"session": tuple(map(str, np.arange(12) // 4))},
        )
    )
    assert [q.value for q in polar.quantities] == pytest.approx([q.value for q in parts.quantities], rel=1e-9)


def test_one_session_notes_that_other_days_are_unknown(table):
    rng = np.random.default_rng(2)
    z = TRUE + 3e-4 * noise(rng, 12)
    alone = leakage.calibrate_leakage(blocked(table, z, np.zeros(12)))
    assert any("one session says nothing of other days" in note for note in alone.notes)
    stated = leakage.calibrate_leakage(blocked(table, z, np.zeros(12), u_session_volt=5e-4))
    assert stated.record["u_leakage_volt"] == pytest.approx(np.sqrt(2) * 5e-4, rel=0.05)
    assert not any("one session" in note and "nothing" in note for note in stated.notes)


def test_both_quadratures_of_a_wrong_buffer_leave_together(table):
    rng = np.random.default_rng(3)
    z = TRUE + 2e-4 * noise(rng, 24)
    z[7] += 5e-3
    readings = blocked(table, z, np.arange(24) // 6)
    assert [k for k, row in enumerate(leakage.calibrate_leakage(readings).rows) if row[-1] == "suspect"] == [7]
    without = leakage.calibrate_leakage(readings, reject=True)
    assert [k for k, row in enumerate(without.rows) if row[-1] == "rejected"] == [7]
    value = without.value("leakage_amplitude_volt") * np.exp(1j * without.value("leakage_phase_rad"))
    assert abs(value - TRUE) < 4e-4


def test_two_kinds_of_columns_at_once_are_refused(table):
    z = np.full(5, TRUE)
    numbers = {"real_volt": z.real, "imaginary_volt": z.imag, "phase_rad": np.angle(z)}
    with pytest.raises(InputError, match="line 1, real_volt, imaginary_volt, phase_rad"):
        leakage.calibrate_leakage(table(leakage.LAYOUT, numbers))


@pytest.mark.parametrize("runs", RUNS)
def test_blocked_leakage_scatters_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances, to_come = np.random.default_rng(4), [], [], []
    sizes = [3, 8, 5, 4, 9, 2, 6, 7, 5, 4, 6, 5]  # sessions need not be alike
    session = np.repeat(np.arange(12), sizes)
    for _ in range(runs):
        shift = 4e-4 * noise(rng, 13)
        z = TRUE + shift[session] + 3e-4 * noise(rng, len(session))
        found = leakage.calibrate_leakage(blocked(table, z, session))
        values.append([q.value for q in found.quantities])
        covariances.append(found.covariance)
        estimate = found.value("leakage_amplitude_volt") * np.exp(1j * found.value("leakage_phase_rad"))
        to_come.append(np.abs(TRUE + shift[12] - estimate) ** 2 / 2 / found.record["u_leakage_volt"] ** 2)
    # 22 effective degrees of freedom: the mean of F is 22/20 where chi-square's is 1.
    each = np.einsum("ni,nij,nj->n", values - POLAR, np.linalg.inv(covariances), values - POLAR)
    assert each.mean() / 2 == pytest.approx(22 / 20, abs=4 * 1.1 / np.sqrt(runs))
    scatters_as_claimed(values, np.broadcast_to(np.mean(covariances, axis=0), (runs, 2, 2)), POLAR)
    assert np.mean(to_come) == pytest.approx(22 / 20, abs=4 * 1.1 / np.sqrt(runs))


def rail(rng, m=40, fading=0.0, sigma=4e-4):
    distance = 5.0 + 0.0061 * np.arange(m)
    light = (2.0 + fading * (distance - 5.0)) * np.exp(1j * (0.7 - 2 * np.pi * distance / HALF))
    return distance, TRUE + light + sigma * noise(rng, m)


def test_known_distances_agree_with_complex_least_squares(table):
    distance, z = rail(np.random.default_rng(5), fading=-0.3)
    found = leakage_lit.calibrate_lit_leakage(lit(table, z, distance, u_volt=4e-4))
    turning = np.exp(-2j * np.pi * distance / HALF)
    design = np.stack([np.ones_like(turning), turning, turning * (distance - distance.mean())], axis=1)
    expected, squares, _, _ = np.linalg.lstsq(design, z, rcond=None)
    value = found.value("leakage_amplitude_volt") * np.exp(1j * found.value("leakage_phase_rad"))
    assert value == pytest.approx(expected[0], abs=1e-12)
    variance = 4e-4**2 * np.linalg.inv(design.conj().T @ design)[0, 0].real  # of each quadrature
    assert found.u("leakage_amplitude_volt") ** 2 == pytest.approx(variance, rel=1e-6)
    assert found.variance_factor == pytest.approx(float(squares[0]) / 4e-4**2 / (2 * len(z) - 6), rel=1e-6)


def test_unknown_distances_agree_with_the_circle(table):
    _, z = rail(np.random.default_rng(6))
    found = leakage_lit.calibrate_lit_leakage(lit(table, z, u_volt=4e-4))
    value = found.value("leakage_amplitude_volt") * np.exp(1j * found.value("leakage_phase_rad"))
    assert value == pytest.approx(circle_leakage(z), abs=1e-9)
    assert found.degrees_of_freedom == 37


def test_a_fading_light_deceives_the_circle_and_not_the_rail(table):
    distance, z = rail(np.random.default_rng(7), m=17, fading=-1.0)
    circle = leakage_lit.calibrate_lit_leakage(lit(table, z, u_volt=4e-4))
    known = leakage_lit.calibrate_lit_leakage(lit(table, z, distance, u_volt=4e-4))
    assert abs(circle.value("leakage_amplitude_volt") - 0.031) > 10 * circle.u("leakage_amplitude_volt")
    assert circle.decisions[1].passed is False
    assert known.value("leakage_amplitude_volt") == pytest.approx(0.031, abs=4 * known.u("leakage_amplitude_volt"))


def test_a_wrong_reading_on_the_rail_is_left_out(table):
    distance, z = rail(np.random.default_rng(8))
    z[11] *= 1.05
    for where in (distance, None):
        found = leakage_lit.calibrate_lit_leakage(lit(table, z, where, u_volt=4e-4), reject=True)
        assert [k for k, row in enumerate(found.rows) if row[-1] == "rejected"] == [11]
        assert found.value("leakage_amplitude_volt") == pytest.approx(0.031, abs=5e-4)


def test_a_short_arc_is_a_failed_decision_with_a_large_u(table):
    rng = np.random.default_rng(9)
    angle = np.linspace(0.0, 0.8, 30)
    z = TRUE + 2.0 * np.exp(1j * angle) + 1e-4 * noise(rng, 30)
    found = leakage_lit.calibrate_lit_leakage(lit(table, z, u_volt=1e-4))
    assert found.decisions[0].passed is False
    assert found.u("leakage_amplitude_volt") > 3e-4
    with pytest.raises(EstimationError):
        leakage_lit.calibrate_lit_leakage(lit(table, z[:3], u_volt=1e-4))


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("known", [True, False])
def test_lit_leakage_scatters_as_claimed(table, scatters_as_claimed, known, runs):
    rng, values, covariances = np.random.default_rng(10), [], []
    for _ in range(runs):
        distance, z = rail(rng, m=24)
        found = leakage_lit.calibrate_lit_leakage(lit(table, z, distance if known else None, u_volt=4e-4))
        values.append([q.value for q in found.quantities])
        covariances.append(found.covariance)
    scatters_as_claimed(values, covariances, POLAR)


def test_few_sessions_are_reported_as_insufficient(table):
    rng = np.random.default_rng(3)
    for count, passed in ((2, False), (6, True)):
        z = TRUE + 3e-4 * noise(rng, 4 * count)
        decision = leakage.calibrate_leakage(blocked(table, z, np.arange(4 * count) // 4)).decisions[0]
        assert (decision.name, decision.passed) == ("sessions", passed)


def test_zero_scatter_between_sessions_is_not_taken_as_exact(table):
    """Buffers alone would have 2 (24 - 1) degrees of freedom; six sessions that might differ have fewer."""
    rng = np.random.default_rng(11)
    while True:
        z = TRUE + 3e-4 * noise(rng, 24)
        found = leakage.calibrate_leakage(blocked(table, z, np.arange(24) // 4))
        if any("between sessions: 0 mV" in note for note in found.notes):
            break
    known = leakage.calibrate_leakage(blocked(table, z, np.arange(24) // 4, u_session_volt=1e-12))
    assert found.quantities[0].coverage > 1.05 * known.quantities[0].coverage
