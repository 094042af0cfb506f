"""Plate levels: planted turns come back against the ground frame, reversal takes out zero and wedge, honest scatter."""

import numpy as np
import pytest

from calibration_scene import RUNS
from catseye.errors import EstimationError
from catseye.reduction.calibrations.monument.plate_levels import LAYOUT, calibrate_plate
from monument_scene import ARCSECOND, mount_axes, plumb_axes, slope

PLACE = np.array([29.5, 115.9, 0.15])  # 120 m out, to the north
AZIMUTH = np.radians(194.28)
ALPHA = np.array([-5.0, 30.0]) * ARCSECOND
SHEET = {
    **{f"{k}_mm": 1e3 * v for k, v in zip("xyz", PLACE, strict=True)},
    "azimuth_deg": 194.28,
    "u_deflection_arcsec": 0.0,
    "u_level_arcsec": 0.5,
    "u_scale_percent": 0.0,
    "u_wedge_arcsec": 0.0,
    "u_balls_arcsec": 0.0,
}
ROUND = np.array([0.0, 90.0, 180.0, 270.0] * 2)


def level(orientation, plate=0.0, *, alpha=ALPHA, deflection=(0.0, 0.0), zero=3.0, wedge=(0.0, 0.0)):
    """Readings of a level on the plate, arcseconds; orientations clockwise from x^ seen from above, degrees."""
    plumb, mount = plumb_axes(PLACE, *deflection), mount_axes(AZIMUTH, *alpha)
    turned, mark = np.radians(orientation), np.radians(np.broadcast_to(plate, np.shape(orientation)))
    tilts = [slope(np.cos(o) * mount[:, 0] + np.sin(o) * mount[:, 2], plumb) for o in turned]
    return zero + np.array(tilts) / ARCSECOND + wedge[0] * np.cos(turned - mark) + wedge[1] * np.sin(turned - mark)


def found(table, readings, orientation=ROUND, plate=None, **sheet):
    numbers = {"orientation_deg": orientation, "reading_arcsec": readings}
    if plate is not None:
        numbers["plate_deg"] = plate
    return calibrate_plate(table(LAYOUT, numbers, **{**SHEET, **sheet}))


def test_planted_turns_against_the_ground_frame_come_back(table):
    c = found(table, level(ROUND))
    assert c.record["alpha2_rad"] / ARCSECOND == pytest.approx(-5.0, abs=1e-3)
    assert c.record["alpha3_rad"] / ARCSECOND == pytest.approx(30.0, abs=1e-3)
    assert c.value("level_zero_arcsec") == pytest.approx(3.0, abs=1e-3)
    assert c.u("alpha2_rad") / ARCSECOND == pytest.approx(0.5 / np.sqrt(4), rel=1e-6)  # half the readings see each axis


def test_the_notes_zy3_reads_minus_five_and_plus_thirty_on_its_level(table):
    # -05" about z^: x^ is 5" low; +30" about x^: z^ (the v-block) is 30" low. On the plumb line itself: at the origin.
    plumb = {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0}
    turned = np.radians(ROUND)
    c = found(table, -5.0 * np.cos(turned) - 30.0 * np.sin(turned), azimuth_deg=122 + 11 / 60 + 50 / 3600, **plumb)
    assert c.record["alpha2_rad"] == pytest.approx(-5 * ARCSECOND, abs=1e-9)  # eq. 2.29
    assert c.record["alpha3_rad"] == pytest.approx(30 * ARCSECOND, abs=1e-9)  # eq. 2.30


def test_a_mount_level_by_the_plumb_line_has_the_curvature_in_its_turn(table):
    # 119.6 m from the origin, pointing at it: alpha3 = -r/R. The azimuth misses the pintle by half a degree.
    c = found(table, np.zeros(8))
    assert c.record["alpha3_rad"] == pytest.approx(-119.6 / 6.37e6, rel=3e-3)
    assert abs(c.record["alpha2_rad"]) < 0.02 * abs(c.record["alpha3_rad"])
    south = found(table, np.zeros(8), y_mm=-115_900.0, x_mm=0.0)  # turned away from the pintle
    assert south.record["alpha3_rad"] > 0.0


def test_the_deflection_counts_where_z_is_the_normal_and_not_where_it_is_the_plumb_line(table):
    reading = level(ROUND, deflection=(6 * ARCSECOND, -4 * ARCSECOND))
    c = found(table, reading, xi_arcsec=6.0, eta_arcsec=-4.0)
    np.testing.assert_allclose([c.record["alpha2_rad"], c.record["alpha3_rad"]], ALPHA, atol=2e-9)
    vague = found(table, reading, xi_arcsec=6.0, eta_arcsec=-4.0, u_deflection_arcsec=1.0)
    assert vague.u("alpha3_rad") / ARCSECOND == pytest.approx(np.hypot(0.25, 1.0), rel=1e-3)
    plumb = found(table, level(ROUND), u_deflection_arcsec=1.0, z_is_plumb=True)
    assert plumb.u("alpha3_rad") / ARCSECOND == pytest.approx(0.25, rel=1e-3)


def test_turning_the_plate_takes_out_its_wedge_and_not_turning_it_costs_its_u(table):
    wedge = (12.0, -7.0)
    plate = np.array([0.0] * 4 + [180.0] * 4)
    turned = found(table, level(ROUND, plate, wedge=wedge), plate=plate, u_wedge_arcsec=20.0)
    np.testing.assert_allclose([turned.record["alpha2_rad"], turned.record["alpha3_rad"]], ALPHA, atol=1e-2 * ARCSECOND)
    thirds = np.repeat([0.0, 120.0, 240.0], 4)
    around = np.tile([0.0, 90.0, 180.0, 270.0], 3)  # the mark's sense of turning counts
    third = found(table, level(around, thirds, wedge=wedge), around, thirds, u_wedge_arcsec=20.0)
    np.testing.assert_allclose([third.record["alpha2_rad"], third.record["alpha3_rad"]], ALPHA, atol=1e-2 * ARCSECOND)
    assert third.variance_factor < 0.01  # no noise was added: all of the wedge is found
    kept = found(table, level(ROUND, 0.0, wedge=wedge), u_wedge_arcsec=20.0)
    assert kept.u("alpha2_rad") / ARCSECOND == pytest.approx(20.0, rel=1e-3)
    assert kept.record["alpha2_rad"] / ARCSECOND == pytest.approx(-5.0 + 12.0, abs=1e-2)
    balls = found(table, level(ROUND, plate, wedge=wedge), plate=plate, u_wedge_arcsec=20.0, u_balls_arcsec=2.0)
    assert balls.u("alpha3_rad") / ARCSECOND == pytest.approx(2.0, rel=0.02)  # no turning of the plate shows them


def test_the_scale_of_the_level_matters_by_the_tilt_only(table):
    c = found(table, level(ROUND, alpha=np.array([0.0, 600.0]) * ARCSECOND), u_scale_percent=1.0)
    assert c.u("alpha3_rad") / ARCSECOND == pytest.approx(6.0, rel=0.02)
    assert c.u("alpha2_rad") / ARCSECOND == pytest.approx(0.25, rel=0.02)


@pytest.mark.parametrize("runs", RUNS)
def test_the_turns_scatter_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(31), [], []
    u = {"u_wedge_arcsec": 1.5, "u_balls_arcsec": 1.0, "u_deflection_arcsec": 0.8, "u_scale_percent": 2.0}
    plate = np.array([0.0] * 4 + [180.0] * 4)
    for _ in range(runs):
        reading = level(
            ROUND,
            plate,
            alpha=ALPHA + 1.0 * ARCSECOND * rng.standard_normal(2) * [1, -1],
            deflection=0.8 * ARCSECOND * rng.standard_normal(2),
            wedge=1.5 * rng.standard_normal(2),
        )
        # Unequal balls tilt the plate in the mount's axes, which the planted turns above have done; scale and noise.
        reading = 3.0 + (reading - 3.0) * (1.0 + 0.02 * rng.standard_normal()) + 0.5 * rng.standard_normal(8)
        c = found(table, reading, plate=plate, **u)
        values.append([c.record["alpha2_rad"] / ARCSECOND, c.record["alpha3_rad"] / ARCSECOND])
        covariances.append(c.covariance[:2, :2] / ARCSECOND**2)
    scatters_as_claimed(values, np.array(covariances), ALPHA / ARCSECOND)


def test_scatter_is_found_where_it_is_not_claimed_and_one_direction_is_refused(table):
    rng = np.random.default_rng(5)
    c = found(table, level(ROUND) + 0.5 * rng.standard_normal(8), u_level_arcsec=None)
    assert 0.1 < c.u("alpha2_rad") / ARCSECOND < 0.6
    assert c.quantities[0].coverage > 2.0
    with pytest.raises(EstimationError):
        found(table, level(np.array([0.0, 180.0, 0.0])), np.array([0.0, 180.0, 0.0]))
