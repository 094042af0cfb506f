"""Copies of a group, each over parameters of its own, predict as the group does at each of them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from catseye.estimation.network.copies import prediction
from catseye.estimation.observations.kinds import FixedDistances, ObservedCoordinates
from estimation.kinds_scene import N, groups

NAMES = [type(group).__name__ for group in groups(0)[0]]
ONE_BY_ONE = {"RigidBodies", "PointsOnLine"}  # of one pose or line for all their rows


def alone(group, x, observed):
    pairs = [replace(group, observed=o).predict(row) for row, o in zip(x, observed, strict=True)]
    return [np.stack(part) for part in zip(*pairs, strict=True)]


@pytest.mark.parametrize("which", range(len(NAMES)), ids=NAMES)
def test_many_parameter_vectors_are_predicted_as_each_by_itself(which):
    made, x = groups(3)
    group, rng = made[which], np.random.default_rng(4)
    at = x + 0.01 * rng.standard_normal((7, N))
    observed = group.observed + rng.uniform(-9, 9, (7, len(group.observed)))  # also on other turns
    predict = prediction(group, x)
    for copies in (slice(0, 5), slice(0, 7), slice(2, 3)):
        values, jacobian = predict(at[copies], observed[copies])
        right, slopes = alone(group, at[copies], observed[copies])
        np.testing.assert_allclose(values, right, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(jacobian, slopes, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("which", range(len(NAMES)), ids=NAMES)
def test_kinds_that_files_have_are_predicted_together(which, monkeypatch):
    made, x = groups(5)
    predict = prediction(made[which], x)
    calls, kind = [], type(made[which])
    monkeypatch.setattr(kind, "predict", lambda self, at, plain=kind.predict: calls.append(1) or plain(self, at))
    predict(np.stack([x] * 9), np.stack([made[which].observed] * 9))
    assert len(calls) == (9 if NAMES[which] in ONE_BY_ONE else 0 if NAMES[which] == "Joint" else 1)


def test_integers_that_are_no_columns_are_noticed():
    @dataclass(frozen=True, eq=False)
    class Steps(FixedDistances):
        count: np.ndarray | None = None

        def predict(self, x):
            values, jacobian = super().predict(x)
            return values + self.count, jacobian

    group = Steps("s", np.ones(2), np.ones(2), np.array([0, 3]), np.array([3, 6]), count=np.array([1, 2]))
    x = np.random.default_rng(1).standard_normal((4, 9))
    values, _ = prediction(group, x[0])(x, np.ones((4, 2)))
    np.testing.assert_allclose(values, alone(group, x, np.ones((4, 2)))[0], rtol=1e-12)


def test_axes_are_no_columns():
    group = ObservedCoordinates("c", np.ones(3), np.ones(3), np.array([0, 0, 0]), np.arange(3))
    x = np.arange(6.0).reshape(2, 3)
    assert prediction(group, x[0])(x, np.ones((2, 3)))[0].tolist() == x.tolist()
