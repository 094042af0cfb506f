"""The antenna of a structural model: without motions it is eq. 2.44; with them a chain written out by hand; slopes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND
from catseye.errors import InputError, ValidityError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.antenna.frames import ground_from_reflector_at
from catseye.geometry.frames.rotation import rx, rz
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.structure.antenna import SubreflectorPosition, antenna_of
from repository import ROOT

EXAMPLE = ROOT / "examples" / "structural-model" / "telescope.toml"
POSTURE = TelescopePosture(0.9, np.radians(38.0), 3.0)
FOOT = np.array([0.0, -8.0, 10.0])


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(read_structural_model(EXAMPLE))


def test_without_motions_it_is_the_first_order(antenna):
    posture = TelescopePosture(np.array([0.0, 2.0]), np.array([0.3, 1.2]), 15.0)
    rigid = antenna.ground_from("reflector", posture, deformed=False)
    expected = ground_from_reflector_at(posture.azimuth, posture.elevation)
    np.testing.assert_allclose(rigid.points([1.0, 50.0, 9.0]), expected.points([1.0, 50.0, 9.0]), rtol=0, atol=1e-13)
    arm = antenna.ground_from("feed_arm", posture, deformed=False)
    np.testing.assert_allclose(arm.points([0, 0, 0]), expected.points(FOOT), rtol=0, atol=1e-13)
    focus = antenna.ground_from("prime_focus", posture, deformed=False)
    np.testing.assert_allclose(focus.points([0, 0, 0]), expected.points([0, 0, 60.0]), rtol=0, atol=1e-13)


def by_hand(x, a, e, t):
    """A point of the feed arm in the ground frame, each motion and turn of the example file written out."""
    turned = lambda w, v: Rotation.from_rotvec(np.array(w) * ARCSECOND).apply(v)  # noqa: E731
    c, s = np.cos(e), np.sin(e)
    x = turned([-150 * c - 30 * s + 5 * np.sin(2 * e) + 0.4 * t, 2 * s, 0], x)
    x = x + np.array([0, 5 * c + 0.3 * np.sin(2 * e), -3 * s + 0.2925 * t]) * 1e-3
    x = x + FOOT
    pivot = np.array([0, 54.839108, -4.99999])
    x = pivot + turned([-55 * c + 18 * s + 3 * np.sin(2 * e) + 0.15 * c * t, 0, 0], x - pivot)
    x = x + np.array([0, 9 * c + 0.4 * np.sin(2 * e), -7 * s - 0.6 * np.sin(2 * e) + 0.06 * t]) * 1e-3
    x = x - pivot  # the vertex in the elevation frame
    x = x + np.array([0, 1.5 * c, -1.5 * s]) * 1e-3
    x = rx(np.pi / 2 - e) @ x + np.array([0, 0, 48.26])
    x = turned([2.2 * np.sin(a) + 3 * np.cos(a), 3 * np.sin(a) - 2.2 * np.cos(a), 0], x)
    return rz(a) @ (x + np.array([0, 0, 0.5646e-3 * t]))


def test_the_chain_follows_the_file(antenna):
    x = np.array([-2.67, 3.76, 47.3])
    found = antenna.ground_from("feed_arm", POSTURE).points(x)
    np.testing.assert_allclose(found, by_hand(x, 0.9, np.radians(38.0), -12.0), rtol=0, atol=1e-12)


def test_gravity_makes_the_arm_droop_downwards_and_warmth_lifts_it(antenna):
    tip = [0.0, 8.0, 50.0]  # the prime focus
    low = TelescopePosture(0.0, np.radians(10.0), 15.0)
    sag = antenna.ground_from("feed_arm", low).points(tip) - antenna.ground_from(
        "feed_arm", low, deformed=False
    ).points(tip)
    assert -0.20 < sag[2] < -0.02  # centimetres
    assert abs(sag[0]) < 0.005
    high = [TelescopePosture(0.0, np.radians(90.0), t) for t in (5.0, 25.0)]
    cold, warm = (antenna.ground_from("feed_arm", posture).points(tip)[2] for posture in high)
    # over 20 degrees: alidade, arm and dish grow, and the arm bends up by 0.4 seconds a degree, 8 m from its foot
    grown = 20 * (0.5646 + 0.2925 + 0.06) * 1e-3 + 20 * 0.4 * ARCSECOND * 8.0
    assert warm - cold == pytest.approx(grown, abs=2e-5)


def test_the_azimuth_axis_leans_the_same_way_on_the_ground_at_any_azimuth(antenna):
    """A tilt about east by +3 seconds takes the top to the south; about north by -2.2 seconds to the west."""
    for azimuth in np.linspace(0.0, 6.0, 7):
        posture = TelescopePosture(azimuth, 1.0, 15.0)
        top = antenna.ground_from("alidade", posture).points([0.0, 0.0, 48.26])
        np.testing.assert_allclose(top[:2] / (48.26 * ARCSECOND), [-2.2, -3.0], rtol=0, atol=1e-3)


def test_the_subreflectors_position_moves_its_frame_in_the_prime_focus(antenna):
    pivot = np.array([0.0, -3.0, 4.5])
    told = SubreflectorPosition(np.array([0.0, 0.0, 0.02]), np.array([0.001, 0.0, 0.0]), pivot)
    here = antenna.ground_from("subreflector", POSTURE).points([0.0, 0.0, 0.0])
    there = antenna.ground_from("subreflector", POSTURE, subreflector=told).points([0.0, 0.0, 0.0])
    out = antenna.ground_from("prime_focus", POSTURE).rotation
    # the motion of its own table is turned with it: 1 mrad of 2 mm
    np.testing.assert_allclose(there - here, out @ [0.0, 0.0, 0.02], rtol=0, atol=3e-6)


def test_derivatives_are_the_slopes_by_every_frame(antenna):
    names = ["alidade", "elevation", "reflector", "feed_arm", "subreflector"]
    x = np.array([0.5, -3.0, 0.3])
    found = antenna.derivatives("subreflector", x, POSTURE)
    turns = antenna.turns("subreflector", POSTURE)
    assert list(found)[::-1] == ["alidade", "elevation", "reflector", "feed_arm", "prime_focus", "subreflector"]
    for name in names:
        for i, h in enumerate(1e-6 * np.eye(6)):
            ends = [antenna.ground_from("subreflector", POSTURE, added={name: v}) for v in (h, -h)]
            slope = (ends[0].points(x) - ends[1].points(x)) / 2e-6
            np.testing.assert_allclose(found[name][:, i], slope, rtol=0, atol=1e-7)  # rounding of 100 m over the step
            turn = Rotation.from_matrix(ends[0].rotation @ ends[1].rotation.T).as_rotvec() / 2e-6
            np.testing.assert_allclose(turns[name][:, i], turn, rtol=0, atol=1e-8)


def test_axis_derivatives_are_the_slopes_of_the_whole_model_to_a_percent(antenna):
    x = np.array([0.0, 8.0, 50.0])
    at = antenna.ground_from("feed_arm", POSTURE).points(x)
    found = antenna.axis_derivatives(at, POSTURE)
    for i, (da, de) in enumerate(((1e-5, 0.0), (0.0, 1e-5))):
        ends = [
            antenna.ground_from("feed_arm", TelescopePosture(0.9 + s * da, np.radians(38.0) + s * de, 3.0)).points(x)
            for s in (1, -1)
        ]
        np.testing.assert_allclose(found[:, i], (ends[0] - ends[1]) / 2e-5, rtol=0, atol=0.5)  # m/rad, of some 100


def test_groups_move_with_their_frames_and_each_point_by_its_own_table(antenna):
    posture = TelescopePosture(np.array([0.1, 0.9]), np.radians([38.0, 80.0]), np.array([15.0, 3.0]))
    rim = antenna.points("rim", posture)
    assert rim.shape == (2, 10, 3)
    e = np.radians(80.0)
    position = antenna.groups["rim"].position[0]
    moved = position + np.array([0, 0.342 * np.cos(e), -1.882 * np.cos(e) - 2.801 * np.sin(e) + 0.02 * -12]) * 1e-3
    here = antenna.ground_from("reflector", TelescopePosture(0.9, e, 3.0))
    np.testing.assert_allclose(rim[1, 0], here.points(moved), rtol=0, atol=1e-12)
    np.testing.assert_allclose(antenna.u_points("rim"), np.hypot(0.5e-3, 0.3e-3), rtol=1e-12)
    np.testing.assert_allclose(antenna.u_points("arm"), 1e-3, rtol=1e-12)


def test_outside_its_range_and_for_strangers_it_refuses(antenna):
    with pytest.raises(ValidityError, match="elevation 96 deg is outside 0 to 95 deg"):
        antenna.ground_from("reflector", TelescopePosture(0.0, np.radians(96.0), 15.0))
    with pytest.raises(ValidityError, match="temperature 50 C"):
        antenna.points("rim", TelescopePosture(0.0, 1.0, np.array([10.0, 50.0])))
    with pytest.raises(InputError, match="frame 'boom' is not in the structural model"):
        antenna.ground_from("boom", POSTURE)
    with pytest.raises(InputError, match="group 'boom' is not"):
        antenna.points("boom", POSTURE)
    with pytest.raises(InputError, match="'reflektor' cannot be shifted"):
        antenna.ground_from("reflector", POSTURE, added={"reflektor": np.ones(6)})
    with pytest.raises(InputError, match="'rim' cannot be shifted"):  # each of its points moves by a table of its own
        antenna.points("rim", POSTURE, added={"rim": np.ones(6)})
    # 0 deg C is legal
    assert np.isfinite(antenna.points("rim", TelescopePosture(0.0, 0.0, 0.0))).all()
