"""STAR*NET's .dat: lines as its manual writes them, and every other line named."""

import numpy as np
import pytest

from catseye.constants import ARCSECOND
from catseye.errors import InputError
from catseye.records.network.claim import RangeClaim
from catseye.records.network.starnet import FIXED_ANGLE, FIXED_LENGTH, starnet_network

FOOT = 1200 / 3937
MILLIGON = np.pi / 200_000
EXACT = {"1": (0.0, 0.0, 0.0), "2": (100.0, 20.0, 5.0), "3": (60.0, 120.0, -4.0)}  # east, north, up
STATIONS = "\n".join(f"C {name} {n} {e} {u} ! ! !" for name, (e, n, u) in EXACT.items())
DEFAULTS = (
    "# catseye: angle_arcsec=2, direction_arcsec=3, azimuth_arcsec=4, zenith_arcsec=5, distance_mm=1, distance_ppm=2"
)


def read(lines, head=""):
    return starnet_network(f"{head}\n{lines}\n", "n.dat")


def group(network, kind):
    return next(g for g in network.groups if g.kinds[0] == kind)


def dms(angle):
    seconds = np.degrees(angle) % 360 * 3600
    return f"{int(seconds // 3600)}-{int(seconds // 60 % 60):02d}-{seconds % 60:09.6f}"


def test_the_manuals_measure_line_is_an_angle_a_slope_distance_and_a_zenith_angle():
    network = read("M T20-T19-T55 33-21-30 89.5 91-22-50 4 0.03 15 5.2/5.7", ".UNITS FeetUS")
    angle, distance, zenith = (group(network, kind) for kind in ("angle", "slope_distance", "zenith_angle"))
    names = network.points.names
    assert [names[end[0] // 3] for end in angle.ends] == ["T20", "T19", "T55"]
    assert (
        [names[end[0] // 3] for end in distance.ends] == [names[end[0] // 3] for end in zenith.ends] == ["T20", "T55"]
    )
    assert np.degrees(angle.observed[0]) == pytest.approx(33 + 21 / 60 + 30 / 3600, abs=1e-12)
    assert distance.observed[0] == pytest.approx(89.5 * FOOT)
    assert np.degrees(zenith.observed[0]) == pytest.approx(91 + 22 / 60 + 50 / 3600, abs=1e-12)
    u = [np.sqrt(g.covariance[0]) for g in (angle, distance, zenith)]
    assert u == pytest.approx([4 * ARCSECOND, 0.03 * FOOT, 15 * ARCSECOND])
    assert distance.shift[0] == pytest.approx([0, 0, (5.7 - 5.2) * FOOT])  # the target above the instrument


def test_coordinates_are_free_fixed_or_known_to_something():
    network = read("C A 1 2 3\nC B 4 5 6 ! ! !\nC D 7 8 9 * 0.02 0\nE F 10 0.5\nB A-F 5-00-00 1")
    assert network.points.xyz[:3].tolist() == [[2, 1, 3], [5, 4, 6], [8, 7, 9]]
    assert network.points.fixed.tolist() == [[False] * 3, [True] * 3, [False, False, True], [False] * 3]
    known = group(network, "coordinates")
    assert known.component.tolist() == ["x", "z"]
    assert known.observed.tolist() == [8, 10]
    assert np.sqrt(known.covariance) == pytest.approx([0.02, 0.5])
    assert network.places[1] == ("line 4", "line 5")


def survey(errors=True, delta=False):
    """Exact observations of the points P and Q from known stations, with their errors or by default."""
    p = {**EXACT, "P": (40.0, 60.0, 12.0), "Q": (75.0, 70.0, 30.0)}
    p = {name: np.array(xyz) for name, xyz in p.items()}

    def line(code, at, to, first, stderr):
        along = p[to] - p[at]
        level = np.hypot(*along[:2])
        along[2] += 1.4 - 1.6
        size = np.linalg.norm(along)
        last = f"{level:.7f} {along[2]:.7f}" if delta else f"{size:.7f} {dms(np.arccos(along[2] / size))}"
        sigma = f"{stderr} 0.001 {0.002 if delta else 5}" if errors else ""
        return f"{code} {first} {last} {sigma} 1.6/1.4"

    def azimuth(at, to):
        along = p[to] - p[at]
        return np.arctan2(along[0], along[1])

    lines = [".DELTA ON" if delta else "", STATIONS]
    lines.append(line("M", "1", "P", f"1-2-P {dms(azimuth('1', 'P') - azimuth('1', '2'))}", 2))
    lines.append(line("BM", "2", "P", f"2-P {dms(azimuth('2', 'P'))}", 4))
    lines.append("DB 3")
    lines += [line("DM", "3", to, f"{to} {dms(azimuth('3', to) - 2.0)}", 3) for to in "PQ"]
    lines += [f"DN 1 {dms(azimuth('3', '1') - 2.0)} {'3' if errors else ''}", "DE"]
    lines.append(f"A Q-1-2 {dms(azimuth('Q', '2') - azimuth('Q', '1'))} {'2' if errors else '&'}")
    return "\n".join(lines)


@pytest.mark.parametrize("delta", [False, True])
def test_exact_observations_give_the_exact_points_with_no_residual(delta, solve):
    network = read(survey(delta=delta))
    names = network.points.names
    start = network.points.xyz.copy()
    start[names.index("P")], start[names.index("Q")] = (41, 59, 12), (74, 71, 29)
    found = solve(network, start)
    assert found.x[names.index("P")] == pytest.approx((40, 60, 12), abs=1e-6)
    assert found.x[names.index("Q")] == pytest.approx((75, 70, 30), abs=1e-6)
    assert max(np.abs(residuals).max() for residuals in found.residuals) < 1e-3
    assert found.degrees == 14 - 7


def test_default_standard_errors_come_from_the_comment_and_nowhere_else():
    network = read(survey(errors=False), DEFAULTS)
    distances = group(network, "slope_distance")
    assert np.sqrt(distances.covariance) == pytest.approx(1e-3 + 2e-6 * distances.observed)
    for kind, seconds in (("angle", 2), ("direction", 3), ("azimuth", 4), ("zenith_angle", 5)):
        assert np.sqrt(group(network, kind).covariance) == pytest.approx(seconds * ARCSECOND)
    with pytest.raises(InputError) as refusal:
        read("C 1 0 0 0 ! ! !\nA 1-2-3 45-00-00")
    wanted = "(expected standard errors in the lines, or above them the comment '# catseye: angle_arcsec = ...')"
    missing = "Angle (1 observation, first line 3)"
    assert str(refusal.value) == f"n.dat: has no values for the project options: {missing} {wanted}"


def test_all_missing_standard_errors_are_listed_in_starnet_terms():
    with pytest.raises(InputError) as refusal:
        read("C 1 0 0 0 ! ! !\nC 2 9 0 0 ! ! !\n.INST TS30 tripod\nA 1-2-3 45-00-00\nDV 1-3 9.5 90-00-00\nD 2-3 8.0")
    said = str(refusal.value)
    assert "the project options or the .INSTRUMENT 'TS30 tripod'" in said
    for words in (
        "Angle (1 observation, first line 5)",
        "Distance Constant and PPM (2 observations, first line 6)",
        "Zenith (1 observation, first line 6)",
        "'# catseye: angle_arcsec = ..., distance_mm = ..., zenith_arcsec = ...'",
    ):
        assert words in said


def test_external_claim_applies_to_distances_until_the_file_changes_it():
    text = "C 1 0 0 0 ! ! !\nC 2 9 0 0 ! ! !\nD 1-3 100.0\n# catseye: distance_mm = 5, distance_ppm = 0.001\nD 2-3 95.0"
    network = starnet_network(text, "n.dat", RangeClaim(1.0, 2.0))
    assert np.sqrt(group(network, "slope_distance").covariance) == pytest.approx([1.2e-3, 5e-3], rel=1e-4)


def test_held_and_excluded_observations_are_in_the_description():
    network = read(
        "B 1-2 N34-23-45.7E !\nD 1-2 10.5 !\nB 1-3 150-33-44 *\nD 1-3 5 0.1\nV 1-2 90-00-00 ?".replace(" ?", " 1")
    )
    held = "azimuth of line 2, slope distance of line 3 are held to 1e-7 m or 1e-9 rad (!)"
    assert network.description == f"azimuth of line 4 take no part (*); {held}"
    assert group(network, "azimuth").covariance == pytest.approx([FIXED_ANGLE**2])
    assert group(network, "slope_distance").covariance[0] == pytest.approx(FIXED_LENGTH**2)


@pytest.mark.parametrize(
    ("written", "degrees"),
    [
        ("N34-23-45.7E", 34.396027778),
        ("S45-00-00E", 135.0),
        ("S10-30-00W", 190.5),
        ("N90-00-00W", 270.0),
        ("275", 275.0),
    ],
)
def test_bearings_are_azimuths_by_their_quadrant(written, degrees):
    azimuth = group(read(f"B 1-2 {written} 1"), "azimuth")
    assert np.degrees(azimuth.observed[0]) == pytest.approx(degrees, abs=1e-8)


def test_units_orders_and_separators_change_from_line_to_line():
    network = read(
        ".UNITS Meters GONS\n.ORDER EN FROMATTO\n.SEP =\nC A-1 1 2 3\nA B=A-1=D 100.0 2\n"
        ".units FeetInt DMS\n.ord ne atfromto\n.sep\nC B 10 20 30\nA B-D-F 90-00-00 2\n.UNITS\n.MULT 0.5\nD B-D 10 0.1"
    )
    names, angles = network.points.names, group(network, "angle")
    assert network.points.xyz[names.index("A-1")].tolist() == [1, 2, 3]
    assert network.points.xyz[names.index("B")] == pytest.approx([20 * 0.3048, 10 * 0.3048, 30 * 0.3048])
    assert [names[end[0] // 3] for end in angles.ends] == ["A-1", "B", "D"]  # at in the middle, in the file
    assert [names[end[1] // 3] for end in angles.ends] == ["B", "D", "F"]
    assert angles.observed == pytest.approx([np.pi / 2] * 2)
    assert np.sqrt(angles.covariance) == pytest.approx([2 * MILLIGON, 2 * ARCSECOND])
    assert group(network, "slope_distance").observed == pytest.approx([5.0])


def test_missing_parts_switched_off_data_and_continued_lines():
    network = read(
        "M 33-32-55 95-38-44.5 ? ? 4.5 & &\n.DATA OFF\nnonsense\n.DATA ON\n"
        "M 8-DUMMY-5 ? 1502.55 93-44-52 & 0.01 &\n   5 5.25/5.10  # no code: the line above goes on\n"
        "D 8-5 20 0.01  'a description D 8-5 21"
    )
    assert [g.kinds[0] for g in network.groups] == ["angle", "slope_distance", "zenith_angle"]
    assert group(network, "slope_distance").observed.tolist() == [1502.55, 20.0]
    assert np.sqrt(group(network, "zenith_angle").covariance) == pytest.approx([5 * ARCSECOND])
    assert "DUMMY" not in network.points.names


def test_a_plane_survey_has_no_heights_and_needs_none(solve):
    network = read(".2D\nC 1 0 0 ! !\nC 2 0 100 ! !\nC 3 78 62\nD 1-3 100 0.01\nD 2-3 89.4427191 0.01")
    assert [g.kinds[0] for g in network.groups] == ["horizontal_distance"]
    assert network.points.absent.tolist() == [[False, False, True]] * 3
    assert solve(network).x[2, :2] == pytest.approx((60.0, 80.0), abs=1e-6)


def test_refraction_turns_the_earths_curvature_on():
    flat, bent = (group(read("V 1-2 90-00-00 1", head), "zenith_angle") for head in ("", ".REFRACTION 0.07"))
    x = np.array([0.0, 0.0, 0.0, 0.0, 1000.0, 0.0])
    difference = bent.predict(x)[0][0] - flat.predict(x)[0][0]
    assert difference == pytest.approx((1 - 0.07) * 1000 / (2 * 6.371e6))
    assert bent.curved
    assert not flat.curved


def test_angles_are_negative_in_all_parts_gon_or_decimal_where_units_say_so():
    written = (("A 1-2-3 -10-30-36 1", "", -10.51), ("A 1-2-3 -10.51 1", ".UNITS DD", -10.51))
    for line, head, degrees in (*written, ("A 1-2-3 10 1", ".UNITS GONS", 9.0)):
        assert np.degrees(group(read(line, head), "angle").observed[0]) == pytest.approx(degrees, abs=1e-12)


def test_levelling_and_second_face():
    network = read("L A-B 1.25 0.3 0.002\nV A-B 269-00-00 1")
    assert group(network, "height_difference").observed.tolist() == [1.25]
    assert np.sqrt(group(network, "height_difference").covariance) == pytest.approx([0.002])
    assert np.degrees(group(network, "zenith_angle").observed) == pytest.approx([91.0])


def test_standard_errors_of_coordinates_have_the_units_of_lengths():
    network = read(".UNITS FEETUS DMS\n.ORDER NE\nC A 0 0 0 ! ! !\nC B 100 200 10 0.1 0.2 0.3\nD A-B 224 0.01")
    foot = 1200.0 / 3937.0
    assert group(network, "coordinates").observed == pytest.approx(np.array([100.0, 200.0, 10.0]) * foot)
    assert np.sqrt(group(network, "coordinates").covariance) == pytest.approx(np.array([0.1, 0.2, 0.3]) * foot)


REFUSED = {
    "SS 1-2-3 10-00-00 5 90-00-00": (
        "'SS 1-2-3 10-00-00 5 90-00-00' is not known here "
        "(expected one of the codes C, E, A, D, V, DV, B, M, BM, DB, DN, DM, DE, L)"
    ),
    "TB 1": "'TB 1' is not known here (expected one of the codes C, E, A, D, V, DV, B, M, BM, DB, DN, DM, DE, L)",
    ".ALTERNATE TS1": (
        "'.ALTERNATE TS1' is not known here "
        "(expected one of .UNITS .ORDER .DELTA .SEPARATOR .2D .3D .DATA .MULTIPLIER .REFRACTION .INSTRUMENT)"
    ),
    ".UNITS Furlong": ".UNITS 'FURLONG' (expected METERS METRES FEETUS FEETINT, DMS, GONS or DD)",
    ".DELTA": ".DELTA '' (expected ON or OFF)",
    "A 1-2 10-00-00 1": "A: stations '1-2' (expected At-From-To)",
    "D 1 10 1": "D: stations '1' (expected From-To)",
    "D 1-2 ten 1": "D: 'ten' (expected a number)",
    "D 1-2 -10 1": "slope_distance '1' to '2' = -10 m (expected above 0)",
    "D 1-1 10 1": "slope_distance '1' to '1' joins a point with itself (expected points that differ)",
    "D 1-2 10 0": "slope_distance '1' to '2' has the sigma 0 (expected above 0: no measurement is exact)",
    "D 1-2": "D: 0 values (expected slope distance)",
    "D 1-2 10 1 2 3": "D: 3 standard errors '1 2 3' (expected none or 1, then perhaps HI/HT)",
    "M 1-2-3 10-00-00 5 90-00-00 1 2": "M: 2 standard errors '1 2' (expected none or 3, then perhaps HI/HT)",
    "A 1-2-3 10-60-00 1": "A: angle '10-60-00' (expected degrees-minutes-seconds, ' and \" below 60)",
    "A 1-2-3 10.5 1": (
        "A: angle '10.5' could be decimal or packed "
        "(expected degrees-minutes-seconds, or .UNITS DD above it for decimal degrees)"
    ),
    "B 1-2 N91-00-00E 1": "B: bearing 'N91-00-00E' (expected a quadrant of 0 to 90 degrees)",
    "C 1 0 0": "C: 2 values (expected a name, 3 coordinates and none or 3 standard errors)",
    "C 1 0 0 0\nC 1 0 0 0": "y of '1' is in line 2 already (expected once)",
    "DN 2 10-00-00 1": "DN: outside a direction set (expected DB before it)",
    "DB 1\nDB 2": "DB: the set at '1' is still open (expected DE before it)",
    "# catseye: angle = 3": (
        "# catseye: 'angle = 3' (expected angle_arcsec, direction_arcsec, azimuth_arcsec, zenith_arcsec, distance_mm, "
        "distance_ppm, elevation_mm = a number above 0)"
    ),
}


@pytest.mark.parametrize("lines", REFUSED)
def test_unknown_input_is_named_with_its_line(lines):
    with pytest.raises(InputError) as refusal:
        read(lines)
    number = 2 + lines.count("\n")
    assert str(refusal.value) == f"n.dat: line {number}, {REFUSED[lines]}"


def test_unfinished_set_and_empty_file_are_refused():
    with pytest.raises(InputError, match="ends within the direction set at '1'"):
        read("DB 1\nDN 2 10-00-00 1")
    with pytest.raises(InputError, match="has no points"):
        read("# nothing")
