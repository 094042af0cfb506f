"""Motions not observed by ranges, and the inner constraints that fix them.

Seven generators move all points: three shifts, three rotations about the axes, one dilation. A motion is free if it
leaves every held coordinate and every point with a prior in place; the dilation also needs every ranger's scale free.
The datum selects, of all networks related by free motions, the one whose datum coordinates are nearest to their given
values (least sum of squares). Its conditions are h = F' sum n (x - x0) = 0 over datum coordinates, n the
generators at the answer x, F the free motions. The covariance uses the exact derivative of h, not that at x0.
If held coordinates leave free motions whose combination F changes with x, that change is neglected: second order.
Source: [FOERSTNER16] chapter 4, gauge constraints and S-transformations.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.estimation.network.multilateration.blocks import IterationState

GENERATORS = 7
STILL = 1e-10  # of the network's size: tolerance for a fixed coordinate
ENOUGH = 64  # held points that are tried first: they usually fix all motions
TURNS = np.array(  # (3, 3, 3): rotation k displaces x by TURNS[k] @ x, the cross product e_k x x
    [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]],
    dtype=float,
)


def generators(x: np.ndarray) -> np.ndarray:
    """Displacements (k, 3, 7) of points x (k, 3) by shifts, rotations and dilation about the origin.

    >>> generators(np.array([[1.0, 2.0, 3.0]]))[0, :, 5]  # turn about z
    array([-2., 1., 0.])
    """
    out = np.zeros((len(x), 3, GENERATORS))
    out[:, 0, 0] = out[:, 1, 1] = out[:, 2, 2] = 1.0
    out[:, 0, 4], out[:, 0, 5] = x[:, 2], -x[:, 1]
    out[:, 1, 5], out[:, 1, 3] = x[:, 0], -x[:, 2]
    out[:, 2, 3], out[:, 2, 4] = x[:, 1], -x[:, 0]
    out[:, :, 6] = x
    return out


def displacements(x: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Displacements (k, 3) of points x (k, 3) by one motion (7,)."""
    return x @ (np.einsum("a,aij->ij", motion[3:6], TURNS) + motion[6] * np.eye(3)).T + motion[:3]


def free_motions(points: np.ndarray, coordinates: np.ndarray, *, dilation: bool, size: float) -> np.ndarray:
    """Basis (7, f) of the motions that leave some coordinates in place.

    points        (k, 3) points, relative to an origin inside the network
    coordinates   (k, 3) bool: their fixed coordinates
    dilation      True if the size of the network is free
    size          of the network, m; a unit of each motion moves points by about 1 m
    """
    unit = np.array([1.0, 1.0, 1.0] + [1.0 / size] * 4)
    generator = np.eye(GENERATORS)[:, : 7 if dilation else 6]
    rows = (generators(points)[coordinates] * unit) @ generator
    if not len(rows):
        return unit[:, None] * generator
    if len(rows) > GENERATORS:
        rows = np.linalg.qr(rows, mode="r")
    _, values, vectors = np.linalg.svd(rows)
    moved = int(np.sum(values > STILL * max(1.0, values[0])))
    return unit[:, None] * (generator @ vectors[moved:].T)


@dataclass(frozen=True, eq=False)
class InnerConstraints:
    """Linearised inner constraints at a state.

    value        (f,) h
    at_stations  (S, 3, f) derivative by the stations' coordinates
    points       (k,) targets in the constraints
    at_targets   (k, 3, f) derivative by their coordinates
    response     (f, f) derivative by the free motions themselves
    """

    value: np.ndarray
    at_stations: np.ndarray
    points: np.ndarray
    at_targets: np.ndarray
    response: np.ndarray

    def restore(self, stations: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Amounts (f,) of the free motions that satisfy the conditions after a step."""
        count = len(self.value)
        ahead = self.value + stations.ravel() @ self.at_stations.reshape(-1, count)
        if len(self.points):
            ahead += targets[self.points].ravel() @ self.at_targets.reshape(-1, count)
        return -np.linalg.solve(self.response, ahead)


@dataclass(frozen=True, eq=False)
class Datum:
    """Coordinates in the inner constraints, and reference values: stations (S, 3), targets (T, 3)."""

    stations: np.ndarray
    targets: np.ndarray
    marked_stations: np.ndarray
    marked_targets: np.ndarray

    def conditions(
        self, state: IterationState, motions: np.ndarray, free: tuple[np.ndarray, np.ndarray]
    ) -> InnerConstraints:
        """Inner constraints at a state, for free motions (7, f).

        `free` holds the masks of stations and targets.
        """
        points = self.points
        first = _share(state.stations, self.stations, self.marked_stations, motions, free[0])
        if not len(points):
            return InnerConstraints(first[0], first[1], points, np.zeros((0, 3, motions.shape[1])), first[2])
        second = _share(
            state.targets[points], self.targets[points], self.marked_targets[points], motions, free[1][points]
        )
        return InnerConstraints(first[0] + second[0], first[1], points, second[1], first[2] + second[2])

    @cached_property
    def points(self) -> np.ndarray:
        """Indices of the targets in the constraints."""
        return np.flatnonzero(self.marked_targets.any(axis=1))

    @cached_property
    def empty(self) -> bool:
        """True if no coordinate is in the constraints."""
        return not (self.marked_stations.any() or len(self.points))


def _share(
    x: np.ndarray, reference: np.ndarray, marked: np.ndarray, motions: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value (f,), derivative (k, 3, f) and response (f, f) of the conditions from some points."""
    off = np.where(marked, x - reference, 0.0)
    n = generators(x).reshape(-1, GENERATORS)
    value = off.ravel() @ n
    slope = n * marked.reshape(-1, 1)
    slope[:, 3:6] += (off @ TURNS).transpose(1, 2, 0).reshape(-1, 3)  # the generators change with x themselves
    slope[:, 6] += off.ravel()
    loose = free.reshape(-1, 1)
    slope = (slope @ motions) * loose
    return value @ motions, slope.reshape(len(x), 3, -1), slope.T @ ((n @ motions) * loose)
