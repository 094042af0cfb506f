"""PlaceDescent within regions."""

import numpy as np
import pytest

from catseye.estimation.design.descent import descend

CENTRE = np.array([[3.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
STRETCH = np.array([1.0, 30.0, 1.0])


def bowl(places):
    away = places - CENTRE
    return float(np.sum(STRETCH * away**2)) + 1.0, 2.0 * STRETCH * away


def in_unit_balls(wished, present):
    length = np.linalg.norm(wished, axis=1, keepdims=True)
    return wished / np.maximum(length, 1.0)


def test_the_minimum_lies_inside_or_on_the_border():
    found = descend(bowl, in_unit_balls, np.array([[0.0, 0.9, 0.0], [0.2, -0.5, 0.1]]), reach=0.25, steps=200)
    assert found.settled
    np.testing.assert_allclose(found.x, [[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]], atol=5e-3)
    assert found.value == pytest.approx(5.0, abs=1e-3)
    assert found.values[0] > found.value


def test_the_cap_of_steps_is_said():
    found = descend(bowl, in_unit_balls, np.array([[0.0, 0.9, 0.0], [0.2, -0.5, 0.1]]), reach=0.01, steps=2)
    assert not found.settled
    assert len(found.values) == 3


def test_a_flat_function_is_settled_at_once():
    found = descend(lambda x: (1.0, np.zeros_like(x)), in_unit_balls, np.zeros((2, 3)), reach=1.0, steps=5)
    assert (found.settled, found.evaluations) == (True, 1)


def test_a_wall_ends_the_descent_at_the_best_place():
    """A step in the function, as where a beam is lost: nothing beyond it is accepted."""

    def walled(x):
        value, slope = bowl(x)
        return (value if x[0, 0] <= 0.4 else value + 1e3), slope

    start = np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    found = descend(walled, in_unit_balls, start, reach=1.0, steps=100)
    assert 0.0 < found.x[0, 0] <= 0.4
    assert found.value < bowl(start)[0]
