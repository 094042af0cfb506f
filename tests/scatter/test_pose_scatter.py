"""Claimed covariances of poses, pointing fits and track profiles against the scatter of many draws."""

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.estimation.shapes.pose import PlaceCovariances, fit_pose
from catseye.geometry.antenna.pointing_series import TERMS, published
from catseye.records.laboratory.tilts import TiltReadings
from catseye.reduction.pose.pointing_fit import fit_pointing
from catseye.reduction.pose.series_comparison import compare_series
from catseye.reduction.pose.track_profile import joined_tilt, track_profile
from draws import draws


def holds(sample, claimed, count):
    """The sample's covariance in units of the claimed one is the unit matrix, within four of its own uncertainties."""
    half = np.linalg.inv(np.linalg.cholesky(claimed))
    np.testing.assert_allclose(half @ np.cov(sample.T) @ half.T, np.eye(len(claimed)), rtol=0, atol=6.0 / count**0.5)
    u = np.sqrt(np.diag(claimed))
    return sample.mean(axis=0) / u * count**0.5


@draws(3, name="thirds")
@pytest.mark.parametrize("robust", [None, "igg3"])
def test_poses_scatter_as_their_covariance(robust, thirds):
    rng, n, count = np.random.default_rng(21), 8, (200 if robust is None else 30) * thirds
    x = rng.uniform(-30, 30, (n, 3))
    q1, q2 = (r @ r.T for r in rng.normal(size=(2, 3 * n, 4 * n)) * 3e-5)
    sample, chi2 = [], []
    for _ in range(count):
        first = x + rng.multivariate_normal(np.zeros(3 * n), q1).reshape(-1, 3)
        second = x + rng.multivariate_normal(np.zeros(3 * n), q2).reshape(-1, 3)
        found = fit_pose(
            [str(k) for k in range(n)], first, second, frame="g", covariance=PlaceCovariances(first=q1, second=q2),
            pivot=np.zeros(3), robust=robust,
        )  # fmt: skip
        sample.append(np.concatenate([found.translation, found.rotation]))
        chi2.append(found.motion.pvv)
    off = holds(np.array(sample), found.covariance if robust is None else _full(x, q1, q2), count)
    assert np.abs(off).max() < 4.0
    if robust is None:
        assert np.mean(chi2) == pytest.approx(18.0, abs=4 * (36 / count) ** 0.5)


def _full(x, q1, q2):
    names = [str(k) for k in range(len(x))]
    return fit_pose(
        names, x, x, frame="g", covariance=PlaceCovariances(first=q1, second=q2), pivot=np.zeros(3)
    ).covariance


def test_pointing_fits_scatter_as_their_covariance():
    rng, n, count = np.random.default_rng(22), 60, 800
    a, e = rng.uniform(0, 2 * np.pi, n), rng.uniform(10, 80, n) * DEGREE
    truth = published().correction(a, e)
    fits = [
        fit_pointing(a, e, truth + rng.normal(size=(n, 2)) * 5.2 * ARCSECOND, u=5.2 * ARCSECOND) for _ in range(count)
    ]
    sample = np.array([f.series.values - published().values for f in fits])
    assert np.abs(holds(sample, fits[0].series.covariance, count)).max() < 4.0
    assert np.mean([f.variance_factor for f in fits]) == pytest.approx(1.0, abs=4 * (2 / 112 / count) ** 0.5)
    p = np.array([compare_series(published(), f.series).p for f in fits])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=4 * (0.0475 / count) ** 0.5)


def test_without_a_claim_the_scatter_gives_the_uncertainty():
    rng, n, count = np.random.default_rng(23), 40, 400
    a, e = rng.uniform(0, 2 * np.pi, n), rng.uniform(10, 80, n) * DEGREE
    truth = published().correction(a, e)
    fits = [fit_pointing(a, e, truth + rng.normal(size=(n, 2)) * 3.0 * ARCSECOND) for _ in range(count)]
    k = TERMS.index("AN")
    w = [(f.series.values[k] - published().values[k]) / f.series.covariance[k, k] ** 0.5 for f in fits]
    assert np.std(w) == pytest.approx((72 / 70) ** 0.5, abs=4 / (2 * count) ** 0.5)  # Student's t


def test_track_profiles_scatter_as_their_covariance():
    rng, count = np.random.default_rng(24), 500
    azimuth = np.arange(0, 360, 40) * DEGREE
    q = np.repeat((np.array([[1.0, 0.3], [0.3, 0.7]]) * ARCSECOND**2)[None], len(azimuth), axis=0)
    at, u = rng.uniform(0, 2 * np.pi, 50), np.full(50, 0.2 * ARCSECOND)
    zero = np.array([30.0, -12.0]) * ARCSECOND
    sample = []
    for _ in range(count):
        turn = rng.multivariate_normal(np.zeros(2), q[0], len(azimuth))
        tilts = TiltReadings(np.zeros(50), at, zero + rng.normal(size=(50, 2)) * 0.2 * ARCSECOND, u, "")
        found = track_profile(azimuth, turn, q, tilts=tilts, harmonics=2)
        sample.append(np.concatenate([found.series.values, found.zero[0] - zero]))
    sample = np.array(sample)
    own = found.series.covariance
    assert np.abs(holds(sample[:, :-2], own, count)).max() < 4.0
    assert np.abs(holds(sample[:, -2:], found.zero[1], count)).max() < 4.0


def test_a_joined_inclinometer_scatters_as_claimed():
    rng, count = np.random.default_rng(25), 3000
    root = rng.normal(size=(6, 8)) * np.array([1e-4] * 3 + [5e-6] * 3)[:, None]
    q, u = root @ root.T, 1e-6
    six = rng.multivariate_normal(np.zeros(6), q, count)
    tilt = rng.normal(size=(count, 2)) * u
    sample = np.array([joined_tilt(s, q, t, u=u)[0] for s, t in zip(six, tilt, strict=True)])
    claimed = joined_tilt(six[0], q, tilt[0], u=u)[1]
    assert np.abs(holds(sample, claimed, count)).max() < 4.0
    assert np.all(np.diag(claimed)[3:5] < u**2)
