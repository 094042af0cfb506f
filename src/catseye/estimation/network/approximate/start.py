"""Approximate coordinates and orientations, found for whatever a network does not give.

Each point is placed by least squares of all that ties it to points already placed: ranges, directions of oriented sets,
zenith angles, height differences, vectors, and the directions of its own set, whose orientation is eliminated. One
routine thus does what surveyors call polar points, trilateration, intersection, resection and free stationing; starts
all around decide whether a second position fits as well. Where that ends, a local network is built about a station
that sees enough, level but turned anyhow, and attached to the placed points by a Helmert transformation; from ranges
alone it is unfolded. Coordinates that are given count as known, good or poor: what is placed from points that are
metres off is metres off too, and serves as a start. Only where most lengths at a point contradict its given coordinates
by a twentieth, as those of exchanged points, is it placed anew, and named.

Where nothing (or too little) is given, the first local network keeps its own axes: z up if it has angles, those of
`Unfolding`, mirror image and side included, if it has ranges alone. `Approximation.assumed` names its points.

`sightings` reads the network into one table, `ties` places one point, `search` one
after the other, `figures` builds local networks, `bodies` poses rigid bodies and
`given` doubts given coordinates.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from catseye.estimation.network.approximate.bodies import bodies_of, poses
from catseye.estimation.network.approximate.figures import place_all
from catseye.estimation.network.approximate.given import disagreeing, placed_anew
from catseye.estimation.network.approximate.search import PlacingSearch
from catseye.estimation.network.approximate.sightings import GROUND, parts_of, sightings
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.observations.kinds import (
    Directions,
    Distances,
    FixedDistances,
    HorizontalDistances,
    Joint,
    LevelPlanes,
)


class Approximation(NamedTuple):
    """Where the adjustment begins.

    xyz          (n, 3) m; nan where nothing was found
    parameters   (p,) values of the other parameters
    found        names of the points that had no coordinates, or not all, and now have
    missing      name -> why it has none
    assumed      those of `found` that stand where no observation puts them: on an assumed side of a mirror plane, or in
                 a figure laid down by convention because too little is given
    replaced     names of the points whose given coordinates grossly disagreed with the lengths, and were placed anew
    """

    xyz: np.ndarray
    parameters: np.ndarray
    found: tuple[str, ...]
    missing: dict[str, str]
    assumed: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()


def approximate(network: ObservationNetwork) -> Approximation:
    """Start values of all points and of the orientations, level heights and poses among the parameters.

    network   points may have nan coordinates; every other point counts as known; absent ones stay nan

    Directions, angles, azimuths, zenith angles, inclinations, ranges, horizontal distances, height differences, level
    planes, vectors, observed coordinates and rigid bodies serve; other kinds hold too little by themselves. Parameters
    of other sorts, and those held or with a prior, begin at their own start. Refraction and ranger zeros that are not
    in the start values are neglected.

    Source: [FOERSTNER16] chapter 4, the least squares of each point; the order of placing is ours.

    >>> from catseye.estimation.network.model import NetworkPoints
    >>> from catseye.estimation.observations.kinds import Vectors
    >>> points = NetworkPoints(("A", "P"), np.array([[1.0, 2.0, 3.0], [np.nan] * 3]), *np.zeros((2, 2, 3), dtype=bool))
    >>> leg = Vectors("leg", np.array([10.0, 0.0, 1.0]), np.full(3, 1e-6), np.array([0]), np.array([3]))
    >>> approximate(ObservationNetwork(points, (), (leg,))).xyz[1]
    array([11.,  2.,  4.])
    """
    points, given = network.points, network.points
    n = len(points.names)
    if points.absent.any():  # any value serves where no observation depends on it
        points = replace(points, xyz=np.where(points.absent, 0.0, points.xyz), absent=np.zeros_like(points.absent))
        network = replace(network, points=points)
    values = np.array([p.start for p in network.parameters], dtype=float)
    unknown = ~np.isfinite(points.xyz).all(axis=1)
    movable = np.array(given.free.all(axis=1))
    search = _search(network if unknown.any() else _lengths_and_directions_of(network), values)
    replaced = np.zeros(n, dtype=bool)
    if disagreeing(search.rows, search.xyz, movable).any():
        search, replaced = placed_anew(_search(network, values), movable, np.array(points.datum.any(axis=1)))
    if unknown.any():
        place_all(search)
    search.orient_sets()
    free = {3 * n + k for k, p in enumerate(network.parameters) if np.isinf(p.sigma)}
    beside = [_levels(network, search.xyz), poses(network, search.xyz, values)]
    for column, start in chain(search.orientations.items(), *beside):
        if column in free:
            values[column - 3 * n] = start
    placed = np.isfinite(search.xyz).all(axis=1)
    missing = {points.names[p]: search.reason(p) for p in np.flatnonzero(~placed).tolist()}
    found, assumed = unknown & placed, np.zeros(n, dtype=bool)
    assumed[list(search.sides | search.conventional)] = True
    named = [tuple(points.names[p] for p in np.flatnonzero(k)) for k in (found, assumed & found, replaced)]
    xyz = np.where(given.absent, np.nan, search.xyz)
    return Approximation(xyz, values, named[0], missing, named[1], named[2])


def _search(network: ObservationNetwork, values: np.ndarray) -> PlacingSearch:
    """A search from what is given, not yet gone on."""
    bodies = [(point, local) for point, local, _, _ in bodies_of(network, values)]
    return PlacingSearch(sightings(network), network.points.xyz.astype(float), _given_orientations(network), bodies)


def _lengths_and_directions_of(network: ObservationNetwork) -> ObservationNetwork:
    """The network with lengths and directions alone: all that is wanted of one whose points are given."""
    kinds = Directions | Distances | FixedDistances | HorizontalDistances | Joint
    return replace(network, groups=tuple(g for g in network.groups if isinstance(g, kinds)))


def _given_orientations(network: ObservationNetwork) -> dict[int, float]:
    """Column -> orientation, of those held or with a prior."""
    n = 3 * len(network.points.names)
    return {n + k: p.start for k, p in enumerate(network.parameters) if np.isfinite(p.sigma)} | {GROUND: 0.0}


def _levels(network: ObservationNetwork, xyz: np.ndarray) -> Iterator[tuple[int, float]]:
    """Column and height of each level plane, from its placed points."""
    for group, _ in parts_of(network):
        if isinstance(group, LevelPlanes):
            height = xyz[group.point // 3, 2] + group.height - group.observed
            for column in np.unique(group.columns[:, 1]):
                known = height[(group.columns[:, 1] == column) & np.isfinite(height)]
                if column >= 0 and len(known):
                    yield int(column), float(np.median(known))
