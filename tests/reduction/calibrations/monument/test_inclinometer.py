"""Inclinometer: tilts of a plate built of vectors come back with every sign, on a table and on a pier; scatter."""

import numpy as np
import pytest

from calibration_scene import RUNS
from catseye.errors import EstimationError, InputError, ValidityError
from catseye.reduction.calibrations.monument.inclinometer import LAYOUT, Inclinometer, calibrate_inclinometer
from monument_scene import ARCSECOND

ZERO, SCALE, TURNED = np.array([0.02, -0.05]), np.array([210.0, -195.0]), np.radians([0.4, -0.7])


def plate(p, q):
    """(3, 3) axes x, y, z of a plate whose x rises by p above the horizon and y by q, rad."""
    x = np.array([np.cos(p), 0.0, np.sin(p)])
    y_up = np.sin(q)
    # y is square to x and of length one: its first component follows from the two rises.
    first = -np.tan(p) * y_up
    y = np.array([first, np.sqrt(1.0 - first**2 - y_up**2), y_up])
    return np.column_stack([x, y, np.cross(x, y)])


def shown(tilts, azimuth=0.0, *, cubic=(0.0, 0.0), warmth=(0.0, 0.0), warm=0.0, scale=SCALE):
    """Readings (m, 2), V, of axes that lie in the plate; azimuth rad clockwise seen from above, warm °C over 20."""
    tilts, azimuth = np.atleast_2d(tilts), np.broadcast_to(azimuth, len(np.atleast_2d(tilts)))
    warm = np.broadcast_to(warm, len(tilts))
    volts = np.zeros((len(tilts), 2))
    for row, ((p, q), a, over) in enumerate(zip(tilts, azimuth, warm, strict=True)):
        axes = plate(p, q)
        for k in range(2):
            angle = -(a + TURNED[k]) + k * np.pi / 2  # counter-clockwise from the plate's x
            rise = np.arcsin((np.cos(angle) * axes[:, 0] + np.sin(angle) * axes[:, 1])[2])
            volts[row, k] = ZERO[k] + warmth[k] * over + scale[k] * (rise + cubic[k] * rise**3)
    return volts


def numbers(volts, tilts=None, azimuth=None, **more):
    made = {"x_volt": volts[:, 0], "y_volt": volts[:, 1], **more}
    if tilts is not None:
        made |= {"tilt_x_arcsec": tilts[:, 0] / ARCSECOND, "tilt_y_arcsec": tilts[:, 1] / ARCSECOND}
    if azimuth is not None:
        made["azimuth_deg"] = np.degrees(azimuth)
    return made


STEPS = np.array([-900.0, -450.0, 0.0, 450.0, 900.0]) * ARCSECOND
GRID = np.array([(p, q) for p in STEPS for q in STEPS])


def test_a_tilt_table_gives_every_constant_with_its_sign(table):
    warm = np.random.default_rng(1).uniform(-5, 8, 25)
    volts = shown(GRID, cubic=(40.0, -25.0), warmth=(1e-4, -2e-4), warm=warm)
    sheet = {"u_volt": 1e-5, "cubic": True, "temperature_coefficient": True}
    made = numbers(volts, GRID, temperature_c=20 + warm)
    c = calibrate_inclinometer(table(LAYOUT, made, **sheet))
    for k, axis in enumerate("xy"):
        assert c.value(f"zero_{axis}_volt") == pytest.approx(ZERO[k], abs=1e-6)
        assert c.value(f"scale_{axis}_volt_per_rad") == pytest.approx(SCALE[k], rel=1e-5)
        assert c.value(f"misalignment_{axis}_arcsec") == pytest.approx(TURNED[k] / ARCSECOND, abs=0.5)
        # That the tilts of a plate are sines and not vectors is part of the bend: 1/rad² at most.
        assert c.value(f"cubic_{axis}_per_rad2") == pytest.approx((40.0, -25.0)[k], abs=2.0)
        assert c.value(f"warmth_{axis}_volt_per_c") == pytest.approx((1e-4, -2e-4)[k], abs=1e-8)


def test_the_model_s_inverse_gives_the_tilts_back():
    model = Inclinometer(ZERO, SCALE, TURNED, np.array([40.0, -25.0]), np.array([1e-4, -2e-4]))
    volts = shown(GRID, 0.8, cubic=(40.0, -25.0), warmth=(1e-4, -2e-4), warm=7.0)
    np.testing.assert_allclose(model.volts(GRID, 0.8, 27.0), volts, atol=2e-5)  # sines against vectors, third order
    np.testing.assert_allclose(model.tilts(model.volts(GRID, 0.8, 27.0), 0.8, 27.0), GRID, atol=1e-14)
    bent = Inclinometer(ZERO, SCALE, TURNED, np.array([-100.0, 0.0]), np.zeros(2))
    with pytest.raises(ValidityError, match="bends the readings back"):
        bent.tilts([20.0, 0.0])


def test_turning_the_case_separates_the_tables_tilt_and_the_zeros(table):
    own = np.array([70.0, -40.0]) * ARCSECOND
    azimuth = np.repeat([0.0, np.pi], 25)
    tilts = np.tile(GRID, (2, 1))
    made = numbers(shown(tilts + own, azimuth), tilts, azimuth)
    c = calibrate_inclinometer(table(LAYOUT, made, u_volt=1e-5, table_tilt=True))
    assert c.value("table_tilt_x_arcsec") == pytest.approx(70.0, abs=0.02)
    assert c.value("table_tilt_y_arcsec") == pytest.approx(-40.0, abs=0.02)
    assert c.value("zero_x_volt") == pytest.approx(ZERO[0], abs=1e-5)
    alone = calibrate_inclinometer(table(LAYOUT, numbers(shown(GRID + own), GRID), u_volt=1e-5))
    assert alone.value("zero_x_volt") == pytest.approx(ZERO[0] + SCALE[0] * own[0], abs=2e-3)


def test_a_pier_gives_zeros_its_tilt_and_how_square_the_axes_are(table):
    azimuth = np.arange(12) * np.pi / 6
    own = np.tile(np.array([250.0, 120.0]) * ARCSECOND, (12, 1))
    sheet = {"scale_x_volt_per_rad": 210.0, "scale_y_volt_per_rad": -195.0, "u_scale_percent": 1.0}
    sheet |= {"u_case_arcsec": 3600.0, "table_tilt": True, "u_volt": 1e-5}
    c = calibrate_inclinometer(table(LAYOUT, numbers(shown(own, azimuth), azimuth=azimuth), **sheet))
    np.testing.assert_allclose([c.value(f"zero_{k}_volt") for k in "xy"], ZERO, atol=2e-5)
    square = (TURNED[1] - TURNED[0]) / ARCSECOND
    assert c.value("misalignment_y_arcsec") == pytest.approx(square, abs=5.0)
    # The tilt turns with the case's mark, which nothing on a pier shows: within its u.
    tilt = np.array([c.value("table_tilt_x_arcsec"), c.value("table_tilt_y_arcsec")])
    assert np.hypot(*tilt) == pytest.approx(np.hypot(250, 120), rel=1e-3)
    assert c.u("table_tilt_x_arcsec") > 120 * np.radians(1.0) * 0.9
    assert np.all(np.abs(tilt - [250, 120]) < 2 * np.array([c.u("table_tilt_x_arcsec"), c.u("table_tilt_y_arcsec")]))


@pytest.mark.parametrize("runs", RUNS)
def test_the_constants_scatter_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(41), [], []
    sheet = {"u_volt": 3e-4, "u_tilt_arcsec": 0.4, "u_tilt_percent": 0.05}
    truth = [*ZERO, *SCALE, *(TURNED / ARCSECOND)]
    for _ in range(runs):
        real = GRID * (1 + 5e-4 * rng.standard_normal()) + 0.4 * ARCSECOND * rng.standard_normal(GRID.shape)
        volts = shown(real) + 3e-4 * rng.standard_normal(GRID.shape)
        c = calibrate_inclinometer(table(LAYOUT, numbers(volts, GRID), **sheet))
        values.append([q.value for q in c.quantities])
        covariances.append(c.covariance)
    scatters_as_claimed(values, np.array(covariances), truth)


@pytest.mark.parametrize("runs", RUNS)
def test_a_pier_s_results_scatter_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(42), [], []
    azimuth, own = np.arange(12) * np.pi / 6, np.array([250.0, 120.0]) * ARCSECOND
    sheet = {"scale_x_volt_per_rad": 210.0, "scale_y_volt_per_rad": -195.0, "u_scale_percent": 1.0}
    sheet |= {"u_case_arcsec": 900.0, "table_tilt": True, "u_volt": 3e-4}
    for _ in range(runs):
        mark = TURNED[0] + 900 * ARCSECOND * rng.standard_normal()  # of the case, so that axis x lies on it but for u
        volts = shown(np.tile(own, (12, 1)), azimuth - mark, scale=SCALE * (1 + 0.01 * rng.standard_normal(2)))
        volts = volts + 3e-4 * rng.standard_normal((12, 2))
        c = calibrate_inclinometer(table(LAYOUT, numbers(volts, azimuth=azimuth), **sheet))
        values.append([q.value for q in c.quantities])
        covariances.append(c.covariance)
    scatters_as_claimed(values, np.array(covariances), [*ZERO, (TURNED[1] - TURNED[0]) / ARCSECOND, 250.0, 120.0])


def test_a_wrong_reading_leaves_with_both_axes(table):
    volts = shown(GRID) + 3e-5 * np.random.default_rng(6).standard_normal(GRID.shape)
    volts[7, 1] += 0.02
    c = calibrate_inclinometer(table(LAYOUT, numbers(volts, GRID), u_volt=3e-5), reject=True)
    assert [k for k, s in enumerate(c.states) if s == "rejected"] == [7]


def test_insufficient_readings_are_refused(table):
    line = np.column_stack([STEPS, STEPS])
    with pytest.raises(EstimationError, match="in one direction"):
        calibrate_inclinometer(table(LAYOUT, numbers(shown(line), line), u_volt=1e-4))
    lone = numbers(shown(GRID), GRID)
    del lone["tilt_y_arcsec"]
    with pytest.raises(InputError, match="both columns"):
        calibrate_inclinometer(table(LAYOUT, lone))
    with pytest.raises(InputError, match="table_tilt"):
        calibrate_inclinometer(table(LAYOUT, numbers(shown(GRID))))
    with pytest.raises(InputError, match="scale_x_volt_per_rad is missing"):
        calibrate_inclinometer(table(LAYOUT, numbers(shown(GRID)), table_tilt=True))
    with pytest.raises(InputError, match="azimuth_deg"):
        calibrate_inclinometer(table(LAYOUT, numbers(shown(GRID), GRID), table_tilt=True))
    sheet = {"scale_x_volt_per_rad": 210.0, "scale_y_volt_per_rad": -195.0, "u_scale_percent": 1.0}
    with pytest.raises(EstimationError, match="too few azimuths"):
        calibrate_inclinometer(
            table(LAYOUT, numbers(shown(GRID), azimuth=np.zeros(25)), table_tilt=True, u_case_arcsec=1.0, **sheet)
        )
