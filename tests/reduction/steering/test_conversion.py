"""Conversion of points with covariance: Monte Carlo, invariants, verdicts."""

import numpy as np
import pytest

from catseye.geometry.antenna.rigid_telescope import FRAMES, RigidTelescope
from catseye.reduction.steering.conversion import converted, depends_on_posture

RNG = np.random.default_rng(244)
POINT = np.array([[-7.5943, -9.0847, 51.8391]])
ROOT = RNG.normal(size=(3, 3)) * 1e-3
COVARIANCE = (ROOT @ ROOT.T)[None]
U_POSTURE = (2e-5, 1e-5)
POSTURE = (np.radians(145.3), np.radians(30.0))


@pytest.mark.parametrize(
    ("to", "from_"),
    [("ground", "reflector"), ("feed_arm", "ground"), ("alidade", "prime_focus"), ("ground", "alidade")],
)
def test_the_covariance_is_that_of_draws(to, from_):
    found = converted(POINT, RigidTelescope(*POSTURE), to=to, from_=from_, covariance=COVARIANCE, u_posture=U_POSTURE)
    draws = 1000
    drawn = np.empty((draws, 3))
    for k in range(draws):
        telescope = RigidTelescope(*(np.array(POSTURE) + np.array(U_POSTURE) * RNG.normal(size=2)))
        drawn[k] = telescope.between(to, from_).points(POINT[0] + ROOT @ RNG.normal(size=3))
    sample, claim = np.cov(drawn.T), found.covariance[0]
    # a sample covariance of n draws scatters by sqrt((s_ii s_jj + s_ij^2)/n): four of these
    scatter = np.sqrt((np.outer(np.diag(claim), np.diag(claim)) + claim**2) / draws)
    assert np.all(np.abs(sample - claim) < 4.0 * scatter)
    np.testing.assert_allclose(drawn.mean(axis=0), found.after[0], atol=4.0 * np.sqrt(claim.trace() / draws))


def test_a_posture_moves_nothing_within_one_body():
    found = converted(
        POINT, RigidTelescope(*POSTURE), to="subreflector", from_="feed_arm", covariance=COVARIANCE, u_posture=U_POSTURE
    )
    np.testing.assert_allclose(found.covariance, COVARIANCE, rtol=1e-12)
    np.testing.assert_allclose(found.after - found.before, [[0.0, -8.0, -50.0]], atol=1e-12)


def test_dependence_on_the_posture_is_that_of_the_transforms():
    here, there = RigidTelescope(0.3, 0.6), RigidTelescope(0.5, 0.9)
    for to in FRAMES:
        for from_ in FRAMES:
            same = np.allclose(here.between(to, from_).points(POINT), there.between(to, from_).points(POINT))
            assert depends_on_posture(to, from_) is not same, (to, from_)


def test_points_in_millimetres_are_doubted():
    found = converted(POINT * 1e3, RigidTelescope(*POSTURE), to="ground", from_="reflector")
    assert found.verdict.word == "doubtful"
    assert "in millimetres it would be" in found.verdict.why
    assert converted(POINT, RigidTelescope(*POSTURE), to="ground", from_="reflector").verdict.word == "good"
