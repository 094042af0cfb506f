"""Predicted covariance of a network of rangers and targets, from places and claimed uncertainties alone.

Unknown are the coordinates of all points, a zero of every ranger and one scale of all ranges (the air's). Every point
has prior information; ties join the points of one unit, such as a triplet. The targets are eliminated unit by unit, so
that one matrix of 4 R + 1 rows is inverted, R the number of rangers. All arithmetic is analytic in the places: complex
places give derivatives by complex step.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.errors import EstimationError

LEAST_U_ZERO, LEAST_U_SCALE = 1e-9, 1e-12  # m and 1: what is smaller is as good as known


@dataclass(frozen=True, eq=False)
class RangeVariance:
    """Claimed standard uncertainty of a range D: variance constant^2 + (relative D)^2.

    constant, relative   m, 1
    """

    constant: float
    relative: float

    def variance(self, distance: Array) -> Array:
        """Variances (m,) m^2 of ranges (m,) m."""
        return self.constant**2 + (self.relative * distance) ** 2


@dataclass(frozen=True, eq=False)
class TiedPoints:
    """Points tied to each other, eliminated together.

    points        (k,) rows of the points
    information   (3k, 3k) 1/m^2, of the tie alone
    """

    points: tuple[int, ...]
    information: Array


@dataclass(frozen=True, eq=False)
class DesignNetwork:
    """Network by its places.

    points        (n, 3) m; may be complex
    rangers       (R,) rows of the points that range
    pairs         (m, 2) ranges: index of a ranger, row of its target; each pair once
    claim         uncertainty of the ranges
    information   (n, 3, 3) 1/m^2, prior of every point, positive definite
    u_zero        (R,) m, prior of the rangers' zeros
    u_scale       prior of the scale of all ranges
    units         ties of targets; no point is in two, none is a ranger
    """

    points: Array
    rangers: NDArray[np.int64]
    pairs: NDArray[np.int64]
    claim: RangeVariance
    information: Array
    u_zero: Array
    u_scale: float
    units: tuple[TiedPoints, ...] = ()

    @cached_property
    def ranger_of(self) -> NDArray[np.int64]:
        """Index of the ranger at each point (n,), -1 for a target."""
        index = np.full(len(self.points), -1)
        index[self.rangers] = np.arange(len(self.rangers))
        return index

    @cached_property
    def batches(self) -> tuple[tuple[NDArray[np.int64], Array], ...]:
        """Units of one size each: rows of their points (b, k), and information (b, 3k, 3k) of their ties."""
        tied = {i for unit in self.units for i in unit.points}
        if any(self.ranger_of[i] >= 0 for i in tied) or len(tied) < sum(len(u.points) for u in self.units):
            raise EstimationError("a tied point is a ranger or in two units (expected targets, each in one)")
        single = [i for i in range(len(self.points)) if self.ranger_of[i] < 0 and i not in tied]
        batches = [(np.array(single, dtype=int)[:, None], np.zeros((len(single), 3, 3)))] if single else []
        for size in sorted({len(u.points) for u in self.units}):
            units = [u for u in self.units if len(u.points) == size]
            batches.append((np.array([u.points for u in units]), np.array([u.information for u in units])))
        return tuple(batches)

    @cached_property
    def column(self) -> NDArray[np.int64]:
        """First column of each point (n,), among those of its kind: border or eliminated."""
        first = np.empty(len(self.points), dtype=int)
        first[self.rangers] = 3 * np.arange(len(self.rangers))
        order = np.concatenate([rows.ravel() for rows, _ in self.batches] or [np.zeros(0, dtype=int)])
        first[order] = 3 * np.arange(len(order))
        return first


@dataclass(frozen=True, eq=False)
class Sights:
    """Geometry of the ranges: unit vectors (m, 3), distances (m,), weights (m,) and their slopes by distance (m,)."""

    unit: Array
    distance: Array
    weight: Array
    slope: Array

    @classmethod
    def of(cls, network: DesignNetwork) -> "Sights":
        """Geometry of a network's ranges; EstimationError where two ends coincide."""
        ranger, target = network.pairs.T
        along = network.points[target] - network.points[network.rangers[ranger]]
        distance = np.sqrt(np.sum(along * along, axis=1))
        if len(distance) and not np.min(distance.real) > 0.0:
            raise EstimationError("a ranger and its target coincide")
        weight = 1.0 / network.claim.variance(distance)
        slope = -2.0 * network.claim.relative**2 * distance * weight**2
        return cls(along / distance[:, None], distance, weight, slope)


@dataclass(frozen=True, eq=False)
class DesignPrediction:
    """Predicted covariance of a network, in the parts from which everything else follows.

    sights        of the ranges
    border        (s, s) covariance of the border: rangers' coordinates, their zeros, the scale; s = 4 R + 1
    gain          (s, 3e) K = B C^-1 of the eliminated coordinates
    inverse       (b, 3k, 3k) C^-1, one array a batch
    carried       (s, 3e) product of border and gain
    covariance    (n, 3, 3) m^2, of every point
    """

    network: DesignNetwork
    sights: Sights
    border: Array
    gain: Array
    inverse: tuple[Array, ...]
    carried: Array
    covariance: Array

    def across(self, columns: Array, others: Array | None = None) -> tuple[Array, Array]:
        """Products Q F of the covariance and columns.

        columns   (n, 3, m) of coordinates
        others    (R + 1, m) of zeros and scale; None: zero

        Of the points (n, 3, m), and of zeros and scale (R + 1, m).
        """
        network = self.network
        count, width = len(network.rangers), columns.shape[2]
        top = np.zeros((len(self.border), width), dtype=np.result_type(self.border, columns))
        top[: 3 * count] = columns[network.rangers].reshape(3 * count, width)
        if others is not None:
            top[3 * count :] = others
        inner = _eliminated(network, columns)
        top = self.border @ (top - self.gain @ inner)
        low, lower = 0, np.empty_like(inner, dtype=top.dtype)
        for inverse in self.inverse:
            size = inverse.shape[0] * inverse.shape[1]
            part = inner[low : low + size].reshape(*inverse.shape[:2], width)
            lower[low : low + size] = (inverse @ part).reshape(size, width)
            low += size
        lower -= self.gain.T @ top
        across = np.empty(columns.shape, dtype=top.dtype)
        across[network.rangers] = top[: 3 * count].reshape(count, 3, width)
        target = np.flatnonzero(network.ranger_of < 0)
        across[target] = lower[network.column[target][:, None] + np.arange(3)]
        return across, top[3 * count :]


def _eliminated(network: DesignNetwork, values: Array) -> Array:
    """Values (n, 3, m) of the eliminated points in their order, (3e, m)."""
    order = np.concatenate([rows.ravel() for rows, _ in network.batches] or [np.zeros(0, dtype=int)])
    return values[order].reshape(3 * len(order), values.shape[2])


def predict(network: DesignNetwork) -> DesignPrediction:
    """Predicted covariance of a network.

    With N the normal equations, split into border S and eliminated C with B between, the border's covariance is
    (A - B C^-1 B')^-1 and that of an eliminated unit C^-1 + K' Q K.

    Source: elimination of groups of unknowns, [FOERSTNER16] section 4.2. Raises EstimationError for ends that coincide.
    """
    sights = Sights.of(network)
    matrix, between, inner = _normal_equations(network, sights)
    size, low = len(matrix), 0
    gain = np.empty_like(between)
    inverses: list[Array] = []
    for rows, tie in network.batches:
        count, width = tie.shape[:2]
        blocks = tie.astype(inner.dtype)
        for k in range(rows.shape[1]):
            blocks[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += inner[rows[:, k]]
        inverse = np.asarray(np.linalg.inv(blocks), dtype=inner.dtype)
        inverses.append(0.5 * (inverse + np.swapaxes(inverse, 1, 2)))
        part = slice(low, low + count * width)
        across = between[:, part].reshape(size, count, width).transpose(1, 0, 2) @ inverses[-1]
        gain[:, part] = across.transpose(1, 0, 2).reshape(size, count * width)
        low += count * width
    scale = 1.0 / np.sqrt(np.diagonal(matrix).real)
    reduced = (matrix - gain @ between.T) * scale[:, None] * scale
    border = np.linalg.inv(reduced) * scale[:, None] * scale
    border = 0.5 * (border + border.T)
    carried = border @ gain
    return DesignPrediction(
        network=network,
        sights=sights,
        border=border,
        gain=gain,
        inverse=tuple(inverses),
        carried=carried,
        covariance=_covariances(network, border, gain, carried, inverses),
    )


def _normal_equations(network: DesignNetwork, sights: Sights) -> tuple[Array, Array, Array]:
    """Border (s, s), border by eliminated (s, 3e), and own blocks (n, 3, 3) of the points."""
    count, kind = len(network.rangers), sights.unit.dtype
    ranger, target = network.pairs.T
    at = network.rangers[ranger]
    w, d = sights.weight, sights.distance
    wu = sights.unit * w[:, None]
    dyad = wu[:, :, None] * sights.unit[:, None, :]
    information_of = network.information.astype(kind)
    np.add.at(information_of, at, dyad)
    np.add.at(information_of, target, dyad)
    three = np.arange(3)
    zero, scale = 3 * count + np.arange(count), 4 * count
    matrix = np.zeros((4 * count + 1, 4 * count + 1), dtype=kind)
    first = 3 * np.arange(count)
    matrix[first[:, None, None] + three[:, None], first[:, None, None] + three] = information_of[network.rangers]
    to_zero, to_scale = np.zeros((count, 3), dtype=kind), np.zeros((count, 3), dtype=kind)
    np.add.at(to_zero, ranger, -wu)
    np.add.at(to_scale, ranger, -wu * d[:, None])
    upper = np.zeros_like(matrix)
    upper[first[:, None] + three, zero[:, None]] = to_zero
    upper[first[:, None] + three, scale] = to_scale
    both = network.ranger_of[target] >= 0  # ranges between rangers
    i, j = ranger[both], network.ranger_of[target[both]]
    np.add.at(upper, (first[i][:, None, None] + three[:, None], first[j][:, None, None] + three), -dyad[both])
    np.add.at(upper, (zero[i][:, None], first[j][:, None] + three), wu[both])
    np.add.at(upper, (scale, first[j][:, None] + three), wu[both] * d[both, None])
    sums = [np.zeros(count, dtype=kind), np.zeros(count, dtype=kind)]
    np.add.at(sums[0], ranger, w)
    np.add.at(sums[1], ranger, w * d)
    upper[zero, scale] = sums[1]
    matrix += upper + upper.T
    matrix[zero, zero] = sums[0] + 1.0 / np.maximum(network.u_zero, LEAST_U_ZERO) ** 2
    matrix[scale, scale] = np.sum(w * d * d) + 1.0 / max(network.u_scale, LEAST_U_SCALE) ** 2
    between = np.zeros((len(matrix), 3 * int(np.sum(network.ranger_of < 0))), dtype=kind)
    apart = ~both
    i, column = ranger[apart], network.column[target[apart]][:, None] + three
    between[first[i][:, None, None] + three[:, None], column[:, None, :]] = -dyad[apart]  # each pair is there once
    between[zero[i][:, None], column] = wu[apart]
    np.add.at(between, (scale, column), wu[apart] * d[apart, None])
    return matrix, between, information_of


def _covariances(network: DesignNetwork, border: Array, gain: Array, carried: Array, inverses: list[Array]) -> Array:
    """Covariances (n, 3, 3) of the points."""
    count, three = len(network.rangers), np.arange(3)
    covariance = np.empty((len(network.points), 3, 3), dtype=border.dtype)
    first = 3 * np.arange(count)
    covariance[network.rangers] = border[first[:, None, None] + three[:, None], first[:, None, None] + three]
    low = 0
    for (rows, _), inverse in zip(network.batches, inverses, strict=True):
        for k in range(rows.shape[1]):
            columns = low + 3 * (np.arange(len(rows)) * rows.shape[1] + k)[:, None] + three
            near, far = gain[:, columns].transpose(1, 2, 0), carried[:, columns].transpose(1, 0, 2)
            block = inverse[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
            covariance[rows[:, k]] = block + near @ far
        low += 3 * rows.size
    return covariance
