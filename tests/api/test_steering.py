"""`point` and `track` in Python: files or records, times as text, and arguments that do not fit refused by name."""

import tomllib

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError
from repository import ROOT

RECORDS = ROOT / "examples/night-01/monuments/ZY103.toml", ROOT / "examples/night-01/mirrors/ZP103.toml"
TO = [0.0, 0.0, 50.0]
PLACE = {"latitude_deg": 38.4, "longitude_deg": -79.84}


def test_a_time_is_a_text_or_an_mjd():
    text = catseye.point(*RECORDS, TO, at_mjd="2003-09-10T12:00:00Z", **PLACE)
    number = catseye.point(*RECORDS, TO, at_mjd=52892.5, **PLACE)
    assert str(text.to_object()) == str(number.to_object())
    assert text.sightings[0].mjd == 52892.5


def test_the_sun_s_cone_is_that_of_the_argument():
    seen = catseye.point(*RECORDS, TO, at_mjd=52892.58, **PLACE).sightings[0]
    separation = float(np.degrees(seen.separation))
    to = catseye.point(*RECORDS, TO).pointings.to[0]
    assert separation > 60.0
    assert seen.sun.allowed
    scan_point = np.array([tomllib.loads(RECORDS[0].read_text())[f"{axis}_mm"] for axis in "xyz"]) * 1e-3
    e, a = seen.altitude + np.radians(20.0), seen.azimuth
    to = scan_point + 200.0 * np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])
    words = [
        catseye.point(*RECORDS, to, at_mjd=52892.58, sun_cone_deg=cone, **PLACE).sightings[0].sun.allowed
        for cone in (10.0, 30.0)
    ]
    assert words == [True, False]


def test_boxes_and_solids_are_files_or_records():
    files = {"keep_out": ROOT / "examples/keep-out.toml", "solids": ROOT / "examples/solids.toml"}
    records = {name: catseye.load(path) for name, path in files.items()}
    more = {"reflector": "prism", "facing": [0.0, 0.0, -1.0], "posture_deg": (145.3, 30.0)}
    found = [catseye.point(*RECORDS, [TO, [60.0, 40.0, 20.0]], **each, **more) for each in (files, records)]
    assert str(found[0].to_object()) == str(found[1].to_object())
    assert {path.name for path in found[0].read} == {"ZY103.toml", "ZP103.toml", "keep-out.toml", "solids.toml"}


def test_counts_are_saved_as_a_file_and_as_a_directory(tmp_path):
    found = catseye.point(*RECORDS, [TO, [60.0, 40.0, 20.0]])
    found.save_counts(tmp_path / "output.dat")
    rows = [line.split() for line in (tmp_path / "output.dat").read_text().splitlines() if not line.startswith("#")]
    assert [float(v) for v in rows[1][:3]] == [60_000.0, 40_000.0, 20_000.0]
    where = catseye.save(found, tmp_path / "out")
    assert (where / "counts.csv").read_text().count("\n") == 3


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"sun_cone_deg": 7.0}, {"sun_cone_deg", "at_mjd"}),
        ({"longitude_deg": 7.0}, {"longitude_deg", "at_mjd"}),
        ({"posture_deg": (1.0, 2.0)}, {"posture_deg", "solids"}),
        ({"at_mjd": "yesterday"}, {"at_mjd"}),
        ({"at_mjd": 52892.5, "sun_cone_deg": 0.1}, {"sun_cone_deg"}),
        ({"facing": (0.0, 0.0, 0.0)}, {"facing"}),
        ({"solids": ROOT / "examples/solids.toml", "posture_deg": (0.0, 96.0)}, {"posture_deg"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.point(*RECORDS, TO, **arguments)
    assert set(refused.value.names) == names


def test_a_ranger_of_a_site_is_that_of_its_two_records():
    records = catseye.point(*RECORDS, TO).to_object()[0]
    of_site = catseye.point(site="night-01", ranger="ZY103", to=TO).to_object()[0]
    assert of_site.pop("ranger") == "ZY103"
    assert str(of_site) == str(records)


def test_a_point_of_the_reflector_is_aimed_at_where_equation_2_44_has_it():
    a, e, vertex, local = np.radians(145.3), np.radians(30.0), [0.0, -54.839108, 4.999990], [2.0, 54.0, 12.2]
    turn = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    tip = np.array([[1.0, 0.0, 0.0], [0.0, np.sin(e), np.cos(e)], [0.0, -np.cos(e), np.sin(e)]])
    ground = turn @ (tip @ np.add(local, vertex) + [0.0, 0.0, 48.260])
    found = catseye.point(*RECORDS, local, frame="reflector", posture_deg=(145.3, 30.0))
    np.testing.assert_allclose(found.to[0], ground, atol=1e-12)
    np.testing.assert_allclose(found.counts, catseye.point(*RECORDS, ground).counts, atol=1e-7)
    said = found.to_object()[0]
    assert (said["frame"], said["in_frame"], said["posture"]["elevation"]) == ("reflector", local, pytest.approx(e))


def test_a_feed_arm_ranger_turns_with_the_telescope():
    """Counts for a point of the reflector are those of the notes' six transformations in the reflector's own axes."""
    arm = next(r for r in catseye.load("gbt").feedarm.ranger if r.name == "ZY115")
    mirror = catseye.load("gbt").mirror_of("ZY115")
    local = np.array([2.0, 54.0, 12.2])
    z = np.array(arm.mount_z) / np.linalg.norm(arm.mount_z)
    y = np.array(arm.mount_y) - z * np.dot(arm.mount_y, z)
    y /= np.linalg.norm(y)
    at = np.stack([np.cross(y, z), y, z]) @ (local - np.array(arm.nominal_scan_point_mm) * 1e-3)
    b1, b2 = mirror.beta1_rad, mirror.beta2_rad
    about_x = np.array([[1, 0, 0], [0, np.cos(b1), np.sin(b1)], [0, -np.sin(b1), np.cos(b1)]])
    about_y = np.array([[np.cos(b2), 0, -np.sin(b2)], [0, 1, 0], [np.sin(b2), 0, np.cos(b2)]])
    at = about_x @ about_y @ at
    theta, phi = np.arctan2(at[1], at[0]), np.arccos(at[2] / np.linalg.norm(at))
    counts = [1e5 / (2 * np.pi) * theta + mirror.na0, 1e5 / (4 * np.pi) * phi + mirror.ne0]
    for posture in ((145.3, 30.0), (12.0, 77.0)):
        found = catseye.point(site="gbt", ranger="ZY115", frame="reflector", to=local, posture_deg=posture)
        assert found.counts[0] == pytest.approx(counts, abs=1e-3)  # a count is 7 mm at 120 m
    still = catseye.point(site="gbt", ranger="ZY115", frame="reflector", to=local)
    assert still.posture == pytest.approx(np.radians([145.3, 30.0]))


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"site": "gbt"}, {"site", "ranger"}),
        ({"ranger": "ZY115"}, {"site", "ranger"}),
        ({"site": "gbt", "ranger": "ZY103", "mirror": RECORDS[1]}, {"mirror", "site", "ranger"}),
        ({"monument": RECORDS[0]}, {"monument", "mirror", "site", "ranger"}),
        ({"monument": RECORDS[0], "mirror": RECORDS[1], "frame": "reflector"}, {"posture_deg"}),
        ({"monument": RECORDS[0], "mirror": RECORDS[1], "frame": "dish"}, {"frame"}),
        ({"site": "gbt", "ranger": "ZY103", "posture_deg": (1.0, 2.0)}, {"posture_deg", "solids"}),
        ({"site": "gbt", "ranger": "ZY103", "to": None}, {"to"}),
    ],
)
def test_a_ranger_of_two_kinds_or_of_none_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.point(**{"to": TO, **arguments})
    assert set(refused.value.names) == names


def test_a_ranger_that_the_site_lacks_or_that_has_no_mount_is_refused():
    with pytest.raises(catseye.InputError, match=r"'ZY199' is not of the site"):
        catseye.point(site="gbt", ranger="ZY199", to=TO)
    with pytest.raises(catseye.InputError, match="no mount_z"):
        catseye.point(site="night-01", ranger="ZY115", to=TO)
