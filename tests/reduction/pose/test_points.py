"""Pose of points of two tables: scipy's rotation, known motions, scatter of the claimed u, and named mistakes."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import catseye
from catseye.errors import ArgumentError, EstimationError, InputError
from draws import draws
from reduction.surface.any_dish_scene import FOLDER, NoNoise, maker

NAMES = [f"R{k:02d}" for k in range(12)]
X = np.random.default_rng(4).uniform(-3.0, 3.0, (12, 3)) + np.array([0.0, 0.0, 9.0])


def table(path, points, *, u="0.05", names=NAMES, header="point,x_mm,y_mm,z_mm,u_mm", scale=1e3):
    rows = [f"{n},{','.join(repr(v) for v in (scale * p).tolist())},{u}" for n, p in zip(names, points, strict=True)]
    if not u:
        header, rows = header.removesuffix(",u_mm"), [row.removesuffix(",") for row in rows]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def epochs(tmp_path):
    """Two tables with noise and a motion of 60 mm and half a degree, and their arrays."""
    rng = np.random.default_rng(5)
    first = X + 5e-5 * rng.normal(size=X.shape)
    second = X @ Rotation.from_rotvec([0.004, -0.006, 0.005]).as_matrix().T + [0.01, 0.05, -0.03]
    second = second + 5e-5 * rng.normal(size=X.shape)
    return table(tmp_path / "first.csv", first), table(tmp_path / "second.csv", second), first, second


def test_with_equal_u_it_is_the_rotation_of_scipy(epochs):
    one, two, first, second = epochs
    found = catseye.pose(two, one)
    rotation, _ = Rotation.align_vectors(second - second.mean(axis=0), first - first.mean(axis=0))
    np.testing.assert_allclose(found.rotation, rotation.as_rotvec(), atol=1e-11)
    np.testing.assert_allclose(found.translation, second.mean(axis=0) - first.mean(axis=0), atol=1e-11)
    np.testing.assert_allclose(found.pivot, first.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(found.u[:3], 5e-5 * np.sqrt(2.0 / 12.0), rtol=1e-4)  # of both means
    assert (found.frame, found.verdict.word, found.names) == ("table", "good", tuple(NAMES))


def test_another_pivot_moves_by_another_translation(epochs):
    one, two, *_ = epochs
    plain, about = catseye.pose(two, one), catseye.pose(two, one, pivot=(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(about.pivot, [1.0, 2.0, 3.0])
    turn = Rotation.from_rotvec(plain.rotation).as_matrix()
    moved = plain.pivot + plain.translation + turn @ (about.pivot - plain.pivot) - about.pivot
    np.testing.assert_allclose(about.translation, moved, atol=1e-12)
    np.testing.assert_allclose(about.rotation, plain.rotation, atol=1e-15)
    assert about.u[:3].max() > plain.u[:3].max()


def test_the_motion_of_the_example_is_found():
    example = maker()
    found = catseye.pose(FOLDER / "receiver-later.csv", FOLDER / "receiver.csv", pivot=example.PIVOT, robust="igg3")
    truth = np.concatenate([example.MOVE, example.TURN])
    assert np.abs((np.concatenate([found.translation, found.rotation]) - truth) / found.u).max() < 4.0
    assert list(found.found.pose.pose.left_out) == [example.KNOCKED]
    assert found.found.pose.missing == (example.LOST,)


def test_a_design_without_u_is_exact(tmp_path):
    example = maker()
    first, _ = example.receiver(NoNoise())
    names, places = list(first), np.array(list(first.values()))
    design = table(tmp_path / "design.csv", places, u="", names=names)
    measured = table(tmp_path / "measured.csv", places + np.array([1e-3, 0.0, 0.0]), names=names)
    found = catseye.pose(measured, design)
    np.testing.assert_allclose(found.translation, [1e-3, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.u[:3], 5e-5 / np.sqrt(12.0), rtol=1e-9)
    plain = table(tmp_path / "plain.csv", places + np.array([1e-3, 0.0, 0.0]), u="", names=names)
    again = catseye.pose(plain, design, u_mm=0.05)
    np.testing.assert_allclose(again.covariance, found.covariance, rtol=1e-9)
    with pytest.raises(InputError, match=r"neither has uncertainties .* u_mm \(--u-mm\)\)"):
        catseye.pose(plain, design)


@draws(300)
def test_poses_of_tables_scatter_as_claimed(tmp_path, runs):
    example, sample = maker(), []
    for seed in range(runs):
        first, later = example.receiver(np.random.default_rng(seed))
        names = [name for name in later if name != example.KNOCKED]
        one, two = (np.array([epoch[n] for n in names]) for epoch in (first, later))
        found = catseye.pose(
            table(tmp_path / "later.csv", two, names=names), table(tmp_path / "first.csv", one, names=names),
            pivot=example.PIVOT,
        )  # fmt: skip
        sample.append(np.concatenate([found.translation, found.rotation]))
    half = np.linalg.inv(np.linalg.cholesky(found.covariance))
    off = 6.0 / np.sqrt(runs)  # four times the scatter of a variance of so many draws
    np.testing.assert_allclose(half @ np.cov(np.array(sample).T) @ half.T, np.eye(6), atol=off)
    truth = np.concatenate([example.MOVE, example.TURN])
    np.testing.assert_array_less(np.abs(np.mean(sample, axis=0) - truth), 4.0 * found.u / np.sqrt(runs))


def test_a_full_covariance_of_a_reduction_counts_with_a_table(tmp_path):
    from catseye.records.network.solved_points import read_solved_points
    from kept_scene import reduction_directory

    solved = read_solved_points(reduction_directory())
    design = table(tmp_path / "design.csv", solved.x - [0.0, 0.0, 2e-3], u="", names=solved.names)
    found = catseye.pose(reduction_directory(), design, points=list(solved.dish))
    np.testing.assert_allclose(found.translation, [0.0, 0.0, 2e-3], atol=1e-9)
    joint = solved.block(solved.dish).reshape(len(solved.dish), 3, len(solved.dish), 3)
    assert found.frame == "table"
    assert found.u[2] < np.sqrt(joint[:, 2, :, 2].mean())  # the weighted mean is better than the plain one
    assert found.u[2] > 0.5 * np.sqrt(joint[:, 2, :, 2].mean())


def test_an_object_says_frame_points_and_what_is_not_observed(epochs, tmp_path):
    one, two, _first, _second = epochs
    answer = catseye.pose(two, one).to_object()
    assert (answer["group"], answer["against"], answer["posture"], answer["unobserved"]) == (
        "points",
        "first",
        None,
        [],
    )
    narrow = X * [2e-5, 2e-5, 1.0]
    found = catseye.pose(table(tmp_path / "a.csv", narrow), table(tmp_path / "b.csv", narrow))
    (said,) = found.to_object()["unobserved"]
    assert said.startswith("rotation about (")
    assert found.verdict.word == "doubtful"


@pytest.mark.parametrize(
    ("points", "options", "said"),
    [
        (X * 1e-3, {}, "0.001 times as far apart as those of .*another unit"),
        (X * 1e3, {}, "1000 times as far apart as those of"),
        (X[:2], {"names": NAMES[:2]}, "2 points in common"),
        (X, {"names": [n.lower() for n in NAMES]}, "0 points in common .*of the same names"),
        (X, {"names": [NAMES[0], *NAMES[:11]]}, r"line 3, point = 'R00' is also in line 2"),
    ],
)
def test_spoiled_tables_are_refused_with_their_mistake(tmp_path, points, options, said):
    one, two = table(tmp_path / "first.csv", X), table(tmp_path / "second.csv", points, **options)
    with pytest.raises(InputError, match=said):
        catseye.pose(two, one)


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ((1, 0, 2), "with x and y exchanged in .*second.csv by 0.00°"),
        ((0, 2, 1), "with y and z exchanged in .*second.csv by 0.00°"),
        ((1, 2, 0), "with axes in the order z, x, y in .*second.csv by 0.00°"),
    ],
)
@pytest.mark.parametrize("flat", [False, True])
def test_exchanged_axes_are_a_doubt_that_names_them(tmp_path, order, said, flat):
    body = X - X.mean(axis=0)
    body = body * [1.0, 1.0, 1e-9] if flat else body
    one, two = table(tmp_path / "first.csv", body), table(tmp_path / "second.csv", body[:, order])
    found = catseye.pose(two, one)
    assert found.verdict.word == "doubtful"
    assert re.search(said, found.verdict.why)


def test_a_point_that_moved_alone_is_named(epochs, tmp_path):
    one, _, _, second = epochs
    knocked = second.copy()
    knocked[7] += [8e-4, 0.0, 0.0]
    found = catseye.pose(table(tmp_path / "knocked.csv", knocked), one)
    assert found.verdict.word == "doubtful"
    assert "R07 has the largest |w|" in found.verdict.why
    assert "without it the others move as one" in found.verdict.why
    knocked[3] += [0.0, 3e-3, 0.0]
    found = catseye.pose(table(tmp_path / "knocked.csv", knocked), one)
    assert "the others do not move as one either" in found.verdict.why


def test_points_on_a_line_are_refused_with_the_free_rotation(tmp_path):
    line = np.outer(np.arange(12.0), [1.0, 2.0, 0.0])
    with pytest.raises(EstimationError, match="lie on one line"):
        catseye.pose(table(tmp_path / "b.csv", line), table(tmp_path / "a.csv", line))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"group": "dish"}, "group needs site"),
        ({"frame": "ground"}, "frame needs site"),
        ({"pointing": "prime"}, "pointing needs site"),
        ({"posture_deg": (10.0, 20.0)}, "posture_deg needs site"),
        ({"u_mm": 0.0}, "u_mm = 0"),
        ({"earlier": None}, "earlier or site is needed"),
    ],
)
def test_arguments_that_need_a_site_are_named(epochs, options, said):
    one, two, *_ = epochs
    with pytest.raises(ArgumentError, match=said):
        catseye.pose(two, **{"earlier": one, **options})


def test_a_missing_point_asked_for_is_named_with_its_table(epochs, tmp_path):
    one, _, _, second = epochs
    short = table(tmp_path / "short.csv", second[:-1], names=NAMES[:-1])
    assert catseye.pose(short, one).found.pose.missing == ("R11",)
    with pytest.raises(InputError, match=r"short.csv: has no point 'R11'"):
        catseye.pose(short, one, points=["R01", "R02", "R03", "R11"])
