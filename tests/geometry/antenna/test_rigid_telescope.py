"""Seven frames of a rigid telescope: against eq. 2.44 by hand, scipy's rotations, and differences."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.antenna.rigid_telescope import FRAMES, RigidTelescope

MOVED = RigidTelescope(
    np.radians(145.3),
    np.radians(31.7),
    subreflector_shift=(0.02, -0.05, 0.03),
    subreflector_turn=(0.02, -0.01, 0.005),
    subreflector_pivot=(0.1, -3.0, 4.5),
)
POINTS = np.random.default_rng(46).uniform(-60.0, 110.0, size=(7, 3))


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "vertex", "focus"),  # m: eq. 2.44 with its printed lengths, worked by hand
    [
        (0.0, 90.0, (0.0, -54.839108, 53.259990), (0.0, -54.839108, 113.259990)),
        (0.0, 0.0, (0.0, 4.999990, 103.099108), (0.0, 64.999990, 103.099108)),
        (180.0, 90.0, (0.0, 54.839108, 53.259990), (0.0, 54.839108, 113.259990)),
        (90.0, 45.0, (-35.241578, 0.0, 90.572632), (7.184829, 0.0, 132.999039)),
        (270.0, 45.0, (35.241578, 0.0, 90.572632), (-7.184829, 0.0, 132.999039)),
    ],
)
def test_vertex_and_focus_are_where_the_notes_have_them(azimuth_deg, elevation_deg, vertex, focus):
    telescope = RigidTelescope(np.radians(azimuth_deg), np.radians(elevation_deg))
    rounding = 0.6e-6  # of the hand-worked micrometres
    np.testing.assert_allclose(telescope.between("ground", "reflector").points(np.zeros(3)), vertex, atol=rounding)
    np.testing.assert_allclose(telescope.between("ground", "prime_focus").points(np.zeros(3)), focus, atol=rounding)


def test_the_subreflector_is_scipys_turns_about_its_pivot():
    pivot, shift = np.array(MOVED.subreflector_pivot), np.array(MOVED.subreflector_shift)
    centre, rise = np.array([0.0, 0.0, 60.0]), np.array([0.0, 0.0, 48.260])
    vertex = np.array([0.0, -54.839108, 4.999990])
    in_focus = pivot + shift + Rotation.from_euler("xyz", MOVED.subreflector_turn).apply(POINTS - pivot)
    in_reflector = in_focus + centre
    # elevation turns about +x by E - 90 degrees, azimuth about -z
    in_alidade = Rotation.from_euler("x", 31.7 - 90.0, degrees=True).apply(in_reflector + vertex)
    expected = Rotation.from_euler("z", -145.3, degrees=True).apply(in_alidade + rise)
    np.testing.assert_allclose(MOVED.between("ground", "subreflector").points(POINTS), expected, atol=1e-12)


@pytest.mark.parametrize(("to", "from_"), list(itertools.permutations(FRAMES, 2)))
def test_there_and_back_is_the_same_place(to, from_):
    there, back = MOVED.between(to, from_), MOVED.between(from_, to)
    np.testing.assert_allclose(back.points(there.points(POINTS)), POINTS, atol=1e-12)


@pytest.mark.parametrize(("to", "from_"), list(itertools.product(FRAMES, FRAMES)))
def test_slopes_are_those_of_differences(to, from_):
    step = 1e-5  # rad: 1e-10 relative curvature, 1e-9 m of rounding over it
    slopes = MOVED.posture_slopes(POINTS, to=to, from_=from_)
    for k, name in enumerate(("azimuth", "elevation")):
        ends = [
            RigidTelescope(**{**vars(MOVED), name: getattr(MOVED, name) + s}).between(to, from_).points(POINTS)
            for s in (step, -step)
        ]
        np.testing.assert_allclose(slopes[..., k], (ends[0] - ends[1]) / (2.0 * step), atol=1e-6)


def test_an_unknown_frame_is_named():
    with pytest.raises(ValidityError, match=r"frame 'dish' is unknown \(expected one of ground, alidade"):
        MOVED.between("ground", "dish")
    with pytest.raises(ValidityError, match="stands in no other"):
        MOVED.in_parent("ground")
