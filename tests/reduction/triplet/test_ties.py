"""Triplets in a network: the groups predict what exact geometry measures, and a shared lateral offset comes out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import InputError
from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Distances, ObservedCoordinates
from catseye.estimation.observations.unit_direction import across
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.reduction.triplet.ties import (
    BALL,
    COUNT,
    LATERAL,
    TILT,
    TripletParameters,
    prism_ranges,
    triplet_observations,
    triplet_start,
)
from catseye.reduction.triplet.use import MountedTriplet

RATIO = 1.527077


def sheet(turn, ball):
    r = turn.as_matrix()
    return MountedTriplet(
        "TR", ball=np.asarray(ball), normal=r[:, 2], axis=r[:, 0], d_12=0.635, h_corr=0.2e-3,
        heights=np.array([0.0384, 0.0382]), ratio=RATIO, u_d_12=30e-6, u_h_corr=20e-6, u_lateral=40e-6, u_normal=5e-3,
    )  # fmt: skip


def ranged(u, s):
    d = np.linalg.norm(s[:, None] - u.prisms, axis=2)
    cosine = np.einsum("kpi,i->kp", s[:, None] - u.prisms, u.normal) / d
    return d - obliquity_correction(u.heights, u.ratio, cosine)


@given(st.integers(0, 2**32 - 1))
def test_the_truth_leaves_no_residual(seed):
    """A unit that leans 5 mrad from its sheet with its ball 1 mm aside: at the true parameters everything observed is
    predicted. What stays is the second order of 5 mrad in dPc: 1/2 d2dPc/dI2 (5 mrad)^2, 0.1 um at 30 deg."""
    rng = np.random.default_rng(seed)
    u = sheet(Rotation.random(random_state=rng), rng.normal(size=3) * 30.0)
    e = across(u.normal[None])[0]
    tilt = 5e-3 * rng.uniform(-1.0, 1.0, 2)
    normal = u.normal + tilt @ e
    normal /= np.linalg.norm(normal)
    axis = u.axis - (u.axis @ normal) * normal
    real = replace(u, normal=normal, axis=axis / np.linalg.norm(axis))
    aside = 1e-3 * rng.normal(size=2)
    ball = u.ball + aside[0] * real.axis + aside[1] * np.cross(normal, real.axis)
    off = rng.uniform(-0.3, 0.3, (3, 2))
    s = u.ball + 60.0 * (normal + off[:, :1] * real.axis + off[:, 1:] * real.across)
    zero = np.array([1e-3, -2e-3, 0.0])
    at = TripletParameters(np.array([9]))
    x = np.concatenate([s.ravel(), real.prisms.ravel(), ball, tilt, aside, zero])
    groups = triplet_observations([u], at)
    np.testing.assert_allclose(groups[0].predict(x)[0], groups[0].observed, rtol=0, atol=1e-13)
    ranges = (ranged(real, s) + zero[:, None])[None]
    group = prism_ranges(
        "r", [u], at, scan_points=s, scan_columns=np.array([0, 3, 6]), ranges=ranges, covariance=np.ones(6),
        zeros=np.array([22, 23, 24]),
    )  # fmt: skip
    residual = group.observed - group.predict(x)[0]
    np.testing.assert_allclose(residual, 0.0, rtol=0, atol=0.15e-6)
    level = x.copy()
    level[9 + TILT : 9 + TILT + 2] = 0.0
    without = group.observed - group.predict(level)[0]
    if np.abs(without).max() > 1e-6:  # the tilts' own share of it is right in sign and size
        assert np.abs(residual).max() < 0.12 * np.abs(without).max()


def test_every_parameter_has_one_prior():
    units = [sheet(Rotation.identity(), [0.0, 0.0, 0.0])] * 3
    first = COUNT * np.arange(3)
    own = triplet_observations(units, TripletParameters(first))
    assert own[1].columns.tolist() == [9, 10, 22, 23, 35, 36]
    assert own[2].columns.tolist() == [11, 12, 24, 25, 37, 38]
    np.testing.assert_allclose(own[1].covariance, 25e-6)
    np.testing.assert_allclose(own[2].covariance, 1.6e-9)
    shared = triplet_observations(units, TripletParameters(first, np.full(3, first[0] + LATERAL)))
    assert shared[2].columns.tolist() == [11, 12]
    assert shared[0].offset[:, :2].tolist() == [[11, 12]] * 3


def test_a_lateral_offset_is_determined_by_many_postures():
    """Eight postures turned about all axes; prisms and ball known to 20 um each time: the offset of the ball, 0.3 mm
    with a prior of 0.2 mm, is found to u = 20 um sqrt(1 + 1/2) / sqrt(8) = 8.7 um, and lies within 4 u of the truth."""
    rng = np.random.default_rng(21)
    truth, u_point, m = np.array([0.25e-3, -0.17e-3]), 20e-6, 8
    units, points = [], []
    for _ in range(m):
        u = replace(sheet(Rotation.random(random_state=rng), rng.normal(size=3) * 30.0), u_lateral=0.2e-3)
        units.append(u)
        ball = u.ball + truth[0] * u.axis + truth[1] * u.across
        points.append(np.concatenate([u.prisms.ravel(), ball]))
    first = COUNT * np.arange(m)
    groups = list(triplet_observations(units, TripletParameters(first, np.full(m, LATERAL))))
    columns = (first[:, None] + [0, 3, BALL]).ravel()
    observed = np.concatenate(points) + u_point * rng.normal(size=9 * m)
    groups.append(ObservedCoordinates.of_points("points", observed, np.full(9 * m, u_point**2), columns))
    free = np.ones(COUNT * m, dtype=bool)
    free[(first[1:, None] + [LATERAL, LATERAL + 1]).ravel()] = False  # nothing uses the others' own
    solution = adjust(triplet_start(units), groups, free=free).require_converged()
    found = solution.x[LATERAL : LATERAL + 2]
    u_found = np.sqrt(np.diag(solution.covariance)[LATERAL : LATERAL + 2])
    expected = 1.0 / np.sqrt(m / (1.5 * u_point**2) + 1.0 / 0.2e-3**2)
    assert u_found[0] == pytest.approx(expected, rel=0.01)
    # across it the plate's normal, 5 mrad on 0.2 mm of height, adds 1 um in each posture
    assert u_found[1] == pytest.approx(expected, rel=0.02)
    assert np.abs((found - truth) / u_found).max() < 4.0
    assert np.abs(found).min() > 10 * u_found.max()  # it is not the prior that answers


def test_a_ranger_that_missed_a_prism_has_one_range_less():
    u = sheet(Rotation.identity(), [0.0, 0.0, 0.0])
    s = np.array([[0.0, 1.0, 60.0], [5.0, 0.0, 50.0]])
    d = ranged(u, s)[None]
    common = {"scan_points": s, "scan_columns": np.array([0, 3]), "covariance": 1e-10 * np.eye(4)}
    at = TripletParameters(np.array([6]))
    whole = prism_ranges("r", [u], at, ranges=d, **common)
    d[0, 0, 1] = np.nan
    part = prism_ranges("r", [u], at, ranges=d, **common)
    assert isinstance(part, Distances)
    assert part.origin.tolist() == [0, 3, 3]
    assert part.target.tolist() == [6, 6, 9]
    assert part.covariance.shape == (3, 3)
    np.testing.assert_array_equal(part.observed, whole.observed[[0, 2, 3]])
    assert (part.nuisance[:, 2] == -1).all()


def test_what_does_not_fit_is_refused():
    u = sheet(Rotation.identity(), [0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="columns of 2 and 2 triplets for 1 units"):
        triplet_observations([u], TripletParameters(np.array([0, 13])))
    with pytest.raises(InputError, match=r"r: ranges \(1, 2\), covariance \(2,\); expected \(1, 1, 2\) and \(2,\)"):
        prism_ranges(
            "r", [u], TripletParameters(np.array([3])), scan_points=[[0.0, 0.0, 50.0]], scan_columns=np.array([0]),
            ranges=[[50.0, 50.0]], covariance=np.ones(2),
        )  # fmt: skip
