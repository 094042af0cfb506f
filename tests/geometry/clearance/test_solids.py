"""Where a path first meets a solid, against points taken densely along it and plain tests of being inside.

The tests of being inside are written anew here, in other words than the code's: rotated corners, heights and radii.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.clearance.solids import Dish, SolidBox, SolidCone, SolidSphere

STEPS = 4001
SHARE = np.linspace(0.0, 1.0, STEPS)


def inside(solid, x):
    if isinstance(solid, SolidBox):
        own = Rotation.from_euler("z", -solid.turn).apply(x - np.asarray(solid.centre))
        return np.all(np.abs(own) <= np.asarray(solid.size) / 2, axis=-1)
    if isinstance(solid, SolidSphere):
        return np.linalg.norm(x - np.asarray(solid.centre), axis=-1) <= solid.radius
    if isinstance(solid, SolidCone):
        foot, top = np.asarray(solid.start), np.asarray(solid.end)
        share = (x - foot) @ (top - foot) / np.sum((top - foot) ** 2)
        off = np.linalg.norm(np.cross(x - foot, (top - foot) / np.linalg.norm(top - foot)), axis=-1)
        return (share >= 0) & (share <= 1) & (off <= (1 - share) * solid.start_radius + share * solid.end_radius)
    surface = (x[..., 0] ** 2 + x[..., 1] ** 2) / (4 * solid.focal_length)
    wide = np.hypot(x[..., 0] - solid.aperture_centre[0], x[..., 1] - solid.aperture_centre[1])
    depth = x[..., 2] - surface
    return (wide <= solid.aperture_radius) & (depth >= -solid.below) & (depth <= solid.above)


def random_solid(rng, kind):
    centre = rng.uniform(-20, 20, 3)
    if kind == "box":
        return SolidBox(centre, rng.uniform(1, 30, 3), rng.uniform(-4, 4))
    if kind == "sphere":
        return SolidSphere(centre, rng.uniform(0.5, 20))
    if kind == "cylinder":
        r = rng.uniform(0.5, 10)
        return SolidCone(centre, centre + rng.normal(0, 15, 3), r, r)
    if kind == "cone":
        r = rng.uniform(0.0, 12, 2)
        return SolidCone(centre, centre + rng.normal(0, 15, 3), *(r if rng.random() < 0.7 else (r[0] + 1, 0.0)))
    return Dish(rng.uniform(5, 60), rng.uniform(-10, 30, 2), rng.uniform(5, 30), below=rng.uniform(0.5, 5), above=0.2)


def paths(rng, n):
    a, b = rng.uniform(-50, 50, (n, 3)), rng.uniform(-50, 50, (n, 3))
    b[: n // 8, 2] = a[: n // 8, 2]  # level paths
    b[n // 8 : n // 4, :2] = a[n // 8 : n // 4, :2]  # upright ones
    return a, b


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder", "cone", "dish"])
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32))
def test_the_first_hit_is_where_points_along_the_path_are_first_inside(kind, seed):
    rng = np.random.default_rng(seed)
    solid = random_solid(rng, kind)
    start, end = paths(rng, 64)
    hit = solid.first_hit(start, end)
    dense = inside(solid, start[:, None] + SHARE[:, None] * (end - start)[:, None])
    step = 1.0 / (STEPS - 1)
    for k in range(len(start)):
        if dense[k].any():
            first = SHARE[np.argmax(dense[k])]
            assert first - step - 1e-12 <= hit[k] <= first + 1e-12
        elif np.isfinite(hit[k]):  # a stretch between two samples: just behind the hit it is inside
            near = hit[k] + np.linspace(0.0, step, 2001)
            assert inside(solid.grown(1e-9), start[k] + near[:, None] * (end[k] - start[k])).any()


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder", "cone", "dish"])
@settings(max_examples=15)
@given(seed=st.integers(0, 2**32), margin=st.floats(0.01, 0.5))
def test_a_grown_solid_holds_all_that_is_within_the_margin(kind, seed, margin):
    rng = np.random.default_rng(seed)
    solid = random_solid(rng, kind)
    x = rng.uniform(-40, 40, (20_000, 3))
    x = x[inside(solid, x)]
    away = rng.normal(size=x.shape)
    away *= 0.999 * margin / np.linalg.norm(away, axis=-1, keepdims=True)
    assert inside(solid.grown(margin), x + away).all()


def test_an_infinitely_thin_dish_is_met_on_its_surface():
    dish = Dish(60.0, (0.0, 54.0), 50.0)
    rng = np.random.default_rng(3)
    foot = np.stack([rng.uniform(-30, 30, 50), rng.uniform(20, 90, 50)], axis=-1)
    on = np.column_stack([foot, np.sum(foot**2, axis=1) / 240.0])
    start = np.array([2.0, 10.0, 60.0])
    hit = dish.first_hit(np.broadcast_to(start, on.shape), on + 0.5 * (on - start))
    np.testing.assert_allclose(hit, 1 / 1.5, rtol=1e-12)
    assert np.all(np.isinf(dish.first_hit(np.broadcast_to(start, on.shape), on - 1e-6 * (on - start))))
    assert np.isinf(dish.first_hit([0.0, 200.0, 0.0], [0.0, 105.0, 100.0]))  # past the rim


def test_a_path_that_begins_inside_hits_at_once_and_one_that_ends_before_does_not():
    for solid in (
        SolidBox((0, 0, 0), (2, 2, 2)),
        SolidSphere((0, 0, 0), 1.0),
        SolidCone((0, 0, -1), (0, 0, 1), 1.0, 0.5),
    ):
        assert solid.first_hit([0.1, 0.0, 0.2], [9.0, 9.0, 9.0]) == 0.0
        assert np.isinf(solid.first_hit([9.0, 0.0, 0.0], [1.5, 0.0, 0.0]))
        assert np.isinf(solid.first_hit([9.0, 0.0, 0.0], [18.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SolidBox((0, 0, 0), (1, 0, 1)), "of a box is not above 0"),
        (lambda: SolidBox((0, 0), (1, 1, 1)), "is not three finite numbers"),
        (lambda: SolidSphere((0, 0, np.nan), 1.0), "is not three finite numbers"),
        (lambda: SolidSphere((0, 0, 0), -1.0), "radius -1.0 m is not above 0"),
        (lambda: SolidCone((1, 1, 1), (1, 1, 1), 1, 1), "same point"),
        (lambda: SolidCone((0, 0, 0), (1, 1, 1), 1, -1), "is below 0"),
        (lambda: SolidCone((0, 0, 0), (1, 1, 1), 0, 0), "larger radius"),
        (lambda: Dish(0.0, (0, 0), 1), "focal length"),
        (lambda: Dish(1.0, (0, 0, 0), 1), "aperture centre"),
        (lambda: Dish(1.0, (0, 0), 1, below=-1.0), "thickness"),
    ],
)
def test_invalid_solids_are_refused(make, message):
    with pytest.raises(ValidityError, match=message):
        make()
