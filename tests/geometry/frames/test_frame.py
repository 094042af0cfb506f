"""Transforms: joining, refusing strangers, refusing what is no rotation."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import FrameError, ValidityError
from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import rz


def alidade_from_ground():
    return Transform("alidade", "ground", rz(0.3), np.array([1.0, 2.0, 3.0]))


def test_unknown_frames_are_refused_by_name():
    dish_from_ground = Transform("dish", "ground", np.eye(3), np.zeros(3))
    with pytest.raises(FrameError) as caught:
        alidade_from_ground() @ dish_from_ground
    assert str(caught.value) == "cannot join dish_from_ground to alidade_from_ground: 'ground' is not 'dish'"


def test_only_transforms_join():
    with pytest.raises(TypeError):
        alidade_from_ground() @ 3.0


def test_names_cancel():
    ground_from_dish = Transform("ground", "dish", np.eye(3), np.ones(3))
    assert str(alidade_from_ground() @ ground_from_dish) == "alidade_from_dish"
    assert str(ground_from_dish.inverse()) == "dish_from_ground"


def test_directions_are_turned_but_not_moved():
    transform = alidade_from_ground()
    difference = transform.points([[4.0, 5.0, 6.0]]) - transform.points([[1.0, 1.0, 1.0]])
    np.testing.assert_allclose(transform.directions([[3.0, 4.0, 5.0]]), difference, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("rotation", "text"),
    [
        (np.diag([1.0, 1.0, -1.0]), "determinant -1"),
        (np.eye(3) * (1 + 1e-8), "departs from orthonormal by 2.0e-08"),
        (np.full((3, 3), np.nan), "not finite"),
        (np.eye(2), r"shapes \(2, 2\) and \(3,\)"),
    ],
)
def test_invalid_rotations_are_refused(rotation, text):
    with pytest.raises(ValidityError, match=f"dish_from_ground: .*{text}"):
        Transform("dish", "ground", rotation, np.zeros(3))


def test_printed_digits_are_no_rotation():
    printed = [[0.999999, 0.0, -0.000121], [0.0, 0.999999, -0.000727], [0.000121, 0.000727, 0.999999]]
    with pytest.raises(ValidityError, match="build it from angles"):
        Transform("mirror", "mount", np.array(printed), np.zeros(3))


def test_a_transform_does_not_change():
    source = np.zeros(3)
    transform = Transform("dish", "ground", np.eye(3), source)
    source[0] = 5.0
    assert transform.translation[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        transform.rotation[0, 0] = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        transform.to = "alidade"


def test_points_need_three_coordinates():
    with pytest.raises(ValidityError, match=r"points have shape \(2,\), expected \(\.\.\., 3\)"):
        alidade_from_ground().points([1.0, 2.0])
