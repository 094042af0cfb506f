"""Displacements by a structural model: by hand, by scatter, and of a site; the beam by a ray trace."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from catseye.constants import ARCSECOND
from catseye.errors import InputError, ValidityError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.site.folder import read_site
from catseye.records.site.structural_model import StructuralModel, read_structural_model
from catseye.reduction.pose.pointing_offsets import site_aperture
from catseye.reduction.structure.antenna import antenna_of
from catseye.reduction.structure.beam import model_beam
from catseye.reduction.structure.displacement import displacements, model_points, site_points
from repository import ROOT

EXAMPLE = ROOT / "examples" / "structural-model" / "telescope.toml"
POSTURE = TelescopePosture(0.9, np.radians(38.0), 3.0)


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(read_structural_model(EXAMPLE))


@pytest.fixture(scope="module")
def site():
    return read_site(ROOT / "examples" / "sites" / "gbt")


def test_at_the_horizon_the_arms_top_moves_as_the_coefficients_say_by_hand(antenna):
    """E = 0, A = 0, 15 °C: cosE = cosA = 1, all else 0. In the alidade's axes (y forward, z up) the beam lies along y.

    Reflector axes at the horizon: z along the beam, y downwards: a body's shift y is down, z is forward.
    """
    found = displacements(antenna, model_points(antenna, ["ZEG41040L"]), TelescopePosture(0.0, 0.0, 15.0))
    foot, top = np.array([0.0, -8.0, 10.0]), np.array([-2.67, -4.24, 57.3])
    pivot = np.array([0.0, 54.839108, -4.99999])
    y, z = 1.5e-3 + 9e-3 + 5e-3, 0.0  # shifts of elevation, reflector and arm by cosE
    arm, dish = -150 * ARCSECOND, -55 * ARCSECOND  # turns about x: (y, z) moves by (-w z, w y)
    y += -arm * (top - foot)[2] - dish * (top - pivot)[2]
    z += arm * (top - foot)[1] + dish * (top - pivot)[1]
    # the azimuth axis leans by 3" about east and -2.2" about north: top to the south by w z, to the west
    lean = np.cross([3.0 * ARCSECOND, -2.2 * ARCSECOND, 0.0], found.rigid[0, 0])
    ground = np.array([0.0, z, -y]) + lean
    np.testing.assert_allclose(found.ground[0, 0], ground, rtol=0, atol=3e-5)  # second order: 47 mm times 4e-4


def test_a_covariance_is_the_scatter_of_perturbed_motions(antenna):
    document = antenna.record.model_dump()
    rng = np.random.default_rng(5)
    root = 0.2 * rng.standard_normal((24, 24))  # mm, arc seconds: four terms of six components
    arm = next(frame for frame in document["frame"] if frame["name"] == "feed_arm")
    arm["motion"]["covariance"] = tuple(map(tuple, root @ root.T))
    uncertain = antenna_of(StructuralModel.model_validate(document))
    points = model_points(uncertain, ["ZEG41040L", "TR03"])
    found = displacements(uncertain, points, POSTURE)
    drawn = []
    for _ in range(1500):
        added = {}
        for name, motion in uncertain.motions.items():
            added[name] = np.linalg.cholesky(motion.six_covariance(POSTURE)) @ rng.standard_normal(6)
        fresh = 0.3e-3 * rng.standard_normal(3)  # of the rim's own table
        places = [
            uncertain.ground_from(p.frame, POSTURE, added=added).points(
                p.position + (uncertain.in_frame("rim", POSTURE)[2] - uncertain.groups["rim"].position[2] + fresh)
                if p.group == "rim"
                else p.position
            )
            for p in points
        ]
        drawn.append(places - found.rigid[0])
    drawn = np.array(drawn)
    for i in range(len(points)):
        seen, claimed = np.cov(drawn[:, i].T), found.covariance[0, i]
        size = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
        np.testing.assert_allclose(seen / size, claimed / size, rtol=0, atol=0.15)  # four sigma of 1500: sqrt(2/1500)
        off = (drawn[:, i].mean(axis=0) - found.ground[0, i]) / np.sqrt(np.diag(claimed) / len(drawn))
        assert np.max(np.abs(off)) < 4.0
        turn = uncertain.ground_from(points[i].frame, POSTURE, deformed=False).rotation
        np.testing.assert_allclose(turn @ found.body_covariance[0, i] @ turn.T, claimed, rtol=0, atol=1e-15)
    assert not found.exact


def test_a_sites_rangers_on_the_arm_move_with_it_and_pillars_do_not(antenna, site):
    points, unmoved = site_points(antenna, site)
    frames = {point.name: (point.frame, point.kind) for point in points}
    assert frames["ZY113"] == ("feed_arm", "ranger")
    assert frames["ZAG731P"] == ("alidade", "target")
    assert frames["TR01-B"] == ("reflector", "target")
    assert not any(name.startswith("DP") for name in frames)
    assert set(site.monuments) <= set(unmoved)
    assert len(site_points(antenna, site, ["DP01*"])[0]) > 5
    found = displacements(antenna, points, POSTURE, unmoved=unmoved)
    i = found.names.index("ZY113")
    nominal = np.array(next(r.nominal_scan_point_mm for r in site.feedarm.ranger if r.name == "ZY113")) * 1e-3
    rigid = antenna.ground_from("reflector", POSTURE, deformed=False).points(nominal)
    np.testing.assert_allclose(found.rigid[0, i], rigid, rtol=0, atol=1e-9)
    arm = antenna.ground_from("feed_arm", POSTURE).points(nominal - [0.0, -8.0, 10.0])
    np.testing.assert_allclose(found.places[0, i], arm, rtol=0, atol=1e-9)
    assert any("stand on the ground" in note for note in found.notes)


@pytest.mark.parametrize("elevation", [10.0, 45.0, 80.0])
def test_the_beam_is_that_of_rays_from_the_bent_dish_to_the_moved_feed(antenna, site, elevation):
    """The direction in the sky for which the paths from a plane wave front by the dish to the feed differ least."""
    posture = TelescopePosture(0.9, np.radians(elevation), 3.0)
    of = site_aperture(site)
    found = model_beam(antenna, of, posture)
    rigid = antenna.ground_from("reflector", posture, deformed=False)
    dish = rigid.inverse().points(antenna.ground_from("reflector", posture).points(of.surface))
    feed = rigid.inverse().points(antenna.ground_from("prime_focus", posture).points([0.0, 0.0, 0.0]))

    def departure(x):
        direction = np.array([x[0], x[1], 1.0]) / np.sqrt(1.0 + x[0] ** 2 + x[1] ** 2)
        path = np.linalg.norm(feed - dish, axis=1) - dish @ direction
        return np.sqrt(of.weight) * (path - x[2])

    settings = {"x_scale": [1e-5, 1e-5, 1e-3], "xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    x, y, _ = least_squares(departure, [0.0, 0.0, 60.0], **settings).x
    # y points downwards: a beam towards +y looks too low; second order of 1e-3 rad: 0.05"
    np.testing.assert_allclose(found.offset[0, :2], [x, -y], rtol=0, atol=0.05 * ARCSECOND)
    assert abs(found.offset[0, 1]) > 10 * ARCSECOND
    np.testing.assert_allclose(found.correction[0], -found.offset[0, :2])


def test_the_beams_covariance_is_that_of_differences_by_every_motion(antenna, site):
    of = site_aperture(site)
    found = model_beam(antenna, of, POSTURE)
    total = np.zeros((3, 3))
    for name in ("alidade", "elevation", "reflector", "feed_arm"):
        motion, slope = antenna.motions[name], []
        for k, step in enumerate(motion.u * 0.1):
            document = antenna.record.model_dump()
            frame = next(each for each in document["frame"] if each["name"] == name)["motion"]
            key = [f"{kind}_{axis}_{unit}" for kind, unit in (("shift", "mm"), ("turn", "arcsec")) for axis in "xyz"][k]
            unit = 1e-3 if k < 3 else ARCSECOND
            first = motion.basis.rows(POSTURE)[0]
            frame[key] = tuple(np.array(frame[key] or np.zeros(len(motion.basis))) + np.eye(len(motion.basis))[0]
                               * step / unit / first)  # fmt: skip
            moved = model_beam(antenna_of(StructuralModel.model_validate(document)), of, POSTURE)
            slope.append((moved.offset[0] - found.offset[0]) / step)
        total += np.array(slope).T @ np.diag(motion.u**2) @ np.array(slope)
    size = np.sqrt(np.diag(found.covariance[0]))
    np.testing.assert_allclose(total / np.outer(size, size), found.covariance[0] / np.outer(size, size), atol=2e-3)


def test_strangers_and_postures_outside_are_refused(antenna, site):
    with pytest.raises(InputError, match="no point is 'BOOM'"):
        model_points(antenna, ["BOOM"])
    with pytest.raises(InputError, match="no point is 'ZY101'"):
        site_points(antenna, site, ["ZY101"])
    with pytest.raises(ValidityError, match="elevation 97 deg"):
        displacements(antenna, model_points(antenna), TelescopePosture(0.0, np.radians(97.0), 15.0))
