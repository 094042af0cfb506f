"""A dish's shape: planted terms found, rms and gain without the noise, changes, all with covariances that scatter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.geometry.frames.frame import Transform
from catseye.optics.zernike import Term
from catseye.reduction.surface.change import change_between
from catseye.reduction.surface.shape import Prisms, ShapeSettings, mean_square, shape_of
from draws import draws, same_sigmas
from surface_scene import APERTURE, NAMES, half_path_of, prisms


def at(shape, term):
    return shape.expansion.terms.index(term)


@pytest.mark.parametrize("term", [Term(2, 2), Term(2, -2)])
def test_planted_astigmatism_is_found_with_the_axis_held(term):
    """0.3 mm on panels of 68 um: the issue asks for 30 um."""
    rough = 6.8e-5 * np.random.default_rng(1).normal(size=len(NAMES))
    shape = shape_of(
        prisms(half_path_of(term, 3e-4) + rough, shift=(0.002, -0.003, 0.004)),
        APERTURE,
        ShapeSettings(free=("vertex", "focal-length"), taper_db=13.0),
    )
    k = at(shape, term)
    assert shape.expansion.value[k] == pytest.approx(3e-4, abs=1e-5)
    assert shape.expansion.joint[k] == pytest.approx(3e-4, abs=1e-5)
    assert shape.expansion.share[k] < 0.03
    assert shape.absorbed == ()


@pytest.mark.parametrize("term", [Term(2, 2), Term(2, -2)])
def test_with_the_axis_free_the_paraboloid_takes_most_and_the_joint_estimate_finds_it(term):
    shape = shape_of(prisms(half_path_of(term, 3e-4)), APERTURE, ShapeSettings(terms=6))
    k = at(shape, term)
    assert shape.expansion.share[k] > 0.9
    assert term in shape.absorbed
    assert Term(2, 0) not in shape.absorbed  # the focal length stands for it
    assert abs(shape.expansion.value[k]) < 5e-5
    u = float(np.sqrt(shape.expansion.joint_covariance[k, k]))
    assert 2e-6 < u < 1e-5
    assert shape.expansion.joint[k] == pytest.approx(3e-4, abs=4 * u)


def test_a_change_of_astigmatism_is_found_whatever_the_dish_did():
    """Two epochs, the second turned by 40 arc seconds and shifted by 20 mm, which a paraboloid takes for the same."""
    first = prisms(half_path_of(Term(2, -2), 1e-4), seed=1)
    second = prisms(half_path_of(Term(2, -2), 4e-4), seed=2, turn=(2e-4, -1e-4), shift=(0.02, 0.01, -0.005))
    change = change_between(first, second, APERTURE, settings=ShapeSettings(terms=15))
    k = change.expansion.terms.index(Term(2, -2))
    u = float(np.sqrt(change.expansion.covariance[k, k]))
    assert u < 3e-6
    # the motion takes a hundredth of the term's square, 1.5 um
    assert change.expansion.value[k] == pytest.approx(3e-4, abs=3e-6 + 4 * u)
    assert change.expansion.share[k] < 0.01
    # 0.3 mm of astigmatism turn what the prisms' motion says by 0.6 urad
    np.testing.assert_allclose(change.motion[3:], [2e-4, -1e-4, 0.0], atol=1e-6)


@draws(300)
def test_the_change_of_nothing_scatters_as_claimed(runs):
    rows = np.arange(0, 2209, 40)
    found, claimed = [], None
    for seed in range(runs):
        one = prisms(np.zeros(2209), seed=2 * seed, rows=rows)
        two = prisms(np.zeros(2209), seed=2 * seed + 1, rows=rows, turn=(1e-4, 0.0))
        change = change_between(one, two, APERTURE, settings=ShapeSettings(terms=6))
        found.append((change.motion, change.deviation, change.expansion.value))
        claimed = change
    motion, deviation, value = (np.array(part) for part in zip(*found, strict=True))
    off = same_sigmas(0.35, 300, runs)  # a variance of 300 draws scatters by 8 %; 4 sigma
    np.testing.assert_allclose(motion.var(axis=0, ddof=1) / np.diag(claimed.motion_covariance), 1.0, atol=off)
    np.testing.assert_allclose(value.var(axis=0, ddof=1) / np.diag(claimed.expansion.covariance), 1.0, atol=off)
    spread = np.mean(deviation.var(axis=0) / np.diag(claimed.deviation_covariance))
    assert spread == pytest.approx(1.0, abs=same_sigmas(0.05, 300, runs))


@draws(250)
@pytest.mark.parametrize("free", [("vertex", "axis", "focal-length"), ("vertex", "focal-length")])
def test_zernike_terms_and_the_mean_square_scatter_as_claimed(free, runs):
    rows = np.arange(0, 2209, 25)
    half = half_path_of(Term(3, 3), 1e-4)
    settings = ShapeSettings(free=free, taper_db=12.0, terms=8, frequencies=(50e9,))
    found = [shape_of(prisms(half, u=1e-4, seed=s, rows=rows), APERTURE, settings) for s in range(runs)]
    perfect = shape_of(prisms(half, u=1e-9, seed=1, rows=rows), APERTURE, settings)
    e = perfect.expansion
    values = np.array([f.expansion.value for f in found])
    claimed = np.diag(found[0].expansion.covariance)
    free_terms = claimed > 1e-3 * claimed.max()  # the rest the paraboloid stands for
    assert free_terms.sum() >= 4
    off = same_sigmas(0.36, 250, runs)  # a variance of 250 draws scatters by 9 %; 4 sigma
    np.testing.assert_allclose(values.var(axis=0, ddof=1)[free_terms] / claimed[free_terms], 1.0, atol=off)
    np.testing.assert_allclose(values.mean(axis=0), e.value, atol=4 * np.sqrt(claimed.max() / runs))
    joint = np.array([f.expansion.joint for f in found])
    asked = np.isfinite(e.joint)
    assert asked.tolist() == [t.n > 1 and t != (2, 0) for t in e.terms]
    ratio = joint.var(axis=0, ddof=1)[asked] / np.diag(found[0].expansion.joint_covariance)[asked]
    np.testing.assert_allclose(ratio, 1.0, atol=off)
    ortho = np.array([f.expansion.orthonormal for f in found])
    square = found[0].expansion.u_orthonormal ** 2
    told = square > 0.05 * square.max()
    np.testing.assert_allclose(ortho.var(axis=0, ddof=1)[told] / square[told], 1.0, atol=off)
    own = np.array([f.square.own for f in found])
    assert own.mean() == pytest.approx(perfect.square.own, abs=4 * own.std() / np.sqrt(runs))
    assert np.mean([f.square.u for f in found]) == pytest.approx(own.std(), rel=same_sigmas(0.15, 250, runs))
    gain = np.array([f.gains[0].ruze for f in found])
    assert np.mean([f.gains[0].u_ruze for f in found]) == pytest.approx(gain.std(), rel=same_sigmas(0.15, 250, runs))


def test_a_perfect_surface_has_no_mean_square_of_its_own():
    rng = np.random.default_rng(4)
    a = rng.normal(size=(40, 40)) * 1e-5
    c, w = a @ a.T, rng.uniform(0, 1, 40)
    found = [mean_square(a @ rng.normal(size=40), c, w) for _ in range(3000)]
    own = np.array([f.own for f in found])
    assert own.mean() == pytest.approx(0.0, abs=4 * own.std() / np.sqrt(3000))
    assert own.min() < 0.0 < own.max()
    for one in found:
        assert (one.rms is None, one.u_rms is None) == (one.own < 0.0,) * 2
        assert one.stands_out == (one.own > 2.0 * one.u)
        if one.rms is not None:
            assert one.u_rms == pytest.approx(0.5 * one.u / np.sqrt(one.own))
    assert np.sqrt(np.mean([f.u**2 for f in found])) == pytest.approx(own.std(), rel=0.6)  # raised by the draw's own


def test_a_dish_in_the_ground_frame_is_the_same_dish():
    """Turned and carried away with its full covariance: same shape, same terms."""
    rows = np.arange(0, 2209, 40)
    here = prisms(half_path_of(Term(4, 0), 2e-4), rows=rows)
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 2.0]).as_matrix()
    ground = Transform("ground", "reflector", turn, np.array([10.0, -40.0, 60.0]))
    full = np.kron(np.eye(len(rows)), turn @ (25e-10 * np.eye(3)) @ turn.T)
    there = Prisms(here.names, ground.points(here.points), full, ground, "there")
    one, two = shape_of(here, APERTURE), shape_of(there, APERTURE)
    np.testing.assert_allclose(one.fit.deviation, two.fit.deviation, atol=1e-11)
    np.testing.assert_allclose(one.expansion.value, two.expansion.value, atol=1e-11)
    np.testing.assert_allclose(one.expansion.covariance, two.expansion.covariance, atol=1e-17)


def test_orthonormal_terms_sum_up_to_the_mean_square():
    shape = shape_of(prisms(half_path_of(Term(4, 4), 2e-4)), APERTURE, ShapeSettings(taper_db=13.0, terms=28))
    total = shape.weights @ shape.fit.half_path**2
    left = shape.weights @ shape.expansion.rest**2
    assert np.sum(shape.expansion.orthonormal**2) + left == pytest.approx(total, rel=1e-10)
    assert left < 0.02 * total + 2 * 25e-10


def test_too_few_prisms_are_refused():
    with pytest.raises(EstimationError, match="15 Zernike terms: 14 points do not determine 15"):
        shape_of(prisms(np.zeros(2209), rows=np.arange(0, 2209, 160)), APERTURE)
    rows = np.arange(0, 2209, 100)
    one, two = prisms(np.zeros(2209), rows=rows), prisms(np.zeros(2209), rows=rows[:5])
    with pytest.raises(EstimationError, match="5 prisms in common"):
        change_between(one, two, APERTURE, settings=ShapeSettings())
