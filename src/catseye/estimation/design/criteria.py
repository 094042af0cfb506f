"""Criteria of a design, with derivatives: mean variance, worst axis, pose of a body, gain of a reflector."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.estimation.design.gradient import Sensitivity
from catseye.estimation.design.network import DesignNetwork

SQUARINGS = 5  # of a covariance, in the smooth worst axis: its 32nd power
DEPENDENT = 1e-9  # of the largest singular value: a smaller one is a motion that changes nothing


class Predicted(Protocol):
    """Predicted covariance (n, 3, 3) m^2 of a network's points, and its products with columns."""

    @property
    def network(self) -> DesignNetwork: ...
    @property
    def covariance(self) -> Array: ...
    def across(self, columns: Array) -> tuple[Array, Array]: ...


class Criterion(Protocol):
    """Measure of a predicted covariance, m^2: smaller is better."""

    def sensitivity(self, prediction: Predicted) -> Sensitivity: ...
    def true_value(self, prediction: Predicted) -> float: ...
    def squares(self, prediction: Predicted, errors: Array) -> Array: ...


@dataclass(frozen=True, eq=False)
class MeanVariance:
    """Mean variance of a coordinate of some points (k,): the trace."""

    points: NDArray[np.int64]

    def sensitivity(self, prediction: Predicted) -> Sensitivity:
        """Mean variance, m^2, and its derivatives."""
        count = 3 * len(self.points)
        blocks = np.zeros(prediction.covariance.shape)
        blocks[self.points] = np.eye(3) / count
        return Sensitivity(np.trace(prediction.covariance[self.points], axis1=1, axis2=2).sum() / count, blocks)

    def true_value(self, prediction: Predicted) -> float:
        """Mean variance of the criterion, m^2."""
        return float(self.sensitivity(prediction).value.real)

    def squares(self, prediction: Predicted, errors: Array) -> Array:
        """Mean square (runs,) m^2 of errors (runs, n, 3), whose expectation is the true value."""
        return np.asarray(np.mean(errors[:, self.points] ** 2, axis=(1, 2)))


@dataclass(frozen=True, eq=False)
class WorstAxis:
    """Variance along the worst axis of some points (k,).

    points      rows
    squarings   q: descended is (sum of tr Q^p)^(1/p), p = 2^q, which is smooth and by (3k)^(1/p) above the largest
    """

    points: NDArray[np.int64]
    squarings: int = SQUARINGS

    def sensitivity(self, prediction: Predicted) -> Sensitivity:
        """Smooth value and derivatives.

        Source: d tr(Q^p) = p tr(Q^(p-1) dQ).
        """
        blocks_of_points = prediction.covariance[self.points]
        largest = np.max(np.trace(blocks_of_points, axis1=1, axis2=2).real)
        scaled, power = blocks_of_points / largest, 2**self.squarings
        high = np.broadcast_to(np.eye(3), blocks_of_points.shape)  # power - 1 = 1 + 2 + 4 + ...
        factor = scaled
        for _ in range(self.squarings):
            high, factor = high @ factor, factor @ factor
        total = np.trace(factor, axis1=1, axis2=2).sum()
        value = total ** (1.0 / power)
        blocks = np.zeros(prediction.covariance.shape, dtype=blocks_of_points.dtype)
        blocks[self.points] = high * (value / total)
        return Sensitivity(value * largest, blocks)

    def true_value(self, prediction: Predicted) -> float:
        """Largest variance along any axis of any of the points, m^2."""
        return float(np.max(np.linalg.eigvalsh(prediction.covariance[self.points].real)))

    def worst(self, prediction: Predicted) -> tuple[int, Array]:
        """Row of the point with the worst axis, and that axis (3,), upwards."""
        values, vectors = np.linalg.eigh(prediction.covariance[self.points].real)
        k = int(np.argmax(values[:, -1]))
        axis = vectors[k, :, -1]
        return int(self.points[k]), axis if axis[2] >= 0.0 else -axis

    def squares(self, prediction: Predicted, errors: Array) -> Array:
        """Square (runs,) m^2 of the errors (runs, n, 3) along the predicted worst axis."""
        point, axis = self.worst(prediction)
        return np.asarray((errors[:, point] @ axis) ** 2)


@dataclass(frozen=True, eq=False)
class BodyPose:
    """Mean variance of the coordinates of a body's points (k,), moved by the errors of its pose alone.

    The pose is that of the least-squares rigid motion; J = tr(P Q P) / 3k with the projector P = R (R'R)^-1 R' onto the
    motions R of the points. Where the points move, dP = (1 - P) dR L + its transpose, L = (R'R)^-1 R', so that
    dJ = 2 tr(L Q (1 - P) dR) / 3k at constant Q.
    """

    points: NDArray[np.int64]

    def sensitivity(self, prediction: Predicted) -> Sensitivity:
        """Mean variance, m^2, and its derivatives."""
        x = prediction.network.points[self.points]
        motions, estimator = self._parts(x)
        size = 3 * len(x)
        remainder = np.linalg.cholesky((motions.T @ motions).real)  # any basis of the motions gives the same projector
        basis = np.linalg.solve(remainder, motions.T).T
        gram = np.linalg.inv(basis.T @ basis)  # the identity, but for a complex step
        columns, weights = self._on_points(prediction, basis), np.full(6, 1.0 / size)
        across = prediction.across(columns)[0][self.points].reshape(size, 6)
        value = np.trace(gram @ basis.T @ across) / size
        through = prediction.across(self._on_points(prediction, estimator.T))[0][self.points].reshape(size, 6)
        turned = (through - motions @ (estimator @ through))[:, 3:].reshape(-1, 3, 3)  # point, coordinate, axis
        explicit = np.zeros(prediction.network.points.shape, dtype=x.dtype)
        cross = np.stack(  # e_a x d, coordinate b: d J / d d_c = 2 sum of Y[a, b] epsilon[b, a, c]
            [
                turned[:, 1, 2] * -1.0 + turned[:, 2, 1],
                turned[:, 0, 2] - turned[:, 2, 0],
                turned[:, 1, 0] - turned[:, 0, 1],
            ],
            axis=1,
        )
        explicit[self.points] = -2.0 * cross / size
        return Sensitivity(value, np.zeros(prediction.covariance.shape), columns, weights, explicit)

    def true_value(self, prediction: Predicted) -> float:
        """Mean variance of the criterion, m^2."""
        return float(np.real(self.sensitivity(prediction).value))

    def pose_covariance(self, prediction: Predicted) -> Array:
        """Covariance (6, 6) of the pose: translation at the points' middle m, turns rad."""
        estimator = self._parts(prediction.network.points[self.points])[1]
        across = prediction.across(self._on_points(prediction, estimator.T))[0][self.points]
        return np.asarray(estimator @ across.reshape(-1, 6))

    @staticmethod
    def _parts(x: Array) -> tuple[Array, Array]:
        """Motions R (3k, 6) of the points, and L (6, 3k), the pose from their displacements."""
        arm = x - x.mean(axis=0)
        motions = np.zeros((len(x), 3, 6), dtype=x.dtype)
        motions[:, range(3), range(3)] = 1.0
        for axis in range(3):
            motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
        flat = motions.reshape(-1, 6)
        return flat, np.asarray(np.linalg.solve(flat.T @ flat, flat.T), dtype=flat.dtype)

    def _on_points(self, prediction: Predicted, columns: Array) -> Array:
        all_points = np.zeros((len(prediction.network.points), 3, columns.shape[1]), dtype=columns.dtype)
        all_points[self.points] = columns.reshape(-1, 3, columns.shape[1])
        return all_points

    def squares(self, prediction: Predicted, errors: Array) -> Array:
        """Mean square (runs,) m^2 of what errors (runs, n, 3) of the points move their body by."""
        motions, estimator = self._parts(prediction.network.points[self.points])
        moved = errors[:, self.points].reshape(len(errors), -1) @ estimator.T @ motions.T
        return np.asarray(np.mean(moved**2, axis=1))


@dataclass(frozen=True, eq=False)
class SurfaceVariance:
    """Mean variance of half-path errors of a reflector's points (k,) less the best-fitting paraboloid: gain by Ruze.

    points    rows
    along     (k, 3) half-path error by displacement: normal times the cosine of the incidence
    weights   (k,) of the aperture, sum 1
    fitted    (k, p) half-path errors of what is fitted: motions of the paraboloid, and its focal length

    The fit's points must not move.
    """

    points: NDArray[np.int64]
    along: Array
    weights: Array
    fitted: Array

    def sensitivity(self, prediction: Predicted) -> Sensitivity:
        """Value and derivatives: sum of w c'Q c less what the fit takes away."""
        root, basis = np.sqrt(self.weights), self._basis
        blocks = np.zeros(prediction.covariance.shape)
        blocks[self.points] = self.weights[:, None, None] * self.along[:, :, None] * self.along[:, None, :]
        columns = np.zeros((len(blocks), 3, basis.shape[1]))
        columns[self.points] = (root[:, None] * self.along)[:, :, None] * basis[:, None, :]
        across = prediction.across(columns)[0]
        value = np.sum(blocks * prediction.covariance) - np.sum(columns * across)
        return Sensitivity(value, blocks, columns, np.full(basis.shape[1], -1.0))

    def true_value(self, prediction: Predicted) -> float:
        """Mean variance of the criterion, m^2."""
        return float(np.real(self.sensitivity(prediction).value))

    def squares(self, prediction: Predicted, errors: Array) -> Array:
        """Mean square (runs,) m^2 of half-path errors less the fit, of errors (runs, n, 3)."""
        root = np.sqrt(self.weights)
        half_path = np.einsum("rki,ki->rk", errors[:, self.points], self.along) * root
        remainder = half_path - (half_path @ self._basis) @ self._basis.T
        return np.asarray(np.sum(remainder**2, axis=1))

    @cached_property
    def _basis(self) -> Array:
        """Orthonormal columns (k, p) of the weighted fit."""
        u, s, _ = np.linalg.svd(self.fitted * np.sqrt(self.weights)[:, None], full_matrices=False)
        return np.asarray(u[:, s > DEPENDENT * s[0]])
