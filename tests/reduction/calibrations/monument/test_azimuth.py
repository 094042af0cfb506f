"""Monument azimuth: the notes' ZY3, every way to tie the circle, stars, leaning axes, refusals, and honest scatter."""

import numpy as np
import pytest

from calibration_scene import PROVENANCE, RUNS
from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.monument.azimuth import calibrate_azimuth
from catseye.reduction.calibrations.monument.azimuth_sheet import LAYOUT
from monument_scene import ARCSECOND, HEIGHT, LATITUDE, LONGITUDE, circle, mount_axes, plumb_axes, topocentric

PLACE = np.array([-85.3, -84.1, 2.4])
POINTS = {
    "ZY104": np.array([119.0, -12.0, 0.3]),
    "ZY107": np.array([3.0, 121.0, 1.2]),
    "TOWER": np.array([-10, 9, 44.0]),
}
OFFSET = np.array([0.012, 0.246, 0.031])
TRUE = np.radians(45.3)
SHEET = {
    "x_mm": PLACE[0] * 1e3,
    "y_mm": PLACE[1] * 1e3,
    "z_mm": PLACE[2] * 1e3,
    "instrument_dx_mm": OFFSET[0] * 1e3,
    "instrument_dy_mm": OFFSET[1] * 1e3,
    "instrument_dz_mm": OFFSET[2] * 1e3,
    "u_instrument_mm": 0.0,
    "u_deflection_arcsec": 0.0,
    "u_collimation_arcsec": 60.0,
    "u_trunnion_arcsec": 60.0,
    "u_lean_arcsec": 0.0,
    "u_direction_arcsec": 0.5,
}
M102 = {"name": "M102", "v_block_deg": 90.0, "u_v_block_arcsec": 0.0}


def points(u_mm=0.0):
    return [
        {
            "name": name,
            **{f"{k}_mm": 1e3 * v for k, v in zip("xyz", at, strict=True)},
            **{f"u_{k}_mm": u_mm for k in "xyz"},
        }
        for name, at in POINTS.items()
    ]


def seen(
    targets=("ZY104", "ZY107", "TOWER"),
    *,
    azimuth=TRUE,
    place=PLACE,
    at=POINTS,
    offset=OFFSET,
    deflection=(0.0, 0.0),
    errors=(0.0, 0.0),
    lean=(0.0, 0.0),
    zero=0.4,
):
    """Circle readings (rad) and faces, both faces of each target in turn; the circle reads `zero` towards z^.

    errors   collimation and trunnion axis, rad; lean of the vertical axis to x^ and z^
    """
    plumb, mount = plumb_axes(place, *deflection), mount_axes(azimuth)
    origin = place + mount @ offset
    to_z = circle(mount[:, 2], plumb)[0]
    top = plumb.T @ (lean[0] * mount[:, 0] + lean[1] * mount[:, 2])
    rows = []
    for name in targets:
        reading, zenith = circle(at[name] - origin, plumb, top[:2])
        side = errors[0] / np.sin(zenith) + errors[1] / np.tan(zenith)
        rows += [(name, reading - to_z + zero + side, "left"), (name, reading - to_z + zero - side + np.pi, "right")]
    return rows


def lab(names=("M102",), zero=0.4, v_block=np.pi / 2):
    return [row for name in names for row in ((name, zero - v_block, "left"), (name, zero - v_block + np.pi, "right"))]


@pytest.fixture
def readings(table):
    def made(field, before=(), after=(), noise=None, mjd=None, **sheet):
        rows = [*before, *field, *after]
        places = ["before"] * len(before) + ["field"] * len(field) + ["after"] * len(after)
        angle = np.array([r[1] for r in rows]) + (0.0 if noise is None else noise)
        numbers = {"direction_deg": np.degrees(np.mod(angle, 2 * np.pi))}
        if mjd is not None:
            numbers["mjd_utc"] = mjd
        words = {"target": tuple(r[0] for r in rows), "face": tuple(r[2] for r in rows), "place": tuple(places)}
        return table(LAYOUT, numbers, words, **{**SHEET, "point": points(), **sheet})

    return made


def off(found):
    """How far the azimuth is off the truth, arcseconds."""
    return (
        np.remainder(np.radians(found.value("azimuth_deg")) - TRUE + np.pi, 2 * np.pi) / ARCSECOND - np.pi / ARCSECOND
    )


def test_the_notes_zy3_carried_from_the_lab(table):
    # Section 2.5: zero set on monument 102 along x^, the v-block turned 90° 00' 00" ± 2" from it; ZBG4 is the origin.
    x_hat = 32 + 11 / 60 + 50 / 3600
    to_zbg4 = np.degrees(np.arctan2(-5.5862, -20.8500)) - x_hat
    direction = np.mod([0, 180, to_zbg4, to_zbg4 + 180, 0, 180], 360)
    words = {"target": ("M102",) * 2 + ("ZBG4",) * 2 + ("M102",) * 2, "face": ("left", "right") * 3}
    words["place"] = ("before",) * 2 + ("field",) * 2 + ("after",) * 2
    place = {"x_mm": 5586.2, "y_mm": 20850.0, "z_mm": -5.8, "instrument_dx_mm": 0.0, "instrument_dz_mm": 0.0}
    found = calibrate_azimuth(
        table(
            LAYOUT,
            {"direction_deg": direction},
            words,
            **{**SHEET, **place},
            reference=[{**M102, "u_v_block_arcsec": 2.0}],
            point=[{"name": "ZBG4", "x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0}],
            u_transport_arcsec=1.0,
        )
    )
    assert np.degrees(found.value("alpha1_rad")) == pytest.approx(57 + 48 / 60 + 10 / 3600, abs=1e-8)  # eq. 2.28
    assert found.value("azimuth_deg") == pytest.approx(122 + 11 / 60 + 50 / 3600, abs=1e-8)  # z^, not x^
    assert found.notes[0] == "x^ looks to the azimuth 32° 11' 50.0\", z^ to 122° 11' 50.0\""
    assert found.record["alpha1_rad"] == pytest.approx(1.008848, abs=1e-6)  # figure 2.6
    # 2" of the v-block, 1" of the transport shared and half of it left, 0.5" of both faces in lab and field.
    expected = np.sqrt(2**2 + 0.5**2 + 0.25 * 0.5 + 0.5 * 0.5**2)
    assert found.u("alpha1_rad") / ARCSECOND == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("way", ["plate", "lab", "v-block"])
def test_each_way_to_tie_the_circle_finds_the_same_azimuth(readings, way):
    if way == "plate":
        made = readings(seen(), plate_zero_deg=float(np.degrees(0.4)), u_plate_zero_arcsec=1.0)
    elif way == "lab":
        made = readings(seen(), lab(), lab(), reference=[M102], u_transport_arcsec=1.0)
    else:
        on_mount = {"name": "V", "v_block_deg": 0.0, "u_v_block_arcsec": 1.0}
        made = readings([*seen(), *lab(("V",), v_block=0.0)], reference=[on_mount])
    found = calibrate_azimuth(made)
    assert off(found) == pytest.approx(0.0, abs=1e-4)
    assert found.record["azimuth_deg"] == pytest.approx(45.3, abs=1e-7)
    assert found.value("alpha1_rad") == pytest.approx(np.pi - TRUE, abs=1e-9)


def test_both_faces_remove_collimation_and_trunnion_a_single_face_reports_their_u(readings):
    errors = (25 * ARCSECOND, -40 * ARCSECOND)
    plate = {"plate_zero_deg": float(np.degrees(0.4)), "u_plate_zero_arcsec": 0.0}
    both = calibrate_azimuth(readings(seen(errors=errors), **plate))
    assert off(both) == pytest.approx(0.0, abs=0.01)
    one = calibrate_azimuth(readings(seen(("ZY104",), errors=errors)[:1], **plate))
    assert one.u("alpha1_rad") / ARCSECOND == pytest.approx(60.0, rel=0.01)
    assert abs(off(one)) == pytest.approx(25.0, abs=0.5)


def test_a_closure_is_shared_by_time(readings):
    drift = 4 * ARCSECOND
    mjd = 61_280.0 + np.array([0, 0, 3, 3, 4, 4]) / 24
    field = [(n, r + 0.75 * drift, f) for n, r, f in seen(("ZY104",))]
    after = [(n, r + drift, f) for n, r, f in lab()]
    sheet = {"reference": [M102], "u_transport_arcsec": 50.0, "u_direction_arcsec": 0.01}
    found = calibrate_azimuth(readings(field, lab(), after, mjd=mjd, **sheet))
    assert off(found) == pytest.approx(0.0, abs=0.01)
    closure = found.decisions[0]
    assert closure.name.startswith("closure")
    assert closure.statistic == pytest.approx(4.0, abs=1e-3)
    # A walk pinned at both ends: u * sqrt(3/4 * 1/4) is left.
    assert found.u("alpha1_rad") / ARCSECOND == pytest.approx(50 * np.sqrt(0.75 * 0.25), rel=1e-3)
    strict = calibrate_azimuth(readings(field, lab(), after, mjd=mjd, **{**sheet, "u_transport_arcsec": 0.5}))
    assert strict.decisions[0].passed is False


def test_a_closure_between_two_references_has_the_u_of_their_directions(readings):
    other = {"name": "M105", "v_block_deg": 90.0, "u_v_block_arcsec": 3.0}
    after = [("M105", r, f) for _, r, f in lab()]
    sheet = {"reference": [{**M102, "u_v_block_arcsec": 4.0}, other], "u_transport_arcsec": 12.0}
    found = calibrate_azimuth(readings(seen(("ZY104",)), lab(), after, **sheet, u_direction_arcsec=0.01))
    assert found.decisions[0].limit == pytest.approx(3.0 * 13.0, rel=1e-3)


def test_a_leaning_axis_is_corrected_and_its_sign_is_right(readings):
    plate = {"plate_zero_deg": float(np.degrees(0.4)), "u_plate_zero_arcsec": 0.0}
    lean = (20 * ARCSECOND, -30 * ARCSECOND)
    field = seen(("TOWER",), lean=lean)
    found = calibrate_azimuth(readings(field, **plate, lean_x_arcsec=20.0, lean_z_arcsec=-30.0))
    without = calibrate_azimuth(readings(field, **plate))
    wrong = calibrate_azimuth(readings(field, **plate, lean_x_arcsec=-20.0, lean_z_arcsec=30.0))
    assert off(found) == pytest.approx(0.0, abs=0.01)
    assert abs(off(without)) > 3.0
    assert off(wrong) == pytest.approx(2 * off(without), rel=0.01)
    vague = calibrate_azimuth(readings(field, **plate, u_lean_arcsec=10.0))
    assert vague.u("alpha1_rad") / ARCSECOND > 2.0


def polaris(mjd, deflection=(0.0, 0.0), ut1=0.0):
    """Reading of Polaris on a circle that reads 0.4 towards z^, by astropy."""
    from astropy import units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    plumb, mount = plumb_axes(PLACE, *deflection), mount_axes(TRUE)
    longitude, latitude, height = topocentric().transform(*PLACE, direction="INVERSE")
    place = EarthLocation.from_geodetic(
        longitude + np.degrees(deflection[1] / np.cos(np.radians(latitude))),
        latitude + np.degrees(deflection[0]),
        height,
        ellipsoid="GRS80",
    )
    when = Time(mjd, format="mjd", scale="utc")
    when.delta_ut1_utc = ut1
    sky = SkyCoord(
        (2 + 31 / 60 + 49.09456 / 3600) * 15 * u.deg,
        (89 + 15 / 60 + 50.7923 / 3600) * u.deg,
        distance=1000 / 7.54 * u.pc,
        pm_ra_cosdec=44.48 * u.mas / u.yr,
        pm_dec=-11.85 * u.mas / u.yr,
        radial_velocity=-16.42 * u.km / u.s,
        obstime=Time(2000.0, format="jyear", scale="tdb"),
    ).apply_space_motion(when)
    azimuth = sky.transform_to(AltAz(obstime=when, location=place)).az.rad
    return azimuth - circle(mount[:, 2], plumb)[0] + 0.4


def test_polaris_gives_the_frame_s_north_not_the_star_s():
    from astropy.utils import iers

    with iers.conf.set_temp("auto_download", False), iers.earth_orientation_table.set(iers.IERS_B.open()):
        mjd = 57_204.9
        deflection = (4 * ARCSECOND, -9 * ARCSECOND)
        pole = [float(v.to_value("arcsec")) for v in iers.IERS_B.open().pm_xy(2_400_000.5, mjd)]
        reading = polaris(mjd, deflection, ut1=-0.31)
    from catseye.records.files.readings import SheetReadings

    keys = {**SHEET, "xi_arcsec": 4.0, "eta_arcsec": -9.0, "ut1_utc_s": -0.31, "u_ut1_utc_s": 0.0}
    keys |= {"pole_x_arcsec": pole[0], "pole_y_arcsec": pole[1], "u_pole_arcsec": 0.0}
    keys |= {"plate_zero_deg": float(np.degrees(0.4)), "u_plate_zero_arcsec": 0.0}

    def found(**sheet):
        return calibrate_azimuth(
            SheetReadings(
                file="t.csv",
                sheet=LAYOUT.sheet.model_validate({"kind": LAYOUT.kind, **PROVENANCE, **keys, **sheet}),
                sheet_file="t.toml",
                numbers={"direction_deg": np.degrees([reading, reading + np.pi]), "mjd_utc": np.array([mjd, mjd])},
                words={"target": ("Polaris",) * 2, "face": ("left", "right")},
                where=("line 2", "line 3"),
                left_out=("", ""),
            )
        )

    assert off(found()) == pytest.approx(0.0, abs=0.02)
    # Laplace: what the deflection to the east is wrong by turns north by tan(phi) of it.
    assert off(found(eta_arcsec=0.0)) == pytest.approx(-9 * np.tan(np.radians(LATITUDE)), abs=0.15)
    vague = found(u_deflection_arcsec=1.0, u_direction_arcsec=0.01)
    assert vague.u("alpha1_rad") / ARCSECOND == pytest.approx(np.tan(np.radians(LATITUDE)), abs=0.03)
    assert 0.0 < found(u_ut1_utc_s=0.52, u_direction_arcsec=0.01).u("alpha1_rad") / ARCSECOND < 0.12
    assert 0.25 < found(u_pole_arcsec=0.3, u_direction_arcsec=0.01).u("alpha1_rad") / ARCSECOND < 0.45
    assert HEIGHT > 0.0 > LONGITUDE


def test_pole_and_time_are_in_the_u_unless_the_sheet_has_them(readings):
    plain = calibrate_azimuth(
        readings(
            [("Polaris", 1.0, "left"), ("Polaris", 1.0 + np.pi, "right")],
            mjd=np.array([61_280.2, 61_280.2]),
            plate_zero_deg=0.0,
            u_plate_zero_arcsec=0.0,
        )
    )
    assert plain.u("alpha1_rad") / ARCSECOND == pytest.approx(
        np.sqrt(0.5 * 0.5**2 + (0.3 / np.cos(0.67)) ** 2), abs=0.06
    )


@pytest.mark.parametrize("runs", RUNS)
def test_the_azimuth_scatters_as_claimed(readings, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(21), [], []
    u = {"noise": 0.7, "v": 1.0, "transport": 1.5, "lean": 3.0, "deflection": 1.5, "offset": 5e-4, "point": 4e-4}
    sheet = {
        "reference": [{**M102, "u_v_block_arcsec": u["v"]}],
        "point": points(0.4),
        **{f"u_{k}_mm": 0.4 for k in "xyz"},
        "u_transport_arcsec": u["transport"],
        "u_direction_arcsec": u["noise"],
        "u_lean_arcsec": u["lean"],
        "u_deflection_arcsec": u["deflection"],
        "u_instrument_mm": 0.5,
        "u_collimation_arcsec": 20.0,
        "u_trunnion_arcsec": 20.0,
    }
    for _ in range(runs):
        walk = u["transport"] * np.cumsum(rng.standard_normal(2)) * np.sqrt(0.5) * ARCSECOND
        v_block = np.pi / 2 + u["v"] * ARCSECOND * rng.standard_normal()
        field = seen(
            place=PLACE + u["point"] * rng.standard_normal(3),
            at={name: at + u["point"] * rng.standard_normal(3) for name, at in POINTS.items()},
            offset=OFFSET + u["offset"] * rng.standard_normal(3),
            deflection=u["deflection"] * ARCSECOND * rng.standard_normal(2),
            errors=20 * ARCSECOND * rng.standard_normal(2),
            lean=u["lean"] * ARCSECOND * rng.standard_normal(2),
            zero=0.4 + walk[0],
        )
        noise = u["noise"] * ARCSECOND * rng.standard_normal(len(field) + 4)
        made = readings(field, lab(v_block=v_block), lab(zero=0.4 + walk[1], v_block=v_block), noise, **sheet)
        found = calibrate_azimuth(made)
        values.append([off(found)])
        covariances.append([[(found.u("alpha1_rad") / ARCSECOND) ** 2]])
    scatters_as_claimed(values, np.array(covariances), [0.0])


def test_a_full_covariance_counts_as_such(readings):
    plate = {"plate_zero_deg": float(np.degrees(0.4)), "u_plate_zero_arcsec": 0.0, "u_direction_arcsec": 0.01}
    field = seen(("ZY104",))
    lone = calibrate_azimuth(readings(field, **plate, point=points(1.0), **{f"u_{k}_mm": 1.0 for k in "xyz"}))
    length = np.linalg.norm((POINTS["ZY104"] - PLACE)[:2])
    assert lone.u("alpha1_rad") == pytest.approx(np.sqrt(2) * 1e-3 / length, rel=0.02)
    # All points move as one: directions do not change.
    together = np.kron(np.ones((4, 4)), np.eye(3)).tolist()
    moved = calibrate_azimuth(readings(field, **plate, covariance_mm2=together))
    assert moved.u("alpha1_rad") < 0.02 * lone.u("alpha1_rad")
    with pytest.raises(ValueError, match="not 12 by 12"):
        readings(field, **plate, covariance_mm2=[[1.0]])
    with pytest.raises(ValueError, match="not positive"):
        readings(field, **plate, covariance_mm2=(-np.eye(12)).tolist())


def test_a_wrong_target_is_rejected_on_request(readings):
    plate = {"plate_zero_deg": float(np.degrees(0.4)), "u_plate_zero_arcsec": 0.5}
    field = seen() * 2
    field[4] = (field[4][0], field[4][1] + 20 * ARCSECOND, field[4][2])
    made = readings(field, **plate, u_lean_arcsec=0.0)
    assert calibrate_azimuth(made).states[4] == "suspect"
    kept = calibrate_azimuth(made, reject=True)
    assert [k for k, s in enumerate(kept.states) if s == "rejected"] == [4]
    assert off(kept) == pytest.approx(0.0, abs=0.01)


def test_inconsistent_input_is_refused(readings):
    plate = {"plate_zero_deg": 0.0, "u_plate_zero_arcsec": 0.0}
    with pytest.raises(InputError, match=r"line 2, target = 'ZZ' is not in t.toml"):
        calibrate_azimuth(readings([("ZZ", 0.0, "left")], **plate))
    with pytest.raises(InputError, match="expected left or right"):
        calibrate_azimuth(readings([("ZY104", 0.0, "up")], **plate))
    with pytest.raises(InputError, match="nothing ties the circle"):
        calibrate_azimuth(readings(seen()))
    with pytest.raises(InputError, match="u_transport_arcsec is missing"):
        calibrate_azimuth(readings(seen(), lab(), reference=[M102]))
    with pytest.raises(InputError, match="no known point and no star"):
        calibrate_azimuth(readings([], lab(), reference=[M102], u_transport_arcsec=1.0))
    with pytest.raises(InputError, match="needed for the star Polaris"):
        calibrate_azimuth(readings([("Polaris", 0.0, "left")], **plate))
    with pytest.raises(InputError, match="expected a reference there"):
        calibrate_azimuth(readings(seen(), [("ZY104", 0.0, "left")], **plate, u_transport_arcsec=1.0))
    with pytest.raises(InputError, match="is there 2 times"):
        calibrate_azimuth(readings(seen(), **plate, reference=[{**M102, "name": "ZY104"}]))
    mjd = 61_280.0 + np.array([0, 0, 9, 9, 4, 4]) / 24
    with pytest.raises(InputError, match="no time between"):
        calibrate_azimuth(readings(seen(("ZY104",)), lab(), lab(), mjd=mjd, reference=[M102], u_transport_arcsec=1.0))
    with pytest.raises(EstimationError):
        calibrate_azimuth(readings(seen(("ZY104",))[:1], **plate, u_direction_arcsec=None))
