"""Spoiled tables of prisms: refused, or not good, while the surface is more than five u from the honest one.

Exempt, since no file can show it: x reversed on prisms whose names the site does not know. The dish is its own mirror
image across x = 0; where the site knows the names, their design places show it.
"""

from itertools import permutations

import numpy as np
import pytest

from catseye.api.surface import surface
from catseye.errors import CatseyeError
from catseye.optics.zernike import Term
from surface_scene import NAMES, SITE, half_path_of, prisms

U = 5e-5
REVERSED = {f"{'xyz'[k]} reversed": lambda p, k=k: p * np.where(np.arange(3) == k, -1, 1) for k in range(3)}
SPOILED = {
    **{f"axes {order}": lambda p, order=order: p[:, order] for order in list(permutations(range(3)))[1:]},
    **REVERSED,
    "x and y turned": lambda p: np.column_stack([-p[:, 1], p[:, 0], p[:, 2]]),
    "millimetres": lambda p: p * 1e3,
    "kilometres": lambda p: p / 1e3,
    "feet": lambda p: p / 0.3048,
    "z in millimetres": lambda p: p * [1, 1, 1e3],
    "another focal length": lambda p: p * [1, 1, 60 / 50],
    "a focal length 1 m off": lambda p: p * [1, 1, 60 / 61],
    "a small dish about its vertex": lambda p: (p - [0, 54, 0]) * [0.25, 0.25, 0] + paraboloid(p, 9.0),
    "another vertex": lambda p: p + np.array([0, 1.0, 0]),
}


def paraboloid(points, focal_length):
    """Heights (k, 3) over a circle of a quarter of the aperture about a vertex."""
    x, y = (points[:, :2] - [0, 54]).T * 0.25
    return np.column_stack([0 * x, 0 * x, (x**2 + y**2) / (4 * focal_length)])


def written(path, names, points):
    rows = [f"{n},{x:.9f},{y:.9f},{z:.9f},{U * 1e3}" for n, (x, y, z) in zip(names, points.tolist(), strict=True)]
    path.write_text("\n".join(["point,x_m,y_m,z_m,u_mm", *rows]) + "\n")
    return path


def made(seed):
    rows = np.sort(np.random.default_rng(seed).choice(len(NAMES), 150, replace=False))
    return prisms(half_path_of(Term(2, 2), 3e-4), u=U, seed=seed, rows=rows)


def fitted(path):
    return surface(path, site=SITE, zernike=6)


@pytest.mark.parametrize("known", [True, False], ids=["names of the site", "other names"])
def test_a_spoiled_surface_is_never_good(tmp_path, known):
    honest = made(1)
    names = honest.names if known else [f"P{k:04d}" for k in range(len(honest.names))]
    assert fitted(written(tmp_path / "p.csv", names, honest.points)).verdict.word == "good"
    good = []
    for name, spoil in SPOILED.items():
        if name == "x reversed" and not known:
            continue
        try:
            found = fitted(written(tmp_path / "p.csv", names, spoil(honest.points)))
        except CatseyeError:
            continue
        good += [name] if found.verdict.word == "good" else []
    assert not good


@pytest.mark.parametrize(("order", "said"), [((1, 0, 2), "x and y"), ((2, 1, 0), "x and z"), ((0, 2, 1), "y and z")])
def test_exchanged_axes_are_named_by_what_puts_them_back(tmp_path, order, said):
    honest = made(3)
    names = [f"P{k:04d}" for k in range(len(honest.names))]
    path = written(tmp_path / "p.csv", names, honest.points[:, order])
    try:
        why = fitted(path).verdict.why
    except CatseyeError as problem:
        why = str(problem)
    assert f"with {said} exchanged" in why
    assert "the points do not fit the site's dish" in why


@pytest.mark.parametrize("axis", "yz")
def test_a_reversed_axis_is_named_and_no_function_or_line_is_blamed(tmp_path, axis):
    honest = made(4)
    names = [f"P{k:04d}" for k in range(len(honest.names))]
    path = written(tmp_path / "p.csv", names, REVERSED[f"{axis} reversed"](honest.points))
    try:
        why = fitted(path).verdict.why
    except CatseyeError as problem:
        why = str(problem)
    assert f"with {axis} reversed they do" in why
    assert "function" not in why
    assert "line" not in why


def test_none_inside_is_refused_with_the_number_and_the_distance(tmp_path):
    """By hand: y from 4 to 104 m reversed; the farthest is at y = -104, 158 m from the centre at 54, less 52.5."""
    honest = made(5)
    path = written(tmp_path / "p.csv", [f"P{k}" for k in range(150)], honest.points * [1, -1, 1])
    unit = np.hypot(honest.points[:, 0], honest.points[:, 1] + 54.0)
    with pytest.raises(
        CatseyeError, match=f"none of 150 prisms inside the aperture, the farthest {unit.max() - 52.5:.1f}"
    ):
        fitted(path)


def test_exchanged_names_are_seen_where_the_site_knows_them(tmp_path):
    honest = made(6)
    found = fitted(written(tmp_path / "p.csv", (*honest.names[1:], honest.names[0]), honest.points))
    assert found.verdict.word == "doubtful"
    assert "nearer to another's design place than to their own" in found.verdict.why


def test_another_telescopes_dish_does_not_blame_the_focal_length(tmp_path):
    """A dish of 25 m with f = 9 m about its own vertex, on the site of 100 m: the VLA's."""
    x, y = np.meshgrid(np.arange(-12, 13, 2.0), np.arange(-12, 13, 2.0))
    keep = np.hypot(x, y) <= 12.5
    points = np.column_stack([x[keep], y[keep], (x[keep] ** 2 + y[keep] ** 2) / 36.0])
    with pytest.raises(CatseyeError, match="the points do not fit the site's dish") as problem:
        fitted(written(tmp_path / "p.csv", [f"V{k}" for k in range(len(points))], points))
    assert "focal length" not in str(problem.value)


def test_a_surface_without_errors_above_the_noise_says_so_once(tmp_path):
    flat = prisms(np.zeros(len(NAMES)), u=U, seed=3, rows=np.arange(0, 2209, 15))
    found = fitted(written(tmp_path / "p.csv", flat.names, flat.points))
    (half,) = [p.text for p in found.passages() if p.title == "Half path"]
    assert found.verdict.word == "doubtful"
    assert "no error of the surface stands out from the noise" in found.verdict.why
    assert "not above the measurement noise" in half
