"""Wavefront tilts against ways of light measured after the mirrors have really moved, by Fermat, and known optics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.antenna.beam_deviation import (
    Gregorian,
    aperture,
    prime_focus_tilt,
    subreflector_tilt,
)

GBT = aperture(60.0, (0.0, 54.0), 50.0)
FOCUS = np.array([0.0, 0.0, 60.0])
SUB = Gregorian()
small = st.floats(-1.0, 1.0)


def way_by_the_moved_ellipsoid(surface, turn, shift, pivot):
    """Length surface point -> ellipsoid, moved as a body -> F2: where it is stationary over the mirror (Fermat).

    The mirror is given by its two foci alone and followed in its own axes; the stationary point is searched for.
    """
    f2 = SUB.second_focus(FOCUS)
    back = Rotation.from_rotvec(turn).inv()
    a, b = (back.apply(p - pivot - shift) + pivot for p in (surface, f2))  # both ends as the mirror sees them
    middle, c = 0.5 * (FOCUS + f2), 0.5 * SUB.interfocal
    big = c / SUB.eccentricity
    minor = np.sqrt(big**2 - c**2)
    axis = (f2 - FOCUS) / SUB.interfocal
    side = np.cross(axis, [1.0, 0.0, 0.0])
    base = np.array([np.cross(side, axis), side, axis])  # rows

    def point(v):
        n = np.array([v[0], v[1], -np.sqrt(max(1.0 - v[0] ** 2 - v[1] ** 2, 0.0))])  # the end beyond F1
        return middle + (n * [minor, minor, big]) @ base

    start = Gregorian().reflections(aperture_at(surface))[0]
    local = base @ (start - middle) / [minor, minor, big]
    v = local[:2]

    def way(u):
        p = point(u)
        return np.linalg.norm(p - a) + np.linalg.norm(p - b)

    for _ in range(30):  # Newton on the gradient: a saddle is stationary, too
        h = 1e-4
        g = np.array([(way(v + h * d) - way(v - h * d)) / (2 * h) for d in np.eye(2)])
        H = np.empty((2, 2))
        for i in range(2):
            for j in range(2):
                di, dj = h * np.eye(2)[i], h * np.eye(2)[j]
                H[i, j] = (way(v + di + dj) - way(v + di - dj) - way(v - di + dj) + way(v - di - dj)) / (4 * h * h)
        step = np.linalg.solve(H, g)
        v = v - step
        if np.abs(step).max() < 1e-9:
            break
    return way(v)


def aperture_at(surface):
    from dataclasses import replace

    return replace(GBT, surface=surface[None], inside=np.zeros((1, 2)), weight=np.ones(1))


@settings(max_examples=4)
@given(st.lists(small, min_size=6, max_size=6))
def test_a_subreflector_that_moves_changes_the_ways_as_fermat_has_it(v):
    v = np.array(v)
    turn, shift, pivot = 2e-5 * v[:3], 2e-4 * v[3:], np.array([0.3, -3.0, 62.0])
    coarse = GBT.surface[::127]
    moved = np.array([way_by_the_moved_ellipsoid(s, turn, shift, pivot) for s in coarse])
    rest = np.array([way_by_the_moved_ellipsoid(s, np.zeros(3), np.zeros(3), pivot) for s in coarse])
    p = SUB.reflections(GBT)[::127]
    delta = shift + np.cross(turn, p - pivot)
    units = [(p - q) / np.linalg.norm(p - q, axis=1)[:, None] for q in (coarse, SUB.second_focus(FOCUS))]
    found = np.sum(delta * (units[0] + units[1]), axis=1)
    np.testing.assert_allclose(moved - rest, found, rtol=0, atol=5e-8)  # (3e-4 m)^2 / 4 m, and rounding of 1e-9


def test_the_tilts_are_the_planes_through_those_ways():
    """The quadrature against a plane fitted to very many points scattered evenly, by lstsq."""
    rng = np.random.default_rng(3)
    inside = rng.uniform(-50, 50, (200_000, 2))
    inside = inside[np.hypot(*inside.T) < 50]
    xy = inside + np.array([0.0, 54.0])
    surface = np.column_stack([xy, np.sum(xy**2, axis=1) / 240.0])
    from dataclasses import replace

    many = replace(GBT, surface=surface, inside=inside, weight=np.ones(len(inside)))
    p, f2 = SUB.reflections(many), SUB.second_focus(FOCUS)
    shift, turn, pivot = np.array([1e-3, -2e-3, 5e-4]), np.array([1e-4, 2e-4, -1e-4]), FOCUS
    units = [(p - q) / np.linalg.norm(p - q, axis=1)[:, None] for q in (surface, f2)]
    way = np.sum((shift + np.cross(turn, p - pivot)) * (units[0] + units[1]), axis=1)
    plane = np.linalg.lstsq(np.column_stack([np.ones(len(inside)), inside]), way, rcond=None)[0]
    found = subreflector_tilt(GBT, SUB, pivot) @ np.concatenate([shift, turn])
    np.testing.assert_allclose(found, plane[1:], rtol=0.01)  # scatter of a hundred and fifty thousand points


def test_every_ray_has_the_same_path_at_rest():
    p, f2 = SUB.reflections(GBT), SUB.second_focus(FOCUS)
    way = np.linalg.norm(p - FOCUS, axis=1) + np.linalg.norm(p - f2, axis=1)
    np.testing.assert_allclose(way, SUB.interfocal / SUB.eccentricity, rtol=1e-13)
    n = (p - FOCUS) / np.linalg.norm(p - FOCUS, axis=1)[:, None]
    ray = (FOCUS - GBT.surface) / np.linalg.norm(FOCUS - GBT.surface, axis=1)[:, None]
    np.testing.assert_allclose(n, ray, rtol=0, atol=1e-12)  # beyond the focus, straight on


def test_the_chosen_gregorian_pair_is_that_of_an_offset_telescope():
    """The rim's rays meet the second focus in a circular cone: 14.99 degrees, as the feed is made for."""
    from dataclasses import replace

    t = np.linspace(0, 2 * np.pi, 73)
    xy = np.column_stack([50 * np.cos(t), 54 + 50 * np.sin(t)])
    rim = replace(GBT, surface=np.column_stack([xy, np.sum(xy**2, axis=1) / 240.0]))
    p, f2 = SUB.reflections(rim), SUB.second_focus(FOCUS)
    d = (p - f2) / np.linalg.norm(p - f2, axis=1)[:, None]
    cone = minimize(lambda v: np.ptp(d @ (v / np.linalg.norm(v))), d.mean(axis=0), method="Nelder-Mead").x
    cone /= np.linalg.norm(cone)
    half = np.degrees(np.arccos(d @ cone))
    assert np.ptp(half) < 0.02
    assert half.mean() == pytest.approx(14.99, abs=0.02)
    assert 1.0 / receiver_tilt(GBT, SUB)[0, 0] == pytest.approx(190.0, rel=0.03)  # symmetric dish of 190 m, deviation 1


def receiver_tilt(of, gregorian):
    """Slopes (2, 3), rad/m, for a shift of a receiver at the second focus: d . (F - Q) / |F - Q| by Fermat."""
    path = gregorian.second_focus(of.focus) - gregorian.reflections(of)
    return of.tilt(path / np.linalg.norm(path, axis=1)[:, None])


def test_moving_subreflector_and_receiver_together_is_moving_both_foci():
    """All that is behind the prime focus shifted as one: as a feed at the prime focus would be, rays cross there."""
    both = subreflector_tilt(GBT, SUB, FOCUS)[:, :3] + receiver_tilt(GBT, SUB)
    np.testing.assert_allclose(both, prime_focus_tilt(GBT), rtol=0, atol=1e-12)


def test_turning_all_that_is_behind_the_focus_about_it_does_nothing():
    f2 = SUB.second_focus(FOCUS)
    w = np.array([1e-4, -2e-4, 3e-4])
    tilt = subreflector_tilt(GBT, SUB, FOCUS)[:, 3:] @ w + receiver_tilt(GBT, SUB) @ np.cross(w, f2 - FOCUS)
    np.testing.assert_allclose(tilt, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    "made",
    [
        lambda: aperture(0.0, (0, 0), 1.0),
        lambda: aperture(1.0, (0, 0), -1.0),
        lambda: Gregorian(eccentricity=1.2).reflections(GBT),
    ],
)
def test_invalid_telescopes_are_refused(made):
    with pytest.raises(ValidityError, match="expected"):
        made()
