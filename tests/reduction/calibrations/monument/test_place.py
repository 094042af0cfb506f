"""Monument place: a table of `catseye adjust` to every line of the monument's report, with covariance."""

import csv
import io

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.readings import read_readings
from catseye.reduction.calibrations.monument.place import LAYOUT, RECIPE, measure_place, monument_place
from monument_scene import HEIGHT, topocentric

COVARIANCE = np.array([[4.0, 1.0, -0.5], [1.0, 9.0, 2.0], [-0.5, 2.0, 1.0]])  # mm²
WHERE = np.array([[119.2, -13.1, 0.4], [-60.0, 103.5, 1.0]])


def survey(coordinates, names=("ZY104", "ZY110")):
    numbers = {f"{k}_m": coordinates[:, j] for j, k in enumerate("xyz")}
    for a, b in ("xx", "xy", "xz", "yy", "yz", "zz"):
        numbers[f"cov_{a}{b}_mm2"] = np.full(len(coordinates), COVARIANCE["xyz".index(a), "xyz".index(b)])
    return numbers, {"point": tuple(names)}


SHEET = {"point": "ZY104", "origin_elevation_m": 806.42, "geoid_height_m": -31.0, "u_deflection_arcsec": 1.0}


def test_ground_coordinates_give_the_report(table):
    c = measure_place(table(LAYOUT, *survey(WHERE), **SHEET, system="ground"))
    np.testing.assert_allclose([c.value(f"{k}_mm") for k in "xyz"], WHERE[0] * 1e3, atol=1e-9)
    np.testing.assert_allclose(c.covariance[:3, :3], COVARIANCE, rtol=1e-6)
    longitude, latitude, height = topocentric().transform(*WHERE[0], direction="INVERSE")
    assert c.value("latitude_deg") == pytest.approx(latitude, abs=1e-12)
    assert c.value("longitude_deg") == pytest.approx(longitude, abs=1e-12)
    assert c.value("elevation_m") == pytest.approx(height + 31.0, abs=1e-7)
    assert c.value("elevation_m") - 806.42 - 0.4 == pytest.approx(119.9**2 / 2 / 6.37e6, abs=2e-5)  # the curvature
    assert c.u("latitude_deg") * 111_000e3 == pytest.approx(3.0, rel=2e-3)  # u of y, 3 mm
    # Easting turns with the convergence: its u is that of a line 0.717° clockwise of north's east.
    turn = np.radians(0.7167)
    along = np.array([np.cos(turn), -np.sin(turn), 0.0])
    assert c.u("wv_x_m") * 1e3 == pytest.approx(np.sqrt(along @ COVARIANCE @ along), rel=1e-3)
    assert set(c.record) >= {"latitude_deg", "longitude_deg", "elevation_m", "wv_x_m", "wv_y_m", "wv_z_m", "u_x_mm"}
    assert c.record["wv_z_m"] == c.record["elevation_m"]


def test_state_plane_coordinates_give_the_same_place(table):
    ground = measure_place(table(LAYOUT, *survey(WHERE), **SHEET, system="ground"))
    plane = np.array([[ground.record[k] for k in ("wv_x_m", "wv_y_m", "wv_z_m")], [7.0e5, 1.6e5, 800.0]])
    deflected = {**SHEET, "xi_arcsec": 0.0}
    c = measure_place(table(LAYOUT, *survey(plane), **deflected, system="state-plane"))
    np.testing.assert_allclose([c.value(f"{k}_mm") for k in "xyz"], WHERE[0] * 1e3, atol=1e-4)
    # Scale and convergence in the covariance: eastings grow by 1/0.999814 on the ground, axes turn by 0.717°.
    turn, scale = np.radians(0.7181), 1 / (0.999935 * 0.999878)
    axes = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]) * [scale, scale, 1]
    tilted = np.diag([0.0, 0.0, (119.2e3**2 + 13.1e3**2) * (np.pi / 648_000) ** 2])  # 1" of deflection, the height's
    np.testing.assert_allclose(c.covariance[:3, :3], axes @ COVARIANCE @ axes.T + tilted, atol=3e-3)
    # From the ground frame the same tilt is in the elevation, where z is given.
    assert ground.u("elevation_m") * 1e3 == pytest.approx(np.sqrt(1.0 + tilted[2, 2]), rel=1e-3)
    off = measure_place(
        table(LAYOUT, *survey(plane), **{**SHEET, "xi_arcsec": 0.0, "eta_arcsec": 2.0}, system="state-plane")
    )
    # The geoid falls to the east by eta: the mark lies lower against the frame.
    assert off.value("z_mm") - c.value("z_mm") == pytest.approx(-119.2e3 * 2 * np.pi / 648_000, abs=0.01)


def test_the_table_of_an_adjustment_is_read_as_it_stands(tmp_path):
    numbers, words = survey(WHERE)
    text = io.StringIO()
    names = ["point", *numbers, "u_x_mm", "u_y_mm", "u_z_mm", "semi_axis_1_mm", "semi_axis_2_mm", "semi_axis_3_mm"]
    rows = csv.writer(text)
    rows.writerow([*names, "fixed", "datum", "observations"])
    for k in range(2):
        rows.writerow([words["point"][k], *(v[k] for v in numbers.values()), 2, 3, 1, 3.1, 2, 0.5, "", "x y", 12])
    (tmp_path / "coordinates.csv").write_text(text.getvalue())
    sheet = ['kind = "monument-place"', 'instrument = "ZY104"', 'serial = "4"', "measured_on = 2026-09-01"]
    sheet += ["valid_until = 2027-09-01", 'by = "a"', 'report = "r"', 'point = "ZY104"', 'system = "ground"']
    sheet += ["origin_elevation_m = 806.42", "geoid_height_m = -31.0", "u_deflection_arcsec = 1.0"]
    (tmp_path / "zy104.toml").write_text("\n".join(sheet))
    c = RECIPE.recipe(read_readings(tmp_path / "coordinates.csv", LAYOUT, tmp_path / "zy104.toml"), False)
    assert c.record["x_mm"] == pytest.approx(119_200.0)
    longitude, latitude, _ = topocentric().transform(*WHERE[0], direction="INVERSE")
    assert (c.record["latitude_deg"], c.record["longitude_deg"]) == pytest.approx((latitude, longitude), abs=1e-12)


def test_propagation_agrees_with_drawn_places(table):
    from catseye.geometry.frames.local_frame import PINTLE_LATITUDE, PINTLE_LONGITUDE, LocalFrame

    frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, 1e-5, -1e-5, -31.0)
    plane = frame.state_plane(WHERE[0])
    values, covariance = monument_place(frame, plane, COVARIANCE * 1e-6, system="state-plane")
    drawn = np.random.default_rng(7).multivariate_normal(plane, COVARIANCE * 1e-6, 20_000)
    points = frame.from_state_plane(drawn) * 1e3
    np.testing.assert_allclose(np.cov(points.T), covariance[:3, :3], atol=0.3)
    np.testing.assert_allclose(points.mean(axis=0), values[:3], atol=0.1)


def test_a_point_that_is_not_there_feet_and_bad_covariances_are_refused(table):
    with pytest.raises(InputError, match="is not there"):
        measure_place(table(LAYOUT, *survey(WHERE), **{**SHEET, "point": "ZY105"}, system="ground"))
    with pytest.raises(InputError, match="is there 2 times"):
        measure_place(table(LAYOUT, *survey(WHERE, ("ZY104", "ZY104")), **SHEET, system="ground"))
    with pytest.raises(InputError, match="US survey feet"):
        measure_place(
            table(LAYOUT, *survey(np.array([[2.3e6, 5.2e5, 2600.0]]), ("ZY104",)), **SHEET, system="state-plane")
        )
    numbers, words = survey(WHERE)
    numbers["cov_xx_mm2"] = np.array([-4.0, 4.0])
    with pytest.raises(InputError, match="not positive"):
        measure_place(table(LAYOUT, numbers, words, **SHEET, system="ground"))
    for pair in ("cov_xx_mm2", "cov_xy_mm2"):  # a small variance beside large ones
        numbers, words = survey(WHERE)
        numbers["cov_zz_mm2"] = np.array([1e8, 1.0])
        numbers["cov_xz_mm2"] = numbers["cov_yz_mm2"] = np.zeros(2)
        numbers[pair] = np.array([-4.0 if pair == "cov_xx_mm2" else 7.0, 1.0])
        with pytest.raises(InputError, match="not positive"):
            measure_place(table(LAYOUT, numbers, words, **SHEET, system="ground"))
    with pytest.raises(InputError, match="unknown"):
        monument_place(None, WHERE[0], COVARIANCE, system="feet")
