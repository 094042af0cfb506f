"""Network of points and observations, independent of the file format, and its adjusted solution.

Axes here are x east, y north, z up, right-handed; azimuths and directions run clockwise from north (from +y to +x).
A file with other axes is converted to these by its reader, and `axes` converts the result back.
The parameters of the whole network are one vector: point i at 3 i, 3 i + 1, 3 i + 2, then the others in their order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import GroupFit
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.least_squares.status import Status
from catseye.estimation.network.names import PointIndex
from catseye.estimation.observations.kinds import ObservationGroup


@dataclass(frozen=True, eq=False)
class NetworkPoints:
    """Points of a network.

    names   unique
    xyz     (n, 3) m, from the file; nan if unknown: an approximation is then computed
    fixed   (n, 3) bool: coordinates held at xyz
    datum   (n, 3) bool: coordinates that take part in the inner constraints, relative to xyz
    absent  (n, 3) bool: coordinates that do not exist, neither given nor measured: heights of a plane network,
            positions of a levelling network. Their xyz is nan; they are neither held nor datum nor free

    A stochastic point is a free one with an observation of its coordinates, of kind `ObservedCoordinates`.
    """

    names: tuple[str, ...]
    xyz: np.ndarray
    fixed: np.ndarray
    datum: np.ndarray
    absent: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), dtype=bool))  # becomes (n, 3), none absent

    def __post_init__(self) -> None:
        if not len(self.absent):
            object.__setattr__(self, "absent", np.zeros(self.xyz.shape, dtype=bool))
        for state, wrong in (("held", self.fixed), ("datum", self.datum), ("given", np.isfinite(self.xyz))):
            if np.any(self.absent & wrong):
                row, axis = np.argwhere(self.absent & wrong)[0]
                raise EstimationError(
                    f"{'xyz'[axis]} of {self.names[row]} is absent and {state} (expected one of both)"
                )

    @property
    def existing(self) -> np.ndarray:
        """Mask (n, 3) of coordinates that the network has."""
        return ~self.absent

    @property
    def free(self) -> np.ndarray:
        """Mask (n, 3) of coordinates that an adjustment may change."""
        return ~(self.fixed | self.absent)

    @property
    def unplaced(self) -> np.ndarray:
        """Mask (n, 3) of existing coordinates without a value."""
        return self.existing & ~np.isfinite(self.xyz)


def absent_coordinates(xyz: np.ndarray, marked: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Mask (n, 3) of coordinates that are neither given, measured nor marked.

    xyz        (n, 3) m, nan if not given
    marked     (n, 3) bool: held or datum
    measured   (n, 3) bool: an observation depends on it

    A point without any given or measured coordinate exists: it is not a levelled or a plane one, but unobserved.
    """
    present = np.isfinite(xyz) | marked | measured
    return ~present & present.any(axis=1, keepdims=True)


@dataclass(frozen=True)
class NetworkParameter:
    """Unknown of a network other than a coordinate.

    name    for reports: "zero ZY101", "scale ZY101", "orientation 4901 set 1", "refractivity morning", "x of FRAME"
    start   start value of the iteration
    sigma   0: held at `start`; infinite: free; else the prior is `start` with this standard uncertainty
    unit    "m", "rad" or "1" (a ratio)
    """

    name: str
    start: float = 0.0
    sigma: float = np.inf
    unit: str = "1"


@dataclass(frozen=True, eq=False, repr=False)
class ObservationNetwork:
    """Points, other parameters and groups of observations.

    points       see `NetworkPoints`
    parameters   beside the points, in the order of the parameter vector after 3 n coordinates
    groups       of observations, over columns of the parameter vector; see `catseye.estimation.observations`
    places       one tuple per group with the place of each row in the file ("line 12"), or () if unknown
    claims       one (m, 3) a group, or None: a, b, c of standard uncertainties a + b D^c (m, m, 1) of lengths D, which
                 a plan computes from the points; if b is 0 the covariance is complete. () if there are none
    axes         (3, 3) signed permutation: coordinates here = axes @ coordinates of the file
    axis_names   of the file's axes, in its order
    source       name of the file, for reports
    description  from the file
    notes        remarks on reading the file, one line each
    doubts       implausible contents, one line each: a result based on them is not good
    """

    points: NetworkPoints
    parameters: tuple[NetworkParameter, ...]
    groups: tuple[ObservationGroup, ...]
    places: tuple[tuple[str, ...], ...] = ()
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    axis_names: tuple[str, str, str] = ("x", "y", "z")
    source: str = ""
    description: str = ""
    claims: tuple[np.ndarray | None, ...] = ()
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def __repr__(self) -> str:
        observed = ", ".join(f"{len(group.observed)} {group.name}" for group in self.groups)
        return f"<Network {self.source}: {len(self.points.names)} points; observed: {observed or 'nothing'}>"


@dataclass(frozen=True, eq=False)
class NetworkSolution:
    """Adjusted network, in the axes of this package (`network.axes` converts to the file's).

    network              the adjusted network
    x                    (n, 3) m; nan if absent
    covariance           (n, 3, 3) m^2 of each point, a priori (variance factor 1); zero if held; nan without a
                         solution and in the rows and columns of absent coordinates
    parameters           (p,) values of network.parameters
    u_parameters         (p,) their standard uncertainties
    status               "converged", or one line with problem, place and remedy
    iterations           steps taken
    fits                 one per group of the network, in its order
    variance_factor      [pvv] / degrees of freedom, expectation 1; nan without redundancy
    degrees_of_freedom   observations less parameters plus the datum's conditions
    datum                in words
    approximate          names of the points whose approximate coordinates were computed, not given
    assumed              names of those on an assumed side of a mirror plane
    replaced             names of those whose given coordinates grossly contradict the observations: the iteration
                         started from the observations instead
    q                    covariance of the full parameter vector; zero if held or absent
    """

    network: ObservationNetwork
    x: np.ndarray
    covariance: np.ndarray
    parameters: np.ndarray
    u_parameters: np.ndarray
    status: Status
    iterations: int
    fits: tuple[GroupFit, ...]
    variance_factor: float
    degrees_of_freedom: float
    datum: str
    approximate: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()
    q: Covariance = field(kw_only=True)

    @cached_property
    def index(self) -> PointIndex:
        """Row of each point by its name, in any spelling."""
        return PointIndex(self.network.points.names)

    @cached_property
    def state(self) -> np.ndarray:
        """Full parameter vector for `predict`: finite, 0 for absent coordinates."""
        return np.concatenate([np.where(self.network.points.absent, 0.0, self.x).ravel(), self.parameters])

    @cached_property
    def answered(self) -> bool:
        """True if every coordinate of the network has a covariance."""
        points = self.network.points
        complete = np.isfinite(self.covariance) | points.absent[:, :, None] | points.absent[:, None, :]
        return bool(complete.all())

    def block(self, names: Sequence[str]) -> np.ndarray:
        """Joint covariance (3k, 3k) m^2 of some points, in the given order.

        Rows of absent coordinates are nan.

        Raises EstimationError for a name that is not in the network.
        """
        unknown = [name for name in names if name not in self.index]
        if unknown:
            raise EstimationError(f"point {unknown[0]!r} is not in the network (expected one of its names)")
        first = 3 * np.array([self.index[name] for name in names], dtype=int)
        at = (first[:, None] + np.arange(3)).ravel()
        absent = self.network.points.absent.ravel()[at]
        return np.where(absent | absent[:, None], np.nan, self.q.within(at))


def points_of(group: ObservationGroup) -> tuple[np.ndarray, ...]:
    """Point rows (m,) of the observations by role (from, to, ...).

    -1 for none.
    """
    return tuple(np.where(end < 0, -1, end // 3) for end in getattr(group, "ends", ()))


def label(network: ObservationNetwork, group: int, row: int) -> str:
    """Label of an observation: kind, points, and place in the file."""
    kind = getattr(network.groups[group], "kind", network.groups[group].name).replace("_", " ")
    ends = [network.points.names[int(end[row])] for end in points_of(network.groups[group]) if end[row] >= 0]
    where = network.places[group][row] if network.places and network.places[group] else ""
    return f"{kind} {' - '.join(ends)}" + (f", {where}" if where else "")
