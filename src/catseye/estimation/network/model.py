"""A network of points and observations, whatever file it came from, and its adjusted answer.

Axes here are x east, y north, z up, right-handed; azimuths and directions run clockwise from north (from +y to +x).
A file with other axes is turned into these by its reader, and `axes` turns the answer back.
The parameters of the whole network are one vector: point i at 3 i, 3 i + 1, 3 i + 2, then the others in their order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import GroupFit
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.network.names import PointIndex
from catseye.estimation.observations.kinds import ObservationGroup


@dataclass(frozen=True, eq=False)
class NetworkPoints:
    """The points of a network.

    names   unique
    xyz     (n, 3) m, where the file puts them; nan where unknown: an approximation is then searched for
    fixed   (n, 3) bool: coordinates held at xyz
    datum   (n, 3) bool: coordinates that take part in the inner constraints, relative to xyz
    absent  (n, 3) bool: coordinates that do not exist, which nobody gave and nothing measures: heights of a plane
            network, places of a levelling network. Their xyz is nan; they are neither held nor datum nor free

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
        """(n, 3) bool: coordinates that the network has."""
        return ~self.absent

    @property
    def free(self) -> np.ndarray:
        """(n, 3) bool: coordinates that an adjustment may change."""
        return ~(self.fixed | self.absent)

    @property
    def unplaced(self) -> np.ndarray:
        """(n, 3) bool: coordinates of the network that have no value yet."""
        return self.existing & ~np.isfinite(self.xyz)


def absent_coordinates(xyz: np.ndarray, marked: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Coordinates (n, 3) that do not exist: nobody gave them, nothing measures them, nobody marked them.

    xyz        (n, 3) m, nan where not given
    marked     (n, 3) bool: held or datum
    measured   (n, 3) bool: an observation depends on it

    A point of which nothing at all is given or measured exists: it is not a levelled or a plane one, but unobserved.
    """
    known = np.isfinite(xyz) | marked | measured
    return ~known & known.any(axis=1, keepdims=True)


@dataclass(frozen=True)
class NetworkParameter:
    """An unknown beside the points.

    name    for reports: "zero ZY101", "scale ZY101", "orientation 4901 set 1", "refractivity morning", "x of FRAME"
    start   where the iteration begins
    sigma   0 holds it at `start`; infinite leaves it free; else its prior is `start` with this standard uncertainty
    unit    "m", "rad" or "1" (a ratio)
    """

    name: str
    start: float = 0.0
    sigma: float = np.inf
    unit: str = "1"


@dataclass(frozen=True, eq=False, repr=False)
class ObservationNetwork:
    """Points, other parameters and groups of observations.

    points       see there
    parameters   beside the points, in the order of the parameter vector after 3 n coordinates
    groups       of observations, over columns of the parameter vector; see `catseye.estimation.observations`
    places       one tuple a group with where each of its rows stands in the file ("line 12"), or () where unknown
    claims       one (m, 3) a group, or None: a, b, c of standard uncertainties a + b D^c (m, m, 1) of lengths D, which
                 a plan computes from the points; where b is 0 the covariance says all. () where there are none
    axes         (3, 3) signed permutation: coordinates here = axes @ coordinates of the file
    axis_names   what the file calls its axes, in its order
    source       the file's name, for reports
    description  the file's own words
    notes        what a person should know of how the file was read, one line each
    doubts       what in it is unlikely, one line each: no answer that rests on it is good
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
    """The adjusted network, in the axes of this package (`network.axes` turns it into the file's).

    network              what was adjusted
    x                    (n, 3) m; nan where a coordinate is absent
    covariance           (n, 3, 3) m^2 of each point, a priori (variance factor 1); zero where held; nan without answer
                         and in the rows and columns of absent coordinates
    parameters           (p,) values of network.parameters
    u_parameters         (p,) their standard uncertainties
    status               "converged", or one line that says what is wrong, where, and what to do
    iterations           steps taken
    fits                 one a group of the network, in its order
    variance_factor      [pvv] / degrees of freedom, expectation 1; nan without redundancy
    degrees_of_freedom   observations less parameters plus the datum's conditions
    datum                in words, how the free directions are held
    approximate          names of the points whose approximate coordinates were found, not given
    assumed              names of those placed on a side that nothing decides
    replaced             names of those whose given coordinates the observations contradict grossly: the iteration began
                         where they put them instead
    q                    covariance of the whole parameter vector, for what is not above; zero where held or absent
    """

    network: ObservationNetwork
    x: np.ndarray
    covariance: np.ndarray
    parameters: np.ndarray
    u_parameters: np.ndarray
    status: str
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
        """Row of each point by its name, however it is written."""
        return PointIndex(self.network.points.names)

    @cached_property
    def state(self) -> np.ndarray:
        """The whole parameter vector, for `predict`: finite, 0 in the place of an absent coordinate."""
        return np.concatenate([np.where(self.network.points.absent, 0.0, self.x).ravel(), self.parameters])

    @cached_property
    def answered(self) -> bool:
        """True if every coordinate of the network has a covariance."""
        points = self.network.points
        known = np.isfinite(self.covariance) | points.absent[:, :, None] | points.absent[:, None, :]
        return bool(known.all())

    def block(self, names: Sequence[str]) -> np.ndarray:
        """Joint covariance (3k, 3k) of some points, m^2, in the order given; nan in rows of absent coordinates.

        Raises EstimationError for a name that is not in the network.
        """
        strange = [name for name in names if name not in self.index]
        if strange:
            raise EstimationError(f"point {strange[0]!r} is not in the network (expected one of its names)")
        first = 3 * np.array([self.index[name] for name in names], dtype=int)
        at = (first[:, None] + np.arange(3)).ravel()
        absent = self.network.points.absent.ravel()[at]
        return np.where(absent | absent[:, None], np.nan, self.q.within(at))


def points_of(group: ObservationGroup) -> tuple[np.ndarray, ...]:
    """For each role of an observation, from, to and so on, the rows (m,) of its points in the network; -1 for none."""
    return tuple(np.where(end < 0, -1, end // 3) for end in getattr(group, "ends", ()))


def label(network: ObservationNetwork, group: int, row: int) -> str:
    """Name of an observation: its kind, its points, and its place in the file."""
    kind = getattr(network.groups[group], "kind", network.groups[group].name).replace("_", " ")
    ends = [network.points.names[int(end[row])] for end in points_of(network.groups[group]) if end[row] >= 0]
    where = network.places[group][row] if network.places and network.places[group] else ""
    return f"{kind} {' - '.join(ends)}" + (f", {where}" if where else "")
