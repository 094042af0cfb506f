"""Batches of rangers and retroreflectors."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.clearance.solids import Dish, SolidBox, SolidCone, SolidSphere
from catseye.geometry.clearance.visibility import first_obstruction, incidence, ranges


def test_incidence_is_the_angle_of_the_law_of_cosines():
    rng = np.random.default_rng(1)
    s, t, axes = rng.uniform(-100, 100, (5, 3)), rng.uniform(-100, 100, (7, 3)), rng.normal(size=(7, 3))
    found = incidence(s, t, axes)
    tip = t + axes / np.linalg.norm(axes, axis=1, keepdims=True)
    d, e = ranges(s, t), ranges(s, tip)
    np.testing.assert_allclose(np.cos(found), (d**2 + 1 - e**2) / (2 * d), atol=1e-11)
    axes[2] = np.nan
    assert np.isnan(incidence(s, t, axes)).all(axis=0).tolist() == [k == 2 for k in range(7)]
    assert incidence([[1.0, 0, 0]], [[0.0, 0, 0]], [[-1.0, 0, 0]]) == pytest.approx(np.pi)


def test_the_first_of_several_solids_is_named_as_points_along_the_path_find_it():
    """Solids taken one by one, points every 2 mm; the batch must name the one that comes first."""
    rng = np.random.default_rng(5)
    solids = [
        SolidSphere((0.0, 0.0, 0.0), 8.0),
        SolidBox((20.0, 5.0, 0.0), (6.0, 30.0, 10.0), 0.4),
        SolidCone((-20.0, 0.0, -30.0), (-20.0, 0.0, 30.0), 3.0, 6.0),
        Dish(20.0, (0.0, 0.0), 30.0, below=0.5),
    ]
    s, t = rng.uniform(-60, 60, (12, 3)), rng.uniform(-60, 60, (15, 3))
    which, at = first_obstruction(s, t, solids, clear_start=2.0, clear_end=1.0)
    assert set(which.ravel()) == {-1, 0, 1, 2, 3}
    length, grazed = ranges(s, t), 0
    for i in range(12):
        for j in range(15):
            along = np.arange(2.0, length[i, j] - 1.0, 0.002)
            x = s[i] + along[:, None] * (t[j] - s[i]) / length[i, j]
            first = [np.inf] * 4
            for k, solid in enumerate(solids):
                hit = _inside(solid, x)
                if hit.any():
                    first[k] = along[np.argmax(hit)]
            if which[i, j] == -1:
                assert np.isinf(at[i, j])
                assert np.min(first) == np.inf
            else:
                grazed += np.isinf(np.min(first))  # shorter within than two points are apart
                assert at[i, j] <= np.min(first) <= at[i, j] + 0.0021 or np.isinf(np.min(first))
                assert first[which[i, j]] == np.min(first)
    assert grazed == 0


def _inside(solid, x):
    if isinstance(solid, SolidSphere):
        return np.sum((x - solid.centre) ** 2, axis=1) < solid.radius**2
    if isinstance(solid, Dish):
        g = x[:, 2] - np.sum(x[:, :2] ** 2, axis=1) / (4 * solid.focal_length)
        return (np.hypot(x[:, 0], x[:, 1]) < solid.aperture_radius) & (g < 0.0) & (g > -solid.below)
    if isinstance(solid, SolidCone):  # upright, as the one above
        share = (x[:, 2] - solid.start[2]) / (solid.end[2] - solid.start[2])
        radius = solid.start_radius + share * (solid.end_radius - solid.start_radius)
        return (share > 0) & (share < 1) & (np.hypot(x[:, 0] - solid.start[0], x[:, 1] - solid.start[1]) < radius)
    c, d = np.cos(solid.turn), np.sin(solid.turn)
    y = x - solid.centre
    own = np.column_stack([c * y[:, 0] + d * y[:, 1], c * y[:, 1] - d * y[:, 0], y[:, 2]])
    return np.all(np.abs(own) < np.asarray(solid.size) / 2, axis=1)


def test_objects_near_the_ends_do_not_obstruct():
    wall = SolidBox((5.0, 0.0, 0.0), (1.0, 10.0, 10.0))
    s, t = [[4.2, 0.0, 0.0]], [[5.0, 0.0, 0.0], [9.0, 0.0, 0.0]]
    assert first_obstruction(s, t, [wall])[0].tolist() == [[0, 0]]
    assert first_obstruction(s, t, [wall], clear_start=0.25, clear_end=0.6)[0].tolist() == [[-1, 0]]
    assert first_obstruction(s, t, [wall], clear_start=1.4)[0].tolist() == [[-1, -1]]
    assert first_obstruction(s, t, [])[0].tolist() == [[-1, -1]]
    with pytest.raises(ValidityError, match="not both 0 or more"):
        first_obstruction(s, t, [wall], clear_end=-1.0)
    with pytest.raises(ValidityError, match="scan points have shape"):
        ranges([0.0, 0.0, 0.0], t)
