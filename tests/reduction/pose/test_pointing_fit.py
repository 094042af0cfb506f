"""The series from stars and from metrology: found as planted, honest where terms resemble each other."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import EstimationError
from catseye.geometry.antenna.pointing_series import TERMS, PointingSeries, published
from catseye.reduction.pose.pointing_fit import fit_pointing
from catseye.reduction.pose.series_comparison import compare_series


def sky(n=60, seed=1, low=10.0, high=80.0):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, 2 * np.pi, n), rng.uniform(low, high, n) * DEGREE, rng


def test_exact_offsets_give_the_published_terms_back():
    a, e, _ = sky()
    found = fit_pointing(a, e, published().correction(a, e), u=ARCSECOND)
    np.testing.assert_allclose(found.series.values, published().values, rtol=0, atol=1e-6 * ARCSECOND)
    assert found.sky_rms < 1e-6 * ARCSECOND


def test_the_fit_is_scipys():
    a, e, rng = sky()
    seen = published().correction(a, e) + rng.normal(size=(60, 2)) * 3 * ARCSECOND
    found = fit_pointing(a, e, seen)

    def model(_, ia, ie, ca, npae, aw, an, hzcz, hzsz):  # the printed formula, in arc seconds
        x = ca + npae * np.sin(e) + ia * np.cos(e) + aw * np.cos(a) * np.sin(e) + an * np.sin(a) * np.sin(e)
        y = -ie - aw * np.sin(a) + an * np.cos(a) + hzcz * np.sin(e) + hzsz * np.cos(e)
        return np.concatenate([x, y])

    values, q = curve_fit(model, np.zeros(120), seen.T.ravel() / ARCSECOND, p0=np.ones(8))
    np.testing.assert_allclose(found.series.values / ARCSECOND, values, rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.sqrt(np.diag(found.series.covariance)) / ARCSECOND, np.sqrt(np.diag(q)), rtol=1e-5)


def test_similar_terms_are_named_with_u_and_predictions_stay_good():
    a, e, rng = sky(80, low=25.0, high=65.0)
    seen = published().correction(a, e) + rng.normal(size=(80, 2)) * 5.2 * ARCSECOND
    found = fit_pointing(a, e, seen, u=5.2 * ARCSECOND)
    across, up = found.weak
    assert set(across.parts) == {"IA", "CA", "NPAE"}
    assert set(up.parts) == {"IE", "HZCZ", "HZSZ"}
    assert up.u > 20 * ARCSECOND  # hardly known
    assert up.u_on_the_sky < 1.0 * ARCSECOND  # and hardly matters there
    assert "arcsec; over" in up.text
    assert "IE" in up.text
    assert found.condition > 50.0
    u = np.sqrt(np.diag(found.series.covariance_of_correction(1.0, 45 * DEGREE)))
    off = found.series.correction(1.0, 45 * DEGREE) - published().correction(1.0, 45 * DEGREE)
    assert np.all(u < 1.5 * ARCSECOND)
    assert np.all(np.abs(off) < 4 * u)


def test_stars_at_one_elevation_determine_one_of_three_and_name_floating_terms():
    a, _, _ = sky()
    e = np.full(60, 45 * DEGREE)
    with pytest.raises(EstimationError, match=r"not determined.*IE.*HZCZ.*HZSZ"):
        fit_pointing(a, e, published().correction(a, e), u=ARCSECOND)
    found = fit_pointing(a, e, published().correction(a, e), u=ARCSECOND, terms=("CA", "IE", "AN", "AW"))
    assert found.series.terms == ("CA", "IE", "AN", "AW")


def test_a_wrong_star_is_rejected_by_name_only_on_request():
    a, e, rng = sky()
    seen = published().correction(a, e) + rng.normal(size=(60, 2)) * 2 * ARCSECOND
    seen[17, 1] += 60 * ARCSECOND
    assert fit_pointing(a, e, seen).used.all()
    found = fit_pointing(a, e, seen, reject=True)
    assert np.flatnonzero(~found.used).tolist() == [17]
    assert np.isnan(found.w[17]).all()
    assert abs(found.residual[17, 1] - 60 * ARCSECOND) < 10 * ARCSECOND
    assert found.sky_rms < 4 * ARCSECOND


def test_metrology_goes_in_with_its_own_covariance():
    """Correlated pairs: against the normal equations written out."""
    a, e, rng = sky(20)
    blocks = [r @ r.T for r in rng.normal(size=(20, 2, 3)) * ARCSECOND]
    q = np.zeros((40, 40))
    for k, block in enumerate(blocks):
        q[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    seen = published().correction(a, e) + np.linalg.cholesky(q).dot(rng.normal(size=40)).reshape(-1, 2)
    found = fit_pointing(a, e, seen, covariance=q)
    from catseye.geometry.antenna.pointing_series import design

    d = design(a, e).reshape(40, 8)
    inverse = np.linalg.inv(d.T @ np.linalg.solve(q, d))
    np.testing.assert_allclose(found.series.covariance, inverse, rtol=0, atol=1e-6 * np.abs(inverse).max())
    np.testing.assert_allclose(
        found.series.values, inverse @ d.T @ np.linalg.solve(q, seen.ravel()), rtol=0, atol=1e-4 * ARCSECOND
    )
    assert not found.scaled


def test_two_series_that_differ_along_the_weak_direction_agree_on_the_sky():
    a, e, rng = sky(low=25.0, high=65.0)
    fits = [
        fit_pointing(a, e, published().correction(a, e) + rng.normal(size=(60, 2)) * 5 * ARCSECOND, u=5 * ARCSECOND)
        for _ in range(2)
    ]
    found = compare_series(fits[0].series, fits[1].series)
    assert found.p > 1e-3
    moved = PointingSeries(TERMS, fits[1].series.values + np.eye(8)[TERMS.index("CA")] * 20 * ARCSECOND,
                           fits[1].series.covariance)  # fmt: skip
    assert compare_series(fits[0].series, moved).p < 1e-6
    assert np.isnan(compare_series(published(), published()).p)
    assert compare_series(published(), published()).rms_on_the_sky == 0.0
    with pytest.raises(EstimationError, match="no term is common"):
        compare_series(
            PointingSeries(("IA",), np.zeros(1), np.zeros((1, 1))),
            PointingSeries(("CA",), np.zeros(1), np.zeros((1, 1))),
        )


@pytest.mark.parametrize(
    ("n", "u", "said"), [(3, 1.0, "cannot determine 8 terms"), (4, None, "only just determine|not determined")]
)
def test_too_few_stars_are_refused(n, u, said):
    a, e, _ = sky(n)
    with pytest.raises(EstimationError, match=said):
        fit_pointing(a, e, published().correction(a, e), u=u)
