"""Laws of following: what is promised of an interval holds for every motion within the speeds it was promised for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from catseye.geometry.mirror.encoder import BEAM_PER_COUNT
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.geometry.mirror.search_pattern import raster, spiral_offsets
from catseye.geometry.mirror.track import CountLine, line_bound, longest_interval, miss

FLAT = MirrorStation([0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0], [0.0, 0.0])
ROUNDING = 2e-10  # counts, of 50 000


def motion(rng, p, speed, acceleration, h):
    """A smooth way from p with that speed at first and no more than that acceleration: 33 places over h."""
    t = np.linspace(0.0, h, 33)[:, None]
    v = rng.normal(size=3)
    v *= speed / np.linalg.norm(v)
    a, b = rng.normal(size=(2, 3))
    a *= 0.5 * acceleration / np.linalg.norm(a)
    b *= 0.5 * acceleration / np.linalg.norm(b)
    w = rng.uniform(0.0, 20.0) / max(h, 1e-9)
    shaken = b / w**2 * (1.0 - np.cos(w * t)) if w > 0.0 else 0.5 * b * t**2  # acceleration b cos(wt)
    return p + v * t + 0.5 * a * t**2 + shaken


@given(
    st.integers(0, 2**32),
    st.floats(0.01, 2.0),
    st.floats(0.0, 0.5),
    st.floats(0.02, 2.0),
    st.sampled_from(["counts", "angle"]),
)
def test_the_chosen_interval_never_exceeds_the_limit(seed, speed, acceleration, limit, kind):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=3) * [1.0, 1.0, 2.0]
    p *= rng.uniform(20.0, 200.0) / np.linalg.norm(p)
    told = {"limit_counts": limit} if kind == "counts" else {"limit_angle": limit * 5e-5}
    h = float(longest_interval(p, speed, acceleration, longest=20.0, **told))
    if h == 0.0:
        return
    points = motion(rng, p, speed, acceleration, h) @ FLAT.mirror_from_ground
    n = counts(FLAT, points)
    n[:, 0] = np.unwrap(n[:, 0], period=1e5)
    line = CountLine(n[0], n[-1], np.array(h)).at(np.linspace(0.0, h, 33))
    off = np.abs(line - n)
    if kind == "counts":
        assert off.max() <= limit + ROUNDING
    else:
        way = miss(FLAT, line, points) / np.linalg.norm(points, axis=1)
        assert way.max() <= limit * 5e-5 * (1 + 1e-9) + 1e-14
    bound, _, way = line_bound(p, speed, acceleration, interval=h)
    assert np.all(off <= bound + ROUNDING)
    assert np.all(miss(FLAT, line, points) <= way + 1e-11)


@given(st.integers(0, 2**32))
def test_the_bound_is_not_idle(seed):
    """A tangential acceleration of the size given comes within a factor of the bound: the choice does not starve."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=3)
    p *= 100.0 / np.linalg.norm(p)
    p = np.array([max(abs(p[0]), 50.0), p[1], p[2]])
    up = np.cross([0.0, 0.0, 1.0], p)
    up /= np.linalg.norm(up)
    h = 0.5
    bound = line_bound(p, 0.0, 0.1, interval=h)[0]
    t = np.array([[0.0], [h / 2], [h]])
    n = counts(FLAT, (p + 0.05 * up * t**2) @ FLAT.mirror_from_ground)
    off = abs(np.remainder((n[0] + n[2]) / 2 - n[1] + 25_000.0, 50_000.0)[0] - 25_000.0)
    assert off >= 0.5 * bound[0]


@given(st.floats(0.3, 25.0), st.integers(0, 2**32))
@settings(max_examples=60)
def test_no_place_of_a_disc_escapes_the_spiral(radius, seed):
    """Radii in units of the reach; random places and a dense rim."""
    rng = np.random.default_rng(seed)
    angle, share = rng.uniform(0, 2 * np.pi, 20_000), np.sqrt(rng.uniform(0, 1, 20_000))
    share[:4000] = 1.0
    places = radius * share[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    assert cKDTree(spiral_offsets(radius, 1.0)).query(places)[0].max() <= 1.0


@given(
    st.floats(1000.0, 24_000.0),
    st.booleans(),
    st.floats(8e-5, 5e-4),
    st.tuples(st.floats(0.0, 2e-3), st.floats(0.0, 2e-3)),
    st.integers(0, 2**32),
)
@settings(max_examples=60)
def test_no_place_of_a_rectangle_escapes_the_raster(elevation, prime, reach, half, seed):
    rng = np.random.default_rng(seed)
    centre = np.array([500.3, -elevation if prime else elevation])
    pattern = raster(centre, [0.0, 0.0], half, reach=reach, limits=(-50_000.0, 50_000.0))
    places = rng.uniform(-1, 1, (3000, 2)) * half
    places[:600, 0] = half[0] * np.sign(places[:600, 0])
    # sky is not flat: its rows bend by half^2/2 cot Phi, at most 3e-5 of these
    assert cKDTree(pattern.offsets).query(places)[0].max() <= reach + 0.6 * half[0] ** 2 / abs(
        np.sin(elevation * BEAM_PER_COUNT[1])
    )


def test_a_bound_that_forgot_the_acceleration_would_be_caught():
    """The law can fail: with the acceleration kept from the chooser its interval is too long."""
    p, speed = np.array([30.0, 80.0, 60.0]), 0.3
    h = float(longest_interval(p, speed, 0.0))
    up = np.cross([0.0, 0.0, 1.0], p)
    up /= np.linalg.norm(up)
    t = np.array([[0.0], [h / 2], [h]])
    n = counts(FLAT, (p + speed * up * t + 0.25 * up * t**2) @ FLAT.mirror_from_ground)
    with pytest.raises(AssertionError):
        assert np.abs((n[0] + n[2]) / 2 - n[1]).max() <= 0.25
