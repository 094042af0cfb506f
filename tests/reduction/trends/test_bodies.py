"""Structural models of bodies: planted truths come back, as sure as claimed."""

from dataclasses import dataclass

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.estimation.harmonic.body import rigid_design
from catseye.reduction.structure.group import Nominal, carrier_of
from catseye.reduction.trends.bodies import BodyPoints, TrendSettings, bodies_in_frames, fit_body
from catseye.reduction.trends.rigid import nightly_motion

YEAR = 365.25


@dataclass(frozen=True)
class BodyTruth:
    """What the simulated body does; m, rad, per degree C, per year.

    motion   (6,) arrays by cause: sine and cosine of elevation, temperature, year
    own      (n, 3) likewise
    steps    (night, point) -> (3,) m
    """

    motion: dict
    own: dict
    steps: dict
    outliers: np.ndarray


def simulated_body(nights=150, points=24, seed=1, *, frame="reflector", wind=2e-4, steps=None, outliers=0.003):
    """Points in the ground frame, and the truth.

    Covariances differ between nights; a tenth of the readings is absent.
    """
    rng = np.random.default_rng(seed)
    mjd = 61000.3 + np.sort(rng.choice(int(1.3 * nights), nights, replace=False))
    azimuth, elevation = rng.uniform(0.0, 6.0, nights), np.radians(rng.uniform(15.0, 85.0, nights))
    warm = 10.0 + 10.0 * np.sin(2.0 * np.pi * (mjd - 61100.0) / YEAR) + 4.0 * rng.normal(size=nights)
    place = rng.uniform(-50.0, 50.0, (points, 3)) * (1.0, 1.0, 0.3)
    causes = {
        "sin": (np.sin(elevation), 1.0),
        "cos": (np.cos(elevation), 1.0),
        "t": (warm - warm.mean(), 0.02),
        "year": ((mjd - mjd.mean()) / YEAR, 0.3),
    }
    size = np.repeat([2e-3, 3e-5], 3)
    motion = {name: rng.normal(size=6) * size * share for name, (_, share) in causes.items()}
    own = {name: rng.normal(size=(points, 3)) * 3e-4 * share for name, (_, share) in causes.items()}
    six = sum(np.outer(value, motion[name]) for name, (value, _) in causes.items())
    six = six + rng.normal(size=(nights, 6)) * np.repeat([wind, wind / 50.0], 3)
    x = place + np.einsum("nij,tj->tni", rigid_design(place - place.mean(axis=0)), six)
    x = x + sum(value[:, None, None] * own[name] for name, (value, _) in causes.items())
    for (night, point), step in (steps or {}).items():
        x[night:, point] += step
    root = 1e-4 * (0.25 * rng.normal(size=(nights, points, 3, 3)) + np.eye(3))
    covariance = root @ np.swapaxes(root, 2, 3)
    x = x + np.einsum("tnij,tnj->tni", root, rng.normal(size=x.shape))
    wrong = rng.random((nights, points)) < outliers
    x[wrong] += 3e-3 * rng.choice([-1.0, 1.0], (int(wrong.sum()), 3))
    x[rng.random((nights, points)) < 0.1] = np.nan
    carriers = [carrier_of(frame, a, e, nominal=Nominal()) for a, e in zip(azimuth, elevation, strict=True)]
    turn = np.array([carrier.rotation for carrier in carriers])
    body = BodyPoints(
        name="prism",
        names=tuple(f"P{k:03d}" for k in range(points)),
        mjd=mjd,
        azimuth=azimuth,
        elevation=elevation,
        temperature_c=warm,
        x=x @ np.swapaxes(turn, 1, 2) + np.array([carrier.translation for carrier in carriers])[:, None],
        covariance=turn[:, None] @ covariance @ np.swapaxes(turn, 1, 2)[:, None],
    )
    return body, BodyTruth(motion, own, dict(steps or {}), wrong & np.isfinite(x).all(axis=2))


CAUSES = {"sinE": "sin", "cosE": "cos", "t": "t", "year": "year"}
QUICK = TrendSettings(probability=1e-5, annual=False)


def departures(body, truth):
    """Departure of each point's displacement by each cause from the truth, over its claim, (causes, n, 3).

    Motion and own shifts together: where one ends and the other begins is a convention.
    """
    at = [body.functions.names.index(name) for name in CAUSES]
    r = rigid_design(body.place - body.middle)
    k = len(body.functions.names)
    q = body.motion.coefficient_covariance.reshape(k, 6, k, 6)
    estimate = np.einsum("nij,kj->kni", r, body.motion.coefficients[at]) + np.moveaxis(
        body.own.fit.coefficients[:, at], 1, 0
    )
    true = np.array([r @ truth.motion[name] + truth.own[name] for name in CAUSES.values()])
    variance = np.array([np.einsum("nij,jk,nik->ni", r, q[a, :, a], r) for a in at])
    variance += np.moveaxis(body.own.fit.u[:, at], 1, 0) ** 2
    return (estimate - true) / np.sqrt(variance)


def test_planted_truths_come_back():
    steps = {(75, 3): (0.6e-3, 0.0, 0.0), (40, 7): (0.0, 0.0, -1e-3)}
    points, truth = simulated_body(steps=steps)
    ((frame, part),) = bodies_in_frames(points, Nominal())
    assert frame == "reflector"
    body = fit_body(part, frame, QUICK, Nominal())
    assert body.functions.names == ("1", "sinE", "cosE", "t", "year")
    assert {(body.points.names[s.series]) for s in body.own.steps} == {"P003", "P007"}
    for step in body.own.steps:
        (night, _), size = next((key, v) for key, v in steps.items() if key[1] == step.series)
        assert abs(step.at - night) <= 2
        assert step.size == pytest.approx(size, abs=5.0 * np.sqrt(np.diag(step.covariance).max()))
    assert np.sum(body.outlier & ~truth.outliers) <= 3
    assert np.sum(body.outlier & truth.outliers) >= 0.9 * truth.outliers.sum()
    assert body.motion.found.steps == ()
    assert np.hypot(body.motion.found.noise.white, body.motion.found.noise.wander) * body.motion.scale == pytest.approx(
        np.repeat([2e-4, 4e-6], 3), rel=0.25
    )


def test_claims_are_those_that_scatter():
    """Departures of five bodies over their claims: one, to 20 %, as all points of a body share its motion."""
    ratios = []
    for seed in range(5):
        points, truth = simulated_body(nights=100, points=12, seed=20 + seed)
        body = fit_body(points, "reflector", QUICK, Nominal())
        ratios.append(departures(body, truth))
    assert np.sqrt(np.mean(np.array(ratios) ** 2)) == pytest.approx(1.0, abs=0.2)


def test_a_monument_that_moves_is_named_and_no_other():
    points, _ = simulated_body(
        nights=100, points=7, seed=4, frame="ground", steps={(50, 2): (2e-3, 0.0, 0.0)}, outliers=0.0
    )
    body = fit_body(points, "ground", QUICK, Nominal())
    assert [(body.points.names[s.series], s.at) for s in body.own.steps] == [("P002", 50)]
    assert body.own.steps[0].size == pytest.approx((2e-3, 0.0, 0.0), abs=2e-4)


def test_the_frame_is_where_points_rest():
    for frame in ("ground", "alidade", "reflector"):
        points, _ = simulated_body(nights=20, points=8, frame=frame)
        assert [found for found, _ in bodies_in_frames(points, Nominal())] == [frame]


def test_a_prediction_is_the_model():
    points, _ = simulated_body(nights=60, points=8, seed=3, outliers=0.0)
    body = fit_body(points, "reflector", QUICK, Nominal())
    t = 30
    place, covariance = body.predict(points.elevation[t], points.temperature_c[t], points.mjd[t])
    known = np.isfinite(body.displacement[t]).all(axis=1)
    rigid = rigid_design(body.place - body.middle) @ body.motion.values[t]
    away = (body.place + rigid + body.displacement[t] - place)[known]
    assert np.abs(away).max() < 2e-3  # four times wind, 0.2 mm and its lever
    assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_few_nights_and_few_points_are_said_or_modelled():
    points, _ = simulated_body(nights=3, points=8, seed=5)
    assert fit_body(points, "reflector", QUICK, Nominal()).functions.names == ("1",)
    points, _ = simulated_body(nights=40, points=3, seed=5)
    assert fit_body(points, "reflector", QUICK, Nominal()).motion is None
    points, _ = simulated_body(nights=1, points=8, seed=5)
    with pytest.raises(InputError, match="no point has more than 1 nights"):
        fit_body(points, "reflector", QUICK, Nominal())


def test_a_residual_is_against_the_others():
    """One point off by 1 mm among six: its residual is 1 mm, whatever it did to the motion."""
    rng = np.random.default_rng(2)
    arms = rng.uniform(-20.0, 20.0, (6, 3))
    arms -= arms.mean(axis=0)
    y = np.zeros((1, 6, 3))
    y[0, 4] = (1e-3, 0.0, 0.0)
    found = nightly_motion(y, np.broadcast_to(1e-8 * np.eye(3), (1, 6, 3, 3)).copy(), arms)
    assert found.residual[0, 4] == pytest.approx((1e-3, 0.0, 0.0), abs=1e-4)
    assert np.all(np.einsum("nii->ni", found.spread[0]) > 1e-8)
