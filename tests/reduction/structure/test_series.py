"""A group's flexible model: against planted coefficients, scatter and a bent body that the formulas do not know."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import EstimationError, InputError, ValidityError
from catseye.estimation.harmonic.series import Spread
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.frames.rotation import from_vector
from catseye.reduction.structure.check import left_out
from catseye.reduction.structure.series import GroupSeries, SeriesModel, fit_structure
from draws import draws, same_sigmas

PIVOT = np.array([0.0, -8.0, 10.0])


def planted(seed, *, epochs=40, n=8, noise=0.05, wind=(0.0, 0.0), own=0.0, hysteresis=0.0, dense=True):
    """A series by rotations of a body, not by small turns; sizes in mm, turns for 40 m.

    wind   of the shift, mm, and of the turn, arc seconds, new in each epoch
    own    mm, of each point, new in each epoch
    """
    rng = np.random.default_rng(seed)
    truth = np.random.default_rng(99)  # the same telescope for all seeds
    rest = PIVOT + truth.uniform(-3.0, 3.0, (n, 3)) + np.linspace(2.0, 45.0, n)[:, None] * [0.0, 0.3, 0.95]
    e = np.linspace(8.0, 85.0, epochs) * DEGREE
    e = np.where(np.arange(epochs) % 2, e, e[::-1])
    way = np.sign(np.diff(e, prepend=e[0] - 1.0))
    warm = 10.0 + 4.0 * rng.normal(size=epochs)
    coefficients = truth.normal(size=(6, 4)) * np.repeat([5.0 * MILLIMETRE, 20.0 * ARCSECOND], 3)[:, None]
    coefficients[:, 3] *= 0.05
    rows = np.stack([np.sin(e), np.cos(e), warm - 10.0, np.zeros(epochs)], axis=1)
    rows[:, 3] = rows[:, 2]
    six = np.stack([np.sin(e), np.cos(e), way * hysteresis, warm - 10.0], axis=1) @ coefficients.T
    six += rng.normal(size=six.shape) * np.repeat([wind[0] * MILLIMETRE, wind[1] * ARCSECOND], 3)
    places = np.array([PIVOT + s[:3] + (rest - PIVOT) @ from_vector(s[3:]).T for s in six])
    root = np.linalg.cholesky(np.eye(3 * n) + 0.5) * noise * MILLIMETRE
    true = places.copy()
    places = places + (rng.normal(size=(epochs, 3 * n)) @ root.T).reshape(epochs, n, 3)
    places += rng.normal(size=places.shape) * own * MILLIMETRE
    spread = (
        Spread(full=(root @ root.T)[None]) if dense else Spread(points=np.eye(3)[None, None] * 1.5 * root[0, 0] ** 2)
    )
    names = tuple(f"P{i}" for i in range(n))
    mjd = 60000.0 + np.arange(epochs) / 48.0
    posture = TelescopePosture(np.zeros(epochs), e, warm)
    labels = tuple(f"epoch {t}" for t in range(epochs))
    return GroupSeries("arm", "reflector", names, mjd, posture, way, places, spread, PIVOT, labels), true


def test_planted_motion_is_recovered_and_predicted():
    series, true = planted(1)
    found = fit_structure(series, SeriesModel(scatter=False))
    told = found.predict(series.posture.elevation, temperature_c=series.posture.temperature_c)
    u = np.sqrt(np.einsum("tnii->tni", told.covariance))
    assert np.sqrt(np.mean(((told.place - true) / u) ** 2)) < 1.5
    assert np.abs(told.place - true).max() < 0.1 * MILLIMETRE
    assert 0.8 < found.fit.variance_factor < 1.2
    assert told.outside == ()
    assert told.six.shape == (40, 6)
    assert np.abs(told.six.mean(axis=0)).max() < 1e-12


@draws(60)
def test_foretelling_covers_the_truth_as_often_as_it_claims(runs):
    """Over campaigns with wind: the epoch to come, its new wind with it, against the claimed covariance."""
    squares, u = [], []
    for seed in range(runs):
        series, _ = planted(seed, epochs=41, wind=(0.3, 3.0), own=0.1)
        found = fit_structure(series.part(np.arange(40)), SeriesModel())
        told = found.predict(
            series.posture.elevation[40:], temperature_c=series.posture.temperature_c[40:], way=series.way[40:]
        )
        e = (series.places[40] - told.place[0]).ravel()
        q = told.covariance[0] + series.spread.full[0].reshape(8, 3, 8, 3)[np.arange(8), :, np.arange(8)]
        squares.append([e[3 * p : 3 * p + 3] @ np.linalg.solve(q[p], e[3 * p : 3 * p + 3]) for p in range(8)])
        u.append([*found.scatter.u_six[:3], found.scatter.u_point])
    # points of an epoch share its wind: 60 epochs, of some 6 degrees of freedom each
    assert abs(np.mean(squares) / 3.0 - 1.0) < 4.0 * np.sqrt(2.0 / (runs * 5))
    np.testing.assert_allclose(np.mean(u, axis=0)[3], 0.1 * MILLIMETRE, rtol=same_sigmas(0.05, 60, runs))
    np.testing.assert_allclose(np.mean(u, axis=0)[:3], 0.3 * MILLIMETRE, rtol=same_sigmas(0.15, 60, runs))


def test_epochs_left_out_are_predicted_as_claimed_and_small_claims_detected():
    series, _ = planted(4, epochs=60, wind=(0.3, 3.0), own=0.1)
    honest = left_out(series, SeriesModel())
    assert 0.75 < honest.ratio < 1.3
    proud = left_out(series, SeriesModel(scatter=False))
    assert proud.ratio > 2.0
    assert honest.rms < 0.8 * MILLIMETRE


def test_hysteresis_is_found_where_it_is_and_not_where_it_is_not():
    for planted_mm in (0.0, 0.3):
        series, _ = planted(6, hysteresis=planted_mm)
        found = fit_structure(series, SeriesModel(hysteresis=True, scatter=False))
        six, q = found.six_of()
        at = found.model.functions.index("up")
        own = q[6 * at : 6 * at + 6, 6 * at : 6 * at + 6]
        value = six[:, at] @ np.linalg.solve(own, six[:, at])
        assert (value > 100.0) == (planted_mm > 0.0)
        if not planted_mm:
            assert value < 25.0  # six degrees of freedom


def test_two_harmonics_and_points_of_their_own_are_nested():
    """More freedom never fits worse, and with no more to find the answer stays within its uncertainty."""
    series, true = planted(7, epochs=60)
    pvv = []
    for model in (SeriesModel(scatter=False), SeriesModel(2, scatter=False), SeriesModel(2, own="each", scatter=False)):
        found = fit_structure(series, model)
        told = found.predict(series.posture.elevation, temperature_c=series.posture.temperature_c)
        off = (told.place - true) / np.sqrt(np.einsum("tnii->tni", told.covariance))
        assert np.sqrt(np.mean(off**2)) < 1.4
        pvv.append(found.fit.pvv)
    assert pvv[0] > pvv[1] > pvv[2]


def test_points_alone_and_points_together_agree_where_they_are_independent():
    series, _ = planted(8, dense=False)
    q = np.einsum("nq,ij->niqj", np.eye(8), series.spread.points[0, 0]).reshape(24, 24)
    for model in (SeriesModel(scatter=False), SeriesModel(own="each", scatter=False), SeriesModel()):
        one = fit_structure(series, model)
        two = fit_structure(replace(series, spread=Spread(full=q[None])), model)
        for a, b in zip(one.six_of(), two.six_of(), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-9 * np.abs(b).max())


def test_predictions_outside_the_epochs_are_flagged():
    found = fit_structure(planted(1)[0])
    told = found.predict([5.0 * DEGREE, 45.0 * DEGREE], temperature_c=[10.0, 60.0])
    assert len(told.outside) == 2
    assert told.outside[0].startswith("elevation 5 deg is outside 9.97")
    assert "temperature 60 C" in told.outside[1]
    near, far = (found.predict([x * DEGREE]).covariance[0, 0, 0, 0] for x in (45.0, -30.0))
    assert far > near


def test_the_motion_of_an_epochs_residuals_is_that_of_a_body():
    found = fit_structure(planted(1)[0], SeriesModel(scatter=False))
    six = np.array([1e-3, -2e-3, 0.5e-3, 3e-5, -1e-5, 2e-5])
    residual = np.full_like(found.fit.residual, np.nan)
    residual[0] = six[:3] + np.cross(six[3:], found.arms)
    residual[1, :2] = residual[0, :2]  # two points: a turn about their line is open
    motion = replace(found, fit=replace(found.fit, residual=residual)).residual_motion
    np.testing.assert_allclose(motion[0], six, rtol=1e-9, atol=1e-15)
    assert np.isnan(motion[1:]).all()


def test_unknown_or_floating_quantities_are_refused_by_name():
    series, _ = planted(1)
    warm = np.array(series.posture.temperature_c)
    warm[3] = np.nan
    blind = replace(series, posture=TelescopePosture(series.posture.azimuth, series.posture.elevation, warm))
    with pytest.raises(InputError, match="epoch epoch 3: its temperature is unknown"):
        fit_structure(blind)
    fit_structure(blind, SeriesModel(temperature=False))
    still = replace(series, way=np.zeros(40))
    with pytest.raises(EstimationError, match=r"arm by 'up' floats"):
        fit_structure(still, SeriesModel(hysteresis=True))
    with pytest.raises(EstimationError, match=r"group 'arm'.* of [A-Z]\w+ by '.*3 epochs"):
        fit_structure(series.part(np.arange(3)), SeriesModel(own="each", scatter=False))
    with pytest.raises(InputError, match="stretches"):
        left_out(series, folds=1)
    with pytest.raises(ValidityError, match="3 harmonics"):
        SeriesModel(3)
